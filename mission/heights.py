"""Heights from a plan alone: above ground, above mean sea level, how fast they change, and which a vehicle may not pass."""

from collections.abc import Sequence

import numpy as np

from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.mission import Mission, Route

SLACK = 0.05  # m, and as a part of a rate: positions and speeds in a PLAN are rounded


def levels(route: Route) -> np.ndarray:
    """Return (n,) metres of a route's waypoints above one level: the sea where the ground is known, else the ground."""
    return np.array([w.z + (w.ground or 0.0) for w in route.waypoints], dtype=float)


def knows_ground(mission: Mission) -> bool:
    """Return whether the ground is known under every waypoint of all that flies, and something does."""
    routes = [r for r in mission.routes if mission.vehicle(r.vehicle).domain == "aerial"]
    return bool(routes) and all(w.ground is not None for r in routes for w in r.waypoints)


def too_high(mission: Mission) -> tuple[str, ...]:
    """Return, a line each, which vehicles' waypoints pass a ceiling, above ground or above mean sea level."""
    found = []
    for route in mission.routes:
        vehicle = mission.vehicle(route.vehicle)
        if vehicle.domain == "aerial" and route.waypoints:
            found += above_ceilings(vehicle, route.xyz[:, 2], levels(route) if knows_ground(mission) else ())
    return tuple(found)


def above_ceilings(vehicle: Vehicle, above_ground: np.ndarray, above_sea: Sequence[float] | np.ndarray) -> list[str]:
    """Return which ceilings of a vehicle the heights (n,) pass, a line each."""
    found = []
    if len(above_ground) and (high := float(above_ground.max())) > vehicle.ceiling + SLACK:
        found.append(
            f"{vehicle.id}: reaches {high:.1f} m above ground and its ceiling is {vehicle.ceiling:g} m; "
            "fly lower, or give it the ceiling that it is allowed"
        )
    if len(above_sea) and (high := float(np.max(above_sea))) > vehicle.ceiling_amsl + SLACK:
        found.append(
            f"{vehicle.id}: reaches {high:.1f} m above mean sea level and its ceiling is {vehicle.ceiling_amsl:g} m"
        )
    return found


def too_steep(mission: Mission) -> tuple[str, ...]:
    """Return, a line each, which vehicles climb or descend faster than they can."""
    found = []
    for route in mission.routes:
        vehicle = mission.vehicle(route.vehicle)
        if vehicle.domain != "aerial" or len(route.waypoints) < 2:
            continue
        speed = np.array([w.speed for w in route.waypoints[1:]])
        length = np.linalg.norm(np.diff(route.xyz, axis=0), axis=1)
        rate = np.diff(levels(route)) * speed / np.where(length > 0, length, np.inf)
        for what, rates, most in (("climbs", rate, vehicle.model.climb_rate), ("descends", -rate, vehicle.model.sink_rate)):
            worst = int(rates.argmax())
            if rates[worst] > most * (1 + SLACK):
                found.append(f"{vehicle.id}: {what} at {rates[worst]:.1f} m/s on leg {worst + 1}; it can {most:g} m/s")
    return tuple(found)
