"""The watch that vehicles keep on one another, so that they stay clear: `separation`'s rules, and the room to obey them."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import LineString

from quarterdeck.geo.scenario import Site, Vehicle
from quarterdeck.physics.fleet import Fleet
from quarterdeck.physics.separation import creep_on, give_way, stop_short

KEEP = 3.0  # lengths kept from other vehicles
WARY = 0.2  # s between looks out for others where some are near
WAITS = 8.0  # s that a vehicle stands for others before it creeps on


class Watch:
    """The watch of all k vehicles of a run on `site`. `slow` (k,) m/s is what it leaves of their speeds; `wary`: somebody
    is so near to another that a second between looks is long.
    """

    def __init__(self, vehicles: Sequence[Vehicle], site: Site) -> None:
        count = len(vehicles)
        self.length = np.array([v.model.length for v in vehicles])
        self.hull = np.array([[v.model.length, v.model.width] for v in vehicles])
        self.keep = KEEP * self.length
        self.brakes = np.array([v.model.acceleration for v in vehicles])
        rooms = {d: site.navigable(d) for d in sorted({v.domain for v in vehicles})}
        shapely.prepare(list(rooms.values()))
        self.room = [rooms[v.domain] for v in vehicles]
        self.slow, self.stood, self.wary = np.full(count, np.inf), np.zeros(count), False

    def keep_clear(
        self,
        time: float,
        fleet: Fleet,
        position: np.ndarray,
        heading: np.ndarray,
        velocity: np.ndarray,
        present: np.ndarray,
    ) -> None:
        """Have vehicles give way to one another; one that has no room to go aside stays on its path.

        Before what lies still on its path it stops, if it can pass on neither side. `position` (k, 3) metres, `heading`
        (k,) radians, `velocity` (k, 3) m/s over ground; `present` (k,) are those out there.
        """
        count = len(position)
        slow, want, instead = (np.empty(count) for _ in range(3))
        course, aside, rest = fleet.gather("course"), fleet.gather("aside"), fleet.gather("rest")
        speed = np.hypot(velocity[:, 0], velocity[:, 1])
        pace = np.where(fleet.gather("idle"), 0.0, fleet.gather("pace"))
        give_way(position, course, speed, pace, fleet.gather("shifted"), self.keep, present, slow, want, instead)
        for i in map(int, np.flatnonzero((want != 0) & (want != aside))):
            reach = course[i] * min(speed[i] * 5.0, rest[i])
            if self._has_room(i, position[i], reach, course[i], want[i] - aside[i]):
                continue
            if np.isnan(instead[i]):
                want[i] = aside[i]
            elif self._has_room(i, position[i], reach, course[i], instead[i] - aside[i]):
                want[i] = instead[i]
            else:
                want[i], slow[i] = aside[i], 0.0
        self.wary = stop_short(position, velocity, course, pace, want - aside, self.length, self.brakes, present, slow)
        free = (slow > 0.05 * pace) | ~np.any(course != 0.0, axis=1) | ~present
        self.stood = np.where(free, time, self.stood)
        stands = time - self.stood > WAITS + 2.0 * np.arange(count)
        creep_on(position, heading, velocity, pace, self.hull, self.brakes, present, stands, slow)
        self.slow = slow
        for squad in fleet.squads:
            squad.tracks["slow"], squad.tracks["want"] = slow[squad.index], want[squad.index]

    def _has_room(self, i: int, here: np.ndarray, ahead: np.ndarray, course: np.ndarray, starboard: float) -> bool:
        """Return whether vehicle `i`, now `here`, can go `ahead`, (2,) metres, and as many further to starboard."""
        there = here[:2] + ahead
        side = there + starboard * np.array([course[1], -course[0]])
        return self.room[i].contains(LineString([here[:2], there, side]))
