"""The mission as MAVLink items: what each domain's vehicle needs, for ArduPilot and for PX4.

Sources: MAVLink common.xml (commands, frames); ArduPilot 4.6 `mode_auto.cpp` of Rover and Copter (which items run);
`../formats` samples. Facts that differ by autopilot are said where they are used.
"""

import math
from dataclasses import dataclass

import numpy as np

from quarterdeck.exporters.export import Autopilot, Settings
from quarterdeck.exporters.limits import board, most_items
from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.check import homeward
from quarterdeck.mission.mission import Mission, Route, Waypoint

WAYPOINT, RETURN, LAND, TAKEOFF, DELAY = 16, 20, 21, 22, 93
CHANGE_SPEED, TRIGGER_DISTANCE = 178, 206
GLOBAL, MISSION_FRAME, RELATIVE, TERRAIN = 0, 2, 3, 10
FRAMES = {"relative": RELATIVE, "terrain": TERRAIN, "amsl": GLOBAL}

CORNER = 2.0  # m: how far from a waypoint ArduPilot 4.6 turned, flown in its own simulator


@dataclass(frozen=True, slots=True)
class Item:
    """One mission item: `p` are the four free parameters, then latitude and longitude in degrees, metres of altitude."""

    command: int
    frame: int
    p: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    lat: float = 0.0
    lon: float = 0.0
    z: float = 0.0


def mission_items(mission: Mission, route: Route, settings: Settings) -> list[Item]:
    """Return the items of a route, home not among them.

    Aerial routes begin with a take-off and end with a return (where they end at home) or a landing; boats and rovers have
    neither, for Rover accepts a take-off and then skips it. The camera is triggered by distance on the survey legs only.
    """
    vehicle, autopilot = mission.vehicle(route.vehicle), settings.autopilot
    frame, heights = FRAMES[settings.altitude], item_heights(route, settings)
    places = mission.frame.to_degrees(route.xyz[:, :2])
    headings = compass(route.xyz[:, :2])
    trigger = trigger_distance(vehicle)
    accept = acceptance_radius(vehicle)
    items = _wait(route)
    flies = vehicle.domain == "aerial"
    path = _flown(route.waypoints) if flies else range(1, len(route.waypoints))
    if flies and path:
        lon, lat = places[0]
        yaw = _yaw(headings[0], autopilot)
        before = route.waypoints[path.start - 1]
        height = heights[path.start - 1 if before.leg == "takeoff" else path.start]
        items.append(Item(TAKEOFF, frame, (0.0, 0.0, 0.0, yaw), lat, lon, height))
    speed, shooting = 0.0, False
    for i in path:
        waypoint = route.waypoints[i]
        before = route.waypoints[i - 1]
        flat = math.hypot(waypoint.x - before.x, waypoint.y - before.y)
        along = waypoint.speed * flat / (math.hypot(flat, waypoint.z - before.z) or 1.0)  # over ground
        if along > 0 and abs(along - speed) > 0.005:
            speed = along
            items.append(Item(CHANGE_SPEED, MISSION_FRAME, (1.0, round(speed, 3), -1.0, 0.0)))
        if trigger is not None and (waypoint.leg == "survey") != shooting:
            shooting = not shooting
            items.append(_trigger(trigger if shooting else 0.0))
        if _repeats(route.waypoints, i):
            continue
        hold = float(math.ceil(waypoint.hold - 1e-9))  # ArduPilot keeps whole seconds
        lon, lat = places[i]
        free = (hold, accept, 0.0, _yaw(headings[i], autopilot))
        items.append(Item(WAYPOINT, frame, free, lat, lon, heights[i]))
    if shooting:
        items.append(_trigger(0.0))
    if flies and path:
        if np.hypot(*(route.xyz[-1, :2] - route.xyz[0, :2])) < 1.0:
            items.append(Item(RETURN, MISSION_FRAME))
        else:
            lon, lat = places[-1]
            items.append(Item(LAND, frame, (0.0, 0.0, 0.0, _yaw(headings[-1], autopilot)), lat, lon, heights[-1]))
    return items


def item_heights(route: Route, settings: Settings) -> list[float]:
    """Return the altitude of each waypoint's item in metres: above home, above the terrain, or above mean sea level.

    Where the plan knows the ground it is one place in all three. Else the ground is taken to be level with home.
    """
    home = home_ground(route, settings)
    datum = {"relative": home, "amsl": 0.0}
    return [
        round(w.z + (home if w.ground is None else w.ground) - datum[settings.altitude], 3)
        if settings.altitude in datum
        else round(w.z, 3)
        for w in route.waypoints
    ]


