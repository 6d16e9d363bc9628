"""Constrained Delaunay triangulations, the one door to Shewchuk's Triangle.

Triangle ends the process on duplicate vertices, NaN and hole seeds outside, and loses vertices and areas silently on other
input. So everything is noded and snapped on the way in, nothing but its option `p` is used, holes are told apart from the
result instead of by seeds, and vertex count, area and every given point are verified on the way out.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from shapely import MultiPolygon, Polygon

from quarterdeck.geo.errors import QuarterdeckError, UnavailableError

Backend = Literal["triangle", "pythoncdt"]
GRID = 1e-12  # of the extent: vertices are snapped to a grid of this size
AREA_TOLERANCE = 1e-9  # relative: by how much the triangles' area may differ from the region's


class TriangulationError(QuarterdeckError, ValueError):
    """A triangulation would be wrong: a point is outside, or a backend lost a vertex or an area."""


@dataclass(frozen=True, slots=True, eq=False)  # one is itself alone, and can be a key
class Triangulation:
    """A constrained Delaunay triangulation.

    `vertices` (n, 2) metres; `triangles` (t, 3) int32, counter-clockwise; `neighbours` (t, 3) int32, the triangle across
    the edge opposite each corner, -1 where that edge is a wall; `points` (k,) the vertex of each point that was given.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    neighbours: np.ndarray
    points: np.ndarray

    @property
    def edges(self) -> np.ndarray:
        """(m, 2) int: every edge once, smaller vertex first, in order."""
        ends = self.triangles[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
        return np.unique(np.sort(ends, axis=1), axis=0)

    @property
    def area(self) -> float:
        """Square metres of all triangles."""
        return float(_areas(self.vertices, self.triangles).sum())


def triangulate(
    space: Polygon | MultiPolygon, points: np.ndarray | None = None, *, backend: Backend = "triangle"
) -> Triangulation:
    """Triangulate the inside of `space` with (k, 2) `points` as further vertices.

    Every boundary edge of `space` is an edge, or a chain of edges where a point lies on it. A point within 1e-12 of the
    extent of an edge is taken to lie on it. Raises TriangulationError if `space` is empty or invalid, anything is not
    finite, or a point is outside.
    """
    if space.is_empty or not space.is_valid:
        why = "is empty" if space.is_empty else f"is invalid: {shapely.is_valid_reason(space)}"
        raise TriangulationError(f"the polygon {why}; give a valid one with an area")
    rings = [ring for polygon in shapely.get_parts(space) for ring in (polygon.exterior, *polygon.interiors)]
    coordinates = [shapely.get_coordinates(ring) for ring in rings]
    segments = np.concatenate([np.stack([c[:-1], c[1:]], axis=1) for c in coordinates])
    result = _triangulate(segments, points, space, backend)
    if abs(result.area - space.area) > AREA_TOLERANCE * max(space.area, 4 * _extent(segments) * space.length):
        raise TriangulationError(f"the triangles cover {result.area:.9g} m2 of {space.area:.9g} m2; simplify the polygon")
    return result


def triangulate_segments(
    segments: np.ndarray, points: np.ndarray | None = None, *, backend: Backend = "triangle"
) -> Triangulation:
    """Triangulate every bounded face of any (m, 2, 2) `segments`: crossing, overlapping, repeated and of no length alike.

    Segments are cut where they meet, and all of them that bound or lie in a face are walls. There are no triangles where
    nothing is enclosed. (k, 2) `points` become vertices; TriangulationError is raised if one is in no face.
    """
    return _triangulate(np.asarray(segments, dtype=float).reshape(-1, 2, 2), points, None, backend)


def _triangulate(
    segments: np.ndarray, points: np.ndarray | None, space: Polygon | MultiPolygon | None, backend: Backend
) -> Triangulation:
    given = np.empty((0, 2)) if points is None else np.asarray(points, dtype=float).reshape(-1, 2)
    if not (np.isfinite(segments).all() and np.isfinite(given).all()):
        raise TriangulationError("a coordinate is not a finite number; remove it")
    lines, grid = _noded(segments, given)
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(lines)))
    if space is not None and len(faces):
        faces = faces[shapely.contains(space, shapely.point_on_surface(faces))]
    if not len(faces):
        if len(given):
            raise TriangulationError(f"point {_text(given[0])} is outside; move it inside")
        none = np.empty((0, 3), dtype=np.int32)
        return Triangulation(np.empty((0, 2)), none, none, np.empty(0, dtype=np.int64))
    vertices, ends, of_point = _unique(lines, given, grid)
    triangles = _BACKENDS[backend](vertices, ends)
    triangles = _inside(vertices, triangles, ends, faces)
    missing = np.setdiff1d(of_point, triangles)
    if len(missing):
        raise TriangulationError(f"point {_text(vertices[missing[0]])} is outside; move it inside")
    expected = float(shapely.area(faces).sum())
    found = float(_areas(vertices, triangles).sum())
    if abs(found - expected) > AREA_TOLERANCE * max(expected, _extent(segments) ** 2 * 1e-3):
        raise TriangulationError(f"{backend} covers {found:.9g} m2 of {expected:.9g} m2; simplify the polygon")
    return Triangulation(vertices, triangles, _neighbours(triangles, ends, len(vertices)), of_point)


def _extent(segments: np.ndarray) -> float:
    return float(np.ptp(segments.reshape(-1, 2), axis=0).max()) if segments.size else 0.0


