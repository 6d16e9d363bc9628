"""Braking in time: each goes on only where its way to rest stays clear of the others' ways to rest.

A vehicle's way is where it passes if it brakes now; that of one that goes on is where it passes if it does so for one
look more and brakes then. As long as no two ways meet, all can come to rest without touching, whatever the others do. So at
each look one after the other goes on if its way then keeps off everybody's, or gets away from the one that it is too near
to; else it brakes. This is passive safety as Macek et al. 2009 and Bouraine et al. 2012 have it, with ways in place of
trajectories: when somebody passes does not matter, so nobody need know how fast the others go.
"""

import numpy as np
from numba import njit

LOOK = 0.4  # s that a vehicle goes on before it brakes: a look, and what it takes to act on it
TOUCH = 1.1  # of both hulls' half diagonals: how near ways may come
SPARE = 1.5  # times as far off one stays that is not about to pass: from there one can turn and go around
BACK = 0.15  # of its pace that one goes astern
OPENING = 0.3  # of its way: so much one gets away by it that was too near
PIECES = 3  # straight ones that a way is made of


@njit(cache=True)
def brake_in_time(
    position: np.ndarray,
    velocity: np.ndarray,
    rate: np.ndarray,
    facing: np.ndarray,
    pace: np.ndarray,
    reach: np.ndarray,
    brakes: np.ndarray,
    present: np.ndarray,
    order: np.ndarray,
    passing: np.ndarray,
    astern: np.ndarray,
    slow: np.ndarray,
) -> bool:
    """Set `slow` (k,), the speed allowed, m/s, to 0 for each that has to brake; return whether some are near to others.

    One that has to brake goes `astern` (k, 3), in that direction, `slow` below 0, if it gets away from whom it is too near
    to; zeros for one that is not to.

    `position` (k, 3); `velocity` (k, 3) m/s over ground; `rate` (k,) rad/s of turn; `facing` (k, 3) the direction in which
    each sets out if it stands, zeros for one that goes nowhere; `pace` (k,) m/s as planned; `reach` (k,) half the hull's
    diagonal, m; `brakes` (k, 3): m/s2 of braking, seconds in which speed fades at the least, and m/s2 of setting out. They
    choose in `order` (k,); those that are `passing` (k,) others come as near as TOUCH.
    """
    count = len(position)
    ways = np.empty((count, PIECES + 1, 3))
    far, keep = np.zeros(count), np.empty(count)
    for i in range(count):
        if present[i]:
            far[i] = _way(ways[i], position[i], velocity[i], rate[i], facing[i], 0.0, brakes[i])
    on = np.empty((PIECES + 1, 3))
    near = False
    for i in order:
        if not present[i]:
            continue
        wanted = min(pace[i], slow[i])
        further = _way(on, position[i], velocity[i], rate[i], facing[i], wanted, brakes[i])
        close = False
        for j in range(count):
            touch = TOUCH * (reach[i] + reach[j])
            keep[j] = touch if passing[i] or not np.any(facing[j] != 0.0) else SPARE * touch
            if j != i and present[j]:
                away = _away(position[i], position[j])
                near |= away < keep[j] + further + far[j] + pace[i] + pace[j]
                close |= away < min(keep[j] + further + far[j], SPARE * touch)
        if not _keeps_off(i, on, further, ways, far, keep, present):
            slow[i] = 0.0
            if close and np.any(astern[i] != 0.0):
                back = BACK * pace[i]
                further = _way(on, position[i], velocity[i], rate[i], astern[i], back, brakes[i])
                keep[:] = SPARE * TOUCH * (reach[i] + reach)
                if _keeps_off(i, on, further, ways, far, keep, present):
                    slow[i], ways[i], far[i] = -back, on, further
        elif wanted > 0.0:
            ways[i], far[i] = on, further
    return near


