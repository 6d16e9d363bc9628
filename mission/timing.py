"""When a vehicle is where, and what it uses: speeds, turns, climbs and holds along a path."""

import math
from collections.abc import Sequence

import numpy as np

from quarterdeck.geo.angles import wrap
from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.mission import Leg, Route, Waypoint
from quarterdeck.mission.reason import Reason

RESERVE = 0.2  # of battery and endurance, kept for wind, current and age


def timed_route(
    vehicle: Vehicle,
    points: np.ndarray,
    legs: Sequence[Leg],
    *,
    pace: Sequence[float] | np.ndarray | None = None,
    holds: Sequence[float] | None = None,
    tasks: Sequence[str | None] | None = None,
) -> Route:
    """Return the route along (n, 3) `points` in metres, its times and energy filled in.

    `legs[i]` is the kind of the leg that ends at point i, `holds[i]` the seconds waited there, `tasks[i]` what is done.
    A leg takes its length at the vehicle's speed, or its climb or descent at its rate where that is longer, plus the turn
    before it (`turn_time`).
    """
    points = np.asarray(points, dtype=float).reshape(-1, 3)
    waits = [0.0] * len(points) if holds is None else [float(h) for h in holds]
    names = [None] * len(points) if tasks is None else list(tasks)
    turns = turn_times(vehicle, points)
    time = energy = 0.0
    waypoints = []
    for i, (x, y, z) in enumerate(points.tolist()):
        speed = 0.0
        if i:
            flat = math.hypot(x - points[i - 1, 0], y - points[i - 1, 1])
            climb = z - points[i - 1, 2]
            rate = vehicle.model.climb_rate if climb > 0 else vehicle.model.sink_rate
            pace_here = 1.0 if pace is None else float(pace[i])
            seconds = max(flat / (pace_here * vehicle.speed), abs(climb) / rate if climb else 0.0)
            speed = math.hypot(flat, climb) / seconds if seconds else vehicle.speed
            energy += vehicle.model.power(pace_here * vehicle.speed if flat else 0.0) * (seconds + turns[i - 1])
            time += seconds + turns[i - 1]
        waypoints.append(Waypoint(x, y, z, legs[i], speed, waits[i], time, names[i]))
        time += waits[i]
        energy += vehicle.model.power_idle * waits[i]
    return Route(vehicle.id, tuple(waypoints), energy / 3600.0)


def commanded_route(vehicle: Vehicle, place: tuple[float, float, float], waypoints: Sequence[Waypoint]) -> Route:
    """Return commanded waypoints as a route from `place`, (x, y, z) metres, with the times and energy of `timed_route`."""
    return timed_route(
        vehicle,
        np.array([place, *((w.x, w.y, w.z) for w in waypoints)]),
        ["start", *(w.leg for w in waypoints)],
        pace=[1.0, *((w.speed or vehicle.speed) / vehicle.speed for w in waypoints)],
        holds=[0.0, *(w.hold for w in waypoints)],
        tasks=[None, *(w.task for w in waypoints)],
    )


def turn_times(vehicle: Vehicle, points: np.ndarray) -> np.ndarray:
    """Return (n,) seconds lost in the turn at each of (n, 2 or 3) points; none at the ends.

    A vehicle with a turn radius drives the arc at speed. Without one, on the ground it stops, turns on the spot and speeds
    up again; in the air it sheds the velocity of one leg for that of the next.
    """
    step = np.diff(np.asarray(points, dtype=float)[:, :2], axis=0)
    heading = np.arctan2(step[:, 1], step[:, 0])
    angle = np.zeros(len(points))
    moving = np.hypot(*step.T) > 0
    both = moving[:-1] & moving[1:]
    angle[1:-1] = np.where(both, np.abs(wrap(np.diff(heading))), 0.0)
    return turn_seconds(vehicle, angle)


def turn_seconds(vehicle: Vehicle, angle: np.ndarray) -> np.ndarray:
    """Return the seconds lost in turns by `angle` radians from 0 to pi, as in `turn_times`."""
    if vehicle.turn_radius > 0:
        return np.zeros(np.shape(angle))
    stop = vehicle.speed / vehicle.model.acceleration
    if vehicle.domain == "ground":
        return np.where(angle > 1e-3, stop + angle / vehicle.model.turn_rate, 0.0)
    return stop * np.sin(angle / 2)


def seconds_out(vehicle: Vehicle) -> float:
    """Return the seconds that a vehicle can be out at its speed, by endurance and by battery, with `RESERVE` in hand."""
    power = vehicle.model.power(vehicle.speed)
    by_battery = vehicle.battery * 3600.0 / power if power > 0 else math.inf
    return (1 - RESERVE) * min(vehicle.endurance, by_battery)


def shortfalls(vehicle: Vehicle, route: Route) -> list[Reason]:
    """Return why the vehicle cannot do the route; none if it can, with `RESERVE` in hand."""
    found = []
    battery, endurance = vehicle.battery * (1 - RESERVE), vehicle.endurance * (1 - RESERVE)
    if route.energy > battery:
        why = (
            f"needs {route.energy:.0f} Wh and has {battery:.0f} Wh "
            f"({vehicle.battery:.0f} Wh less {RESERVE:.0%} reserve), short by {route.energy - battery:.0f} Wh"
        )
        found.append(Reason(why, "energy", vehicle.id))
    if route.duration > endurance:
        why = (
            f"needs {route.duration:.0f} s and has {endurance:.0f} s "
            f"({vehicle.endurance:.0f} s less {RESERVE:.0%} reserve), short by {route.duration - endurance:.0f} s"
        )
        found.append(Reason(why, "energy", vehicle.id))
    return found
