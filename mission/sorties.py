"""Missions beyond a vehicle's endurance, split into sorties that come home and resume where they left off.

Each sortie goes as far as battery and endurance allow with the reserve in hand, the way home counted: by energy and time,
not by equal numbers of waypoints.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Vehicle
from quarterdeck.geo.transit import Roadmap, roadmap, shortest_paths
from quarterdeck.mission.mission import Leg, Mission, Route
from quarterdeck.mission.timing import shortfalls, timed_route

LEAST_WORK = 1.0  # m: a sortie that gets no farther along the route than this is none
_MOST = 1000  # sorties: more is a mistake of units


def sorties(mission: Mission) -> tuple[Mission, ...]:
    """Return one mission for each round of sorties; just the mission itself where every vehicle can do its route.

    In round n every vehicle does its n-th sortie: out to where the last one broke off, on along its route, home by the
    shortest way round what blocks it. A vehicle that has finished stays at its start with a route of one waypoint. Times
    are each round's own. Raises InputError if a vehicle cannot even reach the work and come back.
    """
    split = [_split(mission, route) for route in mission.routes]
    rounds = max((len(s) for s in split), default=1)
    if rounds == 1:
        return (mission,)
    made = []
    for n in range(rounds):
        pairs = zip(split, mission.routes, strict=True)
        routes = tuple(s[n] if n < len(s) else Route(whole.vehicle, whole.waypoints[:1]) for s, whole in pairs)
        name, parameters = f"{mission.name}, sortie {n + 1} of {rounds}", {**mission.parameters, "sortie": n + 1}
        made.append(replace(mission, name=name, routes=routes, reasons=(), parameters=parameters))
    return tuple(made)


@dataclass(frozen=True, slots=True)
class _Work:
    """What is between a route's way out and its way home: (n, 3) points in metres; the kind of the leg that ends at each,
    seconds waited and task there, its speed as a part of the vehicle's. `delay` is seconds waited before launch, `height`
    the metres above ground of its transits.
    """

    points: np.ndarray
    legs: Sequence[Leg]
    holds: Sequence[float]
    tasks: Sequence[str | None]
    paces: Sequence[float]
    delay: float
    height: float


def _split(mission: Mission, route: Route) -> list[Route]:
    vehicle = mission.vehicle(route.vehicle)
    if not shortfalls(vehicle, route):
        return [route]
    road = roadmap(mission.site.navigable(vehicle.domain, vehicle.clearance))
    first, last = _busy(route)
    some = route.waypoints[first:last]
    points, legs = route.xyz[first:last], [w.leg for w in some]
    work = _Work(
        points,
        legs,
        [w.hold for w in some],
        [w.task for w in some],
        _paces(vehicle, route)[first:last],
        route.waypoints[0].hold,
        max((w.z for w in route.waypoints if w.leg == "transit"), default=float(route.xyz[:, 2].max())),
    )
    done: list[Route] = []
    first, here = 0, None  # the next waypoint to make for, and where the last sortie broke off
    while first < len(points):
        best = None
        # As far as it goes: whole waypoints first, then a part of the leg to the next one.
        low, high = first, len(points)
        while low < high:  # greatest number of waypoints that a sortie can hold; more waypoints never cost less
            middle = (low + high + 1) // 2
            trial = _sortie(vehicle, road, work, first, middle, here, None)
            low, high, best = (middle, high, trial) if not shortfalls(vehicle, trial) else (low, middle - 1, best)
        stop = None
        if low < len(points):
            stop, partial = _farthest(vehicle, road, work, first, low, here)
            best = partial or best
        if best is None or (low == first and stop is None) or len(done) >= _MOST:
            raise InputError(f"{vehicle.id}: cannot reach its work and come home on one battery; start it nearer")
        done.append(best)
        # What broke off on a survey leg, or just before one, resumes there.
        if stop is None and low < len(points) and legs[low] == "survey":
            stop = points[low - 1]
        first, here = low, stop
    return done


def _busy(route: Route) -> tuple[int, int]:
    """The waypoints between the way out and the way home: from the first survey leg or task to the last."""
    busy = [i for i, w in enumerate(route.waypoints) if i and (w.leg == "survey" or w.task is not None or w.hold > 0)]
    if not busy:
        return 1, len(route.waypoints)
    return max(busy[0] - (route.waypoints[busy[0]].leg == "survey"), 0), busy[-1] + 1


def _paces(vehicle: Vehicle, route: Route) -> list[float]:
    """The speed of each level leg as a part of the vehicle's; a climb has its own."""
    step = np.diff(route.xyz, axis=0, prepend=route.xyz[:1])
    level = (np.hypot(step[:, 0], step[:, 1]) > 0) & (step[:, 2] == 0)
    speeds = np.array([w.speed for w in route.waypoints])
    return np.where(level & (speeds > 0), speeds / vehicle.speed, 1.0).tolist()


