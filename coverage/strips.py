"""Growing closed tracks outwards into the strips that they leave uncovered.

A closed track can be changed in two ways that keep it closed. A *bulge* pushes a straight piece sideways: its ends run out,
and the piece lies farther out. A *spur* leaves a vertex, goes straight and comes back. Of all that reach what is uncovered
the best per metre is taken, again and again; what is uncovered is then found anew, exactly, until nothing pays.
Lengths are in path cells: tracks are 1 apart and cover 0.5 to each side.
"""

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import MultiPolygon

from quarterdeck.coverage.metrics import swath, track_length, uncovered
from quarterdeck.coverage.strip_kernels import (
    DEPTH,
    PITCH,
    bucket_edges,
    bucket_points,
    candidates,
    cover,
    fill,
    polish,
)
from quarterdeck.geo.deadline import time_is_up
from quarterdeck.geo.grid import area_edges
from quarterdeck.geo.scanline import crossings
from quarterdeck.geo.scenario import as_multipolygon

ROUNDS = 8
LONG = 5000.0  # path cells of border
BAND = 1.5  # path cells from a border that vertices are moved
MANY = 5000.0  # path cells uncovered; of more, only those near the tracks are looked at


@dataclass(frozen=True, slots=True)
class _Lattice:
    """The unit cells that points and walls are sorted into: the lowest corner, rows, columns, and the walls."""

    low: np.ndarray
    rows: int
    columns: int
    walls: tuple[np.ndarray, np.ndarray]


def _lattice(space: MultiPolygon, wanted: MultiPolygon) -> _Lattice:
    bounds = np.array(shapely.total_bounds([space, wanted]))
    low = np.floor(bounds[:2]) - 2.0
    columns, rows = (int(n) for n in np.ceil(bounds[2:]) + 2.0 - low)
    return _Lattice(low, rows, columns, bucket_edges(area_edges(space, 1.0) - np.tile(low, 2), rows, columns))


def grow(
    paths: Sequence[np.ndarray],
    space: MultiPolygon,
    wanted: MultiPolygon,
    *,
    least: float,
    turn_cost: float,
    most_per_area: float = np.inf,
) -> list[np.ndarray]:
    """Return closed `paths`, (n, 2) vertices without the first repeated, grown inside `space` to cover more of `wanted`.

    A change is made while it covers at least `least` path cells per path cell of length, `turn_cost` added for each turn,
    and the length of all paths stays within `most_per_area` times the area that they cover.
    """
    paths = [np.asarray(p, dtype=float) for p in paths]
    lattice = _lattice(space, wanted)
    bounded = bool(np.isfinite(most_per_area))
    kept, rest, budget = paths, None, np.inf
    for _ in range(ROUNDS + 1):
        if time_is_up("the growth of tracks to the edges"):
            break
        closed = [np.vstack([p, p[:1]]) for p in paths]
        bare = uncovered(closed, wanted, 1.0)
        left = most_per_area * (wanted.area - bare.area) - sum(track_length(t) for t in closed) if bounded else np.inf
        if left >= 0.0 or rest is None:
            kept, rest, budget = paths, bare, left
        else:  # changes that are close to each other covered less than foreseen: take fewer
            least *= 1.5
        near = rest if rest.area < MANY else as_multipolygon(rest.intersection(swath(closed, 2.0 * DEPTH + 2.0)))
        points = _points(near, lattice.low)
        changes = _choose(kept, points, lattice, least, turn_cost, budget, most_per_area)
        if not any(changes):
            return kept
        paths = [_changed(p, c) for p, c in zip(kept, changes, strict=True)]
    return kept


def polished(
    paths: Sequence[np.ndarray], space: MultiPolygon, wanted: MultiPolygon, *, price: float, turn_cost: float
) -> list[np.ndarray]:
    """Return closed `paths`, as of `grow`, their vertices near borders moved while it covers more or is shorter.

    A path cell of length is worth `price` path cells of area. The first vertex of a path stays. Sites whose borders are
    longer than `LONG` path cells stay as they are.
    """
    paths = [np.asarray(p, dtype=float) for p in paths]
    if shapely.length(wanted) > LONG:
        return paths
    lattice = _lattice(space, wanted)
    band = as_multipolygon(wanted.difference(wanted.buffer(-BAND - 2.5)))
    points, bucket = bucket_points(_points(band, lattice.low) - lattice.low, lattice.rows, lattice.columns)
    vertex, before, after, first, _ = _joined(paths, lattice.low)
    shapely.prepare(wanted.boundary)
    movable = shapely.dwithin(wanted.boundary, shapely.points(vertex + lattice.low), BAND)
    movable[first] = False
    polish(vertex, before, after, movable, points, bucket, lattice.columns, *lattice.walls, price, turn_cost)
    moved = np.split(vertex + lattice.low, np.cumsum([len(p) for p in paths])[:-1])
    return [p[np.append(True, (np.abs(np.diff(p, axis=0)) > 1e-9).any(axis=1))] for p in moved]


