"""All shortest distances between many places inside a polygon with holes: a visibility graph by triangular expansion."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import shapely
from numba import njit
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from shapely import MultiPolygon, Polygon

from quarterdeck.geo.triangulation import Triangulation, triangulate
from quarterdeck.geo.visibility import visible_points, visible_vertices

TOUCH = 1e-9  # m: a place so near to a vertex is there


@dataclass(frozen=True, slots=True)
class Geodesics:
    """Shortest distances between (k, 2) places: `lengths` (k, k) metres, infinite where there is no way.

    `nodes` (n, 2) are the places and then the corners that paths turn at; `before` (k, n) leads back from each node.
    """

    lengths: np.ndarray
    nodes: np.ndarray
    before: np.ndarray

    def path(self, source: int, target: int) -> np.ndarray:
        """Return the (m, 2) corners of the shortest path between two places, by index, both ends included."""
        chain = [target]
        while chain[-1] != source:
            chain.append(int(self.before[source, chain[-1]]))
            if chain[-1] < 0:
                raise ValueError(f"no path from place {source} to place {target}")
        return self.nodes[chain[::-1]]


def geodesics(space: Polygon | MultiPolygon, places: np.ndarray) -> Geodesics:
    """Return shortest distances and paths between (k, 2) places in a polygon, walls included.

    Shortest paths turn at reflex vertices only; ways between these are remembered for the polygons asked about last.
    Raises TriangulationError if a place is outside.
    """
    places = np.asarray(places, dtype=float).reshape(-1, 2)
    roads = _roads(space)
    k, n = len(places), len(roads.corners)
    corners, others = _seen(roads.mesh, places, roads.corners)
    if not others.diagonal().all():  # on a wall, but for rounding: it is made a vertex
        mesh = triangulate(space, places)
        places = mesh.vertices[mesh.points]
        corners, others = _seen(mesh, places, roads.corners)
    away = np.where(corners, _apart(places, roads.corners), np.inf)
    direct = np.where(others, _apart(places, places), np.inf)
    lengths, first, last = _joined(away, direct, roads.lengths)
    here, corner = np.arange(k)[:, None], np.arange(n)
    before = np.full((k, k + n), -1, dtype=np.int64)
    before[:, :k] = np.where(np.isfinite(lengths), np.where(last >= 0, k + last, here), -1)
    before[:, k:] = np.where(first < 0, -1, np.where(first == corner, here, k + roads.before[first, corner]))
    return Geodesics(lengths, np.concatenate([places, roads.corners]), before)


@dataclass(frozen=True, slots=True)
class _Roads:
    """A polygon's triangulation, its (n, 2) reflex corners, and the shortest ways between these: (n, n) metres, and the
    corner before each.
    """

    mesh: Triangulation
    corners: np.ndarray
    lengths: np.ndarray
    before: np.ndarray


@lru_cache(maxsize=4)
def _roads(space: Polygon | MultiPolygon) -> _Roads:
    mesh = triangulate(space)
    corners = _reflex(space)
    tree = shapely.STRtree(shapely.points(mesh.vertices))
    vertices = np.unique(tree.nearest(shapely.points(corners))) if len(corners) else np.empty(0, dtype=np.int64)
    starts, seen = visible_vertices(mesh, mesh.vertices[vertices])
    number = np.full(len(mesh.vertices), -1)
    number[vertices] = np.arange(len(vertices))
    rows, columns = np.repeat(np.arange(len(vertices)), np.diff(starts)), number[seen]
    used = (columns >= 0) & (columns != rows)
    rows, columns = rows[used], columns[used]
    weights = np.linalg.norm(mesh.vertices[vertices[rows]] - mesh.vertices[vertices[columns]], axis=1)
    graph = csr_array((weights, (rows, columns)), shape=(len(vertices),) * 2)
    graph = graph.maximum(graph.T)  # what one sees along a wall, the other sees too
    lengths, before = dijkstra(graph, return_predecessors=True) if len(vertices) else (np.empty((0, 0)),) * 2
    return _Roads(mesh, mesh.vertices[vertices], lengths, before.astype(np.int64))


def _seen(mesh: Triangulation, places: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (k, n) bool: which corners each of (k, 2) places sees, and (k, k): which places."""
    k = len(places)
    starts, vertex = visible_vertices(mesh, places)
    vertices = np.zeros((k, len(mesh.vertices)), dtype=np.bool_)
    vertices[np.repeat(np.arange(k), np.diff(starts)), vertex] = True
    tree = shapely.STRtree(shapely.points(mesh.vertices))
    starts, other = visible_points(mesh, places, np.inf, places)
    others = np.zeros((k, k), dtype=np.bool_)
    others[np.repeat(np.arange(k), np.diff(starts)), other] = True
    place, at = tree.query(shapely.points(places), predicate="dwithin", distance=TOUCH)
    others[:, place] |= vertices[:, at]  # a vertex is in several triangles, and looked for in one
    return vertices[:, tree.nearest(shapely.points(corners))] if len(corners) else vertices[:, :0], others | others.T


def _apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.norm(one[:, None] - other, axis=2))


@njit(cache=True)
def _joined(away: np.ndarray, direct: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (k, k) shortest lengths between places, the corner (k, n) at which the way from a place to another corner
    first is, and (k, k) that at which the way to another place last is; -1 for none.

    `away` (k, n) metres from places to corners that they see, `direct` (k, k) to other places, `ways` (n, n).
    """
    k, n = away.shape
    lengths, reach = direct.copy(), np.full((k, n), np.inf)
    first, last = np.full((k, n), -1, dtype=np.int64), np.full((k, k), -1, dtype=np.int64)
    for a in range(k):
        for u in range(n):
            if away[a, u] < np.inf:
                for v in range(n):
                    if away[a, u] + ways[u, v] < reach[a, v]:
                        reach[a, v], first[a, v] = away[a, u] + ways[u, v], u
        for b in range(k):
            for v in range(n):
                if away[b, v] < np.inf and reach[a, v] + away[b, v] < lengths[a, b]:
                    lengths[a, b], last[a, b] = reach[a, v] + away[b, v], v
    return lengths, first, last


def _reflex(space: Polygon | MultiPolygon) -> np.ndarray:
    corners = []
    for polygon in shapely.get_parts(shapely.orient_polygons(space)):
        for ring in (polygon.exterior, *polygon.interiors):
            here = shapely.get_coordinates(ring)[:-1]
            (ax, ay), (bx, by) = (here - np.roll(here, 1, axis=0)).T, (np.roll(here, -1, axis=0) - here).T
            corners.append(here[ax * by - ay * bx < 0])  # interior on the left: a right turn is reflex
    return np.concatenate(corners) if corners else np.empty((0, 2))
