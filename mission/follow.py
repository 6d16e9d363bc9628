"""Over terrain: what flies holds its height above the ground, by waypoints where the ground leaves the straight line.

An autopilot flies straight from waypoint to waypoint, in height too. So a leg gets as many more as keep it within a
tolerance of the height that was planned, chosen by the rule of Douglas and Peucker (1973) on the vertical distance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Vehicle
from quarterdeck.geo.terrain import Terrain
from quarterdeck.mission.heights import above_ceilings, levels
from quarterdeck.mission.mission import Mission, Route, Waypoint
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.timing import shortfalls

TOLERANCE = 5.0  # m
PINHOLE = {"focal_length", "sensor_width", "sensor_height", "image_width", "trigger_distance"}
PART = 0.25  # of the height above ground: no tolerance is larger
ACROSS = np.linspace(-1.0, 1.0, 9)  # where in a picture's width the ground is looked at


def follow(mission: Mission, terrain: Terrain, *, tolerance: float = TOLERANCE) -> Mission:
    """Return the mission with what flies held at its height above `terrain`, within `tolerance` metres between waypoints.

    Waypoints are added where needed, each is told the ground beneath it, times and energy follow from climbs and descents.
    Figures tell the heights flown and the worst that a camera sees; ceilings that are passed are reasons. Boats and
    rovers are left alone. Raises InputError where the terrain is not known beneath a route.
    """
    if not (np.isfinite(tolerance) and tolerance > 0):
        raise InputError(f"the tolerance over terrain must be metres above 0, not {tolerance:g}")
    routes, reasons, notes, seen = [], list(mission.reasons), list(mission.figures.get("notes", ())), []
    for route in mission.routes:
        vehicle = mission.vehicle(route.vehicle)
        if vehicle.domain != "aerial" or not route.waypoints:
            routes.append(route)
            continue
        line = _waypoints(mission, route, terrain, tolerance)
        made = _timed(vehicle, route, line)
        above, sea = _flown(made, terrain)
        before = shortfalls(vehicle, route)
        reasons = [r for r in reasons if r not in before]
        reasons += [*shortfalls(vehicle, made), *map(Reason, above_ceilings(vehicle, above, sea))]
        notes += _slowed(vehicle, route, made) + _homeward(vehicle, made, terrain)
        seen.append(
            _Seen(float(above.min()), float(above.max()), float(sea.max()), _pictures(mission, vehicle, made, terrain))
        )
        routes.append(made)
    if not seen:
        return mission
    figures = dict(mission.figures) | _figures(seen) | {"notes": list(dict.fromkeys(notes))}
    figures["terrain_waypoints"] = sum(len(r.waypoints) for r in routes) - sum(len(r.waypoints) for r in mission.routes)
    figures |= {"makespan": max(r.duration for r in routes)} if "makespan" in figures else {}
    figures |= {"energy": sum(r.energy for r in routes)} if "energy" in figures else {}
    if figures.get("least_side_overlap", 1.0) <= 0:
        why = "over the highest ground pictures of neighbouring lines do not meet; fly higher or closer lines"
        reasons.append(Reason(why))
    parameters = dict(mission.parameters) | {"terrain": terrain.name, "tolerance": tolerance}
    return replace(
        mission, routes=tuple(routes), reasons=tuple(dict.fromkeys(reasons)), figures=figures, parameters=parameters
    )


def _waypoints(mission: Mission, route: Route, terrain: Terrain, tolerance: float) -> list[tuple[int, Waypoint]]:
    """The waypoints over terrain, each with the number of the one of `route` at which its leg ended."""
    points = route.xyz
    ground = _ground(mission, route, points[:, :2], terrain)
    made = [(0, replace(route.waypoints[0], ground=float(ground[0])))]
    for i in range(1, len(points)):
        a, b, end = points[i - 1], points[i], route.waypoints[i]
        pieces = int(np.ceil(2.0 * np.hypot(*(b - a)[:2]) / terrain.cell))
        along = np.linspace(0.0, 1.0, max(pieces, 1) + 1)
        places = a + along[:, None] * (b - a)
        beneath = _ground(mission, route, places[:, :2], terrain)
        within = min(tolerance, max(PART * min(a[2], b[2]), 0.5))
        for k in _knots(along, beneath + places[:, 2], within)[1:-1]:
            x, y, z = places[k].tolist()
            part = replace(end, x=x, y=y, z=z, hold=0.0, task=None, ground=float(beneath[k]))
            made.append((i, part))
        made.append((i, replace(end, ground=float(ground[i]))))
    return made


def _ground(mission: Mission, route: Route, xy: np.ndarray, terrain: Terrain) -> np.ndarray:
    heights = terrain.height(xy)
    void = np.flatnonzero(np.isnan(heights))
    if len(void):
        lon, lat = mission.frame.to_degrees(xy[void[:1]])[0]
        raise InputError(
            f"{terrain.name}: not known at {lat:.6f}, {lon:.6f} on the route of {route.vehicle!r} (a void, or beyond its "
            "edge); give one that covers the operating area"
        )
    return heights


def _knots(along: np.ndarray, level: np.ndarray, tolerance: float) -> list[int]:
    """Numbers of the samples at which to bend, so that straight lines stay within `tolerance` of `level`."""
    kept, todo = {0, len(along) - 1}, [(0, len(along) - 1)]
    while todo:
        first, last = todo.pop()
        if last - first < 2:
            continue
        inner = slice(first + 1, last)
        off = np.abs(level[inner] - np.interp(along[inner], along[[first, last]], level[[first, last]]))
        worst = first + 1 + int(off.argmax())
        if off.max() > tolerance:
            kept.add(worst)
            todo += [(first, worst), (worst, last)]
    return sorted(kept)


def _timed(vehicle: Vehicle, route: Route, line: Sequence[tuple[int, Waypoint]]) -> Route:
    """The route with times: each piece as fast as its leg was, or as the climb and descent rates allow."""
    late = more = 0.0
    made = [line[0][1]]
    for leg, w in line[1:]:
        old, last = route.waypoints[leg], made[-1]
        size = float(np.linalg.norm((w.x - last.x, w.y - last.y, w.z - last.z)))
        rise = w.z - last.z + (w.ground or 0.0) - (last.ground or 0.0)
        planned = size / old.speed if old.speed > 0 else 0.0
        seconds = max(planned, rise / vehicle.model.climb_rate, -rise / vehicle.model.sink_rate)
        late += seconds - planned
        more += vehicle.model.power(min(old.speed, vehicle.speed)) * (seconds - planned)
        left = float(np.linalg.norm((old.x - w.x, old.y - w.y, old.z - w.z)))  # of the leg, whose turn came before it
        time = old.time - (left / old.speed if left > 0 else 0.0) + late
        made.append(replace(w, time=time, speed=size / seconds if seconds > 0 else old.speed))
    return Route(route.vehicle, tuple(made), route.energy + more / 3600.0)


def _slowed(vehicle: Vehicle, before: Route, after: Route) -> list[str]:
    late = after.duration - before.duration
    if late < 0.5:
        return []
    flat = np.hypot(*np.diff(after.xyz[:, :2], axis=0).T) > 0.01
    slowest = min(w.speed for w in np.array(after.waypoints[1:], dtype=object)[flat])
    rates = f"climbs {vehicle.model.climb_rate:g} and descends {vehicle.model.sink_rate:g} m/s"
    return [f"{vehicle.id}: slows down to {slowest:.1f} m/s where the ground is steep, {late:.0f} s in all; it {rates}"]


def _homeward(vehicle: Vehicle, route: Route, terrain: Terrain) -> list[str]:
    """What height a straight return needs, where the ground on the way is above home: autopilots know nothing of it."""
    here = np.unique(route.xyz[:, :2], axis=0)
    count = 1 + max(1, int(np.ceil(np.hypot(*(here - vehicle.start).T).max() / terrain.cell)))
    ways = here[:, None] + np.linspace(0.0, 1.0, min(count, 2000))[:, None] * (np.array(vehicle.start) - here)[:, None]
    top = float(np.nanmax(terrain.height(ways))) - (route.waypoints[0].ground or 0.0)
    if top <= 1.0:
        return []
    least = top + max(vehicle.clearance, 10.0)
    way = f"{vehicle.id}: the ground on the straight way home is up to {top:.0f} m above home"
    return [f"{way}; set the height of a return (RTL_ALT, RTL_RETURN_ALT) to {least:.0f} m or more"]


def _flown(route: Route, terrain: Terrain) -> tuple[np.ndarray, np.ndarray]:
    """Heights above ground and above mean sea level along a route, between take-off and landing."""
    xyz, level = route.xyz, levels(route)
    above, sea = [], []
    for i in range(1, len(xyz)):
        if route.waypoints[i].leg in ("takeoff", "landing"):
            continue
        part = np.linspace(0.0, 1.0, 1 + max(1, int(np.ceil(2 * np.hypot(*(xyz[i] - xyz[i - 1])[:2]) / terrain.cell))))
        here = level[i - 1] + part * (level[i] - level[i - 1])
        above.append(here - terrain.height(xyz[i - 1, :2] + part[:, None] * (xyz[i] - xyz[i - 1])[:2]))
        sea.append(here)
    return (np.concatenate(above), np.concatenate(sea)) if above else (xyz[:, 2], level)


@dataclass(frozen=True, slots=True)
class _Seen:
    """What one vehicle's flight comes to: metres above ground, above mean sea level, and its camera's worst."""

    lowest: float
    highest: float
    highest_amsl: float
    pictures: tuple[float, float, float] | None


def _pictures(mission: Mission, vehicle: Vehicle, route: Route, terrain: Terrain) -> tuple[float, float, float] | None:
    """Worst ground resolution (metres a pixel), least side and frontal overlap of a camera on its survey legs.

    Resolution is worst at the lowest ground in a picture, overlap least at the highest (Wolf, Dewitt and Wilkinson,
    Elements of Photogrammetry, ch. 6 and 18), taken across the track at every half cell of the terrain.
    """
    sensor = vehicle.sensor
    if sensor is None or mission.spacing is None or not sensor.parameters.keys() >= PINHOLE:
        return None
    camera, xyz, level = sensor.parameters, route.xyz, levels(route)
    deep, near = [], []
    for i in np.flatnonzero(route.survey):
        a, b = xyz[i - 1, :2], xyz[i, :2]
        length = float(np.hypot(*(b - a)))
        if length == 0:
            continue
        part = np.linspace(0.0, 1.0, 1 + max(1, int(np.ceil(2 * length / terrain.cell))))
        half = camera["sensor_width"] / camera["focal_length"] * xyz[i, 2] / 2
        abeam = half * np.array([a[1] - b[1], b[0] - a[0]]) / length
        places = (a + part[:, None] * (b - a))[:, None] + ACROSS[:, None] * abeam
        ground = terrain.height(places)
        here = level[i - 1] + part * (level[i] - level[i - 1])
        with np.errstate(invalid="ignore"):
            deep.append(np.nanmax(here[:, None] - ground))
            near.append(np.nanmin(here[:, None] - ground))
    if not near:
        return None
    least = max(float(min(near)), 1e-3)
    pixel = camera["sensor_width"] / camera["image_width"] / camera["focal_length"]
    side = 1 - mission.spacing * camera["focal_length"] / camera["sensor_width"] / least
    front = 1 - camera["trigger_distance"] * camera["focal_length"] / camera["sensor_height"] / least
    return float(max(deep)) * pixel, side, front


def _figures(seen: Sequence[_Seen]) -> dict[str, Any]:
    figures: dict[str, Any] = {
        "lowest_above_ground": min(s.lowest for s in seen),
        "highest_above_ground": max(s.highest for s in seen),
        "highest_amsl": max(s.highest_amsl for s in seen),
    }
    pictures = [s.pictures for s in seen if s.pictures is not None]
    if pictures:
        worst, side, front = zip(*pictures, strict=True)
        figures |= {
            "worst_ground_resolution": max(worst),
            "least_side_overlap": min(side),
            "least_frontal_overlap": min(front),
        }
    return figures
