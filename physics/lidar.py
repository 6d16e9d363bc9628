"""A two-dimensional lidar: exact ranges to the edges of the site's polygons, many scanners in one call.

The edges lie in a uniform grid; a ray walks the cells that it crosses (Amanatides & Woo 1987) and stops at the first cell
whose nearest edge it has met. Whether it meets an edge is decided by the sides on which the edge's two ends lie, which is
the same for both edges that share an end: no ray slips through a corner.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import shapely
from numba import njit
from shapely import MultiPolygon, Polygon

MOST_CELLS = 1_000_000


@dataclass(frozen=True, slots=True)
class EdgeGrid:
    """Edges by the cells that they touch. `edges` (m, 4) x, y, x, y metres; cell (row, column) of `shape` has the edges
    `members[offsets[c]:offsets[c + 1]]` with c = row * columns + column; `origin` is the grid's corner, `cell` its side,
    metres.
    """

    edges: np.ndarray
    origin: np.ndarray
    cell: float
    shape: tuple[int, int]
    offsets: np.ndarray
    members: np.ndarray


def edge_grid(polygons: Iterable[Polygon | MultiPolygon]) -> EdgeGrid:
    """Return the edges of polygons, holes too, in a grid of about two cells an edge."""
    rings = [
        shapely.get_coordinates(ring)
        for polygon in polygons
        for part in shapely.get_parts(polygon)
        for ring in (part.exterior, *part.interiors)
    ]
    edges = np.concatenate([np.hstack([r[:-1], r[1:]]) for r in rings]) if rings else np.empty((0, 4))
    if not len(edges):
        return EdgeGrid(edges, np.zeros(2), 1.0, (0, 0), np.zeros(1, np.int64), np.empty(0, np.int64))
    corners = edges.reshape(-1, 2)
    low, high = corners.min(axis=0), corners.max(axis=0)
    size = np.maximum(high - low, 1.0)
    cell = math.sqrt(size[0] * size[1] / min(max(2 * len(edges), 64), MOST_CELLS))
    origin = low - 0.01 * cell
    columns, rows = (int(n) for n in np.ceil((size + 0.02 * cell) / cell))
    offsets, members = _fill(edges, origin, cell, rows, columns)
    return EdgeGrid(edges, origin, cell, (rows, columns), offsets, members)


def cast(
    grid: EdgeGrid, poses: np.ndarray, angles: np.ndarray, reach: float, discs: np.ndarray | None = None
) -> np.ndarray:
    """Return (k, b) distances in metres from `poses` (k, 3) x, y, heading to the first thing along each beam.

    `angles` (b,) radians are counter-clockwise from the heading. Infinity: nothing within `reach` metres. `discs` (n, 3)
    x, y, radius are met too, such as other robots; a scanner inside a disc, its own, does not see it.
    """
    round_things = np.empty((0, 3)) if discs is None else np.ascontiguousarray(discs, dtype=float)
    poses, angles = np.ascontiguousarray(poses, dtype=float).reshape(-1, 3), np.ascontiguousarray(angles, dtype=float)
    rows, columns = grid.shape
    return _cast(
        grid.edges, grid.origin, grid.cell, rows, columns, grid.offsets, grid.members, poses, angles, reach, round_things
    )


def noisy(
    ranges: np.ndarray, random: np.random.Generator, *, deviation: float = 0.01, dropout: float = 0.0, reach: float = np.inf
) -> np.ndarray:
    """Return ranges as a lidar tells them: `deviation` metres of normal noise, a part `dropout` of the beams without echo.

    Echoes never lie behind the scanner; those beyond `reach` are lost.
    """
    told = np.maximum(ranges + deviation * random.standard_normal(ranges.shape), 0.0)
    lost = told > reach
    if dropout > 0:
        lost |= random.random(ranges.shape) < dropout
    return np.where(lost, np.inf, told)


def beam_angles(count: int, field_of_view: float = 2 * math.pi) -> np.ndarray:
    """Return (count,) radians from the heading, evenly over `field_of_view`, which a full circle does not close twice."""
    full = field_of_view >= 2 * math.pi - 1e-9
    return np.linspace(-field_of_view / 2, field_of_view / 2, count, endpoint=not full)


@njit(cache=True)
def _fill(edges: np.ndarray, origin: np.ndarray, cell: float, rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """Return offsets and members: each edge in every cell that it touches, a hair wider so that rounding hides none."""
    counts = np.zeros(rows * columns + 1, np.int64)
    members = np.empty(0, np.int64)
    hair = 1e-6
    for filling in range(2):
        if filling:
            members = np.empty(counts[-1], np.int64)
        cursor = counts.copy()
        for e in range(len(edges)):
            ax, ay = (edges[e, 0] - origin[0]) / cell, (edges[e, 1] - origin[1]) / cell
            bx, by = (edges[e, 2] - origin[0]) / cell, (edges[e, 3] - origin[1]) / cell
            if ax > bx:
                ax, ay, bx, by = bx, by, ax, ay
            for column in range(max(int(ax - hair), 0), min(int(bx + hair), columns - 1) + 1):
                low, high = ay, by
                if bx - ax > 1e-12:
                    low = ay + (by - ay) * (min(max(column - hair, ax), bx) - ax) / (bx - ax)
                    high = ay + (by - ay) * (min(max(column + 1 + hair, ax), bx) - ax) / (bx - ax)
                if low > high:
                    low, high = high, low
                for row in range(max(int(low - hair), 0), min(int(high + hair), rows - 1) + 1):
                    c = row * columns + column
                    if filling:
                        members[cursor[c]] = e
                        cursor[c] += 1
                    else:
                        counts[c + 1] += 1
        if not filling:
            for c in range(rows * columns):
                counts[c + 1] += counts[c]
    return counts, members


@njit(cache=True)
def _cast(
    edges: np.ndarray,
    origin: np.ndarray,
    cell: float,
    rows: int,
    columns: int,
    offsets: np.ndarray,
    members: np.ndarray,
    poses: np.ndarray,
    angles: np.ndarray,
    reach: float,
    discs: np.ndarray,
) -> np.ndarray:
    out = np.full((len(poses), len(angles)), np.inf)
    near = np.empty(len(discs), np.int64)
    for k in range(len(poses)):
        ox, oy = poses[k, 0], poses[k, 1]
        found = 0
        for n in range(len(discs)):
            away = np.hypot(discs[n, 0] - ox, discs[n, 1] - oy)
            if discs[n, 2] < away <= reach + discs[n, 2]:
                near[found] = n
                found += 1
        for b in range(len(angles)):
            angle = poses[k, 2] + angles[b]
            dx, dy = np.cos(angle), np.sin(angle)
            best = _walk(edges, origin, cell, rows, columns, offsets, members, ox, oy, dx, dy, reach)
            for n in near[:found]:
                px, py = discs[n, 0] - ox, discs[n, 1] - oy
                along, across = px * dx + py * dy, px * dy - py * dx
                if along > 0 and abs(across) < discs[n, 2]:
                    best = min(best, along - np.sqrt(discs[n, 2] ** 2 - across**2))
            if best <= reach:
                out[k, b] = best
    return out


@njit(cache=True)
def _walk(
    edges: np.ndarray,
    origin: np.ndarray,
    cell: float,
    rows: int,
    columns: int,
    offsets: np.ndarray,
    members: np.ndarray,
    ox: float,
    oy: float,
    dx: float,
    dy: float,
    reach: float,
) -> float:
    """Return the distance to the first edge along a ray, or infinity."""
    # The part of the ray within the grid, in metres along it.
    enter, leave = 0.0, reach
    for start, step, size in ((ox - origin[0], dx, columns * cell), (oy - origin[1], dy, rows * cell)):
        if abs(step) < 1e-300:
            if start < 0 or start > size:
                return np.inf
            continue
        near, far = -start / step, (size - start) / step
        if near > far:
            near, far = far, near
        enter, leave = max(enter, near), min(leave, far)
    if enter > leave or rows * columns == 0:
        return np.inf
    column = min(max(int((ox + enter * dx - origin[0]) / cell), 0), columns - 1)
    row = min(max(int((oy + enter * dy - origin[1]) / cell), 0), rows - 1)
    step_column, step_row = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
    next_x = np.inf if abs(dx) < 1e-300 else (origin[0] + (column + (dx > 0)) * cell - ox) / dx
    next_y = np.inf if abs(dy) < 1e-300 else (origin[1] + (row + (dy > 0)) * cell - oy) / dy
    every_x = np.inf if abs(dx) < 1e-300 else cell / abs(dx)
    every_y = np.inf if abs(dy) < 1e-300 else cell / abs(dy)
    best = np.inf
    while True:
        c = row * columns + column
        for m in range(offsets[c], offsets[c + 1]):
            best = min(best, _meet(edges, members[m], ox, oy, dx, dy))
        passed = min(next_x, next_y)
        if best <= passed - 1e-9 or passed > leave + cell * 1e-6:
            return best
        if next_x < next_y:
            column += step_column
            next_x += every_x
        else:
            row += step_row
            next_y += every_y
        if column < 0 or row < 0 or column >= columns or row >= rows:
            return best


@njit(cache=True)
def _meet(edges: np.ndarray, e: int, ox: float, oy: float, dx: float, dy: float) -> float:
    ax, ay, bx, by = edges[e, 0] - ox, edges[e, 1] - oy, edges[e, 2] - ox, edges[e, 3] - oy
    side_a, side_b = dx * ay - dy * ax, dx * by - dy * bx
    if (side_a > 0 and side_b > 0) or (side_a < 0 and side_b < 0):
        return np.inf
    far_a, far_b = dx * ax + dy * ay, dx * bx + dy * by
    if side_a == side_b:  # the ray runs along the edge
        if far_a < 0 and far_b < 0:
            return np.inf
        return max(min(far_a, far_b), 0.0)
    far = far_a + (far_b - far_a) * side_a / (side_a - side_b)
    return far if far >= 0 else np.inf
