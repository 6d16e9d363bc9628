"""Tours past guards: the paper's on its trees and short ones on shortest paths; and what becomes of them in a mission."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from quarterdeck.coverage.cst import constrained_tour
from quarterdeck.coverage.guards.space import Space
from quarterdeck.coverage.metrics import track_length
from quarterdeck.coverage.network import Network, network
from quarterdeck.geo.errors import OutOfTimeError
from quarterdeck.geo.geodesics import Geodesics, geodesics
from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.corners import bends
from quarterdeck.mission.guard_tours import improve_tours, makespan_bound, tour_times
from quarterdeck.mission.mission import Guard, Layer, Leg, Route
from quarterdeck.mission.timing import timed_route

BOUNDED = 1200  # guards: ways between more take too long and too much memory, for a bound alone
SHARP = np.pi / 3  # radians: an arc at a sharper bend passes more than a seventh of its radius away from the corner


@dataclass(frozen=True, slots=True)
class Team:
    """Vehicles and where they enter and leave the reach: `starts`, `homes` (k, 2) metres; `ranges` (k,) metres."""

    vehicles: tuple[Vehicle, ...]
    starts: np.ndarray
    homes: np.ndarray
    ranges: np.ndarray

    @property
    def speeds(self) -> np.ndarray:
        """(k,) m/s."""
        return np.array([v.speed for v in self.vehicles])


@dataclass(frozen=True, slots=True)
class Tours:
    """Guards and who passes them. `order`: per robot the guards in the order of its visit, `lines` the (n, 2) metres that
    it moves, start to end, and `stops` where on its line each of them is. `times` (k,) seconds at the robots' speeds.
    Guards on no tour are spare: robots of longer range see for them.
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

    @property
    def owners(self) -> np.ndarray:
        """(m,) int: the robot that passes each guard, -1 for a spare one."""
        owners = np.full(len(self.guards), -1)
        for robot, order in enumerate(self.order):
            owners[list(order)] = robot
        return owners


def paper_tours(space: Space, guards: np.ndarray, team: Team) -> Tours:
    """Return the paper's tours: Reduced-CDT, Multi-Prim's, and a constrained spanning tour on each tree."""
    net = network(space.reach, guards, team.starts)
    number = {int(v): i for i, v in enumerate(net.guards)}
    k = len(team.vehicles)
    orders, lines, stops = [], [], []
    seen: set[int] = set()
    for robot in range(k):
        walk = constrained_tour(net.forest.parents[robot], net.forest.chosen[robot], net.cdt)
        mine = {number[int(v)] for v in net.forest.chosen[robot]} - seen
        order, at, before = [], [], len(net.access[robot]) - 1
        for i, v in enumerate(walk):
            guard = number.get(v)
            if guard in mine:
                mine.discard(guard)
                order.append(guard)
                at.append(before + i)
        seen |= set(order)
        round_trip = np.allclose(team.homes[robot], team.starts[robot])
        entry, home = net.cdt.points[net.entries[robot]], team.homes[robot]
        back = net.access[robot][::-1] if round_trip else geodesics(space.reach, np.stack([entry, home])).path(0, 1)
        lines.append(np.vstack([net.access[robot][:-1], net.cdt.points[walk], back[1:]]))
        orders.append(tuple(order))
        stops.append(tuple(at))
    times = np.array([track_length(line) for line in lines]) / team.speeds
    return Tours(guards, net, tuple(orders), tuple(lines), tuple(stops), times, _bound(space, guards, team))


