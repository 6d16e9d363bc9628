"""Visibility polygons of limited range, exact, by triangular expansion (Bungiu et al. 2014) over a triangulation.

From the point's triangle the view passes from triangle to triangle through their common edges, narrowed by each, until a
wall or the range stops it. What is visited is what is seen, whatever the size of the map.
"""

from functools import lru_cache

import numpy as np
import shapely
from numba import njit

from quarterdeck.geo.deadline import go_on
from quarterdeck.geo.triangulation import Triangulation

BATCH = 256  # views, between two looks at the limit
DISC_SIDES = 64  # of the regular polygon that stands for the disc: inscribed it loses 0.16 % of the area
ON_EDGE = 1e-12  # of the coordinates: a point this near an edge lies on it


def visibility_polygons(
    mesh: Triangulation, points: np.ndarray, ranges: float | np.ndarray, *, outer: bool = False
) -> np.ndarray:
    """Return (k,) polygons: what each of (k, 2) `points` sees within its range, (k,) or one for all, in metres.

    The disc is an inscribed regular polygon, so that each is truly seen; with `outer` a circumscribed one, so that nothing
    that is seen is missing. A point in no triangle sees nothing: an empty polygon. Raises OutOfTimeError where abandoned.
    """
    points = np.ascontiguousarray(points, dtype=float).reshape(-1, 2)
    ranges = np.full(len(points), ranges, dtype=float)
    reach = ranges / np.cos(np.pi / DISC_SIDES) if outer else ranges
    views = [_polygons(mesh, points[:BATCH], reach[:BATCH])]
    for begin in range(BATCH, len(points), BATCH):
        go_on(f"the look around from {len(points):,} places")
        views.append(_polygons(mesh, points[begin : begin + BATCH], reach[begin : begin + BATCH]))
    return np.concatenate(views)


def _polygons(mesh: Triangulation, points: np.ndarray, reach: np.ndarray) -> np.ndarray:
    coordinates, sizes = _outlines(mesh.vertices, mesh.triangles, mesh.neighbours, *_homes(mesh, points), points, reach)
    index = np.repeat(np.arange(len(points)), sizes)
    stars = np.full(len(points), shapely.Polygon(), dtype=object)
    some = np.flatnonzero(sizes >= 4)
    used = np.isin(index, some)
    if len(some):
        rings = shapely.linearrings(coordinates[used], indices=np.searchsorted(some, index[used]))
        stars[some] = shapely.polygons(rings)
    broken = ~shapely.is_valid(stars)
    stars[broken] = shapely.buffer(shapely.make_valid(stars[broken]), 0)  # threads of no width in long needles
    finite = np.isfinite(reach)
    stars[finite] = shapely.intersection(stars[finite], _discs(points[finite], reach[finite]))
    return stars


