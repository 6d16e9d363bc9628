"""Growing closed tracks outwards into the strips that they leave uncovered.

A closed track can be changed in two ways that keep it closed. A *bulge* pushes a straight piece sideways: its ends run out,
and the piece lies farther out. A *spur* leaves a vertex, goes straight and comes back. Of all that reach what is uncovered
the best per metre is taken, again and again; what is uncovered is then found anew, exactly, until nothing pays.
Lengths are in path cells: tracks are 1 apart and cover 0.5 to each side.
"""

import heapq
from collections.abc import Sequence

import numba as nb
import numpy as np
import shapely
from shapely import MultiPolygon

from quarterdeck.coverage.metrics import swath, track_length, uncovered
from quarterdeck.geo.grid import area_edges
from quarterdeck.geo.scanline import crossings
from quarterdeck.geo.scenario import as_multipolygon

PITCH = 0.05  # between the points that stand for what is uncovered
DEPTH = 1.6  # how far a bulge or spur reaches at once; a later round goes on from there
ROUNDS = 8
MANY = 5000.0  # path cells uncovered; of more, only those near the tracks are looked at


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
    bounds = np.array(shapely.total_bounds([space, wanted]))
    low = np.floor(bounds[:2]) - 2.0
    columns, rows = (int(n) for n in np.ceil(bounds[2:]) + 2.0 - low)
    walls = _bucket_edges(area_edges(space, 1.0) - np.tile(low, 2), rows, columns)
    bounded = bool(np.isfinite(most_per_area))
    kept, rest, budget = paths, None, np.inf
    for _ in range(ROUNDS + 1):
        closed = [np.vstack([p, p[:1]]) for p in paths]
        bare = uncovered(closed, wanted, 1.0)
        left = most_per_area * (wanted.area - bare.area) - sum(track_length(t) for t in closed) if bounded else np.inf
        if left >= 0.0 or rest is None:
            kept, rest, budget = paths, bare, left
        else:  # changes that are close to each other covered less than foreseen: take fewer
            least *= 1.5
        near = rest if rest.area < MANY else as_multipolygon(rest.intersection(swath(closed, 2.0 * DEPTH + 2.0)))
        points = _points(near, low)
        changes = _choose(kept, points, low, (rows, columns), walls, least, turn_cost, budget, most_per_area)
        if not any(changes):
            return kept
        paths = [_changed(p, c) for p, c in zip(kept, changes, strict=True)]
    return kept


def _choose(
    paths: list[np.ndarray],
    points: np.ndarray,
    low: np.ndarray,
    shape: tuple[int, int],
    walls: tuple[np.ndarray, np.ndarray],
    least: float,
    turn_cost: float,
    budget: float,
    most_per_area: float,
) -> list[dict[tuple[int, bool], np.ndarray]]:
    """Return for each path {(vertex, is a bulge): new vertices after it}, chosen greedily by what they cover per length."""
    vertex = np.concatenate(paths) - low
    sizes = [len(p) for p in paths]
    first = np.repeat(np.cumsum([0, *sizes[:-1]]), sizes)
    place = np.arange(len(vertex))
    after = np.where(place + 1 < first + np.repeat(sizes, sizes), place + 1, first)
    before = np.empty_like(after)
    before[after] = place
    points, bucket = _bucket_points(points - low, *shape)
    alive = np.ones(len(points), np.bool_)
    at, bulge, lines, length, cost, loss = _candidates(
        vertex, before, after, points, bucket, alive, shape[1], *walls, least, turn_cost
    )
    gain = np.array([_cover(line, points, bucket, shape[1], alive, False) for line in lines]) * PITCH**2 - loss
    heap = [(-gain[n] / cost[n], n, 0) for n in range(len(at)) if gain[n] >= least * cost[n]]
    heapq.heapify(heap)
    bent = np.zeros(len(vertex), bool)  # vertices, and pieces after them, that a change has used
    pushed = np.zeros(len(vertex), bool)
    changes: list[dict[tuple[int, bool], np.ndarray]] = [{} for _ in paths]
    owner = np.repeat(np.arange(len(paths)), sizes)
    taken = 0
    while heap:
        value, n, seen = heapq.heappop(heap)
        i = at[n]
        j = after[i]
        if bent[i] or (bulge[n] and (bent[j] or pushed[i] or pushed[before[i]] or pushed[j])):
            continue
        if seen < taken:
            fresh = _cover(lines[n], points, bucket, shape[1], alive, False) * PITCH**2 - loss[n]
            if fresh >= least * cost[n]:
                heapq.heappush(heap, (-fresh / cost[n], n, taken))
            continue
        if length[n] + value * cost[n] * most_per_area > budget:
            continue
        budget -= length[n] + value * cost[n] * most_per_area if np.isfinite(budget) else 0.0
        _cover(lines[n], points, bucket, shape[1], alive, True)
        taken += 1
        bent[i] = True
        if bulge[n]:
            bent[j] = pushed[i] = True
        changes[owner[i]][int(i - first[i]), bool(bulge[n])] = lines[n, 1:3] + low
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
    return _fill(first, x) * PITCH + low


