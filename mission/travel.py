"""How long every vehicle takes between tasks and depots: shortest ways over its occupancy map, turns counted."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from quarterdeck.geo.deadline import go_on
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.gridpath import Heuristic, Ways, find_ways, nearest_free
from quarterdeck.geo.occupancy import Occupancy, site_occupancy
from quarterdeck.geo.scenario import Scenario, Vehicle
from quarterdeck.geo.triangulation import TriangulationError
from quarterdeck.mission.polygon_ways import PolygonWays, polygon_ways
from quarterdeck.mission.timing import turn_times

CELLS = 1_000_000  # of a map that is made from a site, at most
CELLS_A_CLEARANCE = 4
BYTES_A_WAY = 250  # for each pair of points: its path on a map
BYTES_A_TIME = 24  # for each pair of points: its time for a kind of vehicle
MOST_BYTES = 1_200_000_000
RIGHT_ANGLE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])


@dataclass(frozen=True, slots=True)
class Travel:
    """Between n tasks and the depots of k vehicles, which fall into c classes that drive alike.

    `seconds` (c, n, n), `out` and `home` (k, n), `idle` (k,) are times; inf is no way. `kind` (k,) is a vehicle's class.
    `ways[kind]` has the paths between points: the n tasks, then each vehicle's start, then each vehicle's end.
    `off` (c, n) is how many metres from a task the vehicle serves it, where its clearance keeps it away.
    """

    seconds: np.ndarray
    out: np.ndarray
    home: np.ndarray
    idle: np.ndarray
    kind: np.ndarray
    ways: tuple[Ways | PolygonWays, ...]
    off: np.ndarray

    def path(self, vehicle: int, i: int, j: int) -> np.ndarray:
        """Return a vehicle's (q, 2) path in metres between two points of `ways`. Raises ValueError where there is none."""
        way = self.ways[int(self.kind[vehicle])].path(i, j)
        if way is None:
            raise ValueError(f"no way from point {i} to point {j}")
        return way


def travel(
    scenario: Scenario,
    twin: Occupancy | None = None,
    *,
    resolution: float | None = None,
    heuristic: Heuristic = "none",
    plain: bool = False,
    quick: bool = False,
) -> Travel:
    """Return the travel times of a scenario, on the map `twin` (on the ground and at sea) or one made from the site.

    `resolution` is the made map's in metres; default a quarter of the least clearance, in at most a million cells. A task
    or depot within a vehicle's clearance of an obstacle is served from the nearest place that is not.

    A vehicle that turns on the spot is given a right angle's turn at each task, since its next leg is not known yet;
    `plain` times, the paper's, are metres along the grid over speed, no turns. `quick`: ways are found on the site's own
    polygons instead of a map, in milliseconds. Raises InputError if there are too many points for all ways to be held, and
    OutOfTimeError where it is abandoned.
    """
    vehicles, n, k = scenario.vehicles, len(scenario.tasks), len(scenario.vehicles)
    _refuse_too_many(scenario)
    points = np.array(
        [*(t.position for t in scenario.tasks), *(v.start for v in vehicles), *(v.home for v in vehicles)], dtype=float
    ).reshape(-1, 2)
    step = resolution if resolution is not None else default_resolution(scenario)
    kinds: dict[tuple[object, ...], int] = {}
    known: dict[tuple[str, float], tuple[Ways | PolygonWays, np.ndarray]] = {}
    kind = np.zeros(k, np.int64)
    seconds, turns, ways, off = [], [], [], []
    for r, v in enumerate(vehicles):
        key = _class(v)
        if key not in kinds:
            kinds[key] = len(kinds)
            if (v.domain, v.clearance) not in known:
                make = _quick_ways if quick else _ways
                known[v.domain, v.clearance] = make(scenario, v, twin, step, points, heuristic)
            way, shift = known[v.domain, v.clearance]
            seconds.append(way.steps / v.speed if plain else _seconds(v, way))
            turns.append(0.0 if plain else float(turn_times(v, RIGHT_ANGLE)[1]))
            ways.append(way)
            off.append(shift[:n])
        kind[r] = kinds[key]
    climb = np.array([v.altitude / v.model.climb_rate if v.domain == "aerial" else 0.0 for v in vehicles])
    start, end = n + np.arange(k), n + k + np.arange(k)
    whole = np.array(seconds).reshape(-1, n + 2 * k, n + 2 * k)
    idle = whole[kind, start, end]
    turn = np.array(turns)
    return Travel(
        seconds=whole[:, :n, :n] + turn[:, None, None],
        out=whole[kind, start, :n] + climb[:, None],
        home=whole[kind, end, :n] + (climb + turn[kind])[:, None],
        idle=np.where(idle > 0, idle + 2 * climb, 0.0),
        kind=kind,
        ways=tuple(ways),
        off=np.array(off).reshape(len(off), n),
    )