def _text(point: np.ndarray) -> str:
    return f"({point[0]:.6g}, {point[1]:.6g})"


def _noded(segments: np.ndarray, points: np.ndarray) -> tuple[shapely.Geometry, float]:
    """Cut the segments where they meet one another or a point, on a grid that is a power of two."""
    segments = segments[(segments[:, 0] != segments[:, 1]).any(axis=1)]
    largest = float(np.abs(segments).max()) if segments.size else 1.0
    smallest_grid = max(GRID * _extent(segments), 4 * np.spacing(largest), 1e-150)
    grid = float(2.0 ** np.ceil(np.log2(smallest_grid)))
    lines = shapely.linestrings(segments)
    if len(points) and len(lines):
        at, of = shapely.STRtree(lines).query(shapely.points(points), predicate="dwithin", distance=grid)
        cut = np.unique(of)
        pieces = [_split(segments[i], points[at[of == i]]) for i in cut]
        lines = shapely.linestrings(np.concatenate([np.delete(segments, cut, axis=0), *pieces]))
    return shapely.union_all(lines, grid_size=grid), grid


def _split(segment: np.ndarray, points: np.ndarray) -> np.ndarray:
    along = (points - segment[0]) @ (segment[1] - segment[0])
    chain = np.concatenate([segment[:1], points[np.argsort(along, kind="stable")], segment[1:]])
    pieces = np.stack([chain[:-1], chain[1:]], axis=1)
    return pieces[(pieces[:, 0] != pieces[:, 1]).any(axis=1)]


def _unique(lines: shapely.Geometry, points: np.ndarray, grid: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (n, 2) unique vertices, (m, 2) unique edges between them, and the vertex of each point."""
    coordinates, line = shapely.get_coordinates(shapely.get_parts(lines), return_index=True)
    keys = np.rint(np.concatenate([coordinates, points]) / grid).astype(np.int64)
    unique, index = np.unique(keys, axis=0, return_inverse=True)
    index = index.reshape(-1)
    joined = line[1:] == line[:-1]
    n = len(coordinates)
    ends = np.stack([index[: n - 1][joined], index[1:n][joined]], axis=1)
    ends = np.unique(np.sort(ends, axis=1), axis=0)
    return unique * grid, ends[ends[:, 0] != ends[:, 1]], index[n:]


def _by_triangle(vertices: np.ndarray, ends: np.ndarray) -> np.ndarray:
    import triangle

    result = triangle.triangulate({"vertices": vertices, "segments": ends}, "p")
    if len(result["vertices"]) != len(vertices) or not np.array_equal(result["vertices"], vertices):
        raise TriangulationError("triangle added or moved a vertex; simplify the polygon")
    return result.get("triangles", np.empty((0, 3), dtype=np.int32))


def _by_pythoncdt(vertices: np.ndarray, ends: np.ndarray) -> np.ndarray:
    try:
        import pythoncdt as cdt
    except ImportError:
        raise UnavailableError("the backend pythoncdt is not installed; pip install 'quarterdeck[cdt]'") from None
    mesh = cdt.Triangulation(cdt.VertexInsertionOrder.AUTO, cdt.IntersectingConstraintEdges.NOT_ALLOWED, 0.0)
    mesh.insert_vertices([cdt.V2d(x, y) for x, y in vertices])
    mesh.insert_edges([cdt.Edge(int(a), int(b)) for a, b in ends])
    mesh.erase_super_triangle()
    return np.array([t.vertices for t in mesh.triangles], dtype=np.int32).reshape(-1, 3)


_BACKENDS = {"triangle": _by_triangle, "pythoncdt": _by_pythoncdt}


def _inside(vertices: np.ndarray, triangles: np.ndarray, ends: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Keep the triangles in `faces`: regions between walls are tested by their largest triangle, never by a sliver."""
    if not len(triangles):
        return triangles
    around = _neighbours(triangles, ends, len(vertices))
    source, corner = np.nonzero(around >= 0)
    links = coo_array((np.ones(len(source)), (source, around[source, corner])), shape=(len(triangles),) * 2)
    _, region = connected_components(links, directed=False)
    order = np.lexsort((-_areas(vertices, triangles), region))
    largest = order[np.unique(region[order], return_index=True)[1]]
    centres = vertices[triangles[largest]].mean(axis=1)
    held, _ = shapely.STRtree(faces).query(shapely.points(centres), predicate="within")
    kept = triangles[np.isin(region, held)]
    turned = np.argmin(kept, axis=1)  # the smallest corner first, and in order: the same from every backend
    kept = np.take_along_axis(kept, (turned[:, None] + np.arange(3)) % 3, axis=1)
    return np.ascontiguousarray(kept[np.lexsort(kept.T[::-1])], dtype=np.int32)


def _areas(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    return 0.5 * ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))


def _neighbours(triangles: np.ndarray, walls: np.ndarray, n: int) -> np.ndarray:
    """Return (t, 3) the triangle across the edge opposite each corner, -1 at walls and at the rim."""
    sides = np.sort(triangles[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2).astype(np.int64), axis=1)
    keys = sides[:, 0] * n + sides[:, 1]
    order = np.argsort(keys, kind="stable")
    pair = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    one, other = order[pair], order[pair + 1]
    across = np.full(len(keys), -1, dtype=np.int32)
    across[one], across[other] = other // 3, one // 3
    across[np.isin(keys, walls[:, 0].astype(np.int64) * n + walls[:, 1])] = -1
    return across.reshape(-1, 3)
