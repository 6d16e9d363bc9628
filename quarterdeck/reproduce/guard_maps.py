"""Rooms to try guards in: one like the paper's Fig. 1, maps in metres from files, and random ones of any size."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely
from shapely import MultiPolygon

from quarterdeck.coverage.guards.pieces import paper_guards
from quarterdeck.coverage.guards.space import Space
from quarterdeck.coverage.network import Network, network
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Scenario, Site, Vehicle, as_multipolygon

# The paper prints its environment as a picture alone: this has its kind of obstacles, not its coordinates.
ROOM = shapely.Polygon(
    [(0, 0), (70, 0), (70, 18), (90, 18), (90, 60), (35, 60), (35, 50), (0, 50)],
    [
        [(10, 10), (22, 8), (18, 20)],
        [(30, 12), (42, 12), (42, 18), (36, 18), (36, 26), (30, 26)],
        [(54, 8), (62, 12), (58, 22), (50, 18)],
        [(12, 30), (20, 28), (24, 36), (16, 42), (9, 38)],
        [(44, 34), (58, 30), (60, 38), (48, 44)],
        [(70, 30), (80, 28), (82, 50), (76, 52), (74, 38)],
    ],
)


def read_map(path: Path) -> MultiPolygon:
    """Return the polygon of a map: a GeoJSON Feature or geometry in metres. Raises InputError if it is none."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        polygon = as_multipolygon(shapely.geometry.shape(document.get("geometry", document)))
    except (OSError, ValueError, AttributeError, KeyError, shapely.errors.ShapelyError) as error:
        raise InputError(f"{path}: not a map ({error}); give a GeoJSON Feature with a Polygon in metres") from None
    if polygon.is_empty or not polygon.is_valid:
        raise InputError(f"{path}: its polygon is empty or crosses itself; give a valid one")
    return polygon


def random_room(vertices: int, seed: int) -> MultiPolygon:
    """Return a square of 100 m with about so many vertices: a triangle in each cell of a jittered lattice."""
    rng = np.random.default_rng(seed)
    side = max(1, round(np.sqrt(max(vertices - 4, 3) / 3)))
    cell = 100.0 / side
    centres = (np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2) + 0.5) * cell
    angle = (
        rng.uniform(0, 2 * np.pi, (len(centres), 1)) + np.array([0.0, 2.1, 4.2]) + rng.uniform(-0.4, 0.4, (len(centres), 3))
    )
    radius = rng.uniform(0.15, 0.42, (len(centres), 3)) * cell
    corners = centres[:, None] + radius[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return as_multipolygon(shapely.box(0, 0, 100, 100).difference(shapely.union_all(shapely.polygons(corners))))


def scenario_on(polygon: MultiPolygon, robots: int, starts: str = "spread", seed: int = 0) -> Scenario:
    """Return point robots at 1 m/s, `spread` evenly on the border or `clustered` around a place on it, by the seed."""
    rng = np.random.default_rng(seed)
    border = max(polygon.geoms, key=lambda p: p.area).exterior
    first = rng.uniform(0, border.length)
    part = np.arange(robots) / robots if starts == "spread" else rng.uniform(-0.01, 0.01, robots)
    along = (first + part * border.length) % border.length
    places = shapely.get_coordinates(shapely.line_interpolate_point(border, along))
    model = replace(load_model("husky"), speed=1.0, turn_radius=0.0)
    fleet = tuple(Vehicle(f"r{i}", model, (x, y)) for i, (x, y) in enumerate(places.tolist()))
    return Scenario("map", Frame(0.0, 0.0), Site((Area("area", polygon),), polygon), fleet)


def paper_network(polygon: MultiPolygon, reach: float, starts: np.ndarray) -> Network:
    """Return the network on the paper's guards for robots that start at (k, 2) places."""
    guards = paper_guards(Space(polygon, polygon, polygon, Frame(0.0, 0.0)), reach)
    return network(polygon, guards, starts)
