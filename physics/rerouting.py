"""The ways of robots around what they found (`findings`) and around those who stand in their way.

Where what was found bars the way ahead, a robot plans anew by A* to where it next has something to do. Where there is no
way any more, it stops and says so. A triage team goes around those who stand in its way as robots with lidar do: who is in
range of others' eyes needs none to be seen.
"""

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest

import numpy as np
import shapely
from scipy.ndimage import distance_transform_edt, label
from shapely import LineString

from quarterdeck.geo.gridpath import find_ways, nearest_free
from quarterdeck.geo.occupancy import Occupancy
from quarterdeck.geo.scenario import Site, Vehicle
from quarterdeck.mission.director import Event
from quarterdeck.mission.mission import Waypoint
from quarterdeck.physics.braking import TOUCH
from quarterdeck.physics.findings import CELL, Findings
from quarterdeck.physics.fleet import Fleet
from quarterdeck.physics.paths import ROTATE, SAIL

SLACK = 0.7  # of the clearance: a way that keeps this much of it from what was found is left as it is
AGAIN = 10.0  # s between two attempts of a robot that gets no further
LOOK = 5.0  # s for which it looks on before it says that there is no way
PATIENCE = 60.0  # s without getting further, after which there is no way
STANDS, MOVED = 10.0, 0.3  # s in which a robot that is under way and has not moved so many metres has stalled
QUEUE = 300.0  # s for which it lets others keep it from its way
YIELDS = 10.0  # s that one that made room waits there
ROOM = 1.25  # times as far off another robot as two may come, a way around it, or out of its way, keeps
NEAR = 3.0  # m: who has stalled on a leg stands so near to what is in its way
PLACES = 12  # that are looked at to make room


@dataclass(frozen=True, slots=True)
class Detour:
    """What a robot drives instead of its command: `via` waypoints, then the command's from number `onward` on.

    `done` of the command's were reached before. `waypoints` are all of them; none where there is no way: then it stays.
    """

    waypoints: tuple[Waypoint, ...]
    via: int
    onward: int
    done: int


