"""Shortest ways inside polygons with holes, held against a visibility graph by shapely alone."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from quarterdeck.geo.geodesics import geodesics
from quarterdeck.geo.scenario import as_multipolygon
from quarterdeck.geo.triangulation import TriangulationError


def room(seed):
    """Return a square with boxes in it, in one part or several."""
    rng = np.random.default_rng(seed)
    low, size = rng.uniform(-5, 95, (6, 2)), rng.uniform(5, 40, (6, 2))
    boxes = [shapely.box(x, y, x + w, y + h) for (x, y), (w, h) in zip(low, size, strict=True)]
    return as_multipolygon(shapely.box(0, 0, 100, 100).difference(shapely.union_all(boxes)))


def by_shapely(space, places):
    """Return the lengths of shortest ways over all corners, two of which are linked where shapely says so."""
    nodes = np.vstack([places, np.unique(shapely.get_coordinates(space), axis=0)])
    a, b = np.triu_indices(len(nodes), 1)
    open_ = shapely.covers(space.buffer(1e-7), shapely.linestrings(np.stack([nodes[a], nodes[b]], axis=1)))
    lengths = np.linalg.norm(nodes[a] - nodes[b], axis=1)[open_] + 1e-12  # no length would be no link
    graph = csr_array((lengths, (a[open_], b[open_])), shape=(len(nodes),) * 2)
    return dijkstra(graph, directed=False)[: len(places), : len(places)]


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_lengths_and_paths_are_the_shortest(seed):
    """For places inside, on walls, at corners and twice the same; each path is as long as is said, and inside."""
    space, rng = room(seed), np.random.default_rng(seed)
    places = rng.uniform(0, 100, (40, 2))
    places = places[shapely.contains_xy(space, *places.T)][:8]
    walls = shapely.get_coordinates([space.boundary.interpolate(x, normalized=True) for x in rng.random(2)])
    corners = rng.permutation(shapely.get_coordinates(space))[:3]
    places = np.vstack([places, walls, corners, corners[:1]])
    ways = geodesics(space, places)
    assert np.allclose(ways.lengths, by_shapely(space, places), atol=1e-6)
    inside = space.buffer(1e-6)
    for a, b in zip(*np.nonzero(np.isfinite(ways.lengths)), strict=True):
        path = shapely.LineString(ways.path(a, b) if a != b else ways.nodes[[a, a]])
        assert path.length == pytest.approx(ways.lengths[a, b], abs=1e-6)
        assert inside.covers(path)
        assert path.boundary.is_empty or np.allclose(shapely.get_coordinates(path)[[0, -1]], places[[a, b]], atol=1e-6)


def test_what_is_outside_is_refused():
    """A place in a hole has no way to anywhere, and is told."""
    with pytest.raises(TriangulationError, match="is outside"):
        geodesics(shapely.box(0, 0, 9, 9).difference(shapely.box(4, 4, 6, 6)), np.array([(1.0, 1.0), (5.0, 5.0)]))