def visible_points(
    mesh: Triangulation, origins: np.ndarray, ranges: float | np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return which of (n, 2) `points` each of (k, 2) `origins` sees within its range: CSR (k + 1,) starts and indices.

    Indices ascend within a row. Points in no triangle are never seen.
    """
    origins = np.ascontiguousarray(origins, dtype=float).reshape(-1, 2)
    points = np.ascontiguousarray(points, dtype=float).reshape(-1, 2)
    ranges = np.full(len(origins), ranges, dtype=float)
    starts, homes = _homes(mesh, points)
    home = np.append(homes, -1)[np.where(np.diff(starts) > 0, starts[:-1], len(homes))]
    order = np.argsort(home, kind="stable")
    first = np.searchsorted(home[order], np.arange(len(mesh.triangles) + 1))
    arrays = (mesh.vertices, mesh.triangles, mesh.neighbours, *_homes(mesh, origins))
    return _visible(*arrays, origins, ranges, points, order, first)


def visible_vertices(mesh: Triangulation, origins: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which vertices each of (k, 2) `origins` sees, whatever the distance: CSR (k + 1,) starts and indices.

    What is behind another vertex, in line with it, counts as seen unless a wall lies between.
    """
    origins = np.ascontiguousarray(origins, dtype=float).reshape(-1, 2)
    return _visible_vertices(mesh.vertices, mesh.triangles, mesh.neighbours, *_homes(mesh, origins), origins)


def _homes(mesh: Triangulation, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles that hold each of (k, 2) points, several where it is on an edge: CSR (k + 1,) and ascending."""
    point, triangle = _tree(mesh).query(shapely.points(points))
    order = np.lexsort((triangle, point))
    point, triangle = point[order], triangle[order]
    held = _hold(mesh.vertices, mesh.triangles, triangle, points[point])
    return np.searchsorted(point[held], np.arange(len(points) + 1)), triangle[held]


@lru_cache(maxsize=4)
def _tree(mesh: Triangulation) -> shapely.STRtree:
    """Return a tree of the triangles' boxes, a little wider than `_holds` widens them."""
    corners = mesh.vertices[mesh.triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    hair = 4 * ON_EDGE * np.abs(corners).max(axis=(1, 2))[:, None]
    return shapely.STRtree(shapely.box(*(low - hair).T, *(high + hair).T))


def _discs(points: np.ndarray, radii: np.ndarray) -> np.ndarray:
    angle = np.linspace(0.0, 2 * np.pi, DISC_SIDES, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    return shapely.polygons(points[:, None] + radii[:, None, None] * circle)


@njit(cache=True)
def _cross(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@njit(cache=True)
def _holds(vertices: np.ndarray, triangle: np.ndarray, x: float, y: float) -> bool:
    """Whether the closed triangle, widened by ON_EDGE, holds the point."""
    for i in range(3):
        a, b = vertices[triangle[i]], vertices[triangle[(i + 1) % 3]]
        size = max(abs(a[0]), abs(a[1]), abs(b[0]), abs(b[1]), 1e-300)
        if _cross(a[0], a[1], b[0], b[1], x, y) < -ON_EDGE * size * (abs(b[0] - a[0]) + abs(b[1] - a[1])):
            return False
    return True


@njit(cache=True)
def _hold(vertices: np.ndarray, triangles: np.ndarray, which: np.ndarray, points: np.ndarray) -> np.ndarray:
    held = np.empty(len(which), dtype=np.bool_)
    for k in range(len(which)):
        held[k] = _holds(vertices, triangles[which[k]], points[k, 0], points[k, 1])
    return held


@njit(cache=True)
def _distance2(ax: float, ay: float, bx: float, by: float, x: float, y: float) -> float:
    """Return the squared distance of a segment from a point."""
    dx, dy = bx - ax, by - ay
    t = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)
    t = min(1.0, max(0.0, t))
    ex, ey = ax + t * dx - x, ay + t * dy - y
    return ex * ex + ey * ey


@njit(cache=True)
def _expand(
    vertices: np.ndarray,
    triangles: np.ndarray,
    neighbours: np.ndarray,
    homes: np.ndarray,
    x: float,
    y: float,
    reach: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return what is seen from (x, y), in the triangles `homes`, counter-clockwise.

    `cones` (c, 3): a triangle and the vertices right and left between which it is seen (-1, -1: wholly).
    `ends` (e, 4): the edges where the view ends, as vertices: its own right and left, and the cone's right and left;
    a row of -1 stands for the point itself, where it is on a wall and the view has a gap.
    """
    cones = np.empty((64, 3), dtype=np.int64)
    ends = np.empty((64, 4), dtype=np.int64)
    c = e = 0
    doors = np.empty(
        (64, 5), dtype=np.float64
    )  # the first edges: triangle, corner opposite, right, left, angle of the right
    d = 0
    for t in homes:
        if c == len(cones):
            cones = np.concatenate((cones, np.empty_like(cones)))
        if d + 3 > len(doors):
            doors = np.concatenate((doors, np.empty_like(doors)))
        cones[c, 0], cones[c, 1], cones[c, 2] = t, -1, -1
        c += 1
        for i in range(3):
            right, left = triangles[t, (i + 1) % 3], triangles[t, (i + 2) % 3]
            a, b = vertices[right], vertices[left]
            size = max(abs(a[0]), abs(a[1]), abs(b[0]), abs(b[1]), 1e-300)
            # A point on this edge looks along it; what is beyond, if anything, is a first triangle as well.
            if _cross(a[0], a[1], b[0], b[1], x, y) > ON_EDGE * size * (abs(b[0] - a[0]) + abs(b[1] - a[1])):
                doors[d, 0], doors[d, 1], doors[d, 2], doors[d, 3] = t, i, right, left
                doors[d, 4] = np.arctan2(a[1] - y, a[0] - x)
                d += 1
    order = np.argsort(doors[:d, 4])
    stack = np.empty((2 * len(triangles) + 64, 4), dtype=np.int64)
    reach2 = reach * reach
    for n in range(d):
        k = order[n]
        if doors[order[n - 1], 3] != doors[k, 2]:
            if e == len(ends):
                ends = np.concatenate((ends, np.empty_like(ends)))
            ends[e] = -1
            e += 1
        t, i = int(doors[k, 0]), int(doors[k, 1])
        # An entry is an edge to look through: triangle in front of it, corner opposite, the cone's right and left.
        stack[0, 0], stack[0, 1] = t, i
        stack[0, 2], stack[0, 3] = int(doors[k, 2]), int(doors[k, 3])
        top = 1
        while top:
            top -= 1
            t, i, cone_right, cone_left = stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3]
            right, left = triangles[t, (i + 1) % 3], triangles[t, (i + 2) % 3]
            a, b = vertices[right], vertices[left]
            behind = neighbours[t, i]
            if behind < 0 or _distance2(a[0], a[1], b[0], b[1], x, y) > reach2:
                if e == len(ends):
                    ends = np.concatenate((ends, np.empty_like(ends)))
                ends[e, 0], ends[e, 1], ends[e, 2], ends[e, 3] = right, left, cone_right, cone_left
                e += 1
                continue
            if c == len(cones):
                cones = np.concatenate((cones, np.empty_like(cones)))
            cones[c, 0], cones[c, 1], cones[c, 2] = behind, cone_right, cone_left
            c += 1
            j = 0
            while triangles[behind, j] == right or triangles[behind, j] == left:
                j += 1
            apex = triangles[behind, j]
            p, r, s = vertices[apex], vertices[cone_right], vertices[cone_left]
            from_right = _cross(x, y, r[0], r[1], p[0], p[1])
            from_left = _cross(x, y, s[0], s[1], p[0], p[1])
            # In `behind` the corners are, counter-clockwise, apex, left, right. The left part goes on the stack first.
            if from_left > 0.0:  # the apex is left of the cone: all is seen through the edge right of it
                stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = behind, (j + 1) % 3, cone_right, cone_left
                top += 1
            elif from_right < 0.0:
                stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = behind, (j + 2) % 3, cone_right, cone_left
                top += 1
            else:
                if from_left < 0.0:
                    stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = behind, (j + 2) % 3, apex, cone_left
                    top += 1
                if from_right > 0.0:
                    stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = behind, (j + 1) % 3, cone_right, apex
                    top += 1
    return cones[:c], ends[:e]


@njit(cache=True)
def _hit(vertices: np.ndarray, x: float, y: float, through: int, right: int, left: int) -> tuple[float, float]:
    """Return where the ray from (x, y) through a vertex meets the line of an edge."""
    if through in (right, left):
        return vertices[through, 0], vertices[through, 1]
    ax, ay = vertices[right, 0], vertices[right, 1]
    dx, dy = vertices[left, 0] - ax, vertices[left, 1] - ay
    ux, uy = vertices[through, 0] - x, vertices[through, 1] - y
    below = ux * dy - uy * dx
    if below == 0.0:
        return ax, ay
    t = ((x - ax) * uy - (y - ay) * ux) / -below
    t = min(1.0, max(0.0, t))
    return ax + t * dx, ay + t * dy


@njit(cache=True)
def _outlines(
    vertices: np.ndarray,
    triangles: np.ndarray,
    neighbours: np.ndarray,
    home_starts: np.ndarray,
    homes: np.ndarray,
    points: np.ndarray,
    reach: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the closed rings of all points one after the other, and (k,) their sizes."""
    out = np.empty((1024, 2))
    sizes = np.zeros(len(points), dtype=np.int64)
    n = 0
    for k in range(len(points)):
        x, y = points[k]
        home = homes[home_starts[k] : home_starts[k + 1]]
        _, ends = _expand(vertices, triangles, neighbours, home, x, y, reach[k])
        begin = n
        if not len(ends):
            continue
        while n + 2 * len(ends) + 1 > len(out):
            out = np.concatenate((out, np.empty_like(out)))
        for e in range(len(ends)):
            right, left, cone_right, cone_left = ends[e]
            if right < 0:
                out[n, 0], out[n, 1] = x, y
                n += 1
                continue
            ax, ay = _hit(vertices, x, y, cone_right, right, left)
            bx, by = _hit(vertices, x, y, cone_left, right, left)
            if n == begin or out[n - 1, 0] != ax or out[n - 1, 1] != ay:
                out[n, 0], out[n, 1] = ax, ay
                n += 1
            if out[n - 1, 0] != bx or out[n - 1, 1] != by:
                out[n, 0], out[n, 1] = bx, by
                n += 1
        out[n] = out[begin]
        n += 1
        sizes[k] = n - begin
    return out[:n], sizes


@njit(cache=True)
def _in_cone(vertices: np.ndarray, x: float, y: float, right: int, left: int, px: float, py: float) -> bool:
    if right < 0:
        return True
    r, s = vertices[right], vertices[left]
    return _cross(x, y, r[0], r[1], px, py) >= 0.0 and _cross(x, y, s[0], s[1], px, py) <= 0.0


@njit(cache=True)
def _visible(
    vertices: np.ndarray,
    triangles: np.ndarray,
    neighbours: np.ndarray,
    home_starts: np.ndarray,
    homes: np.ndarray,
    origins: np.ndarray,
    ranges: np.ndarray,
    points: np.ndarray,
    order: np.ndarray,
    first: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    starts = np.zeros(len(origins) + 1, dtype=np.int64)
    found = np.empty(1024, dtype=np.int64)
    seen = np.full(len(points), -1, dtype=np.int64)
    n = 0
    for k in range(len(origins)):
        x, y = origins[k]
        begin = n
        home = homes[home_starts[k] : home_starts[k + 1]]
        cones, _ = _expand(vertices, triangles, neighbours, home, x, y, ranges[k])
        for c in range(len(cones)):
            t = cones[c, 0]
            for q in order[first[t] : first[t + 1]]:
                px, py = points[q]
                if seen[q] == k or (px - x) ** 2 + (py - y) ** 2 > ranges[k] ** 2:
                    continue
                if _in_cone(vertices, x, y, cones[c, 1], cones[c, 2], px, py):
                    seen[q] = k
                    if n == len(found):
                        found = np.concatenate((found, np.empty_like(found)))
                    found[n] = q
                    n += 1
        found[begin:n] = np.sort(found[begin:n])
        starts[k + 1] = n
    return starts, found[:n]


@njit(cache=True)
def _visible_vertices(
    vertices: np.ndarray,
    triangles: np.ndarray,
    neighbours: np.ndarray,
    home_starts: np.ndarray,
    homes: np.ndarray,
    origins: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    starts = np.zeros(len(origins) + 1, dtype=np.int64)
    found = np.empty(1024, dtype=np.int64)
    seen = np.full(len(vertices), -1, dtype=np.int64)
    n = 0
    for k in range(len(origins)):
        x, y = origins[k]
        begin = n
        home = homes[home_starts[k] : home_starts[k + 1]]
        cones, _ = _expand(vertices, triangles, neighbours, home, x, y, np.inf)
        for c in range(len(cones)):
            for i in range(3):
                v = triangles[cones[c, 0], i]
                if seen[v] == k:
                    continue
                if _in_cone(vertices, x, y, cones[c, 1], cones[c, 2], vertices[v, 0], vertices[v, 1]):
                    seen[v] = k
                    if n == len(found):
                        found = np.concatenate((found, np.empty_like(found)))
                    found[n] = v
                    n += 1
        found[begin:n] = np.sort(found[begin:n])
        starts[k + 1] = n
    return starts, found[:n]
