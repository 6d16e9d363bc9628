"""Keeping clear of one another: who gives way, in the manner of the collision regulations at sea (COLREG rules 13 to 17).

The vehicle that has the other on its starboard side gives way, one that overtakes keeps clear, two that meet head-on both
turn to starboard. Where the rules are silent (launching from one place, both lying still) the first in the list goes
first.
"""

import numpy as np
from numba import njit

HORIZON = 20.0  # s
EVASION = 0.6  # radians to starboard


@njit(cache=True)
def give_way(
    position: np.ndarray, velocity: np.ndarray, size: np.ndarray, present: np.ndarray, slow: np.ndarray, bias: np.ndarray
) -> None:
    """Set `slow` (k,), the speed allowed in m/s, and `bias` (k,), radians added to the course, counter-clockwise.

    `position` and `velocity` (k, 3); `size` (k,) the distance kept, metres, of each; `present` (k,) those that are out
    there.
    """
    for i in range(len(position)):
        slow[i], bias[i] = np.inf, 0.0
        if not present[i]:
            continue
        vi = np.hypot(velocity[i, 0], velocity[i, 1])
        course = np.arctan2(velocity[i, 1], velocity[i, 0])
        for j in range(len(position)):
            if j == i or not present[j]:
                continue
            keep = max(size[i], size[j])
            px, py = position[j, 0] - position[i, 0], position[j, 1] - position[i, 1]
            vj = np.hypot(velocity[j, 0], velocity[j, 1])
            away = np.hypot(px, py)
            if away > keep + (vi + vj) * HORIZON or abs(position[j, 2] - position[i, 2]) > keep:
                continue
            if away < keep and vi < 0.1 and i > j:  # wait until the one before has gone
                slow[i] = 0.0
                continue
            if vi < 0.1:
                continue
            wx, wy = velocity[j, 0] - velocity[i, 0], velocity[j, 1] - velocity[i, 1]
            square = wx * wx + wy * wy
            soon = min(max(-(px * wx + py * wy) / square, 0.0), HORIZON) if square > 1e-9 else 0.0
            if np.hypot(px + wx * soon, py + wy * soon) > keep:
                continue
            bearing = _wrap(np.arctan2(py, px) - course)
            if abs(bearing) > 1.96:  # abaft the beam: it is the other's business
                continue
            if vj < 0.1:  # lies still: go round it
                if away < 3 * keep + vi * 5.0:
                    bias[i], slow[i] = -EVASION, min(slow[i], max(0.5 * vi, 0.3))
                continue
            meeting = abs(_wrap(np.arctan2(velocity[j, 1], velocity[j, 0]) - course))
            if meeting < 1.17:  # overtaking, or side by side
                if abs(bearing) < 1.17 or i > j:
                    slow[i] = min(slow[i], 0.8 * vj)
            elif meeting > 2.62 and abs(bearing) < 0.5:  # head-on
                bias[i] = -EVASION
            elif bearing < 0.0:  # crossing, the other to starboard
                bias[i], slow[i] = -EVASION, min(slow[i], 0.5 * vi)


@njit(cache=True)
def _wrap(angle: float) -> float:
    return (angle + np.pi) % (2 * np.pi) - np.pi
