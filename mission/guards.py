"""Coverage by robots of limited visibility: guards, tours past them, and the proof that all is seen."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal

import numpy as np
import shapely
from shapely import MultiPolygon

from quarterdeck.coverage.cst import constrained_tour
from quarterdeck.coverage.guards.bound import guards_bound
from quarterdeck.coverage.guards.certificate import TOLERANCE, mend, uncovered
from quarterdeck.coverage.guards.fewer import fewer_guards
from quarterdeck.coverage.guards.pieces import paper_guards
from quarterdeck.coverage.guards.space import Space, space_of
from quarterdeck.coverage.network import Network, network
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.geodesics import geodesics
from quarterdeck.geo.scenario import Scenario, Vehicle, as_multipolygon
from quarterdeck.geo.triangulation import Triangulation, triangulate
from quarterdeck.geo.visibility import visibility_polygons
from quarterdeck.mission.guard_tours import improve_tours, makespan_bound, tour_times
from quarterdeck.mission.mission import Layer, Leg, Mission, Route
from quarterdeck.mission.timing import shortfalls, timed_route

Mode = Literal["optimised", "paper"]


@dataclass(frozen=True, slots=True)
class Tours:
    """Guards and who passes them. `order`: per robot the guards in the order of its visit, `lines` the (n, 2) metres that
    it moves, start to end, and `stops` where on its line each of them is. `times` (k,) seconds at the robots' speeds.
    """

    guards: np.ndarray
    network: Network
    order: tuple[tuple[int, ...], ...]
    lines: tuple[np.ndarray, ...]
    stops: tuple[tuple[int, ...], ...]
    times: np.ndarray
    bound: float

    @property
    def makespan(self) -> float:
        """Seconds until the last robot is home."""
        return float(self.times.max())


def plan_guards(scenario: Scenario, *, range: float | None = None, mode: Mode = "optimised", seed: int = 0) -> Mission:  # noqa: A002
    """Return the mission that sees every point of the area from within `range` metres (fault-tolerant-cdt).

    `range` is that of the vehicles that have none of their own. As every robot may have to stand in for every other, guards
    are placed for the shortest. `paper` does what the paper does; `optimised` begins there and is never worse, neither in
    guards nor in makespan. Raises InputError if a range is missing or not positive, a vehicle starts outside, or a part
    of the area cannot be reached by any; what cannot be seen because of the clearance makes the mission infeasible.
    """
    reach = _range(scenario.vehicles, range)
    space, starts, homes = _entered(space_of(scenario), scenario.vehicles)
    mesh = triangulate(space.sight)
    guards, unseen = mend(space, mesh, paper_guards(space, reach), reach)
    robots = (starts, homes, scenario.vehicles)
    paper = paper_tours(space, guards, *robots)
    tours = paper if mode == "paper" else _optimised(space, unseen, mesh, paper, *robots, reach=reach, seed=seed)
    rest = uncovered(space, visibility_polygons(mesh, tours.guards, reach))
    reasons = [] if unseen.is_empty else [f"{unseen.area:.6g} m2 cannot be seen from where the vehicles may be"]
    routes = [_route(v, tours, i) for i, v in enumerate(scenario.vehicles)]
    reasons += [line for v, route in zip(scenario.vehicles, routes, strict=True) for line in shortfalls(v, route)]
    figures: dict[str, Any] = {
        "guards": len(tours.guards),
        "makespan": tours.makespan,
        "ratio": tours.makespan / tours.bound if tours.bound > 0 else 1.0,
        "duration": max(r.duration for r in routes),
        "length": sum(r.length for r in routes),
        "area": space.target.area,
        "paper": {"guards": len(paper.guards), "makespan": paper.makespan, "bound": paper.bound},
        "certificate": {
            "uncovered": float(rest.area),
            "tolerance": TOLERANCE,
            "method": "area less the union of range-limited visibility polygons, discs inscribed",
        },
    }
    return Mission(
        name=scenario.name,
        frame=scenario.frame,
        site=scenario.site,
        vehicles=scenario.vehicles,
        routes=tuple(routes),
        method="guards",
        parameters={"range": reach, "mode": mode},
        seed=seed,
        tasks=scenario.tasks,
        casualties=scenario.casualties,
        figures=figures,
        bounds={"makespan": tours.bound, "guards": guards_bound(_less(space, unseen), mesh, reach, seed=seed)},
        reasons=tuple(reasons),
        layers=_layers(tours, scenario.vehicles, reach),
        input_hash=scenario.input_hash,
    )


def _optimised(
    space: Space,
    unseen: MultiPolygon,
    mesh: Triangulation,
    paper: Tours,
    starts: np.ndarray,
    homes: np.ndarray,
    vehicles: Sequence[Vehicle],
    *,
    reach: float,
    seed: int,
) -> Tours:
    """Return tours past few guards; past the paper's own where those would not be shorter than the paper's."""
    few = fewer_guards(_less(space, unseen), mesh, paper.guards, reach, seed=seed)
    tours = shorter_tours(space, paper_tours(space, few, starts, homes, vehicles), starts, homes, vehicles, seed=seed)
    if tours.makespan <= paper.makespan:
        return tours
    return shorter_tours(space, paper, starts, homes, vehicles, seed=seed)


def _less(space: Space, unseen: MultiPolygon) -> Space:
    """Return the space whose target is what can be seen."""
    return space if unseen.is_empty else replace(space, target=as_multipolygon(space.target.difference(unseen)))


def _range(vehicles: Sequence[Vehicle], default: float | None) -> float:
    """Return the shortest range of all vehicles."""
    if default is not None and not (0 < default < float("inf")):
        raise InputError(f"range {default} must be positive and finite; give metres, such as --range 20")
    ranges = []
    for vehicle in vehicles:
        value = default if vehicle.range is None else vehicle.range
        if value is None:
            raise InputError(f"vehicle {vehicle.id!r} has no range; give it one, or --range for all")
        if not 0 < value < float("inf"):
            raise InputError(f"vehicle {vehicle.id!r}: range {value} must be positive and finite")
        ranges.append(value)
    return min(ranges, default=0.0)


def _entered(space: Space, vehicles: Sequence[Vehicle]) -> tuple[Space, np.ndarray, np.ndarray]:
    """Return the space with only the parts that a robot starts in, and where robots enter it from start and end, (k, 2)."""
    parts = shapely.get_parts(space.reach)
    starts = [_enter(space, parts, v, v.start, "starts") for v in vehicles]
    homes = [_enter(space, parts, v, v.home, "ends") for v in vehicles]
    for vehicle, (start, _), (home, _) in zip(vehicles, starts, homes, strict=True):
        if start != home:
            raise InputError(f"vehicle {vehicle.id!r} cannot get from its start to its end; move one of them")
    used = sorted({part for part, _ in starts})
    apart = shapely.union_all(np.delete(parts, used))
    lonely = as_multipolygon(shapely.intersection(space.target, apart))
    if lonely.area > TOLERANCE * space.target.area:
        point = shapely.get_coordinates(shapely.point_on_surface(lonely))
        place = "" if space.frame is None else ", such as {:.6f}, {:.6f}".format(*space.frame.to_degrees(point)[0])
        raise InputError(
            f"{lonely.area:.6g} m2 of the area can be reached by no vehicle{place}; start one there, or leave that part out"
        )
    reach = as_multipolygon(shapely.multipolygons(parts[used]))
    entries, exits = (np.array([xy for _, xy in ends]) for ends in (starts, homes))
    return Space(space.target, space.sight, reach, space.frame), entries, exits


def _enter(
    space: Space, parts: np.ndarray, vehicle: Vehicle, xy: tuple[float, float], word: str
) -> tuple[int, tuple[float, float]]:
    """Return the part nearest to a place that a vehicle may be in, and the place there; a berth may be near the quay."""
    away = shapely.distance(parts, shapely.Point(xy))
    part = int(np.argmin(away))
    if away[part] > 1.2 * vehicle.clearance + 1e-6:
        holes = space.sight.buffer(0).envelope.covers(shapely.Point(xy))
        where = "in an obstacle or outside the area" if holes else "outside the area"
        raise InputError(f"vehicle {vehicle.id!r} {word} {where}, {away[part]:.3g} m from where it may be; move it inside")
    if away[part] == 0:
        return part, xy
    x, y = shapely.get_coordinates(shapely.shortest_line(parts[part], shapely.Point(xy)))[0]
    return part, (float(x), float(y))


def paper_tours(
    space: Space, guards: np.ndarray, starts: np.ndarray, homes: np.ndarray, vehicles: Sequence[Vehicle]
) -> Tours:
    """Return the paper's tours: Reduced-CDT, Multi-Prim's, and a constrained spanning tour on each tree."""
    net = network(space.reach, guards, starts)
    number = {int(v): i for i, v in enumerate(net.guards)}
    ways = geodesics(space.reach, np.concatenate([net.cdt.points[net.entries], homes]))
    orders, lines, stops = [], [], []
    seen: set[int] = set()
    for robot in range(len(vehicles)):
        walk = constrained_tour(net.forest.parents[robot], net.forest.chosen[robot], net.cdt)
        mine = {number[int(v)] for v in net.forest.chosen[robot]} - seen
        order, at, before = [], [], len(net.access[robot]) - 1
        for i, v in enumerate(walk):
            guard = number.get(v)
            if guard in mine and guard not in order:
                order.append(guard)
                at.append(before + i)
        seen |= set(order)
        back = ways.path(robot, len(vehicles) + robot)
        if np.allclose(homes[robot], starts[robot]):
            back = net.access[robot][::-1]
        lines.append(np.vstack([net.access[robot][:-1], net.cdt.points[walk], back[1:]]))
        orders.append(tuple(order))
        stops.append(tuple(at))
    times = np.array([_metres(line) / v.speed for line, v in zip(lines, vehicles, strict=True)])
    ways = geodesics(space.reach, np.concatenate([guards, starts, homes]))
    bound = makespan_bound(ways.lengths, np.array([v.speed for v in vehicles]))
    return Tours(guards, net, tuple(orders), tuple(lines), tuple(stops), times, bound)


def _metres(line: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def shorter_tours(
    space: Space, tours: Tours, starts: np.ndarray, homes: np.ndarray, vehicles: Sequence[Vehicle], *, seed: int = 0
) -> Tours:
    """Return tours past the same guards along shortest paths, of a makespan not above that of `tours`."""
    m, k = len(tours.guards), len(vehicles)
    speeds = np.array([v.speed for v in vehicles])
    ways = geodesics(space.reach, np.concatenate([tours.guards, starts, homes]))
    orders = improve_tours(ways.lengths, tours.order, speeds, seed=seed)
    lines, stops = [], []
    for robot, order in enumerate(orders):
        places = [m + robot, *order, m + k + robot]
        legs = [ways.path(a, b) for a, b in pairwise(places)]
        lines.append(np.vstack([legs[0][:1], *(leg[1:] for leg in legs)]))
        stops.append(tuple(np.cumsum([len(leg) - 1 for leg in legs])[:-1].tolist()))
    times = tour_times(ways.lengths, orders, speeds)
    bound = makespan_bound(ways.lengths, speeds)
    return Tours(tours.guards, tours.network, tuple(map(tuple, orders)), tuple(lines), tuple(stops), times, bound)


def _route(vehicle: Vehicle, tours: Tours, robot: int) -> Route:
    """Return the route along a tour: from the start itself, up where it flies, past the guards, home."""
    line, order, stops = tours.lines[robot], tours.order[robot], tours.stops[robot]
    guard_at = dict(zip(stops, order, strict=True))
    points = [(*vehicle.start, 0.0), *((x, y, vehicle.altitude) for x, y in line.tolist()), (*vehicle.home, 0.0)]
    tasks = [None, *(f"guard-{guard_at[i]}" if i in guard_at else None for i in range(len(line))), None]
    last = max(stops, default=-1)
    legs: list[Leg] = ["start", *("survey" if i <= last else "transit" for i in range(len(line))), "transit"]
    flies = vehicle.domain == "aerial"
    legs[1], legs[-1] = ("takeoff", "landing") if flies else (legs[1], legs[-1])
    used = [i for i in range(len(points)) if i == 0 or points[i] != points[i - 1] or tasks[i]]
    return timed_route(vehicle, np.array(points)[used], [legs[i] for i in used], tasks=[tasks[i] for i in used])


def _layers(tours: Tours, vehicles: Sequence[Vehicle], reach: float) -> tuple[Layer, ...]:
    """Return what is drawn beside the routes: guards, triangulation, reduced graph, trees and tours."""
    net = tours.network
    passed = {guard: (robot, turn) for robot, order in enumerate(tours.order) for turn, guard in enumerate(order)}
    names = [v.id for v in vehicles]
    guards = [
        {"guard": g, "range": reach, "vehicle": names[passed[g][0]], "turn": passed[g][1]} for g in range(len(tours.guards))
    ]
    trees = [net.forest.edges(robot) for robot in range(len(vehicles))]
    grown = [robot for robot, edges in enumerate(trees) if len(edges)]
    return (
        Layer("guards", tuple(shapely.points(tours.guards)), tuple(guards)),
        Layer("triangulation", (_lines(net.cdt.points, net.cdt.edges),), ({"stroke": "#cccccc", "stroke-width": 1},)),
        Layer("reduced graph", (_lines(net.cdt.points, net.reduced.edges),), ({"weight": net.reduced.weight},)),
        Layer(
            "trees",
            tuple(_lines(net.cdt.points, trees[robot]) for robot in grown),
            tuple({"vehicle": names[robot]} for robot in grown),
        ),
        Layer(
            "tours",
            tuple(shapely.LineString(line) for line in tours.lines),
            tuple({"vehicle": name, "length": _metres(line)} for name, line in zip(names, tours.lines, strict=True)),
        ),
    )


def _lines(points: np.ndarray, edges: np.ndarray) -> shapely.MultiLineString:
    return shapely.multilinestrings(shapely.linestrings(points[edges]))