class Rerouting:
    """The detours of the `robots` (n,), places among `vehicles`, on the `site` that their plan knows."""

    def __init__(self, site: Site, vehicles: Sequence[Vehicle], robots: np.ndarray) -> None:
        self.site, self.vehicles, self.robots = site, vehicles, robots
        self.findings = Findings(site, vehicles, robots)
        half = np.array([np.hypot(v.model.length, v.model.width) / 2 for v in vehicles])
        self.room = ROOM * TOUCH * (half + half[robots].max())
        self.detours: dict[int, Detour] = {}
        self.stalled = np.full(len(vehicles), np.inf)  # since when
        self.anchor, self.since = np.full((len(vehicles), 2), np.inf), np.zeros(len(vehicles))
        self.last = -np.ones(len(vehicles))
        self.tried = np.full(len(vehicles), -np.inf)
        self.barred = np.full(len(vehicles), np.inf)  # since when there is no way
        self.stuck: set[int] = set()  # those that have no way

    def begin(self, fresh: Iterable[int]) -> None:
        """Forget the detours of robots that have a fresh command."""
        for i in fresh:
            self.detours.pop(i, None)
            self.stuck.discard(i)
            self.barred[i], self.stalled[i] = np.inf, np.inf

    def drive_around(
        self,
        time: float,
        fleet: Fleet,
        believed: np.ndarray,
        commands: Sequence[tuple[Waypoint, ...]],
        fresh: Container[int],
        stalled: np.ndarray,
        present: np.ndarray,
        there: np.ndarray,
    ) -> list[Event]:
        """Tell the robots of `fleet` whose way is barred to drive around; return an event of each that has no way any more.

        They are at `believed` (k, 3), on `commands`, of which some are `fresh`; `stalled` (k,) are those that get no
        further, `present` (k,) those at work, `there` (k,) those that are in others' way.
        """
        events = []
        actual, mode = fleet.gather("reached"), fleet.gather("tracks")["mode"]
        there = there & np.array([v.domain == "ground" for v in self.vehicles])
        done = self.reached(actual)
        for i in self.robots.tolist():
            command = commands[i]
            if done[i] >= len(command) or not present[i] or (mode[i] not in (SAIL, ROTATE) and i not in fresh):
                continue
            ahead = self._driven(i, command)[actual[i] :]
            others = {
                j: np.array(
                    [believed[j, :2], *((w.x, w.y) for w in self._driven(j, commands[j])[actual[j] :] if present[j])]
                )
                for j in np.flatnonzero(there).tolist()
                if j != i
            }
            detour = self._detour(
                i, time, believed[i, :2], command, int(done[i]), ahead,
                fresh=i in fresh, stalled=bool(stalled[i]), others=others,
            )  # fmt: skip
            if detour is not None:
                squad, place = fleet.of(i)
                squad.command(place, detour.waypoints)
                self.detours[i] = detour
            if detour is not None and not detour.waypoints:
                self.stuck.add(i)
                x, y, _ = believed[i].tolist()
                data = {"x": x, "y": y, "found": self.findings.obstacles(i)}
                stop, rest = command[detour.onward], command[detour.onward :]
                task = next((w.task for w in rest if w.task and (w.x, w.y) == (stop.x, stop.y)), "")
                events.append(Event("unreachable", self.vehicles[i].id, task, data))
        return events

    def _driven(self, i: int, command: tuple[Waypoint, ...]) -> tuple[Waypoint, ...]:
        """Return all waypoints of what robot `i` drives: its detour, or its command."""
        return self.detours[i].waypoints if i in self.detours else command

    def _detour(
        self,
        i: int,
        time: float,
        here: np.ndarray,
        command: tuple[Waypoint, ...],
        done: int,
        ahead: Sequence[Waypoint],
        *,
        fresh: bool,
        stalled: bool,
        others: Mapping[int, np.ndarray],
    ) -> Detour | None:
        """Return another way for robot `i`, now `here` (2,), if its own is barred; None if it may go on as it does.

        `done` of its `command`'s waypoints are reached, `ahead` are those that it now makes for. Its way is looked at when
        the command is `fresh`, and against what was found; when it has `stalled`, or stood still for STANDS, it looks for a
        way around the `others` too: of each the (q, 2) places where it is and is going. It comes back to its survey leg
        past what is in its way. To a place where one stays it goes as near as it may. If there is no way, it makes room for
        them, the last in the list first, and comes back. Who makes no map keeps to its waypoints, from the next past the
        others on, and waits for as long as it takes.
        """
        vehicle, grid = self.vehicles[i], self.findings.grid(i)
        stop = done + _next_to_do(command[done:])
        standing = self._standing(i, time, here)
        self.stalled[i] = min(self.stalled[i], time) if stalled else np.inf
        held = stalled or standing >= STANDS
        if held:
            if time > self.stalled[i] + PATIENCE or (standing > QUEUE and self.findings.looked):
                return Detour((), 0, stop, done)
            if time < self.tried[i] + AGAIN:
                return None
            self.tried[i] = time
        elif ahead[0].leg != "transit" or not self._barred(i, here, ahead, fresh=fresh or np.isfinite(self.barred[i])):
            self.barred[i] = np.inf
            return None
        free = self.findings.clear_of(vehicle.clearance) & _aside(grid, self.findings.found(i), vehicle.clearance)
        if held and others:
            clear = free
            free = free & _aside(grid, np.array([way[0] for way in others.values()]), self.room[i])
        # Who is nearer to a thing than the clearance goes to the nearest place that is not, as plans do.
        reach = vehicle.clearance + 2 * grid.resolution
        first = stop if self.findings.looked else done + _past(here, command[done : stop + 1], others, float(self.room[i]))
        start = nearest_free(grid, free, here, reach)
        goals = [(j, np.array([w.x, w.y])) for j, w in enumerate(command[first:], first)]
        again = None
        if self.findings.looked and done and command[done].leg != "transit":
            again = _rejoined(grid, free, start[0], command[done - 1], command[done])
            goals = [(done, again), *goals] if again is not None else goals
        for j, goal in goals:
            taken = any(len(way) == 1 and np.hypot(*(way[0] - goal)) < self.room[i] for way in others.values())
            corner = j < stop  # which it need not be at
            within = 2 * grid.resolution if corner else reach + self.room[i] * taken
            ends = np.concatenate([start, nearest_free(grid, free, goal, within)])
            path = find_ways(grid, free, ends, "octile").path(0, 1)
            if path is not None:
                path = path[1:] if np.hypot(*(path[0] - here)) < CELL and len(path) > 2 else path
                corners = path if goal is again else path[:-1]
                via = tuple(Waypoint(x, y, speed=command[j].speed) for x, y in corners.tolist())
                self.barred[i] = np.inf
                x, y = path[-1].tolist()
                onward = [replace(w, x=x, y=y) if _same(w, goal) else w for w in command[j:]]
                return Detour((*via, *onward), len(via), j, done)
            if command[j].task is not None:
                break
        if held:
            near = [j for j, way in others.items() if np.hypot(*(way[0] - here)) < 6 * vehicle.model.length]
            if others and standing >= STANDS * (1 + sum(j > i for j in near)):
                return self._make_room(i, here, clear, free, list(others.values()), command, stop, done)
            return None
        self.barred[i] = min(self.barred[i], time)
        return Detour((), 0, stop, done) if time >= self.barred[i] + LOOK else None

    def _make_room(
        self,
        i: int,
        here: np.ndarray,
        clear: np.ndarray,
        free: np.ndarray,
        others: Sequence[np.ndarray],
        command: tuple[Waypoint, ...],
        stop: int,
        done: int,
    ) -> Detour | None:
        """Return the way to the nearest place off the others' ways, a wait there, and the way on from it, if there is one.

        `clear` (rows, cols) are the cells without, `free` those with the others in them.
        """
        vehicle, grid = self.vehicles[i], self.findings.grid(i)
        # GEOS cannot segmentize a line of no length.
        ways = [LineString(w) if np.ptp(w, axis=0).any() else None for w in others]
        along = [
            w if way is None else shapely.get_coordinates(way.segmentize(grid.resolution))
            for w, way in zip(others, ways, strict=True)
        ]
        off = np.argwhere(free & _aside(grid, np.concatenate(along), self.room[i]))
        places = grid.to_metres(off + 0.5)
        places = places[np.argsort(np.hypot(*(places - here).T), kind="stable")]
        chosen: list[np.ndarray] = []
        while len(places) and len(chosen) < PLACES:
            chosen.append(places[0])
            places = places[np.hypot(*(places - places[0]).T) > vehicle.model.length]
        if not chosen:
            return None
        goal = np.array([command[stop].x, command[stop].y])
        reach = vehicle.clearance + 2 * grid.resolution
        out = find_ways(grid, free, nearest_free(grid, free, np.array([here, *chosen]), reach))
        best = int(np.argmin(out.lengths[0, 1:])) + 1
        way = out.path(0, best)
        ends = nearest_free(grid, clear, np.array([chosen[best - 1], goal]), reach)
        back = find_ways(grid, clear, ends, "octile").path(0, 1)
        if way is None or back is None:
            return None
        waits = Waypoint(float(way[-1, 0]), float(way[-1, 1]), hold=YIELDS)
        via = (*(Waypoint(x, y) for x, y in way[:-1].tolist()), waits, *(Waypoint(x, y) for x, y in back[1:-1].tolist()))
        return Detour((*via, *command[stop:]), len(via), stop, done)

    def _standing(self, i: int, time: float, here: np.ndarray) -> float:
        """Return for how many seconds a robot that is under way has hardly moved."""
        if time - self.last[i] > 1.5 or np.hypot(*(here - self.anchor[i])) > MOVED:  # it held, or it moves
            self.anchor[i], self.since[i] = here, time
        self.last[i] = time
        return float(time - self.since[i])

    def reached(self, actual: np.ndarray) -> np.ndarray:
        """Return (k,) how many waypoints of their commands robots have reached: `actual` (k,) are of what they drive."""
        out = actual.copy()
        for i, d in self.detours.items():
            out[i] = d.done if actual[i] <= d.via else d.onward + actual[i] - d.via
        return out

    def _barred(self, i: int, here: np.ndarray, ahead: Sequence[Waypoint], *, fresh: bool) -> bool:
        """Whether what was found, or, on a fresh command, what is known lies in the way to where something is to do."""
        stop = _next_to_do(ahead)
        points = np.array([here, *((w.x, w.y) for w in ahead[: stop + 1])])
        way, keep = LineString(points), SLACK * self.vehicles[i].clearance
        if fresh and not shapely.dwithin(shapely.Point(here), shapely.Point(points[1]), 0.5):
            leg, solid = LineString(points[:2]), [o.polygon for o in self.site.obstacles if "ground" in o.blocks]
            if shapely.dwithin(leg, solid, self.vehicles[i].model.width / 2).any():
                return True
        at = self.findings.found(i)
        return bool(len(at)) and bool(shapely.dwithin(way, shapely.MultiPoint(at), keep))


