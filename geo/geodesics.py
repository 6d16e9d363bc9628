"""All shortest distances between many places inside a polygon with holes: a visibility graph by triangular expansion."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import shapely
from numba import njit
from scipy.sparse import block_array, csr_array
from scipy.sparse.csgraph import dijkstra
from shapely import MultiPolygon, Polygon

from quarterdeck.geo.deadline import go_on
from quarterdeck.geo.triangulation import Triangulation, triangulate
from quarterdeck.geo.visibility import visible_points, visible_vertices

TOUCH = 1e-9  # m: a place so near to a vertex is there
ASIDE = 1e-6  # m2: of a triangle so small, which side is not told
BATCH = 256  # corners whose views are held at once
SOURCES = 32  # places from which all corners are reached at once


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
    Raises TriangulationError if a place is outside, and OutOfTimeError where it is abandoned.
    """
    places = np.asarray(places, dtype=float).reshape(-1, 2)
    roads = _roads(space)
    k, n = len(places), len(roads.corners)
    starts, corner, others = _seen(roads.mesh, places, roads.corners)
    if not others.diagonal().all():  # on a wall, but for rounding: it is made a vertex
        mesh = triangulate(space, places)
        places = mesh.vertices[mesh.points]
        starts, corner, others = _seen(mesh, places, roads.corners)
    away = np.linalg.norm(places[np.repeat(np.arange(k), np.diff(starts))] - roads.corners[corner], axis=1)
    lengths = np.where(others, np.linalg.norm(places[:, None] - places, axis=2), np.inf)
    before = np.where(others, np.arange(k, dtype=np.int32)[:, None], np.int32(-1))
    before = np.concatenate([before, np.full((k, n), -1, dtype=np.int32)], axis=1)
    out = csr_array((np.maximum(away, 1e-12), corner, starts), shape=(k, n))  # no length would be no link
    for begin in range(0, k, SOURCES):
        if begin:
            go_on(f"the search for ways between {k:,} places around {n:,} corners")
        some = slice(begin, begin + SOURCES)
        rows = out[some]
        graph = block_array([[roads.links, None], [rows, csr_array((rows.shape[0],) * 2)]], format="csr")
        reach, last = dijkstra(graph, indices=np.arange(n, n + rows.shape[0]), return_predecessors=True)
        here = np.arange(k)[some, None]
        before[some, k:] = np.where(last[:, :n] < 0, -1, np.where(last[:, :n] >= n, here, k + last[:, :n]))
        _join(lengths[some], before[some], reach, starts, corner, away)
    return Geodesics(lengths, np.concatenate([places, roads.corners]), before)


@dataclass(frozen=True, slots=True)
class _Roads:
    """A polygon's triangulation, its (n, 2) reflex corners, and the lengths in metres of straight ways between these."""

    mesh: Triangulation
    corners: np.ndarray
    links: csr_array


@lru_cache(maxsize=4)
def _roads(space: Polygon | MultiPolygon) -> _Roads:
    """Return what ways in a polygon are made of; a way turns around corners, so its links are tangents there."""
    mesh = triangulate(space)
    corners, beside = _reflex(space)
    if not len(corners):
        return _Roads(mesh, corners, csr_array((0, 0)))
    tree = shapely.STRtree(shapely.points(mesh.vertices))
    vertices, first, count = np.unique(tree.nearest(shapely.points(corners)), return_index=True, return_counts=True)
    corners, beside, several = mesh.vertices[vertices], beside[:, first], count > 1  # where obstacles touch
    number = np.full(len(mesh.vertices), -1)
    number[vertices] = np.arange(len(vertices))
    pairs = []
    for begin in range(0, len(corners), BATCH):
        if begin:
            go_on(f"the search for ways between {len(corners):,} corners of obstacles and borders")
        starts, seen = visible_vertices(mesh, corners[begin : begin + BATCH])
        rows, columns = np.repeat(np.arange(begin, begin + len(starts) - 1), np.diff(starts)), number[seen]
        used = (columns >= 0) & (columns != rows)
        rows, columns = rows[used], columns[used]
        used = (several[rows] | _tangent(corners, rows, columns, beside)) & (
            several[columns] | _tangent(corners, columns, rows, beside)
        )
        pairs.append(np.column_stack([rows[used], columns[used]]))
    rows, columns = np.concatenate(pairs).T
    weights = np.linalg.norm(corners[rows] - corners[columns], axis=1)
    links = csr_array((weights, (rows, columns)), shape=(len(corners),) * 2)
    return _Roads(mesh, corners, links.maximum(links.T))  # what one sees along a wall, the other sees too


