import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from quarterdeck.geo.triangulation import Triangulation, TriangulationError, triangulate, triangulate_segments

RING = shapely.Polygon([(0, 0), (10, 0), (10, 10), (0, 10)], [[(2, 2), (4, 2), (4, 4), (2, 4)], [(4, 4), (7, 5), (6, 8)]])


@pytest.mark.parametrize("backend", ["triangle", "pythoncdt"])
def test_covers_exactly_and_keeps_every_point(backend: str) -> None:
    """Holes that touch at a vertex, points inside, on an edge and on a vertex: the area is exact and all are vertices."""
    points = np.array([[1.0, 1.0], [5.0, 0.0], [4.0, 4.0], [9.0, 9.0], [1.0, 1.0]])
    mesh = triangulate(RING, points, backend=backend)  # type: ignore[arg-type]
    assert mesh.area == pytest.approx(RING.area, rel=1e-12)
    assert np.allclose(mesh.vertices[mesh.points], points, atol=1e-9)
    assert mesh.points[0] == mesh.points[4]


def test_both_backends_give_the_same_triangles() -> None:
    """Where no four vertices lie on a circle, a constrained Delaunay triangulation is unique."""
    rng = np.random.default_rng(1)
    points = rng.uniform(0, 10, (200, 2))
    points = points[shapely.contains_xy(RING, points[:, 0], points[:, 1])]
    one, other = triangulate(RING, points), triangulate(RING, points, backend="pythoncdt")
    assert np.array_equal(one.triangles, other.triangles)
    assert np.array_equal(one.neighbours, other.neighbours)


def test_agrees_with_the_triangulation_of_shapely() -> None:
    """Without points GEOS makes the same triangles."""
    shape = shapely.Polygon([(0, 0), (9.1, 0.3), (10, 10.7), (5.2, 3.3), (0.4, 8.9)], [[(2, 2), (4, 2.2), (3.1, 3.4)]])
    mesh = triangulate(shape)
    ours = {frozenset(map(tuple, np.round(mesh.vertices[t], 6))) for t in mesh.triangles}
    theirs = shapely.get_parts(shapely.constrained_delaunay_triangles(shape))
    assert ours == {frozenset(map(tuple, np.round(shapely.get_coordinates(t)[:3], 6))) for t in theirs}


def test_neighbours_mirror_each_other_and_stop_at_walls() -> None:
    """The triangle across an edge has that edge too, and edges of the polygon have nothing across."""
    mesh = triangulate(RING, np.array([[1.0, 5.0], [8.0, 3.0]]))
    for t, around in enumerate(mesh.neighbours):
        for corner, other in enumerate(around):
            edge = set(np.delete(mesh.triangles[t], corner))
            if other >= 0:
                assert t in mesh.neighbours[other]
                assert edge <= set(mesh.triangles[other])
            else:
                line = shapely.LineString(mesh.vertices[list(edge)])
                assert RING.boundary.buffer(1e-9).contains(line)


@pytest.mark.parametrize(
    ("shape", "points", "text"),
    [
        (RING, [[3.0, 3.0]], "point \\(3, 3\\) is outside"),
        (RING, [[np.nan, 3.0]], "finite"),
        (shapely.Polygon(), None, "empty"),
        (shapely.Polygon([(0, 0), (1, 1), (1, 0), (0, 1)]), None, "invalid"),
    ],
)
def test_refuses_what_cannot_be(shape: shapely.Polygon, points: list[list[float]] | None, text: str) -> None:
    """A point in a hole, a NaN, an empty and a crossed polygon are told in a line."""
    with pytest.raises(TriangulationError, match=text):
        triangulate(shape, None if points is None else np.array(points))


def test_a_soup_with_nothing_enclosed_has_no_triangles() -> None:
    """Duplicates, zero length and a cross: what ends the process when Triangle gets it bare."""
    soup = np.array([[[0, 0], [1, 1]], [[1, 1], [0, 0]], [[0, 1], [1, 0]], [[0, 0], [0, 0]], [[0, 0], [1, 1]]], dtype=float)
    assert len(triangulate_segments(soup).triangles) == 0
    assert len(triangulate_segments(np.empty((0, 2, 2))).triangles) == 0


def _sound(mesh: Triangulation, soup: np.ndarray) -> None:
    noded = shapely.union_all(shapely.linestrings(soup))
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))
    assert mesh.area == pytest.approx(float(shapely.area(faces).sum()), rel=1e-9, abs=1e-9)


@settings(deadline=None, max_examples=150)
@given(hnp.arrays(np.int64, st.tuples(st.integers(1, 25), st.just(2), st.just(2)), elements=st.integers(0, 6)))
def test_any_grid_soup_is_triangulated_whole(soup: np.ndarray) -> None:
    """Segments on a coarse grid repeat, overlap and cross: the area is that of the faces that shapely finds."""
    _sound(triangulate_segments(soup.astype(float)), soup.astype(float))


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.floats(-8.0, 8.0))
def test_any_crossing_soup_is_triangulated_whole(seed: int, scale: float) -> None:
    """Random crossing segments of any size, from nanometres to the globe."""
    rng = np.random.default_rng(seed)
    soup = rng.uniform(-1, 1, (int(rng.integers(3, 40)), 2, 2))
    mesh = triangulate_segments(soup * 10.0**scale)
    _sound(Triangulation(mesh.vertices / 10.0**scale, mesh.triangles, mesh.neighbours, mesh.points), soup)
