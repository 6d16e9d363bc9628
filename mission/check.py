"""Whether a plan may leave: everything that is wrong with it, found from the plan alone, whoever made it."""

import math
from collections.abc import Callable
from dataclasses import fields
from itertools import combinations

import numpy as np
import shapely
from shapely import LineString, Point
from shapely.geometry.base import BaseGeometry
from shapely.ops import unary_union

from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.heights import too_high, too_steep
from quarterdeck.mission.mission import Mission, Route, Waypoint
from quarterdeck.mission.timing import shortfalls

HIGHEST = 10_000.0  # m above ground: no height that somebody means
TOLERANCE = 0.05  # m: positions in a PLAN are rounded, curves are polygons
Way = tuple[np.ndarray, np.ndarray]  # (n,) seconds and (n, 3) metres


def check_mission(mission: Mission, *, prove: bool = True) -> tuple[str, ...]:
    """Return every problem found, a line each: none means that the plan can be driven as it is.

    Checked are: numbers and order of times; staying in the operating area; clear of obstacles by each vehicle's clearance
    (its berth apart); survey legs in the areas; vehicles apart in time; energy and endurance with the reserve; ceilings and
    rates of climb; jumps; what the planner itself found; and, to `prove` it, a guards plan's coverage, by another way than
    it was planned.
    """
    broken = unsound(mission)
    if broken:
        return broken
    problems = [
        *map(str, mission.reasons),
        *trespasses(mission),
        *_strange(mission),
        *_too_near(mission),
        *_astray(mission),
        *_meetings(mission),
    ]
    for route in mission.routes:
        problems += map(str, shortfalls(mission.vehicle(route.vehicle), route))
    problems += [*too_high(mission), *too_steep(mission)]
    if mission.method == "guards" and prove:
        from quarterdeck.mission.guard_check import unproved  # numba and more, which exports need not wait for

        problems += unproved(mission)
    return tuple(dict.fromkeys(problems))


def unsound(mission: Mission) -> tuple[str, ...]:
    """Return what no later step could make sense of: no such vehicle, numbers that are not finite, times that run back."""
    problems = []
    known = {v.id for v in mission.vehicles}
    numbers = [f.name for f in fields(Waypoint) if f.name not in ("leg", "task", "ground")]
    for route in mission.routes:
        if route.vehicle not in known:
            problems.append(f"route of {route.vehicle!r}: there is no such vehicle")
            continue
        if not route.waypoints:
            problems.append(f"{route.vehicle}: its route has no waypoint")
            continue
        table = np.array([[getattr(w, name) for name in numbers] for w in route.waypoints], dtype=float)
        bad = np.argwhere(~np.isfinite(table))
        if len(bad):
            row, column = bad[0]
            problems.append(f"{route.vehicle}: waypoint {row}: {numbers[column]} is {table[row, column]}, not a number")
            continue
        if not np.isfinite([w.ground for w in route.waypoints if w.ground is not None]).all():
            problems.append(f"{route.vehicle}: the ground beneath a waypoint is not a number")
            continue
        times, holds = table[:, numbers.index("time")], table[:, numbers.index("hold")]
        back = np.flatnonzero(np.diff(times) < holds[:-1] - 0.01)
        if len(back):
            problems.append(f"{route.vehicle}: waypoint {back[0] + 1} is reached before waypoint {back[0]} is left")
        fast = np.flatnonzero(table[:, numbers.index("speed")] > mission.vehicle(route.vehicle).model.max_speed * 1.01)
        if len(fast):
            top = mission.vehicle(route.vehicle).model.max_speed
            problems.append(
                f"{route.vehicle}: waypoint {fast[0]}: {route.waypoints[fast[0]].speed:.2f} m/s exceeds {top:g} m/s"
            )
    return tuple(problems)


def trespasses(mission: Mission) -> tuple[str, ...]:
    """Return where routes leave the operating area or cross what blocks their vehicle, a line for each route and place."""
    problems = []
    allowed = mission.site.operating.buffer(TOLERANCE)
    shapely.prepare(allowed)
    for route in mission.routes:
        vehicle, legs = mission.vehicle(route.vehicle), _legs(route)
        out = np.flatnonzero(~shapely.covers(allowed, legs))
        if len(out):
            far = max(out, key=lambda i: _excess(legs[i], mission.site.operating))
            gone = _excess(legs[far], mission.site.operating)
            where = _place(mission, shapely.get_point(legs[far], 1))
            problems.append(f"{route.vehicle}: leaves the operating area on leg {far + 1} by {gone:.1f} m, {where}")
        for obstacle in mission.site.obstacles:
            if vehicle.domain not in obstacle.blocks:
                continue
            core = obstacle.polygon.buffer(-TOLERANCE)
            shapely.prepare(core)
            hit = np.flatnonzero(shapely.intersects(core, legs))
            if len(hit):
                where = _place(mission, legs[hit[0]].intersection(obstacle.polygon).centroid)
                problems.append(f"{route.vehicle}: leg {hit[0] + 1} crosses no-go zone {obstacle.id!r}, {where}")
    return tuple(problems)


