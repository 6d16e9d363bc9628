"""A digital twin that is given as a map: the map's cells become the site that simulation, pictures and checks see."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely
from shapely import MultiPolygon

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.occupancy import FREE, Occupancy, read_map
from quarterdeck.geo.scenario import Obstacle, Scenario, as_multipolygon

WALL = 2.0  # m: how high what a map shows is taken to be


def map_scenario(
    scenario: Scenario, source: str | Path, origin: tuple[float, float] | None = None
) -> tuple[Scenario, Occupancy]:
    """Return the scenario on the map in a map_server .yaml file, and the map in the scenario's frame.

    `origin` is the (lon, lat) degrees of the map's (0, 0), default what the map says, else the frame's; the map's axes
    point east and north. What the map does not show as free becomes obstacles for vehicles on the ground and at sea. Raises
    InputError if a vehicle or task lies outside the map.
    """
    twin = read_map(source)
    origin = origin or twin.place
    if origin is not None:
        x, y = scenario.frame.to_metres(np.array([origin]))[0]
        twin = twin.shifted(float(x), float(y))
    rows, columns = twin.cells.shape
    for what, name, xy in (
        *(("vehicle", v.id, v.start) for v in scenario.vehicles),
        *(("task", t.id, t.position) for t in scenario.tasks),
    ):
        row, column = twin.to_cells(np.array([xy]))[0]
        if not (0 <= row < rows and 0 <= column < columns):
            raise InputError(f"{what} {name!r}: lies outside the map {source}; give --map-origin where the map's (0, 0) is")
    outline = _polygons(
        np.ones((1, 1), bool), replace(twin, resolution=1.0), (rows * twin.resolution, columns * twin.resolution)
    )
    blocked = _polygons(twin.cells != FREE, twin, (1.0, 1.0))
    blocks = frozenset({"ground", "surface"})
    obstacles = tuple(Obstacle(f"map-{i}", part, blocks, WALL) for i, part in enumerate(blocked.geoms))
    site = replace(scenario.site, operating=outline, obstacles=(*scenario.site.obstacles, *obstacles))
    return replace(scenario, site=site), twin


def _polygons(blocked: np.ndarray, twin: Occupancy, size: tuple[float, float]) -> MultiPolygon:
    """Return the union of the cells, `size` cells high and wide, in metres; each run in a row is one box."""
    padded = np.pad(blocked, ((0, 0), (1, 1)))
    change = np.diff(padded.astype(np.int8), axis=1)
    rows, starts = np.nonzero(change == 1)
    ends = np.nonzero(change == -1)[1]
    boxes = shapely.box(starts * size[1], rows * size[0], ends * size[1], (rows + 1) * size[0])
    return as_multipolygon(shapely.transform(shapely.union_all(boxes), lambda xy: twin.to_metres(xy[:, ::-1])))
