"""Shortest paths around obstacles."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, MultiPolygon, Point, affinity, box
from shapely.ops import unary_union

from quarterdeck.geo.errors import InputError
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


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_many_corners_give_the_same_ways_as_few(seed):
    """Looking from triangle to triangle instead of at every pair changes no length; walls may be in line, and touch."""
    rng = np.random.default_rng(seed)
    corner, size = rng.integers(1, 17, (9, 2)), rng.integers(1, 4, (9, 2))
    free = box(0, 0, 20, 20).difference(unary_union([box(*a, *b) for a, b in zip(corner, corner + size, strict=True)]))
    free = affinity.rotate(free, float(rng.choice([0.0, 17.0])))
    points = np.array([p for p in rng.uniform(0, 20, (30, 2)) if free.covers(Point(p))])[:4]
    few = roadmap(as_multipolygon(free))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("quarterdeck.geo.transit.MANY", 0)
        many = roadmap(as_multipolygon(free))
    one, other = (shortest_paths(road, points, points)[0] for road in (few, many))
    np.testing.assert_allclose(one, other, rtol=1e-9)


def test_too_many_views_are_refused(monkeypatch):
    """Corners that see each other in more pairs than can be held: one line with what helps."""
    monkeypatch.setattr("quarterdeck.geo.transit.MANY", 0)
    monkeypatch.setattr("quarterdeck.geo.transit.MOST_LINKS", 1)
    with pytest.raises(InputError, match="4 corners, between which too many ways are straight"):
        roadmap(as_multipolygon(box(-10, -10, 10, 10).difference(box(-2, -2, 2, 2))))


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