def _refuse_too_many(scenario: Scenario) -> None:
    n, k = len(scenario.tasks), len(scenario.vehicles)
    maps, classes = {(v.domain, v.clearance) for v in scenario.vehicles}, {_class(v) for v in scenario.vehicles}
    a_pair = BYTES_A_WAY * len(maps) + BYTES_A_TIME * len(classes)
    if (n + 2 * k) ** 2 * a_pair > MOST_BYTES:
        most = max(0, math.isqrt(MOST_BYTES // a_pair) - 2 * k)
        raise InputError(
            f"the ways between {n:,} tasks for {k:,} vehicles ({len(classes):,} that differ) are too many to hold; "
            + (f"at most {most:,} tasks work" if most else "give fewer vehicles")
        )


def _class(v: Vehicle) -> tuple[object, ...]:
    """Return what vehicles that drive alike have in common."""
    return v.domain, v.clearance, v.speed, v.turn_radius, v.model.name, v.altitude


def default_resolution(scenario: Scenario) -> float:
    """Return the side of a map's cells in metres: a quarter of the least clearance, or what `CELLS` allow."""
    x0, y0, x1, y1 = scenario.site.operating.bounds
    least = math.sqrt(max((x1 - x0) * (y1 - y0), 1e-6) / CELLS)
    return max(least, min((v.clearance for v in scenario.vehicles), default=0.0) / CELLS_A_CLEARANCE)


def _quick_ways(
    scenario: Scenario,
    vehicle: Vehicle,
    twin: Occupancy | None,
    step: float,
    points: np.ndarray,
    heuristic: Heuristic,
) -> tuple[Ways | PolygonWays, np.ndarray]:
    """Return ways on the site's polygons, or on a map where there is one, or they cannot be triangulated."""
    try:
        if twin is None:
            return polygon_ways(scenario, vehicle, points)
    except TriangulationError:
        pass
    return _ways(scenario, vehicle, twin, step, points, heuristic)


def _ways(
    scenario: Scenario,
    vehicle: Vehicle,
    twin: Occupancy | None,
    step: float,
    points: np.ndarray,
    heuristic: Heuristic,
) -> tuple[Ways, np.ndarray]:
    """Return the ways of a domain and clearance, and how far each point was moved to stand free."""
    if twin is None or vehicle.domain == "aerial":
        # A path may run anywhere in a cell whose centre is free: half a diagonal is added, so that none cuts the clearance.
        map_ = site_occupancy(scenario.site, vehicle.domain, step, vehicle.clearance + step * math.sqrt(0.5))
        free = map_.free()
    else:
        map_ = twin
        free = map_.free(vehicle.clearance)
    stands = nearest_free(map_, free, points, vehicle.clearance + 2 * map_.resolution)
    return find_ways(map_, free, stands, heuristic), np.hypot(*(stands - points).T)


def _seconds(vehicle: Vehicle, ways: Ways | PolygonWays) -> np.ndarray:
    seconds = ways.lengths / vehicle.speed
    if isinstance(ways, PolygonWays):
        return np.asarray(seconds + ways.turning(vehicle))
    for i, row in enumerate(ways.paths):
        go_on(f"the count of turns on the ways after {i:,} of {len(ways.paths):,} tasks and depots")
        for j, path in enumerate(row):
            if path is not None and len(path) > 2:
                seconds[i, j] += turn_times(vehicle, path).sum()
                seconds[j, i] = seconds[i, j]
    return np.asarray(seconds)


def reachable(travel: Travel) -> np.ndarray:
    """Return (k, n) bool: the vehicle can get to the task and from it to its end."""
    return np.isfinite(travel.out) & np.isfinite(travel.home)


def usable(vehicles: Sequence[Vehicle], reserve: float) -> np.ndarray:
    """Return (k,) seconds that each vehicle can be out, by endurance and by battery at cruise, less the reserve."""
    return np.array(
        [(1 - reserve) * min(v.endurance, v.battery * 3600.0 / v.model.power(v.speed)) for v in vehicles], dtype=float
    )
