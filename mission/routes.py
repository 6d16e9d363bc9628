"""From closed survey tracks to routes: out, round them, home; launches staggered, altitudes layered, corners drivable."""

from collections.abc import Iterable, Sequence

import numpy as np
from shapely import LineString, Point
from shapely.ops import substring

from quarterdeck.coverage.metrics import straight_pieces
from quarterdeck.geo.scenario import Vehicle, as_multipolygon
from quarterdeck.geo.transit import Roadmap, shortest_paths, straight
from quarterdeck.mission.corners import driven, entered, with_turns
from quarterdeck.mission.mission import Leg, Route, unbroken
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.timing import shortfalls, timed_route

PIVOT = np.pi  # radians: a turn on the spot, at the most
LAYER_STEP = 5.0  # m between the altitudes at which aerial vehicles transit, less where a ceiling is near


def survey_routes(
    vehicles: Sequence[Vehicle], tracks: Sequence[Sequence[np.ndarray]], roads: Sequence[Roadmap]
) -> tuple[tuple[Route, ...], list[Reason]]:
    """Return each vehicle's route out, round its closed (n, 2) tracks, nearest first, and home; and why some fail."""
    return line_routes(vehicles, [_in_order(v, own) for v, own in zip(vehicles, tracks, strict=True)], roads)


def _in_order(vehicle: Vehicle, tracks: Sequence[np.ndarray]) -> list[np.ndarray]:
    here, left, lines = Point(vehicle.start), list(tracks), []
    while left:
        nearest = min(range(len(left)), key=lambda i: here.distance(LineString(left[i])))
        lines.append(_entered(left.pop(nearest), here))
        here = Point(lines[-1][-1])
    return lines


def _entered(track: np.ndarray, point: Point) -> np.ndarray:
    """Return a closed (n, 2) track begun, and ended, where it is nearest to a point."""
    line = LineString(track)
    along = line.line_locate_point(point)
    parts = [substring(line, along, line.length), substring(line, 0.0, along)]
    return _straightened(np.concatenate([np.array(p.coords) for p in parts]))


def _straightened(line: np.ndarray) -> np.ndarray:
    """Return an (n, 2) polyline without the points in the middle of its straight runs."""
    pieces = straight_pieces(line)
    return np.concatenate([pieces[:, 0], pieces[-1:, 1]])


def line_routes(
    vehicles: Sequence[Vehicle], lines: Sequence[Sequence[np.ndarray]], roads: Sequence[Roadmap]
) -> tuple[tuple[Route, ...], list[Reason]]:
    """Return each vehicle's route along its (n, 2) survey lines in their order, and home; and why some cannot be done."""
    ways = [_linked(vehicle, own, road) for vehicle, own, road in zip(vehicles, lines, roads, strict=True)]
    routes, reasons = way_routes(vehicles, [(points, legs) for points, legs, _ in ways], roads)
    return routes, [reason for _, _, missing in ways for reason in missing] + reasons


def way_routes(
    vehicles: Sequence[Vehicle], ways: Sequence[tuple[np.ndarray, Sequence[Leg]]], roads: Sequence[Roadmap]
) -> tuple[tuple[Route, ...], list[Reason]]:
    """Return each vehicle's route along its way, (n, 2) metres and the kind of each leg, and why some cannot be done.

    Corners become drivable (where nothing else has room, by a stop and a turn on the spot), aerial vehicles climb and land,
    launches are staggered, times and energy are filled in.
    """
    routes, reasons = [], []
    for i, (vehicle, (points, legs), road) in enumerate(zip(vehicles, ways, roads, strict=True)):
        path = with_turns(points, legs, vehicle.turn_radius, road.polygon)
        if vehicle.heading is not None:
            room = road.polygon.buffer(0.5 * vehicle.clearance)  # half the clearance is for being off one's path
            path = entered(path, vehicle.heading, vehicle.turn_radius, as_multipolygon(room))
        xyz, kinds, pace = np.column_stack([path.points, np.zeros(len(path.points))]), path.legs, path.pace
        holds = np.where(path.stops, PIVOT / vehicle.model.turn_rate, 0.0)
        if vehicle.domain == "aerial" and len(xyz) > 1:
            survey = np.array([leg == "survey" for leg in kinds])
            xyz[:, 2] = np.where(survey, vehicle.altitude, _transit_height(vehicles, i))
            xyz, kinds, kept = _with_takeoff(xyz, kinds)
            pace, holds = np.where(kept < 0, 1.0, pace[kept]), np.where(kept < 0, 0.0, holds[kept])
        holds[0] = _launch_delay(vehicles, i)
        route = timed_route(vehicle, xyz, kinds, holds=holds.tolist(), pace=pace)
        routes.append(route)
        reasons += shortfalls(vehicle, route)
    return tuple(routes), reasons


