"""From guards to trees: triangulation, Reduced-CDT, where robots enter it, their trees (fault-tolerant-cdt, Figs 2, 3)."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from shapely import MultiPolygon

from quarterdeck.coverage.forest import Forest, multi_prims
from quarterdeck.coverage.graph import Graph, graph_of
from quarterdeck.coverage.reduced import reduced_cdt
from quarterdeck.geo.triangulation import Triangulation, triangulate
from quarterdeck.geo.visibility import visible_vertices


@dataclass(frozen=True, slots=True)
class Network:
    """What robots move on. `cdt` and `reduced` have the same vertices; `guards` (m,) are the guards' vertices.

    `access`: per robot the (n, 2) metres from its start to where it enters the reduced graph, `entries` (k,) that vertex.
    """

    mesh: Triangulation
    cdt: Graph
    reduced: Graph
    guards: np.ndarray
    entries: np.ndarray
    access: tuple[np.ndarray, ...]
    forest: Forest


def network(reach: MultiPolygon, guards: np.ndarray, starts: np.ndarray, *, left: np.ndarray | None = None) -> Network:
    """Return the network on (m, 2) guards for robots that start at (k, 2), all in metres and in `reach`.

    With `left`, indices, trees lead to these guards alone, over a graph of all: it is remembered, and need not be made
    again for every robot that is lost. Parts of `reach` that do not hang together are reduced apart. A robot enters at the
    vertex of the reduced graph that is nearest of those it sees; where it sees none, at the nearest along the
    triangulation. Robots are no vertices. Raises TriangulationError if a guard is outside.
    """
    mesh, cdt, reduced = _graphs(reach, np.asarray(guards, dtype=float).tobytes())
    chosen = mesh.points if left is None else mesh.points[left]
    inside = np.zeros(len(mesh.vertices), dtype=np.bool_)
    inside[mesh.points] = True
    inside[reduced.edges.ravel()] = True
    access = tuple(_access(mesh, cdt, inside, start) for start in np.asarray(starts, dtype=float).reshape(-1, 2))
    entries = np.array([vertex for vertex, _ in access], dtype=np.int64)
    forest = multi_prims(reduced, chosen, entries)
    return Network(mesh, cdt, reduced, chosen, entries, tuple(path for _, path in access), forest)


@lru_cache(maxsize=4)
def _graphs(reach: MultiPolygon, guards: bytes) -> tuple[Triangulation, Graph, Graph]:
    """Return the triangulation, its graph and the reduced one; of guards that come as bytes, which can be remembered."""
    mesh = triangulate(reach, np.frombuffer(guards).reshape(-1, 2))
    cdt = graph_of(mesh.vertices, mesh.edges)
    count, part = connected_components(_matrix(cdt), directed=False)
    pieces = [
        reduced_cdt(cdt, mesh.points[part[mesh.points] == i]).edges for i in range(count) if (part[mesh.points] == i).any()
    ]
    return mesh, cdt, graph_of(mesh.vertices, np.concatenate([np.empty((0, 2), dtype=np.int64), *pieces]))


def _matrix(graph: Graph) -> csr_array:
    return csr_array((np.maximum(graph.lengths, 1e-12), graph.indices, graph.starts), shape=(len(graph.points),) * 2)


def _access(mesh: Triangulation, cdt: Graph, inside: np.ndarray, start: np.ndarray) -> tuple[int, np.ndarray]:
    """Return the vertex at which a robot enters, and the way there."""
    seen = visible_vertices(mesh, start)[1]
    if not len(seen):  # by rounding it is outside: it sees the corners of the triangle beside it
        triangles = shapely.polygons(mesh.vertices[mesh.triangles])
        seen = mesh.triangles[int(np.argmin(shapely.distance(triangles, shapely.Point(start))))]
    away = np.linalg.norm(mesh.vertices[seen] - start, axis=1)
    good = inside[seen]
    if good.any():
        vertex = int(seen[good][np.lexsort((seen[good], away[good]))[0]])
        return vertex, np.array([start, mesh.vertices[vertex]])
    lengths, before = dijkstra(_matrix(cdt), indices=seen, return_predecessors=True)
    total = np.where(inside, away[:, None] + lengths, np.inf)
    first, last = divmod(int(np.argmin(total)), total.shape[1])
    chain = [last]
    while before[first, chain[-1]] >= 0:
        chain.append(int(before[first, chain[-1]]))
    return last, np.vstack([start, mesh.vertices[chain[::-1]]])
