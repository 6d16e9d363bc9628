"""The leg that a track is on: where it goes and ends, and how the track moves on, stops and keeps aside.

`t` is a record of `paths.TRACK`, changed in place; `table` the (n,) `paths.WAYPOINT` of all vehicles; times in seconds.
"""

from typing import Any

import numpy as np
from numba import njit

from quarterdeck.geo.angles import wrap
from quarterdeck.physics.paths import HOLD, IDLE, SAIL

CORNER = 0.3  # radians: a ground vehicle stops and turns on the spot at sharper corners
SIDEWAYS = 0.33  # of its speed: how fast one goes aside

wrapped = njit(cache=True)(wrap)


@njit(cache=True)
def leg_of(t: Any, table: np.ndarray, x: float, y: float) -> tuple[float, float, float, float, float]:
    """Return the leg's direction (2), length, and the position's distance along it and to port of it."""
    a, b = table[max(t.leg - 1, t.first)], table[t.leg]
    dx, dy = b.x - a.x, b.y - a.y
    length = np.hypot(dx, dy)
    if length < 1e-9:
        return 1.0, 0.0, 0.0, 0.0, 0.0
    tx, ty = dx / length, dy / length
    return tx, ty, length, tx * (x - a.x) + ty * (y - a.y), tx * (y - a.y) - ty * (x - a.x)


@njit(cache=True)
def corner(t: Any, table: np.ndarray) -> float:
    """Return the signed turn at the end of the leg, radians."""
    a, b, c = table[max(t.leg - 1, t.first)], table[t.leg], table[min(t.leg + 1, t.last)]
    if (b.x == a.x and b.y == a.y) or (b.x == c.x and b.y == c.y):
        return 0.0
    return wrapped(np.arctan2(c.y - b.y, c.x - b.x) - np.arctan2(b.y - a.y, b.x - a.x))


@njit(cache=True)
def stops(t: Any, table: np.ndarray, time: float) -> bool:
    """Whether the vehicle comes to a stop at the end of the leg: to hold, to wait, or for good."""
    return t.leg >= t.last or table[t.leg].hold > 0 or table[min(t.leg + 1, t.last)].depart > time


@njit(cache=True)
def to_stop(t: Any, table: np.ndarray, time: float, rest: float, far: float) -> float:
    """Return the metres to where a rover next stops, `rest` of them on this leg; infinity if it does not within `far`."""
    leg, there = t.leg, False
    while True:
        there = stops(t, table, time) or abs(corner(t, table)) > CORNER
        if there or rest > far:
            break
        t.leg += 1
        a, b = table[t.leg - 1], table[t.leg]
        rest += np.hypot(b.x - a.x, b.y - a.y)
    t.leg = leg
    return rest if there else np.inf


@njit(cache=True)
def arrive(t: Any, table: np.ndarray, time: float) -> None:
    """Hold at the end of the leg: for as long as is to be waited there, and until the next leg may begin."""
    t.integral = 0.0
    t.until = time + table[t.leg].hold
    if t.leg < t.last:
        t.until = max(t.until, table[t.leg + 1].depart)
    t.mode = HOLD


@njit(cache=True)
def depart(t: Any) -> None:
    """Go on to the next leg after a hold; after the last there is nothing left to do."""
    if t.leg < t.last:
        t.leg += 1
        t.mode = SAIL
    else:
        t.mode = IDLE


@njit(cache=True)
def step_aside(t: Any, speed: float, step: float) -> None:
    """Move towards the offset that separation wants, at SIDEWAYS of `speed`."""
    most = SIDEWAYS * speed * step
    t.aside += min(max(t.want - t.aside, -most), most)


@njit(cache=True)
def keep_aside(t: Any, table: np.ndarray, x: float, y: float) -> None:
    """Carry the offset over to a new leg: one that is aside stays where it is, to port or to starboard of that."""
    _, _, length, _, cross = leg_of(t, table, x, y)
    if length > 0.0:
        t.aside = min(max(-cross, -abs(t.aside)), abs(t.aside))
