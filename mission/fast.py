"""A mission in the fast world: points at constant speed that turn in no time and pass through one another.

It is what a run in PyBullet is held against: the same director, in the same time, without dynamics, wind or encounters.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from quarterdeck.mission.director import Director
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.world import Actor, Fault, run_world


@dataclass(frozen=True, slots=True)
class FastRun:
    """What the fast world came to: seconds to the end of each vehicle's last move, and those at which tasks were served.

    `tracks` (n, 3) seconds, x, y by vehicle, straight in between. `reason` says why the run was cut short, if it was.
    """

    times: Mapping[str, float]
    served: Mapping[str, float]
    tracks: Mapping[str, np.ndarray]
    reason: str = ""

    @property
    def time(self) -> float:
        """Seconds until nobody moved any more."""
        return max(self.times.values(), default=0.0)


def run_fast(mission: Mission, director: Director, faults: Sequence[Fault] = (), *, until: float = inf) -> FastRun:
    """Run a mission under a director in the fast world, for `until` seconds at the most."""
    first = {r.vehicle: r.waypoints[0] for r in mission.routes if r.waypoints}
    actors = [
        Actor(v.id, *((w.x, w.y, w.z) if (w := first.get(v.id)) else (*v.start, 0.0)), speed=v.speed)
        for v in mission.vehicles
    ]
    run = run_world(director, actors, (), (), 0.0, faults=faults, until=until)
    served = {e.subject: t for t, e in reversed(run.events) if e.kind == "served"}
    return FastRun({v: _arrival(track) for v, track in run.tracks.items()}, served, run.tracks, run.reason)


def _arrival(track: np.ndarray) -> float:
    """Return the second of the last move along an (n, 3) track of seconds, x, y."""
    moves = np.flatnonzero(np.abs(np.diff(track[:, 1:], axis=0)).max(axis=1, initial=0.0) > 0)
    return float(track[moves[-1] + 1, 0]) if len(moves) else 0.0