def home_ground(route: Route, settings: Settings) -> float:
    """Return metres of the ground at home above mean sea level, as the plan knows it or the user says."""
    known = route.waypoints[0].ground if route.waypoints else None
    return settings.ground if known is None else round(known, 3)


def tell_limits(mission: Mission, settings: Settings) -> None:
    """Say, once an export, what autopilots do that a plan cannot hinder: return straight, and cut corners."""
    for line in homeward(mission):
        settings.tell(line)
    for route in mission.routes:
        count = len(mission_items(mission, route, settings)) + 1
        if count > (most := most_items(mission.vehicle(route.vehicle).domain, settings)):
            settings.tell(
                f"{route.vehicle}: its mission has {count} items and {board(settings)} holds {most}: "
                "widen the spacing, or use more vehicles or sorties"
            )
    for vehicle in mission.vehicles:
        if vehicle.clearance <= CORNER:
            settings.tell(
                f"{vehicle.id}: autopilots cut corners by about {CORNER:g} m and its clearance is {vehicle.clearance:g} m; "
                f"lower the autopilot's waypoint radius to {acceptance_radius(vehicle):g} m"
            )


def _wait(route: Route) -> list[Item]:
    """The wait before it leaves, where launches are staggered."""
    seconds = float(math.ceil(route.waypoints[0].hold)) if route.waypoints else 0.0
    return [Item(DELAY, MISSION_FRAME, (seconds, -1.0, -1.0, -1.0))] if seconds else []


def _flown(waypoints: tuple[Waypoint, ...]) -> range:
    """The waypoints between take-off and landing: the climb's end is the take-off item's, the ground is the landing's."""
    first, last = 1, len(waypoints)
    while first < last and waypoints[first].leg == "takeoff":
        first += 1
    while last > first and waypoints[last - 1].leg == "landing" and waypoints[last - 1].z <= 0.0:
        last -= 1
    return range(first, last)


def _repeats(waypoints: tuple[Waypoint, ...], i: int) -> bool:
    a, b = waypoints[i - 1], waypoints[i]
    same = abs(a.x - b.x) < 0.01 and abs(a.y - b.y) < 0.01 and abs(a.z - b.z) < 0.01
    return same and b.hold == 0 and b.task is None and i < len(waypoints) - 1


def _trigger(distance: float) -> Item:
    # The third parameter takes one picture at once: without it the first comes a whole distance into the leg.
    return Item(TRIGGER_DISTANCE, MISSION_FRAME, (round(distance, 3), 0.0, 1.0 if distance else 0.0, 0.0))


def _yaw(heading: float, autopilot: Autopilot) -> float:
    # PX4 turns to the yaw it is given, and 0 would be north; ArduPilot ignores it.
    return round(float(heading), 2) if autopilot == "px4" else 0.0


def compass(xy: np.ndarray) -> np.ndarray:
    """Return (n,) compass degrees in [0, 360) of the leg that ends at each of (n, 2) places; the first takes the next's."""
    steps = np.diff(np.asarray(xy, dtype=float), axis=0)
    degrees = np.degrees(np.arctan2(steps[:, 0], steps[:, 1])) % 360.0
    moved = np.hypot(steps[:, 0], steps[:, 1]) > 1e-6
    if not moved.any():
        return np.zeros(len(xy))
    # Where it stands still it keeps the heading of the last leg that moved (the first one's before that).
    last = np.maximum.accumulate(np.where(moved, np.arange(len(steps)), np.argmax(moved)))
    degrees = degrees[last]
    return np.concatenate([degrees[:1], degrees])


def acceptance_radius(vehicle: Vehicle) -> float:
    """Return metres within which a waypoint counts as reached.

    Autopilots cut the corner by about as much, so it is below the clearance where that leaves half a metre.
    """
    radius = max(0.5, min(2.0, 0.8 * vehicle.clearance)) if vehicle.clearance > 0 else 1.0
    return round(radius, 2)


def trigger_distance(vehicle: Vehicle) -> float | None:
    """Return metres between pictures for a vehicle with a camera whose trigger distance is known, else None."""
    sensor = vehicle.sensor
    if sensor is None or sensor.kind != "camera":
        return None
    return sensor.parameters.get("trigger_distance")
