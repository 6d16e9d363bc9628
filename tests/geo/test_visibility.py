import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from quarterdeck.geo.triangulation import triangulate
from quarterdeck.geo.visibility import visibility_polygons, visible_points, visible_vertices


def random_space(rng: np.random.Generator) -> shapely.Polygon:
    """Return a polygon with holes: a square less random triangles, its largest part."""
    shape = shapely.box(0, 0, 10, 10)
    for _ in range(int(rng.integers(1, 9))):
        shape = shape.difference(shapely.Polygon(rng.uniform(0, 10) + rng.uniform(-3, 3, (3, 2))))
    parts = shapely.get_parts(shape)
    return parts[np.argmax(shapely.area(parts))]


def inside(rng: np.random.Generator, space: shapely.Polygon, n: int) -> np.ndarray:
    """Return up to n random points well inside."""
    points = rng.uniform(0, 10, (n, 2))
    return points[shapely.contains(space.buffer(-1e-3), shapely.points(points))]


def test_sees_a_square_up_to_the_range_and_not_behind_a_pillar() -> None:
    """A hand-computed shadow: the pillar hides a trapezoid behind it."""
    space = shapely.Polygon([(0, 0), (10, 0), (10, 10), (0, 10)], [[(4, 6), (6, 6), (6, 7), (4, 7)]])
    view = visibility_polygons(triangulate(space), np.array([5.0, 5.0]), np.inf)[0]
    shadow = shapely.Polygon([(4, 6), (6, 6), (10, 10), (0, 10)])
    assert view.symmetric_difference(shapely.box(0, 0, 10, 10).difference(shadow)).area < 1e-12


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_points_are_seen_when_the_line_of_sight_is_free(seed: int) -> None:
    """A point within range is in the view if and only if the segment to it stays in the space (shapely's answer)."""
    rng = np.random.default_rng(seed)
    space = random_space(rng)
    origins, targets = inside(rng, space, 4), inside(rng, space, 60)
    mesh = triangulate(space)
    starts, seen = visible_points(mesh, origins, 6.0, targets)
    views = visibility_polygons(mesh, origins, 6.0)
    for k, origin in enumerate(origins):
        lines = shapely.linestrings(np.stack([np.broadcast_to(origin, targets.shape), targets], axis=1))
        free = shapely.covers(space, lines)
        away = np.linalg.norm(targets - origin, axis=1)
        assert np.array_equal(np.flatnonzero(free & (away <= 6.0)), seen[starts[k] : starts[k + 1]])
        clear_cut = (away <= 6.0 * np.cos(np.pi / 64)) | (away > 6.0)
        held = shapely.covers(views[k].buffer(1e-9), shapely.points(targets))
        assert np.array_equal(held[clear_cut], (free & (away <= 6.0))[clear_cut])


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_views_from_vertices_and_edges_are_the_limits_of_views_beside(seed: int) -> None:
    """From a vertex or the middle of an edge, walls and inner edges alike, no part of the view is lost or invented."""
    rng = np.random.default_rng(seed)
    mesh = triangulate(random_space(rng))
    shapes = shapely.polygons(mesh.vertices[mesh.triangles])
    for a, b, _ in mesh.vertices[mesh.triangles[:12]]:
        for at in (a, (a + b) / 2):
            view = visibility_polygons(mesh, at, 5.0)[0]
            around = shapely.distance(shapes, shapely.Point(at)) < 1e-9
            beside = at + 1e-9 * (mesh.vertices[mesh.triangles[around]].mean(axis=1) - at)
            assert view.symmetric_difference(shapely.union_all(visibility_polygons(mesh, beside, 5.0))).area < 1e-4


def test_the_outer_view_holds_the_disc_and_the_inner_is_held_by_it() -> None:
    """In the open, the inscribed and the circumscribed polygon enclose the disc between them."""
    mesh = triangulate(shapely.box(-10, -10, 10, 10))
    inner, outer = (visibility_polygons(mesh, np.zeros(2), 5.0, outer=o)[0] for o in (False, True))
    disc = np.pi * 25
    assert 0.998 * disc < inner.area < disc < outer.area < 1.001 * disc


def test_vertices_seen_are_those_with_a_free_line() -> None:
    """From a corner of a room with a pillar, hand-counted."""
    space = shapely.Polygon([(0, 0), (10, 0), (10, 10), (0, 10)], [[(4, 4), (6, 4), (6, 6), (4, 6)]])
    mesh = triangulate(space)
    starts, seen = visible_vertices(mesh, np.array([[1.0, 2.0]]))
    corners = {(0, 0), (10, 0), (0, 10), (4, 4), (6, 4), (4, 6)}
    assert {tuple(v) for v in mesh.vertices[seen[: starts[1]]]} == corners


def test_a_point_outside_sees_nothing() -> None:
    """No triangle, no view; and no error either."""
    mesh = triangulate(shapely.box(0, 0, 1, 1))
    assert visibility_polygons(mesh, np.array([[2.0, 2.0]]), 1.0)[0].is_empty
    assert visible_points(mesh, np.array([[2.0, 2.0]]), 9.0, np.array([[0.5, 0.5]]))[0].tolist() == [0, 0]


def test_a_comb_is_seen_whole() -> None:
    """A comb of 60 teeth, seen from the end of its corridor, has more edges in view than the first arrays have room for."""
    teeth = [(x, y) for i in range(60) for x, y in ((i, 0.5), (i + 0.4, 9.0), (i + 0.8, 0.5))]
    space = shapely.Polygon([(60, 0.5), (60, 0), (0, 0), *teeth])
    view = visibility_polygons(triangulate(space), np.array([59.9, 0.25]), np.inf)[0]
    assert view.is_valid
    assert view.area == pytest.approx(space.intersection(view).area)
    assert view.intersects(shapely.box(0, 0, 0.1, 0.5))
