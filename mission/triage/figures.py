"""The figures of a triage mission: the paper's four (Eqs 1 and 2, Table I), and those that a responder asks for."""

from collections.abc import Mapping, Sequence

import numpy as np

from quarterdeck.mission.triage.outcome import Fate, Outcome
from quarterdeck.mission.triage.settings import SORT

VALUE = {"red": 100.0, "yellow": 50.0, "green": 20.0}  # the paper's, Eq. 2
HORIZONS = (300.0, 600.0, 1800.0)  # s
SIGHTS = ("red", "yellow", "green")


def figures(outcome: Outcome) -> dict[str, float]:
    """Return the figures by name: seconds, metres, counts.

    Waiting lasts from the mission's start until a medic reaches the casualty; where there is no red, red waiting is NaN.
    """
    run, team = outcome.run, outcome.team
    medics = list(team.medics)
    reached = [f for f in outcome.fates if f.reached is not None]
    waits = {c: np.array([f.reached for f in reached if SORT[f.colour] == c], dtype=float) for c in SIGHTS}
    weighted = sum(VALUE[SORT[f.colour]] * float(f.reached or 0.0) for f in reached)
    value = sum(VALUE[SORT[f.colour]] for f in reached)
    found: dict[str, float] = {
        "time": outcome.end,
        "score": score(outcome.fates),
        "ugv_distance": float(np.mean([run.length(u) for u in team.ugvs])),
        "medic_distance": float(np.mean([run.length(m) for m in medics])),
        "uav_distance": float(np.mean([run.length(u) for u in team.uavs])) if team.uavs else 0.0,
        "casualties": float(len(outcome.fates)),
        "found": float(sum(f.found is not None for f in outcome.fates)),
        "treated": float(sum(f.treated is not None for f in outcome.fates)),
        "undeliverable": float(sum(f.undeliverable for f in outcome.fates)),
        "value_weighted_wait": weighted / value if value else np.nan,
        "medic_idle": float(np.mean([_idle(outcome, m) for m in medics])),
    }
    for colour, wait in waits.items():
        found[f"{colour}_wait"] = float(wait.mean()) if len(wait) else np.nan
        found[f"{colour}_wait_95"] = float(np.percentile(wait, 95)) if len(wait) else np.nan
    for horizon in HORIZONS:
        found[f"reached_{horizon / 60:.0f}_min"] = float(sum(float(f.reached or 0.0) <= horizon for f in reached))
    return found


def score(fates: Sequence[Fate]) -> float:
    """Return Eqs 1 and 2: how far the order of treatment is from the order of priorities, elementwise; 0 is best."""
    served = [VALUE[SORT[f.colour]] for f in sorted(fates, key=lambda f: f.reached or 0.0) if f.reached is not None]
    return float(np.abs(np.sort(served)[::-1] - np.array(served)).sum()) if served else 0.0


def counts_over_time(fates: Sequence[Fate], times: np.ndarray) -> Mapping[str, Mapping[str, np.ndarray]]:
    """Return, by colour and by `found`, `delivered` and `treated`, how many casualties were by each of (m,) times."""
    times = np.asarray(times, dtype=float)

    def by(what: str, colour: str) -> np.ndarray:
        moments = sorted(t for f in fates if f.colour == colour and (t := getattr(f, what)) is not None)
        return np.searchsorted(moments, times, side="right")

    colours = sorted({f.colour for f in fates}, key=list(SORT).index)
    return {c: {what: by(what, c) for what in ("found", "delivered", "treated")} for c in colours}


def _idle(outcome: Outcome, name: str) -> float:
    """Return how long a medic had nothing to do until the mission's end, in seconds."""
    total, since = 0.0, 0.0
    idle = True
    for e in outcome.log:
        if e.who == name and e.what == "state":
            if idle and e.about != "idle":
                total += e.time - since
            if not idle and e.about == "idle":
                since = e.time
            idle = e.about == "idle"
    return total + max(0.0, outcome.end - since) if idle else total
