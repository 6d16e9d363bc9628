"""The paper's two drawn cases, scripted: Figs 6 to 8 (three UGVs in simulation) and Fig. 9 (two, in the laboratory).

Their UGVs search strips, so that the pictures stay what they are when division and tours improve.
"""

from dataclasses import dataclass, replace

import numpy as np
from shapely import MultiPolygon, box

from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Casualty, Scenario, Site, Vehicle
from quarterdeck.mission.triage.generate import FIELD, paper_team
from quarterdeck.mission.triage.outcome import Outcome, run_triage
from quarterdeck.mission.triage.search import Search
from quarterdeck.mission.triage.settings import COLOURS, Settings

_SIMULATION = {
    "red": [(10.0, 15.0), (19.0, 17.0), (21.0, 18.0), (53.0, 34.0), (51.0, 4.0)],
    "yellow": [(55.0, 12.0), (70.0, 9.0), (13.0, 4.0)],
    "green": [(77.0, 20.0), (29.0, 14.0), (59.0, 42.0)],
}
_LABORATORY = {
    "red": [(1.7, 1.0), (1.2, 3.5), (3.6, 3.6)],
    "yellow": [(4.8, 2.3), (3.4, 0.3)],
    "green": [(1.5, 2.9)],
}
LABORATORY = (6.0, 4.0)  # m; the paper gives no measures


@dataclass(frozen=True, slots=True)
class Case:
    """A scripted case: the scenario, the settings and the UGVs' paths."""

    scenario: Scenario
    settings: Settings
    search: Search

    def run(self, method: str = "relay") -> Outcome:
        """Run a method on it."""
        return run_triage(self.scenario, method, self.settings, search=self.search)


def simulation_case() -> Case:
    """Return Fig. 6's case: 5 red, 3 yellow and 3 green on 80 x 50 m.

    The paper gives two of its places, the red at (10, 15) that reaches the medic only after the yellow at (55, 12). The
    others are ours, chosen so that this, the second red of Fig. 6b and the waiting of Fig. 6c happen here too.
    """
    scenario = replace(paper_team(), name="Figs 6 to 8", casualties=_casualties(_SIMULATION))
    return Case(scenario, Settings(), _strips(FIELD, 3, 2.5))


def laboratory_case() -> Case:
    """Return the counterpart of Fig. 9: two UGVs, a UAV and a medic on 6 x 4 m, and small robots' speeds and ranges.

    UGV1 finds the first red, UGV2 later one in the upper right while the medic is on the way to one in the upper left.
    """
    rover, drone = load_model("jackal"), load_model("crazyflie")
    field = MultiPolygon([box(0.0, 0.0, *LABORATORY)])
    scenario = Scenario(
        name="Fig. 9",
        frame=paper_team().frame,
        site=Site((Area("laboratory", field),), field),
        vehicles=(
            Vehicle("ugv1", rover, (2.75, 0.1), speed=0.3),
            Vehicle("ugv2", rover, (5.75, 0.1), speed=0.3),
            Vehicle("uav1", drone, (3.0, 2.0), speed=0.6, altitude=1.0),
        ),
        casualties=_casualties(_LABORATORY),
        medics=(("medic1", (3.0, 2.0)),),
        rendezvous=(("rendezvous", (3.0, 2.0)),),
    )
    settings = Settings(
        spacing=0.5, ugv_sees=0.5, medic_sees=0.4, medic_speed=0.25, talk=0.4, treat=dict.fromkeys(COLOURS, 3.0)
    )
    return Case(scenario, settings, _strips(LABORATORY, 2, settings.spacing))


def _strips(size: tuple[float, float], ugvs: int, spacing: float) -> Search:
    """Return upright strips of equal width, each searched up and down in lanes at most `spacing` apart, from its right."""
    width, height = size
    lanes = int(np.ceil(width / ugvs / spacing))
    paths = []
    for i in range(ugvs):
        x = width / ugvs * (i + 1 - (np.arange(lanes) + 0.5) / lanes)
        y = np.where(np.arange(2 * lanes) // 2 % 2 == np.arange(2 * lanes) % 2, spacing / 2, height - spacing / 2)
        paths.append(np.column_stack([np.repeat(x, 2), y]))
    return Search(tuple(paths), 0.0)


def _casualties(places: dict[str, list[tuple[float, float]]]) -> tuple[Casualty, ...]:
    return tuple(
        Casualty(f"{colour[0]}{i + 1}", xy, colour)  # type: ignore[arg-type]
        for colour, spots in places.items()
        for i, xy in enumerate(spots)
    )