def _next_to_do(ahead: Sequence[Waypoint]) -> int:
    """Return the number of the first waypoint that must be reached: with something to do, or at an end of a survey leg."""
    for j, (w, after) in enumerate(zip_longest(ahead, ahead[1:])):
        if w.task is not None or w.hold > 0 or w.leg != "transit" or after is None or after.leg != "transit":
            return j
    return 0


def _rejoined(grid: Occupancy, free: np.ndarray, here: np.ndarray, start: Waypoint, end: Waypoint) -> np.ndarray | None:
    """Return the (2,) place from where the leg from `start` to `end` is driven on; None if all of it is barred.

    It is the nearest to `here`; if something is in the way there or before long, the first past it. It can be reached over
    the `free` cells (rows, cols) of the grid.
    """
    a, b = np.array([start.x, start.y]), np.array([end.x, end.y])
    length = float(np.hypot(*(b - a)))
    begin = float(np.clip((here - a) @ (b - a) / max(length, CELL), 0.0, length))
    places = a + np.outer(np.arange(begin, length, grid.resolution), (b - a) / max(length, CELL))
    parts, _ = label(free)
    cells = np.clip(np.floor(grid.to_cells(np.vstack([here, places]))).astype(int), 0, np.array(free.shape) - 1)
    part = parts[cells[:, 0], cells[:, 1]]
    open_ = (part[1:] == part[0]) & (part[0] > 0)
    barred = np.flatnonzero(~open_)
    if len(barred) and barred[0] * grid.resolution < NEAR:
        open_[: barred[0]] = False
    return places[np.argmax(open_)] if open_.any() else None