@nb.njit(cache=True)
def _fill(first, x):  # type: ignore[no-untyped-def]
    count = 0
    for at in range(0, len(x) - 1, 2):
        count += max(0, int(np.ceil(x[at + 1] - 0.5)) - int(np.ceil(x[at] - 0.5)))
    points = np.empty((count, 2))
    count = 0
    for i in range(len(first) - 1):
        for at in range(first[i], first[i + 1] - 1, 2):
            for j in range(int(np.ceil(x[at] - 0.5)), int(np.ceil(x[at + 1] - 0.5))):
                points[count] = (j + 0.5, i + 0.5)
                count += 1
    return points[:count]


@nb.njit(cache=True)
def _bucket_points(points, rows, columns):  # type: ignore[no-untyped-def]
    """Return the points sorted by unit cell, and (rows * columns + 1,) where each cell's begin."""
    key = np.empty(len(points), np.int64)
    for n in range(len(points)):
        key[n] = int(points[n, 1]) * columns + int(points[n, 0])
    bucket = np.zeros(rows * columns + 1, np.int64)
    for k in key:
        bucket[k + 1] += 1
    bucket = np.cumsum(bucket)
    return points[np.argsort(key, kind="mergesort")], bucket


@nb.njit(cache=True)
def _bucket_edges(edges, rows, columns):  # type: ignore[no-untyped-def]
    """Return the edges that touch each unit cell, cell after cell, and (rows * columns + 1,) where each cell's begin."""
    bucket = np.zeros(rows * columns + 1, np.int64)
    filled = bucket
    touching = np.empty((0, 4))
    for put in (False, True):
        if put:
            bucket = np.cumsum(bucket)
            filled = bucket.copy()
            touching = np.empty((bucket[-1], 4))
        for e in range(len(edges)):
            x0, y0, x1, y1 = edges[e]
            for r in range(int(np.floor(min(y0, y1))), int(np.floor(max(y0, y1))) + 1):
                a, b = x0, x1
                if y0 != y1:
                    a = x0 + (min(max(r, min(y0, y1)), max(y0, y1)) - y0) * (x1 - x0) / (y1 - y0)
                    b = x0 + (min(max(r + 1, min(y0, y1)), max(y0, y1)) - y0) * (x1 - x0) / (y1 - y0)
                for c in range(int(np.floor(min(a, b) - 1e-9)), int(np.floor(max(a, b) + 1e-9)) + 1):
                    if put:
                        touching[filled[r * columns + c]] = edges[e]
                        filled[r * columns + c] += 1
                    else:
                        bucket[r * columns + c + 1] += 1
    return touching, bucket