def _excess(leg: LineString, area: BaseGeometry) -> float:
    outside = leg.difference(area)
    points = shapely.points(shapely.get_coordinates(outside))
    return float(shapely.distance(points, area).max()) if len(points) else 0.0


def _strange(mission: Mission) -> list[str]:
    """Routes that nobody means: jumps, heights that are none, surveys at the ground by what flies."""
    problems = []
    for route in mission.routes:
        vehicle, heights = mission.vehicle(route.vehicle), route.xyz[:, 2]
        gap = np.hypot(*np.diff(route.xyz[:, :2], axis=0).T)
        took = np.diff([w.time for w in route.waypoints]) - [w.hold for w in route.waypoints[:-1]]
        jumps = np.flatnonzero(gap > vehicle.model.max_speed * 1.02 * (took + 0.01) + TOLERANCE)
        problems += [
            f"{route.vehicle}: leg {leg + 1} jumps {gap[leg]:,.1f} m in {took[leg]:.1f} s, faster than it can move"
            for leg in jumps[:1].tolist()
        ]
        flies = vehicle.domain == "aerial"
        odd = np.flatnonzero((heights < -TOLERANCE) | (heights > HIGHEST) if flies else np.abs(heights) > TOLERANCE)
        sane = f"which must be from 0 to {HIGHEST:,.0f}" if flies else "and it does not fly"
        problems += [f"{route.vehicle}: waypoint {i} is {heights[i]:,.1f} m above ground, {sane}" for i in odd[:1].tolist()]
        low = np.flatnonzero(route.survey & (heights <= 0) & flies)
        problems += [f"{route.vehicle}: waypoint {i} surveys at the ground; give it an altitude" for i in low[:1].tolist()]
    return problems


def _too_near(mission: Mission) -> list[str]:
    """Routes nearer to an obstacle than the clearance; where a vehicle is launched or recovered it may be."""
    problems = []
    for route in mission.routes:
        vehicle, legs = mission.vehicle(route.vehicle), _legs(route)
        if vehicle.clearance <= TOLERANCE:
            continue
        berths = unary_union([Point(p).buffer(vehicle.clearance + 1.0) for p in (vehicle.start, vehicle.home)])
        for obstacle in mission.site.obstacles:
            if vehicle.domain not in obstacle.blocks:
                continue
            shapely.prepare(obstacle.polygon)
            near = np.flatnonzero(
                shapely.dwithin(obstacle.polygon, legs, vehicle.clearance - TOLERANCE)
                & ~shapely.intersects(obstacle.polygon.buffer(-TOLERANCE), legs)  # those are told as trespasses
            )
            gaps = [(legs[i].difference(berths).distance(obstacle.polygon), i) for i in near]
            least, leg = min((g for g in gaps if not math.isnan(g[0])), default=(math.inf, 0))
            if least < vehicle.clearance - TOLERANCE:
                problems.append(
                    f"{route.vehicle}: leg {leg + 1} passes {obstacle.id!r} at {least:.2f} m; "
                    f"its clearance is {vehicle.clearance:g} m"
                )
    return problems


def _astray(mission: Mission) -> list[str]:
    """Routes that survey outside the areas."""
    if mission.method == "guards":  # what counts is what is seen from the stops, not what is driven over
        return []
    if not mission.site.areas:
        return []
    area = mission.site.area.buffer(TOLERANCE)
    shapely.prepare(area)
    problems = []
    for route in mission.routes:
        legs = _legs(route)
        out = np.flatnonzero(route.survey[1:] & ~shapely.covers(area, legs))
        if len(out):
            length = float(shapely.length(shapely.difference(legs[out], area)).sum())
            if length > 10 * TOLERANCE:
                problems.append(f"{route.vehicle}: surveys {length:.1f} m outside the areas, first on leg {out[0] + 1}")
    return problems


def _meetings(mission: Mission) -> list[str]:
    """Pairs of vehicles that would touch, both under way, by the plan's times."""
    problems = []
    ways = [(mission.vehicle(route.vehicle), way_of(route)) for route in mission.routes]
    for (one, a), (two, b) in combinations(ways, 2):
        if found := met(one, a, two, b):
            gap, when, room = found
            problems.append(f"{one.id} and {two.id}: {gap:.1f} m apart at {when:.0f} s; they need {room:.1f} m")
    return problems


