"""A triage mission after its run in PyBullet: what became of the casualties, beside what the fast world expected."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission import world
from quarterdeck.mission.director import State
from quarterdeck.mission.mission import Mission, Route, Waypoint
from quarterdeck.mission.progress import Progress
from quarterdeck.mission.triage.carry_on import progress_of
from quarterdeck.mission.triage.figures import figures
from quarterdeck.mission.triage.outcome import Fate, Outcome, judge
from quarterdeck.mission.triage.plan import scenario_of, settings_of, team_of
from quarterdeck.physics.faults import Fault
from quarterdeck.physics.sightings import Lookout
from quarterdeck.physics.trace import Trace

BESIDE = 1.5  # m: a medic who stands so near somebody may be treating him
NEARLY = 0.9  # of the time of treatment: so long a stand counts
TIMES = ("found", "reported", "delivered", "reached", "treated")


@dataclass(frozen=True, slots=True)
class Compared:
    """A mission as it was `driven` and as the `fast` world has it; `expected` has the fast tracks as routes.

    `progress` is how far it had come at the end, for `replan`.
    """

    driven: Outcome
    fast: Outcome
    expected: Mission
    progress: Progress

    def document(self) -> dict[str, Any]:
        """Return both side by side for the report."""
        return side_by_side(self.fast, self.driven)


def side_by_side(fast: Outcome, driven: Outcome, unknown: Collection[str] = ()) -> dict[str, Any]:
    """Return figures by name, then each casualty; [fast, driven] throughout, None of what is `unknown` of the driven."""
    one, other = figures(fast), figures(driven)
    return {
        "method": driven.method,
        "figures": {name: [_number(one[name]), None if name in unknown else _number(other[name])] for name in one},
        "casualties": [_row(a, b) for a, b in zip(fast.fates, driven.fates, strict=True)],
    }


def of_devices(faults: Sequence[Fault], mission: Mission) -> tuple[Fault, ...]:
    """Return the faults of a triage mission: what fails of a medic is his device, not the person."""
    medics = mission.parameters["medics"]
    return tuple(replace(f, kind="comms") if f.kind == "lost" and f.vehicle in medics else f for f in faults)


def compare(
    mission: Mission,
    memory: Any,
    trace: Trace,
    reason: str,
    fast: Outcome,
    standing: tuple[Mapping[str, State], Mapping[str, tuple[Waypoint, ...]]],
) -> Compared:
    """Return what became of the casualties in a run that left `trace` and the director's `memory`, beside the `fast` world.

    `reason` says why the run was cut short, if it was; `standing` is what `Running.standing` returned at its end.
    """
    tracks = {v: np.column_stack([trace.time, trace.x[:, i], trace.y[:, i]]) for i, v in enumerate(trace.vehicles)}
    run = world.Run(tracks, (), float(trace.time[-1]), memory, reason)
    scenario, team, settings = scenario_of(mission), team_of(mission), settings_of(mission)
    driven = judge(scenario, team, mission.parameters["method"], settings, run, seed=mission.seed)
    driven = replace(driven, faults=fast.faults)
    progress = progress_of(mission, float(trace.time[-1]), *standing, memory, tracks)
    return Compared(driven, fast, expected(mission, fast), progress)


def expected(mission: Mission, fast: Outcome) -> Mission:
    """Return a mission with the fast world's tracks as its routes."""
    began = np.array([fast.team.began, 0.0, 0.0])
    return replace(mission, routes=tuple(_as_route(v, fast.run.tracks[v.id] - began) for v in mission.vehicles))


def told_by_tracks(mission: Mission, trace: Trace, fast: Outcome) -> Outcome:
    """Return what a trace alone tells of the casualties: whom a UGV or medic could see, and by whom a medic stood.

    Who was told of whom, it does not tell. Found is who lay within range and sight of a UGV or medic, treated by whom a
    medic stood for as long as treatment takes.
    """
    look, settings, began = Lookout(mission, None), settings_of(mission), fast.team.began
    fates = []
    for fate in (Fate(f.id, f.x, f.y, f.colour) for f in fast.fates):
        away = np.hypot(trace.x - fate.x, trace.y - fate.y)
        sights = [
            (float(trace.time[k]), v)
            for i, v in enumerate(trace.vehicles)
            if (k := _first_sight(look, i, trace, away[:, i], np.array([fate.x, fate.y]))) is not None
        ]
        seconds = settings.treat[fate.colour]
        stands = [
            (float(trace.time[a]), v)
            for i, v in enumerate(trace.vehicles)
            if v in fast.team.medics
            for a, b in np.flatnonzero(np.diff(np.r_[0, away[:, i] <= BESIDE, 0])).reshape(-1, 2)
            if trace.time[b - 1] - trace.time[a] >= NEARLY * seconds
        ]
        found = min(sights, default=None)
        cared = min(stands, default=None)
        fates.append(
            replace(
                fate,
                found=found and began + found[0],
                found_by=found and found[1],
                reached=cared and began + cared[0],
                treated=cared and began + cared[0] + seconds,
                treated_by=cared and cared[1],
            )
        )
    tracks = {v: np.column_stack([began + trace.time, trace.x[:, i], trace.y[:, i]]) for i, v in enumerate(trace.vehicles)}
    reasons = [f"casualty {f.id} ({f.colour}) was {_missing(f)}, by the tracks" for f in fates if f.treated is None]
    end = max([0.0, *(f.treated for f in fates if f.treated is not None)])
    run = world.Run(tracks, (), began + float(trace.time[-1]), None)
    return replace(fast, fates=tuple(fates), log=(), run=run, end=end, reasons=tuple(reasons), faults=())


def _missing(fate: Fate) -> str:
    return "not found" if fate.found is None else "not treated"


def _first_sight(look: Lookout, i: int, trace: Trace, away: np.ndarray, spot: np.ndarray) -> int | None:
    """Return the first sample at which a vehicle has a casualty so far away within its range and sight."""
    for k in np.flatnonzero(away <= look.sees[i]).tolist():
        if look.clear(np.array([trace.x[k, i], trace.y[k, i]]), float(look.eyes[i]), spot):
            return k
    return None


def _as_route(vehicle: Vehicle, track: np.ndarray) -> Route:
    """Return an (n, 3) track of seconds, x, y as a route; standing is holding."""
    waypoints = [Waypoint(float(track[0, 1]), float(track[0, 2]), leg="start")]
    energy = 0.0
    for (t0, x0, y0), (t1, x, y) in zip(track[:-1].tolist(), track[1:].tolist(), strict=True):
        seconds, metres = t1 - t0, float(np.hypot(x - x0, y - y0))
        energy += vehicle.model.power(metres / seconds if seconds > 0 else 0.0) * seconds
        if metres < 1e-6:
            waypoints[-1] = replace(waypoints[-1], hold=waypoints[-1].hold + seconds)
        else:
            waypoints.append(Waypoint(x, y, vehicle.altitude, speed=metres / max(seconds, 1e-9), time=t1))
    return Route(vehicle.id, tuple(waypoints), energy / 3600.0)


def _row(fast: Fate, driven: Fate) -> dict[str, Any]:
    times = {name: [_number(getattr(f, name)) for f in (fast, driven)] for name in TIMES}
    return {"id": fast.id, "colour": fast.colour, "state": [fast.state, driven.state], **times}


def _number(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else round(float(value), 3)
