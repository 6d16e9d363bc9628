"""Small missions made by hand."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from shapely import MultiPolygon, box

from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Obstacle, Site, Vehicle
from quarterdeck.mission.mission import Mission, Route, Waypoint


def lawnmower(
    model: str,
    *,
    count: int = 1,
    rows: int = 2,
    spacing: float = 20.0,
    length: float = 100.0,
    obstacles: Sequence[Obstacle] = (),
) -> Mission:
    """`count` vehicles side by side, each on `rows` parallel survey legs and back to its start."""
    kind = load_model(model)
    width = rows * spacing
    area = box(-spacing, -spacing / 2, length + spacing, count * width - spacing / 2)
    site = Site((Area("area", MultiPolygon([area])),), MultiPolygon([area.buffer(50.0)]), tuple(obstacles))
    vehicles, routes = [], []
    for i in range(count):
        vehicle = Vehicle(
            f"{model}-{i + 1}",
            kind,
            (0.0, i * width),
            speed=kind.speed,
            turn_radius=kind.turn_radius,
            clearance=kind.clearance,
            battery=kind.battery,
            altitude=kind.altitude,
        )
        places = [(0.0, i * width, 0.0, "start")]
        z = kind.altitude
        if z:
            places.append((0.0, i * width, z, "takeoff"))
        for row in range(rows):
            y, ends = i * width + row * spacing, (0.0, length) if row % 2 == 0 else (length, 0.0)
            if row:
                places.append((ends[0], y, z, "survey"))
            places.append((ends[1], y, z, "survey"))
        places.append((0.0, i * width, z, "transit"))
        if z:
            places.append((0.0, i * width, 0.0, "landing"))
        xyz = np.array([p[:3] for p in places])
        pace = np.where([p[3] in ("takeoff", "landing") for p in places], kind.climb_rate or 1.0, kind.speed)
        times = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(xyz, axis=0), axis=1) / pace[1:])]
        waypoints = tuple(
            Waypoint(*p[:3], leg=p[3], speed=kind.speed, time=float(t)) for p, t in zip(places, times, strict=True)
        )
        vehicles.append(vehicle)
        routes.append(Route(vehicle.id, waypoints, kind.power(kind.speed) * float(times[-1]) / 3600))
    return Mission("by hand", Frame(0.0, 0.0), site, tuple(vehicles), tuple(routes), "stc", spacing=spacing)


@pytest.fixture
def mow() -> Callable[..., Mission]:
    """Return the maker of missions."""
    return lawnmower


def straight(model: str, *paths: Sequence[tuple[float, float]], speeds: Sequence[float] = ()) -> Mission:
    """A vehicle for each path of (x, y) places, all transit, aerial ones already at their altitude."""
    kind = load_model(model)
    area = MultiPolygon([box(-1000.0, -1000.0, 1000.0, 1000.0)])
    vehicles, routes = [], []
    for i, path in enumerate(paths):
        speed = speeds[i] if speeds else kind.speed
        vehicle = Vehicle(
            f"v{i + 1}", kind, path[0], end=path[-1], speed=speed, turn_radius=kind.turn_radius, clearance=kind.clearance
        )
        places = [Waypoint(*path[0], kind.altitude, "start")]
        places += [Waypoint(*place, kind.altitude, "transit", speed=speed) for place in path[1:]]
        vehicles.append(vehicle)
        routes.append(Route(vehicle.id, tuple(places)))
    site = Site((Area("area", area),), area)
    return Mission("by hand", Frame(0.0, 0.0), site, tuple(vehicles), tuple(routes), "by hand")


@pytest.fixture
def sail() -> Callable[..., Mission]:
    """Return the maker of straight missions."""
    return straight