@nb.njit(cache=True)
def _cover(line, points, bucket, columns, alive, take):  # type: ignore[no-untyped-def]
    """Return how many of the points still alive are within 0.5 of the (4, 2) polyline; `take` their lives if told to."""
    count = 0
    rows = (len(bucket) - 1) // columns
    r0, r1 = int(line[:, 1].min() - 0.5), int(line[:, 1].max() + 0.5)
    c0, c1 = int(line[:, 0].min() - 0.5), int(line[:, 0].max() + 0.5)
    for r in range(max(r0, 0), min(r1, rows - 1) + 1):
        for n in range(bucket[r * columns + max(c0, 0)], bucket[r * columns + min(c1, columns - 1) + 1]):
            if alive[n]:
                for s in range(3):
                    x, y = points[n, 0] - line[s, 0], points[n, 1] - line[s, 1]
                    dx, dy = line[s + 1, 0] - line[s, 0], line[s + 1, 1] - line[s, 1]
                    size = dx * dx + dy * dy
                    t = min(1.0, max(0.0, (x * dx + y * dy) / size)) if size > 0.0 else 0.0
                    if (x - t * dx) ** 2 + (y - t * dy) ** 2 <= 0.25:
                        count += 1
                        if take:
                            alive[n] = False
                        break
    return count


@nb.njit(cache=True)
def _reach(x, y, dx, dy, limit, walls, bucket, columns):  # type: ignore[no-untyped-def]
    """Return how far one gets from (x, y) in the unit direction (dx, dy) before a wall, at most `limit`."""
    best = limit
    for r in range(int(min(y, y + dy * limit)), int(max(y, y + dy * limit)) + 1):
        for c in range(int(min(x, x + dx * limit)), int(max(x, x + dx * limit)) + 1):
            for e in range(bucket[r * columns + c], bucket[r * columns + c + 1]):
                ax, ay = walls[e, 0] - x, walls[e, 1] - y
                ex, ey = walls[e, 2] - walls[e, 0], walls[e, 3] - walls[e, 1]
                turn = dx * ey - dy * ex
                if turn != 0.0:
                    along, across = (ax * ey - ay * ex) / turn, (ax * dy - ay * dx) / turn
                    if 0.0 <= along < best and -1e-12 <= across <= 1.0 + 1e-12:
                        best = along
    return best


@nb.njit(cache=True)
def _turns(a, b, c):  # type: ignore[no-untyped-def]
    """Return 1 if the path a, b, c changes direction at b, else 0."""
    ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], c[0] - b[0], c[1] - b[1]
    return 0 if abs(ux * vy - uy * vx) < 1e-9 and ux * vx + uy * vy >= 0.0 else 1


@nb.njit(cache=True)
def _bared(half, side):  # type: ignore[no-untyped-def]
    """Return what half a piece that is pushed away bares on its far side; `side` is -1 if the track comes from there."""
    if side < -0.5:
        return max(half - 0.5, 0.0) * 0.5
    m = min(half, 0.5)
    return half * 0.5 - 0.5 * (m * np.sqrt(max(0.25 - m * m, 0.0)) + 0.25 * np.arcsin(2.0 * m))


