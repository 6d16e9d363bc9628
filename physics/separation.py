"""Keeping clear of one another: who gives way, in the manner of the collision regulations at sea (COLREG rules 13 to 17).

The vehicle that has the other on its starboard side gives way, one that overtakes keeps clear, two that meet head-on both
turn to starboard. Where the rules are silent (launching from one place, both lying still) the first in the list goes
first.
"""

import numpy as np
from numba import njit

HORIZON = 20.0  # s
REACH = 0.65  # lengths from its middle that a hull may reach, whichever way it points
BERTH = 0.45  # of the distance kept: how near one may pass what lies still; less than routes keep from wrecks
CREEP = 0.15  # of its pace that one goes who has stood for others too long
GAP = 0.1  # lengths that hulls keep apart while one creeps


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
    instead: np.ndarray,
) -> None:
    """Set `slow` (k,), the speed allowed, m/s, and `want` (k,), how far to starboard of its path each is to go, metres.

    `instead` (k,) is where to go if there is no room for that, to port of what lies still or to starboard of it; NaN where
    going to starboard is the rule.

    `position` (k, 3); `course` (k, 2) the direction of the leg, zeros for one that lies still; `speed` (k,) over ground and
    `pace` (k,) as planned, m/s, 0 for one that is done; `aside` (k,) how far off its leg each has already gone; `keep` (k,)
    the distance kept; `present` (k,) those out there. Conflicts are looked for between the legs as planned, so that a
    vehicle stays aside until the other is past.
    """
    for i in range(len(position)):
        slow[i], want[i], instead[i] = np.inf, 0.0, np.nan
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
            still = course[j, 0] == 0.0 and course[j, 1] == 0.0 and speed[j] < 0.3
            if still and going:  # pass it by, on the side where that is the smaller detour
                along = px * course[i, 0] + py * course[i, 1]
                aft = px * course[i, 1] - py * course[i, 0] + aside[i]  # to starboard of the leg
                berth = BERTH * apart
                passing = -berth if aside[i] != 0.0 else 0.0  # aside until it is past
                if passing < along < berth + speed[i] * HORIZON and abs(aft) < berth:
                    one, other = aft + 1.1 * berth, aft - 1.1 * berth
                    want[i], instead[i] = (one, other) if one < -other else (other, one)
                    lack = 0.9 * berth - abs(aft - aside[i])
                    if lack > 0.0:  # not yet aside: no faster than it gets there
                        soon = 0.33 * (along - berth) / lack if along > berth else 0.0
                        slow[i] = min(slow[i], pace[i] * (max(soon, 0.25) if soon > 0.0 else 0.0))
                continue
            if speed[i] < 0.2 * pace[i]:  # about to start: those before it in the list go first
                if np.hypot(px, py) < apart and i > j and pace[j] > 0.0:
                    slow[i] = 0.0
                continue
            if not going:
                continue
            turning = speed[j] < 0.1 * pace[j] and i < j
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
            if turning and speed[j] < 0.3:  # pass it by
                want[i] = 1.3 * apart
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
def stop_short(
    position: np.ndarray,
    velocity: np.ndarray,
    course: np.ndarray,
    pace: np.ndarray,
    shift: np.ndarray,
    length: np.ndarray,
    brake: np.ndarray,
    present: np.ndarray,
    slow: np.ndarray,
) -> bool:
    """Set `slow` (k,) to 0 for each that would run into another ahead of it, as both move now, before it can stop.

    Whatever the rules say: on turns and off their legs vehicles are not where the rules look for them. `velocity` (k, 3)
    m/s over ground; `shift` (k,) metres to starboard that each is about to go; `length` (k,) m; `brake` (k,) m/s2. One that
    stands sets out where the way is free; of two that stand the first in the list does. Returns whether some are so near
    that this is to be asked again soon.
    """
    near = False
    for i in range(len(position)):
        if not present[i]:
            continue
        ux, uy, moving = _motion(velocity[i], course[i], pace[i], shift[i], length[i])
        if ux == 0.0 and uy == 0.0:
            continue
        ahead = 1.5 + np.hypot(ux, uy) / brake[i]  # s: the next call is one away
        for j in range(len(position)):
            if j == i or not present[j]:
                continue
            px, py, pz = position[j] - position[i]
            touch = REACH * (length[i] + length[j])
            if abs(pz) > touch + abs(velocity[j, 2] - velocity[i, 2]) * ahead or px * ux + py * uy <= 0.0:
                continue
            near |= np.hypot(px, py) < touch + ahead * (np.hypot(ux, uy) + np.hypot(velocity[j, 0], velocity[j, 1]))
            if np.hypot(px, py) < 0.5 * touch:  # one upon the other, where they are launched: the list decides
                continue
            vx, vy = velocity[j, 0], velocity[j, 1]
            if not moving and i > j:
                vx, vy, _ = _motion(velocity[j], course[j], pace[j], shift[j], length[j])
            wx, wy = vx - ux, vy - uy
            square = wx * wx + wy * wy
            soon = min(max(-(px * wx + py * wy) / square, 0.0), ahead) if square > 1e-9 else 0.0
            if np.hypot(px + wx * soon, py + wy * soon) < touch:
                slow[i] = 0.0
    return near