def met(one: Vehicle, a: Way, two: Vehicle, b: Way) -> tuple[float, float, float] | None:
    """Return metres, seconds and the metres needed where two vehicles come too near on their ways; None: they do not."""
    room = (one.model.length + two.model.length) / 2
    if (a[1].min(axis=0) > b[1].max(axis=0) + room).any() or (b[1].min(axis=0) > a[1].max(axis=0) + room).any():
        return None
    gap, when = closest(a, b, _away(one), _away(two))
    return (gap, when, room) if gap < room else None


def way_of(route: Route) -> Way:
    """Return (2n,) times and (2n, 3) places: when it arrives at each waypoint and when it leaves."""
    arrive = np.array([w.time for w in route.waypoints])
    leave = arrive + np.array([w.hold for w in route.waypoints])
    return np.column_stack([arrive, leave]).ravel(), np.repeat(route.xyz, 2, axis=0)


def _away(vehicle: Vehicle) -> Callable[[np.ndarray], np.ndarray]:
    """Whether (n, 3) places are clear of where the vehicle is launched and recovered."""
    room = vehicle.clearance + vehicle.model.length

    def away(places: np.ndarray) -> np.ndarray:
        clear = [np.hypot(places[:, 0] - x, places[:, 1] - y) > room for x, y in (vehicle.start, vehicle.home)]
        return clear[0] & clear[1]

    return away


def always(places: np.ndarray) -> np.ndarray:
    """Whether (n, 3) places count: all do."""
    return np.ones(len(places), dtype=bool)


def closest(
    a: Way,
    b: Way,
    away_a: Callable[[np.ndarray], np.ndarray],
    away_b: Callable[[np.ndarray], np.ndarray],
) -> tuple[float, float]:
    """Return the least distance and its time, away from berths.

    Between two common breakpoints the relative motion is straight, so each pair of legs is closest at one place, exactly;
    where that place is at a berth, the rest of the pair is not looked at.
    """
    times = np.unique(np.concatenate([a[0], b[0]]))
    times = times[(times >= max(a[0][0], b[0][0])) & (times <= min(a[0][-1], b[0][-1]))]
    if len(times) < 2:
        return math.inf, 0.0
    here, there = (np.column_stack([np.interp(times, t, p[:, k]) for k in range(3)]) for t, p in (a, b))
    apart = here - there
    step = np.diff(apart, axis=0)
    squared = (step**2).sum(axis=1)
    part = np.clip(-(apart[:-1] * step).sum(axis=1) / np.where(squared > 0, squared, 1.0), 0.0, 1.0)
    gaps = np.linalg.norm(apart[:-1] + part[:, None] * step, axis=1)
    at = times[:-1] + part * np.diff(times)
    places = [np.column_stack([np.interp(at, t, p[:, k]) for k in range(3)]) for t, p in (a, b)]
    gaps = np.where(away_a(places[0]) & away_b(places[1]), gaps, math.inf)
    least = int(gaps.argmin())
    return float(gaps[least]), float(at[least])


def homeward(mission: Mission) -> tuple[str, ...]:
    """Return, a line each, where the straight line home would cross a no-go zone or leave the operating area.

    Autopilots return straight when a link or a battery fails, whatever the mission's way was.
    """
    notes = []
    for route in mission.routes:
        vehicle = mission.vehicle(route.vehicle)
        free = mission.site.navigable(vehicle.domain).buffer(TOLERANCE)
        shapely.prepare(free)
        xy = route.xyz[:, :2]
        lines = shapely.linestrings(np.stack([xy, np.broadcast_to(xy[0], xy.shape)], axis=1))
        blocked = int((~shapely.covers(free, lines)).sum())
        if blocked:
            notes.append(
                f"{route.vehicle}: the straight way home from {blocked} of its {len(xy)} waypoints crosses a no-go zone or "
                "the fence; let a failsafe retrace the way (SmartRTL) or hold, not return"
            )
    return tuple(notes)


def _legs(route: Route) -> np.ndarray:
    """(n - 1,) lines in metres; a route of one waypoint has none."""
    xy = route.xyz[:, :2]
    return shapely.linestrings(np.stack([xy[:-1], xy[1:]], axis=1)) if len(xy) > 1 else np.empty(0, dtype=object)


def _place(mission: Mission, point: Point) -> str:
    lon, lat = mission.frame.to_degrees(np.array([[point.x, point.y]]))[0]
    return f"near {lat:.6f}, {lon:.6f}"
