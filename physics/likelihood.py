"""The likelihood field of a site: how well the end of a lidar beam fits the map (Thrun, Burgard & Fox 2005, section 6.4).

The field holds signed distances to the nearest edge, exact at its nodes: negative inside an obstacle, so that interpolation
between nodes stays exact across a straight wall, where unsigned distances have a kink.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numba import njit
from shapely import MultiPolygon, Polygon

from quarterdeck.physics.lidar import edge_grid

FAR = 2.0  # m: further from any edge, all ends of beams are equally unlikely
MOST_NODES = 4_000_000


@dataclass(frozen=True, slots=True)
class DistanceField:
    """Signed distances to the nearest edge, at most FAR metres. `values` (rows, columns) float32; node (i, j) stands at
    `origin` + `spacing` * (j, i), metres.
    """

    values: np.ndarray
    origin: np.ndarray
    spacing: float

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """West, south, east and north in metres."""
        rows, columns = self.values.shape
        x, y = self.origin.tolist()
        return x, y, x + (columns - 1) * self.spacing, y + (rows - 1) * self.spacing


def distance_field(
    polygons: Sequence[Polygon | MultiPolygon], bounds: tuple[float, float, float, float], spacing: float = 0.1
) -> DistanceField:
    """Return the field of solid polygons over `bounds` (west, south, east, north), FAR wider on every side.

    Nodes are `spacing` metres apart, further where the site is so large that there would be more than MOST_NODES.
    """
    west, south, east, north = bounds
    width, height = east - west + 2 * FAR, north - south + 2 * FAR
    spacing = max(spacing, math.sqrt(width * height / MOST_NODES))
    rows, columns = math.ceil(height / spacing) + 1, math.ceil(width / spacing) + 1
    origin = np.array([west - FAR, south - FAR])
    values = np.full((rows, columns), FAR, np.float32)
    edges = edge_grid(shapely.get_parts(shapely.union_all(list(polygons))).tolist()).edges
    _spread(values, origin, spacing, edges)
    _negate_inside(values, origin, spacing, edges)
    return DistanceField(values, origin, spacing)


def spread_beams(count: int, beams: int) -> np.ndarray:
    """Return the indices of at most `beams` of `count` beams, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(beams, count)).round().astype(int))


@njit(cache=True)
def distance_at(values: np.ndarray, origin: np.ndarray, spacing: float, x: float, y: float) -> float:
    """Return the signed distance at a place, FAR outside the field."""
    u, v = (x - origin[0]) / spacing, (y - origin[1]) / spacing
    if not (0 <= u < values.shape[1] - 1 and 0 <= v < values.shape[0] - 1):
        return FAR
    j, i = int(u), int(v)
    u -= j
    v -= i
    return (values[i, j] * (1 - u) + values[i, j + 1] * u) * (1 - v) + (
        values[i + 1, j] * (1 - u) + values[i + 1, j + 1] * u
    ) * v


