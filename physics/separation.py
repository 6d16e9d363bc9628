"""Keeping clear of one another: who gives way, in the manner of the collision regulations at sea (COLREG rules 13 to 17).

The vehicle that has the other on its starboard side gives way, one that overtakes keeps clear, two that meet head-on both
turn to starboard. Where the rules are silent (launching from one place, both lying still) the first in the list goes
first.
"""

import numpy as np
from numba import njit

HORIZON = 20.0  # s
MARGIN = 0.2  # m between two hulls


@njit(cache=True)
def give_way(
    position: np.ndarray,
    course: np.ndarray,
    speed: np.ndarray,
    pace: np.ndarray,
    aside: np.ndarray,
    keep: np.ndarray,
    present: np.ndarray,
    slow: np.ndarray,
    want: np.ndarray,
) -> None:
    """Set `slow` (k,), the speed allowed, m/s, and `want` (k,), how far to starboard of its path each is to go, metres.

    `position` (k, 3); `course` (k, 2) the direction of the leg, zeros for one that lies still; `speed` (k,) over ground and
    `pace` (k,) as planned, m/s, 0 for one that is done; `aside` (k,) how far off its leg each has already gone; `keep` (k,)
    the distance kept; `present` (k,) those out there. Conflicts are looked for between the legs as planned, so that a
    vehicle stays aside until the other is past.
    """
    for i in range(len(position)):
        slow[i], want[i] = np.inf, 0.0
        if not present[i]:
            continue
        going = course[i, 0] != 0.0 or course[i, 1] != 0.0
        angle = np.arctan2(course[i, 1], course[i, 0])
        ux, uy = pace[i] * course[i, 0], pace[i] * course[i, 1]
        for j in range(len(position)):
            if j == i or not present[j]:
                continue
            apart = 0.5 * (keep[i] + keep[j])
            px, py = position[j, 0] - position[i, 0], position[j, 1] - position[i, 1]
            if np.hypot(px, py) > 2 * apart + (speed[i] + speed[j]) * HORIZON:
                continue
            if abs(position[j, 2] - position[i, 2]) > apart:
                continue
            if speed[i] < 0.2 * pace[i]:  # about to start: those before it in the list go first
                if np.hypot(px, py) < apart and i > j and pace[j] > 0.0:
                    slow[i] = 0.0
                ahead, beside = px * course[i, 0] + py * course[i, 1], px * course[i, 1] - py * course[i, 0]
                stays = course[j, 0] == 0.0 and course[j, 1] == 0.0
                if going and stays and 0.0 < ahead < 2 * apart and abs(beside + aside[i]) < apart:
                    want[i] = 1.3 * apart
                continue
            if not going:
                continue
            gap, turning = np.hypot(px, py), speed[j] < 0.1 * pace[j] and i < j
            beside = abs(px * course[i, 1] - py * course[i, 0])
            # Both as they would be on their legs.
            px += aside[i] * course[i, 1] - aside[j] * course[j, 1]
            py += aside[j] * course[j, 0] - aside[i] * course[i, 0]
            vx, vy = speed[j] * course[j, 0], speed[j] * course[j, 1]
            wx, wy = vx - ux, vy - uy
            square = wx * wx + wy * wy
            soon = min(max(-(px * wx + py * wy) / square, 0.0), HORIZON) if square > 1e-9 else 0.0
            if np.hypot(px + wx * soon, py + wy * soon) > apart:
                continue
            bearing = _wrap(np.arctan2(py, px) - angle)
            if abs(bearing) > 1.96 and np.hypot(px, py) > 0.5 * apart:  # abaft the beam: the other's business
                continue
            still = ((vx == 0.0 and vy == 0.0) or turning) and speed[j] < 0.3
            if still:  # pass it by, slowly until there is room
                want[i] = 1.3 * apart
                if beside < 0.8 * apart and course[j, 0] == 0.0 and course[j, 1] == 0.0:
                    slow[i] = min(slow[i], max(0.5 * (gap - 0.8 * apart), 0.2))
                continue
            meeting = abs(_wrap(np.arctan2(vy, vx) - angle))
            if meeting > 2.62 and abs(bearing) < 1.6:  # head-on: both to starboard
                want[i] = apart
            elif meeting < 1.17:  # overtaking, or side by side
                if abs(bearing) < 0.8 or (i > j and abs(bearing) < 1.96):
                    slow[i] = min(slow[i], 0.7 * speed[j])
            elif bearing < 0.0:  # crossing, the other to starboard: let it pass ahead
                slow[i] = min(slow[i], 0.35 * pace[i])
                if meeting > 2.0:
                    want[i] = apart


@njit(cache=True)
def stop_for_others(
    position: np.ndarray,
    course: np.ndarray,
    speed: np.ndarray,
    radius: np.ndarray,
    brakes: np.ndarray,
    present: np.ndarray,
    slow: np.ndarray,
) -> None:
    """Set `slow` (k,) to 0 for whoever would come too near, before it could stop, to a moving one before it in the list.

    Where small vehicles meet on purpose this comes on top of `give_way`: `radius` (k,) metres of the hulls, `brakes` (k,)
    m/s2; all else as there. Who stands goes on standing until the other is past.
    """
    for i in range(len(position)):
        if not present[i] or (course[i, 0] == 0.0 and course[i, 1] == 0.0):
            continue
        pace = max(speed[i], 0.5)
        soon = pace / brakes[i] + 1.0
        for j in range(i):
            near = radius[i] + radius[j] + MARGIN
            if not present[j] or speed[j] < 0.1 or abs(position[j, 2] - position[i, 2]) > near:
                continue
            px, py = position[j, 0] - position[i, 0], position[j, 1] - position[i, 1]
            wx, wy = speed[j] * course[j, 0] - pace * course[i, 0], speed[j] * course[j, 1] - pace * course[i, 1]
            if px * wx + py * wy >= 0.0:  # they part
                continue
            when = min(-(px * wx + py * wy) / (wx * wx + wy * wy), soon)
            if np.hypot(px + wx * when, py + wy * when) < near:
                slow[i] = 0.0


@njit(cache=True)
def _wrap(angle: float) -> float:
    return (angle + np.pi) % (2 * np.pi) - np.pi
