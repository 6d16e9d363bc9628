"""Courses in closed form: where a point is that moves straight between knots, and when it comes near something.

A course is (n, 3) float64 knots, seconds, x, y, in order of time; after the last it stands still.
"""

import numba
import numpy as np


@numba.njit(cache=True)
def at(knots: np.ndarray, now: float) -> tuple[float, float, float]:
    """Return x, y and heading at a time."""
    n = len(knots)
    k = min(int(np.searchsorted(knots[:, 0], now, side="right")), n - 1)
    if k == 0:
        return knots[0, 1], knots[0, 2], 0.0
    (t0, x0, y0), (t1, x1, y1) = knots[k - 1], knots[k]
    heading = np.arctan2(y1 - y0, x1 - x0)
    if now >= t1 or t1 <= t0:
        return x1, y1, heading
    s = max(0.0, (now - t0) / (t1 - t0))
    return x0 + s * (x1 - x0), y0 + s * (y1 - y0), heading


@numba.njit(cache=True)
def sightings(knots: np.ndarray, spots: np.ndarray, reach: float, now: float) -> np.ndarray:
    """Return (m,) first times from `now` on at which a course is within `reach` of each of (m, 2) spots, or infinity."""
    times = np.full(len(spots), np.inf)
    for c in range(len(spots)):
        for k in range(len(knots)):
            t0 = max(knots[k, 0], now)
            t1 = knots[k + 1, 0] if k + 1 < len(knots) else np.inf
            if t1 < now or (t1 == knots[k, 0] and k + 1 < len(knots)):
                continue
            vx, vy = _velocity(knots, k)
            dx = knots[k, 1] + vx * (t0 - knots[k, 0]) - spots[c, 0]
            dy = knots[k, 2] + vy * (t0 - knots[k, 0]) - spots[c, 1]
            s = _entry(dx, dy, vx, vy, reach)
            if t0 + s <= t1:
                times[c] = t0 + s
                break
    return times


@numba.njit(cache=True)
def crossing(a: np.ndarray, b: np.ndarray, reach: float, now: float, entering: bool) -> float:
    """Return the first time from `now` on at which two courses come within `reach`, or go beyond it; infinity if never."""
    if reach == np.inf:
        return now if entering else np.inf
    i = max(int(np.searchsorted(a[:, 0], now, side="right")) - 1, 0)
    j = max(int(np.searchsorted(b[:, 0], now, side="right")) - 1, 0)
    t0 = now
    while True:
        ta = a[i + 1, 0] if i + 1 < len(a) else np.inf
        tb = b[j + 1, 0] if j + 1 < len(b) else np.inf
        t1 = min(ta, tb)
        if t1 > t0 or t1 == np.inf:
            ax, ay = _velocity(a, i)
            bx, by = _velocity(b, j)
            dx = a[i, 1] + ax * (t0 - a[i, 0]) - b[j, 1] - bx * (t0 - b[j, 0])
            dy = a[i, 2] + ay * (t0 - a[i, 0]) - b[j, 2] - by * (t0 - b[j, 0])
            s = _entry(dx, dy, ax - bx, ay - by, reach) if entering else _exit(dx, dy, ax - bx, ay - by, reach)
            if t0 + s <= t1 and s < np.inf:
                return t0 + s
        if t1 == np.inf:
            return np.inf
        t0 = max(float(t1), t0)
        if ta <= t1:
            i += 1
        if tb <= t1:
            j += 1


@numba.njit(cache=True)
def _velocity(knots: np.ndarray, k: int) -> tuple[float, float]:
    if k + 1 >= len(knots) or knots[k + 1, 0] <= knots[k, 0]:
        return 0.0, 0.0
    dt = knots[k + 1, 0] - knots[k, 0]
    return (knots[k + 1, 1] - knots[k, 1]) / dt, (knots[k + 1, 2] - knots[k, 2]) / dt


@numba.njit(cache=True)
def _entry(dx: float, dy: float, vx: float, vy: float, reach: float) -> float:
    """Return the first s >= 0 with |d + s v| <= reach, or infinity."""
    c = dx * dx + dy * dy - reach * reach
    if c <= 0.0:
        return 0.0
    a, b = vx * vx + vy * vy, dx * vx + dy * vy
    root = b * b - a * c
    if a == 0.0 or b >= 0.0 or root < 0.0:
        return np.inf
    return c / (-b + np.sqrt(root))


@numba.njit(cache=True)
def _exit(dx: float, dy: float, vx: float, vy: float, reach: float) -> float:
    """Return the first s >= 0 from which on |d + s v| > reach, or infinity."""
    c = dx * dx + dy * dy - reach * reach
    a, b = vx * vx + vy * vy, dx * vx + dy * vy
    if c > 0.0:
        return 0.0
    if a == 0.0:
        return np.inf
    return (-b + np.sqrt(max(b * b - a * c, 0.0))) / a