@njit(cache=True)
def log_likelihoods(
    values: np.ndarray,
    origin: np.ndarray,
    spacing: float,
    poses: np.ndarray,
    angles: np.ndarray,
    ranges: np.ndarray,
    deviation: float,
    random_part: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the log likelihood of a scan at each pose (n,), and the mean likelihood of a beam (n,).

    `poses` (n, 3); `angles`, `ranges` (b,), infinite ones are left out; `deviation` metres of a hit, `random_part` of the
    beams end anywhere. A hit on the edge itself has likelihood 1.
    """
    total, mean = np.zeros(len(poses)), np.zeros(len(poses))
    hits = np.flatnonzero(np.isfinite(ranges))
    x, y = np.empty(len(hits)), np.empty(len(hits))
    for b in range(len(hits)):
        x[b], y[b] = ranges[hits[b]] * np.cos(angles[hits[b]]), ranges[hits[b]] * np.sin(angles[hits[b]])
    narrow = -0.5 / deviation**2
    for n in range(len(poses)):
        cos, sin = np.cos(poses[n, 2]), np.sin(poses[n, 2])
        for b in range(len(hits)):
            d = distance_at(
                values,
                origin,
                spacing,
                poses[n, 0] + cos * x[b] - sin * y[b],
                poses[n, 1] + sin * x[b] + cos * y[b],
            )
            p = (1 - random_part) * np.exp(narrow * d * d) + random_part
            total[n] += np.log(p)
            mean[n] += p
        if len(hits):
            mean[n] /= len(hits)
    return total, mean


@njit(cache=True)
def scan_information(
    values: np.ndarray,
    origin: np.ndarray,
    spacing: float,
    pose: np.ndarray,
    angles: np.ndarray,
    ranges: np.ndarray,
    deviation: float,
) -> np.ndarray:
    """Return the (3, 3) Fisher information on x, y and heading of a scan at `pose` (3,), from the walls that it meets.

    Beams that end far from any wall of the map tell nothing.
    """
    out = np.zeros((3, 3))
    row = np.empty(3)
    for b in range(len(ranges)):
        if not np.isfinite(ranges[b]):
            continue
        dx, dy = ranges[b] * np.cos(pose[2] + angles[b]), ranges[b] * np.sin(pose[2] + angles[b])
        x, y = pose[0] + dx, pose[1] + dy
        if abs(distance_at(values, origin, spacing, x, y)) > 4 * deviation:
            continue
        row[0] = distance_at(values, origin, spacing, x + spacing, y) - distance_at(values, origin, spacing, x - spacing, y)
        row[1] = distance_at(values, origin, spacing, x, y + spacing) - distance_at(values, origin, spacing, x, y - spacing)
        size = np.hypot(row[0], row[1])
        if size < 1e-9:
            continue
        row[0] /= size
        row[1] /= size
        row[2] = row[1] * dx - row[0] * dy
        for i in range(3):
            for j in range(3):
                out[i, j] += row[i] * row[j] / deviation**2
    return out


@njit(cache=True)
def _spread(values: np.ndarray, origin: np.ndarray, spacing: float, edges: np.ndarray) -> None:
    """Lower every node within FAR of an edge to its distance from it."""
    rows, columns = values.shape
    for e in range(len(edges)):
        ax, ay, bx, by = edges[e]
        dx, dy = bx - ax, by - ay
        square = dx * dx + dy * dy
        for i in range(
            max(int((min(ay, by) - FAR - origin[1]) / spacing), 0),
            min(int((max(ay, by) + FAR - origin[1]) / spacing) + 1, rows - 1) + 1,
        ):
            y = origin[1] + i * spacing
            for j in range(
                max(int((min(ax, bx) - FAR - origin[0]) / spacing), 0),
                min(int((max(ax, bx) + FAR - origin[0]) / spacing) + 1, columns - 1) + 1,
            ):
                x = origin[0] + j * spacing
                s = 0.0
                if square > 0:
                    s = min(max(((x - ax) * dx + (y - ay) * dy) / square, 0.0), 1.0)
                d = np.hypot(x - ax - s * dx, y - ay - s * dy)
                if d < values[i, j]:
                    values[i, j] = d


@njit(cache=True)
def _negate_inside(values: np.ndarray, origin: np.ndarray, spacing: float, edges: np.ndarray) -> None:
    """Negate every node with an odd number of edges to its west."""
    rows, columns = values.shape
    odd = np.zeros((rows, columns + 1), np.bool_)
    for e in range(len(edges)):
        ax, ay, bx, by = edges[e]
        if ay > by:
            ax, ay, bx, by = bx, by, ax, ay
        for i in range(max(int((ay - origin[1]) / spacing), 0), min(int((by - origin[1]) / spacing) + 1, rows - 1) + 1):
            y = origin[1] + i * spacing
            if ay <= y < by:
                x = ax + (bx - ax) * (y - ay) / (by - ay)
                j = int(np.ceil((x - origin[0]) / spacing))
                odd[i, min(max(j, 0), columns)] ^= True
    for i in range(rows):
        inside = False
        for j in range(columns):
            inside ^= odd[i, j]
            if inside:
                values[i, j] = -values[i, j]