@nb.njit(cache=True)
def _candidates(vertex, before, after, points, bucket, alive, columns, walls, wall_bucket, least, turn_cost):  # type: ignore[no-untyped-def]
    """Return vertex, kind, (n, 4, 2) line, added length, cost with turns and what is bared of all changes worth a look."""
    at, bulge, lines = [0][:0], [False][:0], [np.zeros((4, 2))][:0]
    length, cost, loss = [0.0][:0], [0.0][:0], [0.0][:0]
    diagonal = np.sqrt(0.5)
    cuts = (0.001, 0.2, 0.35, 0.5)  # short of the wall: 0.001, since a ray from a wall might miss it
    rows = (len(bucket) - 1) // columns
    line = np.empty((4, 2))
    for i in range(len(vertex)):
        p = vertex[i]
        near = 0
        for r in range(max(int(p[1]) - 2, 0), min(int(p[1]) + 3, rows)):
            near += bucket[r * columns + min(int(p[0]) + 3, columns)] - bucket[r * columns + max(int(p[0]) - 2, 0)]
        if near == 0:
            continue
        q, o, z = vertex[after[i]], vertex[before[i]], vertex[after[after[i]]]
        step = np.hypot(q[0] - p[0], q[1] - p[1])
        straight = _turns(o, p, q)
        if 0.3 < step < 1.7:
            hx, hy = (q[0] - p[0]) / step, (q[1] - p[1]) / step
            for side in (1.0, -1.0):
                nx, ny = -side * hy, side * hx
                from_p, from_q = (o[0] - p[0]) * nx + (o[1] - p[1]) * ny, (z[0] - q[0]) * nx + (z[1] - q[1]) * ny
                if from_p > 1e-6 or from_q > 1e-6:
                    continue  # it would run back along the track
                bare = _bared(step / 2.0, from_p) + _bared(step / 2.0, from_q)
                deep_p = _reach(p[0], p[1], nx, ny, DEPTH, walls, wall_bucket, columns)
                deep_q = _reach(q[0], q[1], nx, ny, DEPTH, walls, wall_bucket, columns)
                for level in (False, True):
                    for cut in cuts:
                        a, b = deep_p - cut, deep_q - cut
                        if level:
                            a = b = min(a, b)
                        if a < 0.02 or b < 0.02:
                            continue
                        line[0], line[3] = p, q
                        line[1, 0], line[1, 1] = p[0] + nx * a, p[1] + ny * a
                        line[2, 0], line[2, 1] = q[0] + nx * b, q[1] + ny * b
                        vx, vy = line[2, 0] - line[1, 0], line[2, 1] - line[1, 1]
                        outer = np.hypot(vx, vy)
                        if (
                            _reach(line[1, 0], line[1, 1], vx / outer, vy / outer, outer, walls, wall_bucket, columns)
                            < outer
                        ):
                            continue
                        added = a + b + outer - step
                        turns = _turns(o, p, line[1]) + _turns(p, line[1], line[2]) + _turns(line[1], line[2], q)
                        turns += _turns(line[2], q, z) - straight - _turns(p, q, z)
                        price = max(added + turn_cost * turns, 1e-6)
                        if _cover(line, points, bucket, columns, alive, False) * PITCH**2 - bare >= least * price:
                            at.append(i)
                            bulge.append(True)
                            lines.append(line.copy())
                            length.append(added)
                            cost.append(price)
                            loss.append(bare)
        for k in range(8):
            dx, dy = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[k % 4]
            if k >= 4:
                dx, dy = diagonal * (dx - dy), diagonal * (dx + dy)
            deep = _reach(p[0], p[1], dx, dy, DEPTH, walls, wall_bucket, columns)
            for cut in cuts:
                a = deep - cut
                if a < 0.02:
                    continue
                line[0] = p
                line[1, 0], line[1, 1] = p[0] + dx * a, p[1] + dy * a
                line[2], line[3] = p, p
                turns = _turns(o, p, line[1]) + 1 + _turns(line[1], p, q) - straight
                price = max(2.0 * a + turn_cost * turns, 1e-6)
                if _cover(line, points, bucket, columns, alive, False) * PITCH**2 >= least * price:
                    at.append(i)
                    bulge.append(False)
                    lines.append(line.copy())
                    length.append(2.0 * a)
                    cost.append(price)
                    loss.append(0.0)
    stacked = np.empty((len(lines), 4, 2))
    for n in range(len(lines)):
        stacked[n] = lines[n]
    return np.array(at), np.array(bulge), stacked, np.array(length), np.array(cost), np.array(loss)