def _bound(space: Space, guards: np.ndarray, team: Team) -> float:
    """Return seconds that no tours past the guards can beat; of many it is that of some, in no time as the crow flies."""
    some = guards[:: max(1, -(-len(guards) // BOUNDED))]
    try:
        lengths = _ways(space, some, team).lengths
    except OutOfTimeError:
        places = np.concatenate([some, team.starts, team.homes])
        lengths = np.linalg.norm(places[:, None] - places, axis=2)
    return makespan_bound(lengths, team.speeds)


def shorter_tours(
    space: Space,
    tours: Tours,
    team: Team,
    *,
    ranks: np.ndarray | None = None,
    exchange: bool = True,
    effort: float = 1.0,
    seed: int = 0,
) -> Tours:
    """Return tours past the same guards along shortest paths, of a makespan not above that of `tours`.

    With `ranks` (m,) no robot visits a guard before one of a higher rank, whatever that costs. Without `exchange` robots
    keep their guards.
    """
    ways = _ways(space, tours.guards, team)
    if exchange:
        orders = improve_tours(ways.lengths, tours.order, team.speeds, ranks=ranks, effort=effort, seed=seed)
    else:
        orders = [_alone(ways.lengths, tours, team, robot, ranks, seed) for robot in range(len(team.vehicles))]
    return _driven(ways, tours, orders, team)


def _ways(space: Space, guards: np.ndarray, team: Team) -> Geodesics:
    return geodesics(space.reach, np.concatenate([guards, team.starts, team.homes]))


def _alone(lengths: np.ndarray, tours: Tours, team: Team, robot: int, ranks: np.ndarray | None, seed: int) -> list[int]:
    m, k = len(tours.guards), len(team.vehicles)
    mine = np.array(tours.order[robot], dtype=np.int64)
    places = np.append(mine, [m + robot, m + k + robot])
    order = improve_tours(
        lengths[np.ix_(places, places)],
        [range(len(mine))],
        team.speeds[[robot]],
        ranks=None if ranks is None else ranks[mine],
        seed=seed,
    )[0]
    return mine[order].tolist()


def _driven(ways: Geodesics, tours: Tours, orders: Sequence[Sequence[int]], team: Team) -> Tours:
    """Return the tours along shortest paths in the given orders."""
    m, k = len(tours.guards), len(team.vehicles)
    lines, stops = [], []
    for robot, order in enumerate(orders):
        places = [m + robot, *order, m + k + robot]
        legs = [ways.path(a, b) for a, b in pairwise(places)]
        lines.append(np.vstack([legs[0][:1], *(leg[1:] for leg in legs)]))
        stops.append(tuple(np.cumsum([len(leg) - 1 for leg in legs])[:-1].tolist()))
    times = tour_times(ways.lengths, orders, team.speeds)
    used = [*sorted(g for order in orders for g in order), *range(m, m + 2 * k)]
    bound = makespan_bound(ways.lengths[np.ix_(used, used)], team.speeds)
    return Tours(tours.guards, tours.network, tuple(map(tuple, orders)), tuple(lines), tuple(stops), times, bound)


def guard_route(vehicle: Vehicle, tours: Tours, robot: int) -> Route:
    """Return the route along a tour: from the start itself, up where it flies, past the guards, home.

    One that has a turn radius stops at guards where it bends sharply, and turns on the spot: its arc would not pass there.
    """
    line, order, stops = tours.lines[robot], tours.order[robot], tours.stops[robot]
    guard_at = dict(zip(stops, order, strict=True))
    points = [(*vehicle.start, 0.0), *((x, y, vehicle.altitude) for x, y in line.tolist()), (*vehicle.home, 0.0)]
    tasks = [None, *(f"guard-{guard_at[i]}" if i in guard_at else None for i in range(len(line))), None]
    last = max(stops, default=-1)
    legs: list[Leg] = ["start", *("survey" if i <= last else "transit" for i in range(len(line))), "transit"]
    flies = vehicle.domain == "aerial"
    legs[1], legs[-1] = ("takeoff", "landing") if flies else (legs[1], legs[-1])
    used = [i for i in range(len(points)) if i == 0 or points[i] != points[i - 1] or tasks[i]]
    places, stops_at = np.array(points)[used], [tasks[i] for i in used]
    bend = np.abs(bends(places[:, :2])[1]) * (vehicle.turn_radius > 0.0)
    holds = np.where((bend > SHARP) & [t is not None for t in stops_at], bend / vehicle.model.turn_rate, 0.0)
    return timed_route(vehicle, places, [legs[i] for i in used], holds=holds.tolist(), tasks=stops_at)


def guards_of(tours: Tours, team: Team) -> tuple[Guard, ...]:
    """Return the guards with who passes them, and when."""
    names, owners = [v.id for v in team.vehicles], tours.owners.tolist()
    turns = {guard: turn for order in tours.order for turn, guard in enumerate(order)}
    ranges = [float(team.ranges[owner] if owner >= 0 else team.ranges.min()) for owner in owners]
    return tuple(
        Guard(x, y, ranges[i], names[owners[i]] if owners[i] >= 0 else None, turns.get(i))
        for i, (x, y) in enumerate(tours.guards.tolist())
    )


def guard_layers(tours: Tours, team: Team) -> tuple[Layer, ...]:
    """Return what is drawn beside the routes and guards: triangulation, reduced graph, trees and tours."""
    net, names = tours.network, [v.id for v in team.vehicles]
    trees = [net.forest.edges(robot) for robot in range(len(names))]
    grown = [robot for robot, edges in enumerate(trees) if len(edges)]
    return (
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
            tuple({"vehicle": name, "length": track_length(line)} for name, line in zip(names, tours.lines, strict=True)),
        ),
    )


def _lines(points: np.ndarray, edges: np.ndarray) -> shapely.MultiLineString:
    return shapely.multilinestrings(shapely.linestrings(points[edges]))