@njit(cache=True)
def _way(
    way: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
    rate: float,
    facing: np.ndarray,
    wanted: float,
    brakes: np.ndarray,
) -> float:
    """Set `way` (PIECES + 1, 3), the places passed until at rest, and return its length.

    If `wanted` m/s is 0 it brakes now, else after it has gone on and gained on it for LOOK.
    """
    brake, lag, surge = brakes
    ux, uy, uz = velocity
    if wanted > 0.0:
        gain = min(max(wanted - (ux * facing[0] + uy * facing[1] + uz * facing[2]), 0.0), surge * LOOK)
        ux, uy, uz = ux + gain * facing[0], uy + gain * facing[1], uz + gain * facing[2]
    speed = np.sqrt(ux * ux + uy * uy + uz * uz)
    time = max(lag, speed / (2 * brake)) + (LOOK if wanted > 0.0 else 0.0)
    turn = rate * lag if speed > 0.05 else 0.0  # radians, all along
    for n in range(PIECES + 1):
        part = n / PIECES
        cos, sin = np.cos(0.5 * turn * part), np.sin(0.5 * turn * part)
        way[n, 0] = position[0] + part * time * (cos * ux - sin * uy)
        way[n, 1] = position[1] + part * time * (sin * ux + cos * uy)
        way[n, 2] = position[2] + part * time * uz
    return time * speed


@njit(cache=True)
def _keeps_off(
    i: int, way: np.ndarray, length: float, ways: np.ndarray, far: np.ndarray, keep: np.ndarray, present: np.ndarray
) -> bool:
    """Return whether `way` of vehicle `i`, `length` metres, keeps `keep` (k,) off the others', or opens."""
    for j in range(len(ways)):
        if j != i and present[j]:
            nearest = _away(way[0], ways[j, 0]) - length - far[j]
            if nearest < keep[j]:
                nearest = _between(way, ways[j])
            if nearest < keep[j] and not _opens(way, length, nearest, ways[j]):
                return False
    return True


@njit(cache=True)
def _away(here: np.ndarray, there: np.ndarray) -> float:
    """Return the distance between two places, metres."""
    dx, dy, dz = here[0] - there[0], here[1] - there[1], here[2] - there[2]
    return np.sqrt(dx * dx + dy * dy + dz * dz)


@njit(cache=True)
def _opens(way: np.ndarray, length: float, nearest: float, other: np.ndarray) -> bool:
    """Return whether one that is too near to another's way gets away from it, and never nearer."""
    now, then = np.inf, np.inf
    for b in range(len(other) - 1):
        now = min(now, _apart(way[0], way[0], other[b], other[b + 1]))
        then = min(then, _apart(way[-1], way[-1], other[b], other[b + 1]))
    return nearest >= now - 1e-6 and then >= now + OPENING * length


@njit(cache=True)
def _between(one: np.ndarray, other: np.ndarray) -> float:
    """Return the least distance between two ways (n, 3), metres."""
    least = np.inf
    for a in range(len(one) - 1):
        for b in range(len(other) - 1):
            least = min(least, _apart(one[a], one[a + 1], other[b], other[b + 1]))
    return least


@njit(cache=True)
def _apart(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> float:
    """Return the distance between the pieces from `a` to `b` and from `c` to `d` (Ericson 2005, section 5.1.9)."""
    ux, uy, uz = b - a
    vx, vy, vz = d - c
    wx, wy, wz = a - c
    uu, vv, uv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, ux * vx + uy * vy + uz * vz
    uw, vw = ux * wx + uy * wy + uz * wz, vx * wx + vy * wy + vz * wz
    s, square = 0.0, uu * vv - uv * uv
    if square > 1e-12:
        s = min(max((uv * vw - uw * vv) / square, 0.0), 1.0)
    t = (uv * s + vw) / vv if vv > 1e-12 else 0.0
    t = min(max(t, 0.0), 1.0)
    s = min(max((uv * t - uw) / uu, 0.0), 1.0) if uu > 1e-12 else 0.0
    x, y, z = wx + s * ux - t * vx, wy + s * uy - t * vy, wz + s * uz - t * vz
    return np.sqrt(x * x + y * y + z * z)
