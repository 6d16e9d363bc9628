"""The watch that vehicles keep on one another: the rules of `separation`, the room to obey them, and `braking` in time."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import LineString

from quarterdeck.geo.scenario import Site, Vehicle
from quarterdeck.physics.braking import SPARE, TOUCH, brake_in_time
from quarterdeck.physics.fleet import Fleet
from quarterdeck.physics.paths import HOLD
from quarterdeck.physics.separation import CREEP, TRAFFIC, give_way
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
        speed = np.linalg.norm(velocity, axis=1)
        pace = np.where(fleet.gather("idle"), 0.0, fleet.gather("pace"))
        going = present & (fleet.gather("tracks")["mode"] != HOLD) & (pace > 0.0)
        order, stood = self._stand(time, position, going, fleet.gather("tracks")["want"] != 0.0)
        stands = stood > WAITS
        bow = np.column_stack([np.cos(heading), np.sin(heading), np.zeros(len(heading))])
        traffic = self._traffic(fleet, position, bow, speed, pace, going)
        traffic["present"], traffic["place"], traffic["stands"] = present, np.argsort(order), stands
        give_way(traffic)
        # Who was held sets out slowly: the slower, the shorter is its way to rest.
        held = stands & (self.slow <= CREEP * pace)
        traffic["slow"] = np.where(held, np.minimum(traffic["slow"], CREEP * pace), traffic["slow"])
        self._find_room(traffic, going, fleet.gather("rest"))
        want, aside, leg = traffic["want"], traffic["aside"], traffic["leg"]
        facing = self._facing(fleet, traffic, bow, going)
        passing = (want != 0) | (aside != 0) | ~np.isnan(traffic["instead"])
        astern = np.where(self.aerial[:, None], -leg, -bow) * (stands & passing)[:, None]
        for i in map(int, np.flatnonzero(stands & passing)):
            astern[i] *= self._has_room(i, position[i, :2], 0.5 * self.keep[i] * astern[i, :2], np.zeros(2))
        slow = np.minimum(traffic["slow"], fleet.gather("nearing"))
        self.wary = brake_in_time(
            position, velocity, rate, facing, pace, self.reach, self.brakes, present, order, passing, astern, slow
        )
        self.slow = slow
        for squad in fleet.squads:
            squad.tracks["slow"], squad.tracks["want"] = slow[squad.index], want[squad.index]
        end = fleet.gather("ends")[:, 1]
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

    def _traffic(
        self,
        fleet: Fleet,
        position: np.ndarray,
        bow: np.ndarray,
        speed: np.ndarray,
        pace: np.ndarray,
        going: np.ndarray,
    ) -> np.ndarray:
        """Return how all are on their ways, (k,) TRAFFIC, but who is there and in which order; `bow` (k, 3) is where they
        head, `going` (k,) are those that go somewhere.
        """
        traffic = np.zeros(len(position), TRAFFIC)
        course = fleet.gather("course")
        start, end = fleet.gather("ends").transpose(1, 0, 2)
        leg = (end - start) * going[:, None] / np.maximum(np.linalg.norm(end - start, axis=1), 1e-9)[:, None]
        side = np.where(np.any(course != 0.0, axis=1, keepdims=True), course, bow[:, :2])[:, ::-1] * [1.0, -1.0]
        traffic["position"], traffic["course"], traffic["leg"], traffic["side"] = position, course, leg, side
        traffic["speed"], traffic["pace"], traffic["aside"] = speed, pace, fleet.gather("shifted")
        traffic["offset"] = np.sum((position - start)[:, :2] * side, axis=1)
        traffic["rest"] = np.linalg.norm(end - position, axis=1)
        traffic["keep"], traffic["reach"] = self.keep, self.reach
        return traffic

    def _find_room(self, traffic: np.ndarray, going: np.ndarray, rest: np.ndarray) -> None:
        """Set what the `traffic` wants to what there is room for; one without room stays on its path, or stops.

        `rest` (k,) metres it has to the end of its leg on the plan.
        """
        for i in map(int, np.flatnonzero(((traffic["want"] != 0) | (traffic["aside"] != 0)) & going)):
            me = traffic[i]
            ahead = me["course"] * min(max(me["speed"], 0.5 * me["pace"]) * AHEAD, rest[i])
            sides = [w for w in (me["want"], me["instead"]) if not np.isnan(w)]
            offsets = (*sides, me["aside"], 0.0)
            here, side = me["position"][:2], me["side"]
            found = next((w for w in offsets if self._has_room(i, here, ahead, (w - me["aside"]) * side)), None)
            me["want"] = 0.0 if found is None else found
            if len(sides) == 2 and me["want"] not in sides:  # it can pass what lies still on neither
                me["slow"] = 0.0
            if found is None:  # back to its path, as steeply as it can
                me["slow"] = min(me["slow"], CREEP * me["pace"])

    def _facing(self, fleet: Fleet, traffic: np.ndarray, bow: np.ndarray, going: np.ndarray) -> np.ndarray:
        """Return in which direction each that is `going` sets out, (k, 3); zeros for the others.

        Vessels and rovers set out along the `bow` (k, 3), aerial vehicles to where they want to be.
        """
        shift = traffic["want"] - traffic["aside"]
        level = np.column_stack([traffic["side"] * shift[:, None], np.zeros(len(traffic))])
        onward = 2 * self.length[:, None] * traffic["leg"] * ~(traffic["stands"] & (shift != 0.0))[:, None]
        onward += fleet.gather("goal") - traffic["position"]
        facing = np.where(self.aerial[:, None], onward + level, bow)
        return facing * (going / np.maximum(np.linalg.norm(facing, axis=1), 1e-9))[:, None]

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
