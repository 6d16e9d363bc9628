"""The watch that vehicles keep on one another: the rules of `separation`, the room to obey them, and `braking` in time."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import LineString

from quarterdeck.geo.scenario import Site, Vehicle
from quarterdeck.physics.braking import SPARE, TOUCH, brake_in_time
from quarterdeck.physics.fleet import Fleet
from quarterdeck.physics.paths import HOLD
from quarterdeck.physics.separation import CREEP, give_way
from quarterdeck.physics.world import HEIGHT

KEEP = 3.0  # lengths kept from other vehicles
SLIM = 1.4  # half diagonals that count as a length where a hull is higher than long
WARY = 0.2  # s between looks out for others where some are near
WAITS = 8.0  # s that a vehicle stands for others before it goes around
HELD = 60.0  # s after which one that stands says who lies in its way
NEAR = 2.0  # of the distance kept: so near others may be what one stands for
TURN = 40.0  # s that one of those who stand has to go around before it is another's turn
AHEAD = 5.0  # s that one that is aside, or is to go there, looks ahead for room
LAG = {"surface": 2.0, "ground": 0.3, "aerial": 0.5}  # s in which speed fades: of a vessel by its autopilot's gain


class Watch:
    """The watch of all k vehicles of a run on `site`. `slow` (k,) m/s is what it leaves of their speeds; `wary`: somebody
    is so near to another that a second between looks is long.
    """

    def __init__(self, vehicles: Sequence[Vehicle], site: Site) -> None:
        count = len(vehicles)
        self.length = np.array([v.model.length for v in vehicles])
        width = np.array([v.model.width for v in vehicles])
        self.aerial = np.array([v.domain == "aerial" for v in vehicles])
        height = np.array([HEIGHT[v.domain] for v in vehicles]) * self.aerial  # others pass above and below
        self.reach = np.linalg.norm([self.length, width, height], axis=0) / 2
        self.keep = KEEP * np.maximum(self.length, SLIM * self.reach)
        self.brakes = np.array([(v.model.acceleration, LAG[v.domain], _surge(v)) for v in vehicles])
        margins = [(v.domain, TOUCH * v.model.width / 2) for v in vehicles]
        rooms = {key: site.navigable(*key) for key in sorted(set(margins))}
        shapely.prepare(list(rooms.values()))
        self.room = [rooms[key] for key in margins]
        self.slow, self.wary = np.full(count, np.inf), False
        self.anchor, self.since = np.full((count, 3), np.inf), np.zeros(count)

    def keep_clear(
        self,
        time: float,
        fleet: Fleet,
        position: np.ndarray,
        heading: np.ndarray,
        velocity: np.ndarray,
        rate: np.ndarray,
        present: np.ndarray,
    ) -> None:
        """Have vehicles give way to one another; one that has no room to go aside stays on its path.

        Before what lies still on its path it stops, if it can pass on neither side; if that lies where it was to go, it has
        come as near as it may. `position` (k, 3) metres, `heading` (k,) radians, `velocity` (k, 3) m/s over ground, `rate`
        (k,) rad/s; `present` (k,) are those out there.
        """
        count = len(position)
        slow, want, instead = (np.empty(count) for _ in range(3))
        course, aside, rest = fleet.gather("course"), fleet.gather("shifted"), fleet.gather("rest")
        speed = np.linalg.norm(velocity, axis=1)
        pace = np.where(fleet.gather("idle"), 0.0, fleet.gather("pace"))
        going = present & (fleet.gather("tracks")["mode"] != HOLD) & (pace > 0.0)
        order, stood = self._stand(time, position, going, fleet.gather("tracks")["want"] != 0.0)
        place = np.argsort(order)
        stands = stood > WAITS
        start, end = fleet.gather("ends").transpose(1, 0, 2)
        leg = (end - start) * going[:, None] / np.maximum(np.linalg.norm(end - start, axis=1), 1e-9)[:, None]
        bow = np.column_stack([np.cos(heading), np.sin(heading)])
        side = np.where(np.any(course != 0.0, axis=1, keepdims=True), course, bow)[:, ::-1] * [1.0, -1.0]
        offset = np.sum((position - start)[:, :2] * side, axis=1)
        to_go = np.linalg.norm(end - position, axis=1)
        give_way(
            position, course, leg, side, speed, pace, aside, offset, to_go, self.keep, self.reach, present, place, stands,
            slow, want, instead,
        )  # fmt: skip
        # Who was held sets out slowly: the slower, the shorter is its way to rest.
        slow = np.where(stands & (self.slow <= CREEP * pace), np.minimum(slow, CREEP * pace), slow)
        for i in map(int, np.flatnonzero(((want != 0) | (aside != 0)) & going)):
            ahead = course[i] * min(max(speed[i], 0.5 * pace[i]) * AHEAD, rest[i])
            sides = [w for w in (want[i], instead[i]) if not np.isnan(w)]
            offsets = (*sides, aside[i], 0.0)
            found = next((w for w in offsets if self._has_room(i, position[i, :2], ahead, (w - aside[i]) * side[i])), None)
            want[i] = 0.0 if found is None else found
            if len(sides) == 2 and want[i] not in sides:  # it can pass what lies still on neither
                slow[i] = 0.0
            if found is None:  # back to its path, as steeply as it can
                slow[i] = min(slow[i], CREEP * pace[i])
        # Vessels and rovers set out along the bow, aerial vehicles to where they want to be.
        level = np.column_stack([side * (want - aside)[:, None], np.zeros(count)])
        onward = 2 * self.length[:, None] * leg * ~(stands & (want != aside))[:, None]
        onward += fleet.gather("goal") - position
        facing = np.where(self.aerial[:, None], onward + level, np.column_stack([bow, np.zeros(count)]))
        facing *= (going / np.maximum(np.linalg.norm(facing, axis=1), 1e-9))[:, None]
        passing = (want != 0) | (aside != 0) | ~np.isnan(instead)
        astern = np.where(self.aerial[:, None], -leg, -np.column_stack([bow, np.zeros(count)]))
        astern *= (stands & passing)[:, None]
        for i in map(int, np.flatnonzero(stands & passing)):
            astern[i] *= self._has_room(i, position[i, :2], 0.5 * self.keep[i] * astern[i, :2], np.zeros(2))
        slow = np.minimum(slow, fleet.gather("nearing"))
        self.wary = brake_in_time(
            position, velocity, rate, facing, pace, self.reach, self.brakes, present, order, passing, astern, slow
        )
        self.slow = slow
        for squad in fleet.squads:
            squad.tracks["slow"], squad.tracks["want"] = slow[squad.index], want[squad.index]
        self._stop_short(fleet, position, end, stands, present & (pace == 0.0))

    def _stand(
        self, time: float, position: np.ndarray, going: np.ndarray, passing: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the order in which vehicles go, (k,), who stood for longest first, and for how long each has, (k,) s.

        One stands that is `going` (k,) somewhere and has not come the distance kept further, nor is done with
        `passing` (k,) the one it stood for. Those who stand take turns: the first may have no room.
        """
        around = passing & (time - self.since > WAITS)
        moved = ~going | ~around & (np.linalg.norm(position - self.anchor, axis=1) > self.keep)
        self.anchor[moved], self.since[moved] = position[moved], time
        stood = time - self.since
        order = np.argsort(np.where(stood > WAITS, self.since, np.inf), kind="stable")
        standing = int((stood > WAITS).sum())
        order[:standing] = np.roll(order[:standing], int(time // TURN))
        return order, stood

    def _stop_short(
        self, fleet: Fleet, position: np.ndarray, end: np.ndarray, stands: np.ndarray, still: np.ndarray
    ) -> None:
        """Have those who stand (k,) before one that lies `still` (k,) where their leg has its `end` (k, 3) be content."""
        for i in map(int, np.flatnonzero(stands)):
            touch = TOUCH * (self.reach[i] + self.reach)
            there = still & (np.linalg.norm(position - end[i], axis=1) < touch)
            if (there & (np.linalg.norm(position - position[i], axis=1) < SPARE * touch)).any():
                squad, place = fleet.of(i)
                squad.stop_short(place)

    def _has_room(self, i: int, here: np.ndarray, ahead: np.ndarray, aside: np.ndarray) -> bool:
        """Return whether vehicle `i`, now `here`, can go `ahead`, and as many metres further `aside`, all (2,)."""
        return bool(self.room[i].contains(LineString([here, here + ahead, here + ahead + aside])))

    def held(self, time: float, position: np.ndarray, still: np.ndarray) -> list[tuple[int, int]]:
        """Return who has stood for another `HELD` s, each with those `still` (k,) that are near to its `position` (k, 3).

        Asked once a second it tells of each once in `HELD`.
        """
        stood = time - self.since
        pairs = []
        for i in map(int, np.flatnonzero((stood >= HELD) & (stood % HELD < 1.0) & ~still)):
            near = still & (np.linalg.norm(position - position[i], axis=1) < NEAR * self.keep[i])
            pairs += [(i, int(j)) for j in np.flatnonzero(near)]
        return pairs


def _surge(vehicle: Vehicle) -> float:
    """Return how fast a vehicle gains speed when it sets out, m/s2: its controllers', more than planners count on."""
    return {"surface": 0.6 * vehicle.speed, "ground": 5.0, "aerial": vehicle.model.acceleration}[vehicle.domain]
