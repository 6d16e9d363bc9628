import networkx as nx
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import floyd_warshall
from scipy.spatial import Delaunay

from quarterdeck.coverage.graph import Graph, graph_of
from quarterdeck.coverage.reduced import reduced_cdt


def random_graph(rng: np.random.Generator, n: int) -> Graph:
    """Return a Delaunay graph of random points, without ties."""
    points = rng.uniform(0, 100, (n, 2))
    triangles = Delaunay(points).simplices
    edges = np.unique(np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    return graph_of(points, edges)


def by_floyd_warshall(graph: Graph, guards: np.ndarray) -> float:
    """Return the weight of Algorithm 1 as it is printed: all shortest paths first, then one guard after the other."""
    matrix = csr_array((graph.lengths, graph.indices, graph.starts), shape=(len(graph.points),) * 2)
    distance, before = floyd_warshall(matrix, directed=False, return_predecessors=True)
    among = distance[np.ix_(guards, guards)] + np.diag(np.full(len(guards), np.inf))
    i, j = np.unravel_index(np.argmin(among), among.shape)
    component, edges = set(), set()
    path = (int(guards[i]), int(guards[j]))
    left = {int(g) for g in guards}
    while True:
        v = path[1]
        component.add(v)
        while v != path[0]:
            u = int(before[path[0], v])
            edges.add((min(u, v), max(u, v)))
            component.add(u)
            v = u
        left -= component
        if not left:
            return sum(float(np.linalg.norm(graph.points[a] - graph.points[b])) for a, b in edges)
        inside, outside = sorted(component), sorted(left)
        a, b = np.unravel_index(np.argmin(distance[np.ix_(inside, outside)]), (len(inside), len(outside)))
        path = (inside[a], outside[b])


@settings(deadline=None, max_examples=100)
@given(st.integers(0, 2**32 - 1))
def test_weighs_what_floyd_warshall_and_greed_weigh(seed: int) -> None:
    """One heap finds the tree of Algorithm 1."""
    rng = np.random.default_rng(seed)
    graph = random_graph(rng, int(rng.integers(4, 60)))
    guards = rng.permutation(len(graph.points))[: int(rng.integers(2, len(graph.points) + 1))]
    reduced = reduced_cdt(graph, guards)
    assert np.isclose(reduced.weight, by_floyd_warshall(graph, guards), rtol=1e-12)
    tree = reduced.networkx()
    assert nx.is_tree(tree)
    assert set(guards.tolist()) <= set(tree)
    assert all(v in set(guards.tolist()) for v in tree if tree.degree[v] == 1)


def test_one_guard_needs_no_edge() -> None:
    """A single guard, and none, have an empty Reduced-CDT."""
    graph = random_graph(np.random.default_rng(0), 5)
    assert len(reduced_cdt(graph, np.array([2])).edges) == 0
    assert len(reduced_cdt(graph, np.array([], dtype=np.int64)).edges) == 0
