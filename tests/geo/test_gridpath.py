"""Grid paths against networkx's shortest paths, and pulled strings against exact geometry."""

import math

import networkx as nx
import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from quarterdeck.geo.gridpath import find_ways, nearest_free
from quarterdeck.geo.occupancy import OCCUPIED, Occupancy


def cluttered(seed: int, size: int = 14, part: float = 0.3) -> tuple[Occupancy, np.ndarray, np.ndarray]:
    """A random map, its free cells, and five random points in them."""
    rng = np.random.default_rng(seed)
    cells = np.where(rng.random((size, size)) < part, OCCUPIED, 0).astype(np.int8)
    cells[0, 0] = 0
    map_ = Occupancy(cells, 0.5, (3.0, -2.0), 0.3)
    free = map_.free()
    where = np.argwhere(free)
    return map_, free, map_.to_metres(where[rng.integers(0, len(where), 5)] + rng.uniform(0.01, 0.99, (5, 2)))


def reference(free: np.ndarray) -> nx.Graph:
    """The 8-connected graph without cut corners."""
    graph = nx.Graph()
    for i, j in np.argwhere(free).tolist():
        graph.add_node((i, j))
        for di, dj in ((0, 1), (1, 0), (1, 1), (1, -1)):
            a, b = i + di, j + dj
            if 0 <= a < free.shape[0] and 0 <= b < free.shape[1] and free[a, b] and free[i, b] and free[a, j]:
                graph.add_edge((i, j), (a, b), weight=math.hypot(di, dj))
    return graph


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6))
def test_shortest_as_networkx_and_never_through_a_wall(seed):
    """Steps equal networkx's; A* agrees; Manhattan is never shorter; pulled paths are no longer and stay in free cells."""
    map_, free, points = cluttered(seed)
    ways, star, paper = (find_ways(map_, free, points, h) for h in ("none", "octile", "manhattan"))
    graph = reference(free)
    cells = [tuple(c) for c in np.floor(map_.to_cells(points)).astype(int).tolist()]
    walls = shapely.union_all([shapely.box(j, i, j + 1, i + 1) for i, j in np.argwhere(~free)])
    for i in range(5):
        lengths = nx.single_source_dijkstra_path_length(graph, cells[i])
        for j in range(i + 1, 5):
            expected = lengths.get(cells[j], math.inf) * map_.resolution
            np.testing.assert_allclose([ways.steps[i, j], star.steps[i, j]], expected, rtol=1e-9, atol=1e-9)
            assert paper.steps[i, j] >= expected - 1e-9
            path = ways.path(j, i)
            assert (path is None) == math.isinf(expected)
            if path is None:
                continue
            np.testing.assert_array_equal(path[[0, -1]], points[[j, i]])
            assert ways.lengths[i, j] <= expected + 2 * map_.resolution + 1e-9
            line = shapely.LineString(map_.to_cells(path)[:, ::-1])
            assert line.intersection(walls).length < 1e-6


def test_an_open_field_is_one_straight_line():
    """Where nothing is in the way the pulled path is the segment, and the grid's own way is longer."""
    map_ = Occupancy(np.zeros((50, 80), np.int8), 0.1)
    points = np.array([[0.55, 0.55], [7.23, 3.11]])
    ways = find_ways(map_, map_.free(), points)
    np.testing.assert_allclose(ways.path(0, 1), points)
    assert ways.lengths[0, 1] < ways.steps[0, 1]


def test_a_blocked_point_is_moved_or_has_no_way():
    """A point on a blocked cell moves to the nearest free cell within reach; beyond it has no way."""
    cells = np.zeros((10, 10), np.int8)
    cells[:, 5:] = OCCUPIED
    map_ = Occupancy(cells, 1.0)
    points = np.array([[1.5, 1.5], [6.5, 4.5], [9.5, 4.5]])
    moved = nearest_free(map_, map_.free(), points, 2.5)
    np.testing.assert_allclose(moved, [[1.5, 1.5], [4.5, 4.5], [9.5, 4.5]])
    assert np.isfinite(find_ways(map_, map_.free(), moved).lengths).tolist() == [
        [True, True, False],
        [True, True, False],
        [False, False, True],
    ]
