"""The cut into trapezoids, of any polygon."""

import numpy as np
import pytest
import shapely

from quarterdeck.coverage.guards.pieces import trapezoids
from quarterdeck.geo.scenario import as_multipolygon
from quarterdeck.reproduce.guard_maps import random_room


@pytest.mark.parametrize("vertices", [10, 100, 1000])
def test_trapezoids_are_convex_and_tile_the_polygon(vertices: int) -> None:
    """Their areas add up to the room's, each is its own hull, and there are as many as corners, but for a few."""
    room = random_room(vertices, 3)
    pieces = shapely.polygons([shapely.linearrings(p) for p in trapezoids(room)])
    assert shapely.area(pieces).sum() == pytest.approx(room.area, rel=1e-9)
    assert shapely.area(shapely.convex_hull(pieces)) == pytest.approx(shapely.area(pieces), abs=1e-6)
    assert shapely.union_all(pieces).symmetric_difference(room).area < 1e-6
    assert len(pieces) <= 2 * len(shapely.get_coordinates(room))


def test_upright_edges_and_corners_above_each_other_are_cut_right() -> None:
    """Boxes on one lattice: a vertical from a corner ends at the next box, and none runs through one."""
    boxes = [shapely.box(x, y, x + 2, y + 2) for x in (2, 6) for y in (2, 6)]
    room = as_multipolygon(shapely.box(0, 0, 10, 10).difference(shapely.union_all(boxes)))
    pieces = np.array([shapely.Polygon(p) for p in trapezoids(room)])
    assert sorted(shapely.area(pieces).tolist()) == [4.0] * 6 + [20.0] * 3