@njit(cache=True)
def creep_on(
    position: np.ndarray,
    heading: np.ndarray,
    velocity: np.ndarray,
    pace: np.ndarray,
    hull: np.ndarray,
    brake: np.ndarray,
    present: np.ndarray,
    stands: np.ndarray,
    slow: np.ndarray,
) -> None:
    """Raise `slow` (k,) to CREEP of its pace for each that `stands` (k,) too long for others and has room to creep ahead.

    Two may stand for each other. The first in the list creeps first; nobody to where its hull, (k, 2) length and width in
    metres, would come within GAP of another's, as that one moves or creeps, unless it gets away from it. `heading` (k,)
    radians, `velocity` (k, 3) m/s over ground.
    """
    motion = velocity.copy()
    for i in range(len(position)):
        if not (stands[i] and present[i]):
            continue
        speed = max(CREEP * pace[i], np.hypot(velocity[i, 0], velocity[i, 1]))
        ux, uy = speed * np.cos(heading[i]), speed * np.sin(heading[i])
        ahead = 1.5 + speed / brake[i]  # s: the next call is one away
        clear = True
        for j in range(len(position)):
            px, py, pz = position[j] - position[i]
            touch = REACH * (hull[i, 0] + hull[j, 0])
            wx, wy = motion[j, 0] - ux, motion[j, 1] - uy
            if j == i or not present[j] or abs(pz) > touch + abs(motion[j, 2]) * ahead:
                continue
            if np.hypot(px, py) > touch + np.hypot(wx, wy) * ahead:
                continue
            before = _gap(px, py, heading[i], heading[j], hull[i], hull[j])
            for soon in np.linspace(0.0, ahead, 5)[1:]:
                after = _gap(px + wx * soon, py + wy * soon, heading[i], heading[j], hull[i], hull[j])
                clear &= after > min(GAP * 0.5 * (hull[i, 0] + hull[j, 0]), before)
        if clear:
            slow[i] = max(slow[i], CREEP * pace[i])
            motion[i, 0], motion[i, 1] = ux, uy


@njit(cache=True)
def _gap(px: float, py: float, one: float, other: float, mine: np.ndarray, theirs: np.ndarray) -> float:
    """Return at least how far apart two boxes are, metres, along the axes of both; below 0 where they overlap.

    The other's middle is at `px`, `py` from the one's; they head `one` and `other`; `mine` and `theirs` are length, width.
    """
    gap = -np.inf
    for axis in (one, one + 0.5 * np.pi, other, other + 0.5 * np.pi):
        reach = mine[0] * abs(np.cos(one - axis)) + mine[1] * abs(np.sin(one - axis))
        reach += theirs[0] * abs(np.cos(other - axis)) + theirs[1] * abs(np.sin(other - axis))
        gap = max(gap, abs(px * np.cos(axis) + py * np.sin(axis)) - 0.5 * reach)
    return gap


@njit(cache=True)
def _motion(
    velocity: np.ndarray, course: np.ndarray, pace: float, shift: float, length: float
) -> tuple[float, float, bool]:
    """Return how one moves, m/s, and whether it does; of one that stands, how it is about to set out."""
    if np.hypot(velocity[0], velocity[1]) > 0.1 * pace:
        return velocity[0], velocity[1], True
    x, y = 2 * length * course[0] + shift * course[1], 2 * length * course[1] - shift * course[0]
    far = np.hypot(x, y)
    if far == 0.0:
        return 0.0, 0.0, False
    return 0.3 * pace * x / far, 0.3 * pace * y / far, False


@njit(cache=True)
def _wrap(angle: float) -> float:
    return (angle + np.pi) % (2 * np.pi) - np.pi