def _joined(
    paths: Sequence[np.ndarray], low: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return all vertices less `low`, the indices of those before and after each, of its path's first, and of its path."""
    sizes = np.array([len(p) for p in paths])
    owner = np.repeat(np.arange(len(paths)), sizes)
    first = np.concatenate([[0], np.cumsum(sizes)[:-1]])[owner]
    place = np.arange(len(owner))
    after = np.where(place + 1 < first + sizes[owner], place + 1, first)
    before = np.empty_like(after)
    before[after] = place
    return np.concatenate(paths) - low, before, after, first, owner


def _choose(
    paths: list[np.ndarray],
    points: np.ndarray,
    lattice: _Lattice,
    least: float,
    turn_cost: float,
    budget: float,
    most_per_area: float,
) -> list[dict[tuple[int, bool], np.ndarray]]:
    """Return for each path {(vertex, is a bulge): new vertices after it}, chosen greedily by what they cover per length."""
    columns = lattice.columns
    vertex, before, after, first, owner = _joined(paths, lattice.low)
    points, bucket = bucket_points(points - lattice.low, lattice.rows, columns)
    alive = np.ones(len(points), np.bool_)
    at, bulge, lines, length, cost, loss = candidates(
        vertex, before, after, points, bucket, alive, columns, *lattice.walls, least, turn_cost
    )
    gain = np.array([cover(line, points, bucket, columns, alive, False) for line in lines]) * PITCH**2 - loss
    heap = [(-gain[n] / cost[n], n, 0) for n in range(len(at)) if gain[n] >= least * cost[n]]
    heapq.heapify(heap)
    bent = np.zeros(len(vertex), bool)  # vertices, and pieces after them, that a change has used
    pushed = np.zeros(len(vertex), bool)
    changes: list[dict[tuple[int, bool], np.ndarray]] = [{} for _ in paths]
    taken = 0
    while heap:
        value, n, seen = heapq.heappop(heap)
        i = at[n]
        j = after[i]
        if bent[i] or (bulge[n] and (bent[j] or pushed[i] or pushed[before[i]] or pushed[j])):
            continue
        if seen < taken:
            fresh = cover(lines[n], points, bucket, columns, alive, False) * PITCH**2 - loss[n]
            if fresh >= least * cost[n]:
                heapq.heappush(heap, (-fresh / cost[n], n, taken))
            continue
        if length[n] + value * cost[n] * most_per_area > budget:
            continue
        budget -= length[n] + value * cost[n] * most_per_area if np.isfinite(budget) else 0.0
        cover(lines[n], points, bucket, columns, alive, True)
        taken += 1
        bent[i] = True
        if bulge[n]:
            bent[j] = pushed[i] = True
        changes[owner[i]][int(i - first[i]), bool(bulge[n])] = lines[n, 1:3] + lattice.low
    return changes


def _changed(path: np.ndarray, changes: dict[tuple[int, bool], np.ndarray]) -> np.ndarray:
    """Return a path with its changes: a spur comes back to its vertex, a bulge runs on to the next."""
    parts, done = [], 0
    for (i, is_bulge), new in sorted(changes.items()):
        parts += [path[done : i + 1], new if is_bulge else np.vstack([new[:1], path[i : i + 1]])]
        done = i + 1
    return np.vstack([*parts, path[done:]])


def _points(rest: shapely.Geometry, low: np.ndarray) -> np.ndarray:
    """Return (n, 2) points `PITCH` apart that fill `rest`."""
    rings = shapely.get_rings(shapely.get_parts(rest))
    if not len(rings):
        return np.zeros((0, 2))
    coordinates, ring = shapely.get_coordinates(rings, return_index=True)
    edges = np.hstack([coordinates[:-1], coordinates[1:]])[ring[1:] == ring[:-1]]
    edges = (edges - np.tile(low, 2)) / PITCH
    first, x = crossings(edges, int(np.ceil(edges[:, 1::2].max())))
    return fill(first, x) * PITCH + low