def _past(here: np.ndarray, ahead: Sequence[Waypoint], others: Mapping[int, np.ndarray], room: float) -> int:
    """Return the number of the waypoint at which one is past the `others` that are within `room` of its way from `here`."""
    corners = np.array([here, *((w.x, w.y) for w in ahead)])
    spots = shapely.points(np.array([way[0] for way in others.values()]).reshape(-1, 2))
    nearest = shapely.distance(shapely.linestrings(np.stack([corners[:-1], corners[1:]], axis=1))[:, None], spots)
    nearer = nearest < shapely.distance(shapely.Point(here), spots) - CELL  # within already, it may be getting away
    beset = ((nearest < room) & nearer).any(axis=1)
    return int(np.flatnonzero(beset & ~np.append(beset[1:], False))[0]) if beset.any() else 0


def _same(waypoint: Waypoint, place: np.ndarray) -> bool:
    return waypoint.x == place[0] and waypoint.y == place[1]


def _aside(grid: Occupancy, places: np.ndarray, margin: float) -> np.ndarray:
    """Return (rows, cols) bool: the cell's centre is at least `margin` metres from all (m, 2) `places`."""
    clear = np.ones(grid.cells.shape, bool)
    cells = np.floor(grid.to_cells(places)).astype(int)
    cells = cells[((cells >= 0) & (cells < clear.shape)).all(axis=1)]
    if len(cells):
        clear[cells[:, 0], cells[:, 1]] = False
        clear = distance_transform_edt(clear) * grid.resolution >= margin
    return clear
