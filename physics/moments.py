"""What an operator looks for in a run: who was lost and who was told a new route, where and when."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from quarterdeck.physics.trace import Trace

What = Literal["lost", "stuck", "told"]
WORDS: dict[What, str] = {"lost": "lost", "stuck": "stuck or down", "told": "told a new route"}


@dataclass(frozen=True, slots=True)
class Moment:
    """`vehicle` was at (x, y) metres when, `time` seconds after the start, it was `lost` (it stopped for ever), `stuck`
    (given up: held fast, aground, or fallen), or `told` a new route: another's part or, after other changes, its own.
    """

    time: float
    vehicle: str
    what: What
    x: float
    y: float


def moments(trace: Trace, gone: np.ndarray, lost: np.ndarray, told: Sequence[tuple[float, str]]) -> tuple[Moment, ...]:
    """Return the moments of a run in order. `gone` (k,) seconds is when each vehicle ended before its time (infinite: it
    did not), `lost` (k,) whether by a loss; `told` are seconds and vehicles.
    """
    ids = list(trace.vehicles)
    found: list[tuple[float, str, What]] = [
        (float(gone[i]), ids[i], "lost" if lost[i] else "stuck") for i in np.flatnonzero(np.isfinite(gone))
    ]
    found += [(time, vehicle, "told") for time, vehicle in told]
    made = []
    for time, vehicle, what in sorted(found, key=lambda f: (f[0], f[2] == "told", f[1])):
        at, i = min(int(np.searchsorted(trace.time, time - 1e-6)), len(trace.time) - 1), ids.index(vehicle)
        made.append(Moment(time, vehicle, what, float(trace.x[at, i]), float(trace.y[at, i])))
    return tuple(made)