def _tangent(corners: np.ndarray, at: np.ndarray, to: np.ndarray, beside: np.ndarray) -> np.ndarray:
    """Return (l,) bool: the way from each corner `at` to another has both of its neighbours, (2, n, 2), on one side."""
    way, (one, other) = corners[to] - corners[at], beside[:, at] - corners[at]
    a, b = (way[:, 0] * side[:, 1] - way[:, 1] * side[:, 0] for side in (one, other))
    return np.asarray(~((a > ASIDE) & (b < -ASIDE) | (a < -ASIDE) & (b > ASIDE)))


def _seen(mesh: Triangulation, places: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which corners each of (k, 2) places sees: CSR (k + 1,) and indices; and (k, k) bool: which places."""
    k = len(places)
    starts, vertex = visible_vertices(mesh, places)
    sees = csr_array((np.ones(len(vertex), dtype=np.bool_), vertex, starts), shape=(k, len(mesh.vertices)))
    tree = shapely.STRtree(shapely.points(mesh.vertices))
    first, other = visible_points(mesh, places, np.inf, places)
    others = np.zeros((k, k), dtype=np.bool_)
    others[np.repeat(np.arange(k), np.diff(first)), other] = True
    place, at = tree.query(shapely.points(places), predicate="dwithin", distance=TOUCH)
    others[:, place] |= sees[:, at].toarray()  # a vertex is in several triangles, and looked for in one
    corner = sees[:, tree.nearest(shapely.points(corners))] if len(corners) else csr_array((k, 0), dtype=np.bool_)
    # scipy chooses how wide its indices are, the kernel has one signature
    return corner.indptr.astype(np.int64), corner.indices.astype(np.int64), others | others.T


@njit(cache=True)
def _join(
    lengths: np.ndarray, before: np.ndarray, reach: np.ndarray, starts: np.ndarray, corner: np.ndarray, away: np.ndarray
) -> None:
    """Shorten (b, k) `lengths` from some of k places to all by ways over corners that these see, and note the last one
    `before`; the corners are `reach` (b, n) metres away.
    """
    k = len(starts) - 1
    for a in range(len(lengths)):
        for b in range(k):
            for e in range(starts[b], starts[b + 1]):
                if reach[a, corner[e]] + away[e] < lengths[a, b]:
                    lengths[a, b], before[a, b] = reach[a, corner[e]] + away[e], k + corner[e]


def _reflex(space: Polygon | MultiPolygon) -> tuple[np.ndarray, np.ndarray]:
    """Return the (n, 2) corners that ways can turn around, and (2, n, 2) those before and after them on the ring."""
    corners, beside = [np.empty((0, 2))], [np.empty((2, 0, 2))]
    for polygon in shapely.get_parts(shapely.orient_polygons(space)):
        for ring in (polygon.exterior, *polygon.interiors):
            here = shapely.get_coordinates(ring)[:-1]
            last, after = np.roll(here, 1, axis=0), np.roll(here, -1, axis=0)
            (ax, ay), (bx, by) = (here - last).T, (after - here).T
            reflex = ax * by - ay * bx < 0  # interior on the left: a right turn is reflex
            corners.append(here[reflex])
            beside.append(np.stack([last[reflex], after[reflex]]))
    return np.concatenate(corners), np.concatenate(beside, axis=1)
