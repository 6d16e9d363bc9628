"""The kernels of `coverage.strips`: what is uncovered stands as points, borders as edges, both sorted into unit cells.

All is in path cells, with coordinates not below 0. They stay in one file: numba's cache does not see a change in another.
"""

import numba as nb
import numpy as np

PITCH = 0.05  # between the points that stand for an area
DEPTH = 1.6  # how far a bulge or spur reaches at once; a later round goes on from there


@nb.njit(cache=True)
def fill(first, x):  # type: ignore[no-untyped-def]
    """Return the (n, 2) points j + 0.5, i + 0.5 inside the stretches that `crossings` found."""
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
def bucket_points(points, rows, columns):  # type: ignore[no-untyped-def]
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
def bucket_edges(edges, rows, columns):  # type: ignore[no-untyped-def]
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
def cover(line, points, bucket, columns, alive, take):  # type: ignore[no-untyped-def]
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
def candidates(vertex, before, after, points, bucket, alive, columns, walls, wall_bucket, least, turn_cost):  # type: ignore[no-untyped-def]
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
                        if cover(line, points, bucket, columns, alive, np.bool_(False)) * PITCH**2 - bare >= least * price:
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
                if cover(line, points, bucket, columns, alive, np.bool_(False)) * PITCH**2 >= least * price:
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


@nb.njit(cache=True)
def _near(x, y, a, b):  # type: ignore[no-untyped-def]
    """Return 1 if (x, y) is within 0.5 of the piece from a to b, else 0."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    size = dx * dx + dy * dy
    t = min(1.0, max(0.0, ((x - a[0]) * dx + (y - a[1]) * dy) / size)) if size > 0.0 else 0.0
    return 1 if (x - a[0] - t * dx) ** 2 + (y - a[1] - t * dy) ** 2 <= 0.25 else 0


@nb.njit(cache=True)
def _clear(a, b, walls, wall_bucket, columns):  # type: ignore[no-untyped-def]
    """Whether nothing is in the way from a to b, seen from both ends, and neither end touches a wall."""
    size = np.hypot(b[0] - a[0], b[1] - a[1])
    if size < 1e-9:
        return True
    dx, dy = (b[0] - a[0]) / size, (b[1] - a[1]) / size
    far = size + 1e-4
    return (
        _reach(a[0], a[1], dx, dy, far, walls, wall_bucket, columns) == far
        and _reach(b[0], b[1], -dx, -dy, far, walls, wall_bucket, columns) == far
    )


@nb.njit(cache=True)
def polish(vertex, before, after, movable, points, bucket, columns, walls, wall_bucket, price, turn_cost):  # type: ignore[no-untyped-def]
    """Move the `movable` of the (n, 2) vertices, in place, while it covers more or is shorter.

    A path cell of length is worth `price` path cells of area, a turn `turn_cost` of length. The points must stand for all
    that the pieces at movable vertices, at most 1.7 long, could cover.
    """
    rows = (len(bucket) - 1) // columns
    count = np.zeros(len(points), np.int32)  # pieces that cover each point
    for i in range(len(vertex)):
        a, b = vertex[i], vertex[after[i]]
        for r in range(max(int(min(a[1], b[1]) - 0.5), 0), min(int(max(a[1], b[1]) + 0.5), rows - 1) + 1):
            c0, c1 = max(int(min(a[0], b[0]) - 0.5), 0), min(int(max(a[0], b[0]) + 0.5), columns - 1)
            for n in range(bucket[r * columns + c0], bucket[r * columns + c1 + 1]):
                count[n] += _near(points[n, 0], points[n, 1], a, b)
    new, winner = np.empty(2), np.empty(2)
    for step in (0.3, 0.3, 0.2, 0.2, 0.1, 0.1, 0.05, 0.05, 0.02):
        for i in range(len(vertex)):
            if not movable[i]:
                continue
            p, o, q = vertex[i].copy(), vertex[before[i]], vertex[after[i]]
            oo, qq = vertex[before[before[i]]], vertex[after[after[i]]]
            old = np.hypot(o[0] - p[0], o[1] - p[1]) + np.hypot(q[0] - p[0], q[1] - p[1])
            if np.hypot(o[0] - p[0], o[1] - p[1]) > 1.7 or np.hypot(q[0] - p[0], q[1] - p[1]) > 1.7:
                continue
            turns = _turns(oo, o, p) + _turns(o, p, q) + _turns(p, q, qq)
            best = 1e-6
            for k in range(10):
                if k == 8:
                    new[0], new[1] = (o[0] + q[0]) / 2.0, (o[1] + q[1]) / 2.0
                elif k == 9:
                    new[0], new[1] = o[0], o[1]
                else:
                    new[0], new[1] = p[0] + step * np.cos(k * np.pi / 4), p[1] + step * np.sin(k * np.pi / 4)
                added = np.hypot(o[0] - new[0], o[1] - new[1]) + np.hypot(q[0] - new[0], q[1] - new[1]) - old
                more = _turns(oo, o, new) + _turns(o, new, q) + _turns(new, q, qq) - turns
                gain = 0
                r0, r1 = min(o[1], q[1], p[1], new[1]) - 0.5, max(o[1], q[1], p[1], new[1]) + 0.5
                c0, c1 = min(o[0], q[0], p[0], new[0]) - 0.5, max(o[0], q[0], p[0], new[0]) + 0.5
                for r in range(max(int(r0), 0), min(int(r1), rows - 1) + 1):
                    first = bucket[r * columns + max(int(c0), 0)]
                    for n in range(first, bucket[r * columns + min(int(c1), columns - 1) + 1]):
                        x, y = points[n, 0], points[n, 1]
                        less = count[n] - _near(x, y, o, p) - _near(x, y, p, q)
                        gain += (less + _near(x, y, o, new) + _near(x, y, new, q) > 0) - (count[n] > 0)
                score = gain * PITCH**2 - price * (added + turn_cost * more)
                if (
                    score > best
                    and _clear(o, new, walls, wall_bucket, columns)
                    and _clear(new, q, walls, wall_bucket, columns)
                ):
                    best = score
                    winner[:] = new
            if best > 1e-6:
                r0, r1 = min(o[1], q[1], p[1], winner[1]) - 0.5, max(o[1], q[1], p[1], winner[1]) + 0.5
                c0, c1 = min(o[0], q[0], p[0], winner[0]) - 0.5, max(o[0], q[0], p[0], winner[0]) + 0.5
                for r in range(max(int(r0), 0), min(int(r1), rows - 1) + 1):
                    first = bucket[r * columns + max(int(c0), 0)]
                    for n in range(first, bucket[r * columns + min(int(c1), columns - 1) + 1]):
                        x, y = points[n, 0], points[n, 1]
                        count[n] += _near(x, y, o, winner) + _near(x, y, winner, q) - _near(x, y, o, p) - _near(x, y, p, q)
                vertex[i] = winner
