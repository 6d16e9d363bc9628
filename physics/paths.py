"""What every vehicle has been told to do, as arrays that guidance runs over: waypoints in one table, a track for each
vehicle.
"""

from collections.abc import Sequence

import numpy as np

from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.mission import Mission, Waypoint

LEGS = ("start", "transit", "survey", "turn", "takeoff", "landing")  # a leg's code is its place here
SAIL, HOLD, IDLE, ROTATE = range(4)  # modes of a track

WAYPOINT = np.dtype(
    [(n, float) for n in ("x", "y", "z", "speed", "hold", "depart")] + [("kind", np.int8), ("number", np.int32)]
)

# `first` is the row of the place where the vehicle was when told, `last` of its last waypoint, `leg` of the one made for;
# `slow` is the speed that separation allows, `want` how far to starboard of the path it wants the vehicle, `aside` how far
# it is there; `bias` is the angle, radians, that the potential field adds to a rover's course.
TRACK = np.dtype(
    [(n, np.int64) for n in ("first", "last", "leg")]
    + [("mode", np.int8)]
    + [
        (n, float)
        for n in ("until", "integral", "driftx", "drifty", "reach", "pace", "slow", "want", "aside", "bias", "cross")
    ]
    + [("turning", np.bool_)]
)

LIMITS = np.dtype(
    [(n, float) for n in ("length", "speed", "max_speed", "radius", "rate", "accel", "climb", "sink", "zone")]
)


def vehicle_limits(vehicles: Sequence[Vehicle]) -> np.ndarray:
    """Return the (k,) LIMITS that guidance keeps; `zone` is how far from a corner a leg still counts as turn, metres."""
    rows = [
        (
            v.model.length,
            v.speed,
            v.model.max_speed,
            v.turn_radius,
            v.model.turn_rate,
            v.model.acceleration,
            v.model.climb_rate,
            v.model.sink_rate,
            max(3 * v.turn_radius, 2 * v.speed),
        )
        for v in vehicles
    ]
    return np.array(rows, LIMITS)


def empty_tracks(count: int) -> np.ndarray:
    """Return (count,) tracks of vehicles that have been told nothing yet."""
    tracks = np.zeros(count, TRACK)
    tracks["mode"], tracks["slow"] = IDLE, np.inf
    return tracks


def command_track(
    tracks: np.ndarray, table: np.ndarray, index: int, position: np.ndarray, waypoints: Sequence[Waypoint], cruise: float
) -> np.ndarray:
    """Tell vehicle `index`, now at `position` (3,), to follow `waypoints`; return the table with its new rows.

    None means stop here and stay. A waypoint without a speed is approached at `cruise` m/s.
    """
    rows = np.zeros(len(waypoints) + 1, WAYPOINT)
    rows[0] = (*position, cruise, 0.0, 0.0, 0, 0)
    for number, w in enumerate(waypoints, start=1):
        rows[number] = (w.x, w.y, w.z, w.speed or cruise, w.hold, w.time, LEGS.index(w.leg), number)
    track = tracks[index]
    track["first"], track["last"] = len(table), len(table) + len(waypoints)
    track["leg"] = track["first"] + (1 if waypoints else 0)
    track["mode"], track["until"] = (HOLD, waypoints[0].time) if waypoints else (IDLE, 0.0)
    if waypoints:  # waits where it is until it may depart
        track["leg"] -= 1
    track["integral"] = track["reach"] = track["pace"] = track["aside"] = track["want"] = 0.0
    return np.concatenate([table, rows])


def starts(mission: Mission) -> tuple[np.ndarray, np.ndarray]:
    """Return where the vehicles stand (k, 3) and head (k,): at their routes' first waypoint, towards the second."""
    routes = {route.vehicle: route.waypoints for route in mission.routes}
    position, heading = np.zeros((len(mission.vehicles), 3)), np.zeros(len(mission.vehicles))
    for i, vehicle in enumerate(mission.vehicles):
        waypoints = routes.get(vehicle.id, ())
        position[i, :2] = vehicle.start
        if waypoints:
            position[i] = waypoints[0].x, waypoints[0].y, waypoints[0].z if vehicle.domain == "aerial" else 0.0
        onward = next((w for w in waypoints if np.hypot(w.x - position[i, 0], w.y - position[i, 1]) > 0.01), None)
        if onward is not None:
            heading[i] = np.arctan2(onward.y - position[i, 1], onward.x - position[i, 0])
    return position, heading