def _linked(vehicle: Vehicle, lines: Sequence[np.ndarray], road: Roadmap) -> tuple[np.ndarray, list[Leg], list[Reason]]:
    """Return (n, 2) metres from the start along survey lines (m, 2) in order and home, the kind of each leg, what fails."""
    points, legs, missing = [np.array([vehicle.start])], ["start"], []  # type: list[np.ndarray], list[Leg], list[Reason]
    ends = [np.array(vehicle.start), *(line[-1] for line in lines)]
    clear = straight(road, np.array(ends[:-1]), np.array([line[0] for line in lines])) if lines else np.empty(0)
    for line, end, seen in zip(lines, ends, clear.tolist(), strict=False):
        here = points[-1][-1]
        if (here == line[0]).all():  # it goes on where the one before it ends
            way = here[None]
        elif seen and (here == end).all():
            way = np.array([here, line[0]])
        else:
            way = shortest_paths(road, here, line[0])[1][0][0]
        if way is None:
            missing.append(
                Reason(f"{vehicle.id}: no way from its start to its region; move the start, or lessen its clearance")
            )
            continue
        points += [way[1:], line[1:]]
        legs.extend(["transit"] * (len(way) - 1))
        legs.extend(["survey"] * (len(line) - 1))
    if not vehicle.returns:
        return np.concatenate(points), legs, missing
    way = shortest_paths(road, points[-1][-1], np.array(vehicle.home))[1][0][0]
    if way is None:
        missing.append(Reason(f"{vehicle.id}: no way from its region to its end; move the end, or lessen its clearance"))
    elif len(points) > 1 or vehicle.home != vehicle.start:
        points.append(way[1:])
        legs.extend(["transit"] * (len(way) - 1))
    return np.concatenate(points), legs, missing


def survey_lines(routes: Iterable[Route]) -> list[np.ndarray]:
    """Return the (n, 2) lines in metres along which routes survey, legs that follow one another joined."""
    return [line for route in routes for line in unbroken(route.xyz[:, :2], route.survey)]


def survey_tracks(vehicle: Vehicle, route: Route) -> list[np.ndarray]:
    """Return the (n, 2) lines in metres along which a route surveys, corners rounded as the vehicle drives them."""
    return [driven(line, vehicle.turn_radius) for line in survey_lines([route])]


def _transit_height(vehicles: Sequence[Vehicle], index: int) -> float:
    """Return metres above ground of a vehicle's transits: each has its own layer above its altitude, below its ceiling."""
    flying = [v for v in vehicles if v.domain == "aerial"]
    own = vehicles[index]
    step = min([LAYER_STEP, *((v.ceiling - v.altitude) / len(flying) for v in flying if v.ceiling > v.altitude)])
    return own.altitude + (flying.index(own) + 1) * step


def _launch_delay(vehicles: Sequence[Vehicle], index: int) -> float:
    """Return seconds that a vehicle waits at its start, so that those beside it are clear before it leaves."""
    own = vehicles[index]
    room = 2 * (own.clearance + own.model.length)
    ahead = [v for v in vehicles[:index] if v.domain == own.domain and np.hypot(*np.subtract(v.start, own.start)) < room]
    return float(sum(2 * room / v.speed for v in ahead))


def _with_takeoff(xyz: np.ndarray, legs: list[Leg]) -> tuple[np.ndarray, list[Leg], np.ndarray]:
    """Put a climb at the start and a descent at the end of an aerial path; changes of altitude are made on the spot.

    Returns the (m, 3) points, the kind of each leg, and (m,) which point of `xyz` each was, -1 where it is new.
    """
    rows: list[np.ndarray] = [np.array([*xyz[0, :2], 0.0]), np.array([*xyz[0, :2], xyz[min(1, len(xyz) - 1), 2]])]
    kinds: list[Leg] = ["start", "takeoff"]
    kept = [-1, -1]
    for i, (row, leg) in enumerate(zip(xyz[1:], legs[1:], strict=True), start=1):
        if row[2] != rows[-1][2]:
            rows.append(np.array([*rows[-1][:2], row[2]]))
            kinds.append("transit")
            kept.append(-1)
        rows.append(row)
        kinds.append(leg)
        kept.append(i)
    rows.append(np.array([*xyz[-1, :2], 0.0]))
    kinds.append("landing")
    return np.array(rows), kinds, np.array([*kept, -1])
