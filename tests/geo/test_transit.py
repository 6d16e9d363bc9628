"""Shortest paths around obstacles."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, MultiPolygon, Point, box
from shapely.ops import unary_union

from quarterdeck.geo.scenario import as_multipolygon
from quarterdeck.geo.transit import roadmap, shortest_path, shortest_paths


def test_around_a_square():
    """The way around a square block goes over two of its corners, with the length that geometry gives."""
    road = roadmap(as_multipolygon(box(-10, -10, 10, 10).difference(box(-2, -2, 2, 2))))
    path = shortest_path(road, (-5.0, 0.0), (5.0, 0.0))
    assert path is not None
    assert np.isclose(LineString(path).length, 2 * np.hypot(3, 2) + 4)


def test_not_through_touching_corners():
    """Two blocks that together reach from wall to wall leave no way."""
    free = box(0, 0, 10, 10).difference(unary_union([box(0, 5, 5, 6), box(5, 4, 10, 5)]))
    lengths, paths = shortest_paths(roadmap(as_multipolygon(free)), np.array([[1.0, 9.0]]), np.array([[9.0, 1.0]]))
    assert not np.isfinite(lengths[0, 0])
    assert paths[0][0] is None


def test_not_through_a_square_along_its_diagonal():
    """A line that passes a hole through two opposite vertices crosses no edge, and is refused all the same."""
    road = roadmap(as_multipolygon(box(-10, -10, 10, 10).difference(box(-2, -2, 2, 2))))
    path = shortest_path(road, (-5.0, -5.0), (7.0, 7.0))
    assert path is not None
    assert LineString(path).intersection(box(-2, -2, 2, 2).buffer(-1e-5)).is_empty


def test_leaves_a_berth_inside_the_clearance():
    """A start outside the navigable polygon goes to the nearest place inside first."""
    road = roadmap(MultiPolygon([box(0, 0, 10, 10)]))
    path = shortest_path(road, (-1.0, 5.0), (5.0, 5.0))
    assert path is not None
    assert np.allclose(path, [[-1, 5], [0, 5], [5, 5]], atol=1e-5)


blocks = st.lists(st.tuples(*[st.integers(1, 17)] * 2, *[st.integers(1, 4)] * 2), max_size=6)


@settings(max_examples=60, deadline=None)
@given(blocks, st.integers(0, 2**32 - 1))
def test_paths_are_inside_and_no_longer_than_any_detour(rectangles, seed):
    """A path stays inside, is at least the straight line, and obeys the triangle inequality over any third point."""
    free = as_multipolygon(
        box(0, 0, 20, 20).difference(unary_union([box(x, y, x + w, y + h) for x, y, w, h in rectangles]))
    )
    rng = np.random.default_rng(seed)
    points = np.array([p for p in rng.uniform(0, 20, (30, 2)) if free.covers(Point(p))])[:3]
    lengths, paths = shortest_paths(roadmap(free), points, points)
    for i in range(len(points)):
        for j in range(len(points)):
            path = paths[i][j]
            assert (path is None) == (not np.isfinite(lengths[i, j])) == (not np.isfinite(lengths[j, i]))
            if path is None:
                continue
            assert abs(lengths[i, j] - lengths[j, i]) < 1e-9
            assert free.buffer(1e-5).covers(LineString(path))
            assert lengths[i, j] >= np.linalg.norm(points[i] - points[j]) - 1e-9
            for k in range(len(points)):
                assert lengths[i, j] <= lengths[i, k] + lengths[k, j] + 1e-6
