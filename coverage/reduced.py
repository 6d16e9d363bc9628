"""The Reduced-CDT: the part of a triangulation that links all guards (fault-tolerant-cdt, Algorithm 1).

Algorithm 1 is the heuristic of Takahashi and Matsuyama (1980) for Steiner trees, begun at the closest pair of guards. The
paper takes all shortest paths by Floyd-Warshall first; one heap, re-seeded with each path that joins, finds the same tree.
"""

from heapq import heappop, heappush

import numpy as np
from numba import njit

from quarterdeck.coverage.graph import Graph, graph_of


def reduced_cdt(graph: Graph, guards: np.ndarray) -> Graph:
    """Return the Reduced-CDT over the same vertices: a tree on all (k,) guards that can be reached from the closest pair.

    `guards` are vertices. Ties go to the smaller distance, then vertex. Fewer than two guards: no edges.
    """
    marked = np.zeros(len(graph.points), dtype=np.bool_)
    marked[guards] = True
    return graph_of(graph.points, _steiner(graph.starts, graph.indices, graph.lengths, marked))


@njit(cache=True)
def _steiner(starts: np.ndarray, indices: np.ndarray, lengths: np.ndarray, guard: np.ndarray) -> np.ndarray:
    n = len(guard)
    distance, source, before = np.full(n, np.inf), np.full(n, -1), np.full(n, -1)
    heap = [(0.0, -1)]
    heappop(heap)
    for v in range(n):
        if guard[v]:
            distance[v], source[v] = 0.0, v
            heappush(heap, (0.0, v))
    while heap:
        d, v = heappop(heap)
        if d > distance[v]:
            continue
        for e in range(starts[v], starts[v + 1]):
            w = indices[e]
            if d + lengths[e] < distance[w]:
                distance[w], source[w], before[w] = d + lengths[e], source[v], v
                heappush(heap, (distance[w], w))
    best, one, other = np.inf, -1, -1
    for v in range(n):
        for e in range(starts[v], starts[v + 1]):
            w = indices[e]
            if source[v] >= 0 and source[v] < source[w] and distance[v] + lengths[e] + distance[w] < best:
                best, one, other = distance[v] + lengths[e] + distance[w], v, w
    edges = np.empty((n, 2), dtype=np.int64)
    count = 0
    if one < 0:
        return edges[:0]
    inside = np.zeros(n, dtype=np.bool_)
    edges[0, 0], edges[0, 1] = one, other
    count = 1
    for end in (one, other):
        v = end
        inside[v] = True
        while before[v] >= 0:
            edges[count, 0], edges[count, 1] = v, before[v]
            count += 1
            v = before[v]
            inside[v] = True
    distance[:] = np.inf
    for v in range(n):
        if inside[v]:
            distance[v] = 0.0
            heappush(heap, (0.0, v))
    while heap:
        d, v = heappop(heap)
        if d > distance[v]:
            continue
        if guard[v] and not inside[v]:
            while not inside[v]:  # the path joins, and what is on it is at no distance from now on
                inside[v] = True
                edges[count, 0], edges[count, 1] = v, before[v]
                count += 1
                distance[v] = 0.0
                heappush(heap, (0.0, v))
                v = before[v]
            continue
        for e in range(starts[v], starts[v + 1]):
            w = indices[e]
            if d + lengths[e] < distance[w]:
                distance[w], before[w] = d + lengths[e], v
                heappush(heap, (distance[w], w))
    return edges[:count]