def _farthest(
    vehicle: Vehicle,
    road: Roadmap,
    work: _Work,
    first: int,
    last: int,
    here: np.ndarray | None,
) -> tuple[np.ndarray | None, Route | None]:
    """The place on the leg to waypoint `last` where the sortie has to turn home, to a metre, and that sortie; or None."""
    points = work.points
    begin = points[last - 1] if last > first else here
    if begin is None or work.legs[last] != "survey":  # a transit is not worth breaking
        return None, None
    leg = points[last] - begin
    found: tuple[np.ndarray | None, Route | None] = (None, None)
    low, high = 0.0, 1.0
    while (high - low) * np.linalg.norm(leg) > LEAST_WORK:
        middle = (low + high) / 2
        trial = _sortie(vehicle, road, work, first, last, here, begin + middle * leg)
        if shortfalls(vehicle, trial):
            high = middle
        else:
            low, found = middle, (begin + middle * leg, trial)
    return found


def _sortie(
    vehicle: Vehicle,
    road: Roadmap,
    work: _Work,
    first: int,
    last: int,
    here: np.ndarray | None,
    stop: np.ndarray | None,
) -> Route:
    """By the shortest way to `here` (or waypoint `first`), waypoints up to `last`, maybe on to `stop`, home."""
    places: list[np.ndarray] = [work.points[first:last]]
    kinds: list[Leg] = list(work.legs[first:last])
    waits, names, pace = list(work.holds[first:last]), list(work.tasks[first:last]), list(work.paces[first:last])
    if here is not None:
        places.insert(0, here[None])
        kinds, waits, names, pace = ["transit", *kinds], [0.0, *waits], [None, *names], [1.0, *pace]
    if stop is not None:
        places.append(stop[None])
        kinds, waits, names, pace = [*kinds, "survey"], [*waits, 0.0], [*names, None], [*pace, work.paces[last]]
    way = np.concatenate(places)
    out = _transit(road, vehicle.start, way[0, :2], work.height)
    home = _transit(road, way[-1, :2], vehicle.home, work.height)
    # Where the work is at another height, the vehicle changes it on the spot.
    out = out[:-1] if way[0, 2] == work.height else out
    home = home[1:] if way[-1, 2] == work.height else home
    if here is None and len(kinds):
        kinds[0], pace[0] = "transit", 1.0
    xyz = np.concatenate([out, way, home])
    every: list[Leg] = [*["transit"] * len(out), *kinds, *["transit"] * len(home)]  # type: ignore[list-item]
    waits = [*[0.0] * len(out), *waits, *[0.0] * len(home)]
    names = [*[None] * len(out), *names, *[None] * len(home)]
    pace = [*[1.0] * len(out), *pace, *[1.0] * len(home)]
    if vehicle.domain == "aerial":
        ground = [np.array([[*vehicle.start, 0.0]]), np.array([[*vehicle.home, 0.0]])]
        xyz = np.concatenate([ground[0], xyz, ground[1]])
        every = ["start", "takeoff", *every[1:], "landing"]
        waits, names, pace = [0.0, *waits, 0.0], [None, *names, None], [1.0, *pace, 1.0]
    else:
        every[0] = "start"
    waits[0] = work.delay
    return timed_route(vehicle, xyz, every, holds=waits, tasks=names, pace=pace)


def _transit(
    road: Roadmap, a: np.ndarray | tuple[float, float], b: np.ndarray | tuple[float, float], z: float
) -> np.ndarray:
    way = shortest_paths(road, np.asarray(a), np.asarray(b))[1][0][0]
    if way is None:
        way = np.array([a, b], dtype=float)  # the planner found none either; the checker says what it crosses
    return np.column_stack([way, np.full(len(way), z)])
