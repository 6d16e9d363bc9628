"""All shortest distances between many places inside a polygon with holes: a visibility graph by triangular expansion."""

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from shapely import MultiPolygon, Polygon

from quarterdeck.geo.triangulation import triangulate
from quarterdeck.geo.visibility import visible_vertices


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

    Shortest paths turn at reflex vertices only. Raises TriangulationError if a place is outside.
    """
    places = np.asarray(places, dtype=float).reshape(-1, 2)
    mesh = triangulate(space, places)
    corners = _reflex(space)
    tree = shapely.STRtree(shapely.points(mesh.vertices))
    at = tree.nearest(shapely.points(corners)) if len(corners) else np.empty(0, dtype=np.int64)
    vertices = np.unique(np.concatenate([mesh.points, at]))
    starts, seen = visible_vertices(mesh, mesh.vertices[vertices])
    number = np.full(len(mesh.vertices), -1)
    number[vertices] = np.arange(len(vertices))
    rows, columns = np.repeat(np.arange(len(vertices)), np.diff(starts)), number[seen]
    used = (columns >= 0) & (columns != rows)
    rows, columns = rows[used], columns[used]
    weights = np.linalg.norm(mesh.vertices[vertices[rows]] - mesh.vertices[vertices[columns]], axis=1)
    graph = csr_array((weights, (rows, columns)), shape=(len(vertices),) * 2)
    graph = graph.maximum(graph.T)  # what one sees along a wall, the other sees too
    sources = number[mesh.points]
    lengths, before = dijkstra(graph, indices=sources, return_predecessors=True)
    # Places first, then all the mesh's nodes: two places may share one.
    lengths = lengths[:, sources]
    k = len(places)
    chains = np.full((k, k + len(vertices)), -1, dtype=np.int64)
    chains[:, k:] = np.where(before >= 0, before + k, -1)
    chains[:, :k] = np.where(before[:, sources] >= 0, before[:, sources] + k, -1)
    source_nodes = sources + k
    for i in range(k):
        chains[i, source_nodes[i]] = i
        chains[i, :k][sources == sources[i]] = i
    return Geodesics(lengths, np.concatenate([places, mesh.vertices[vertices]]), chains)


def _reflex(space: Polygon | MultiPolygon) -> np.ndarray:
    corners = []
    for polygon in shapely.get_parts(shapely.orient_polygons(space)):
        for ring in (polygon.exterior, *polygon.interiors):
            here = shapely.get_coordinates(ring)[:-1]
            (ax, ay), (bx, by) = (here - np.roll(here, 1, axis=0)).T, (np.roll(here, -1, axis=0) - here).T
            corners.append(here[ax * by - ay * bx < 0])  # interior on the left: a right turn is reflex
    return np.concatenate(corners) if corners else np.empty((0, 2))
