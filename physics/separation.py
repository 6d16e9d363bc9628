"""Keeping clear of one another: who gives way, in the manner of the collision regulations at sea (COLREG rules 13 to 17).

The vehicle that has the other on its starboard side gives way, one that overtakes keeps clear, two that meet head-on both
turn to starboard. Where the rules are silent (launching from one place, both lying still) the first in the list goes
first.
"""

import numpy as np
from numba import njit

from quarterdeck.physics.braking import TOUCH

HORIZON = 20.0  # s
MEET = 0.6  # of the distance kept: how far each of two goes aside that meet head-on
PASS = 1.25  # berths off one passes it
BERTH = 0.45  # of the distance kept: how near one may pass what lies still; less than routes keep from wrecks
CREEP = 0.25  # of its pace that one makes at the least who passes another by, or sets out after it stood for long
WIDE = 0.8  # of the distance kept: how near one may pass what stands and wants to go on


@njit(cache=True)
def give_way(
    position: np.ndarray,
    course: np.ndarray,
    leg: np.ndarray,
    side: np.ndarray,
    speed: np.ndarray,
    pace: np.ndarray,
    aside: np.ndarray,
    offset: np.ndarray,
    rest: np.ndarray,
    keep: np.ndarray,
    reach: np.ndarray,
    present: np.ndarray,
    place: np.ndarray,
    stands: np.ndarray,
    slow: np.ndarray,
    want: np.ndarray,
    instead: np.ndarray,
) -> None:
    """Set `slow` (k,), the speed allowed, m/s, and `want` (k,), how far to starboard of its path each is to go, metres.

    `instead` (k,) is where to go if there is no room for that, to port of what lies still or to starboard of it; NaN where
    going to starboard is the rule.

    `position` (k, 3); `course` (k, 2) the level direction of the leg, `leg` (k, 3) that in space, zeros for one that lies
    still, `side` (k, 2) what is to starboard; `speed` (k,) over ground and `pace` (k,) as planned, m/s, 0 for one that is
    done; `aside` (k,) how far off its leg each has already gone for that, `offset` (k,) how far to starboard of it each is,
    `rest` (k,) how far it has to the leg's end, metres; `keep` (k,) the distance kept and `reach` (k,) half the hull's
    diagonal, metres; `present` (k,) those out there; `place` (k,) in the order in which they go. One that `stands` (k,) too
    long passes by those that stand and come after it, and obeys no other rule. Conflicts are looked for between the legs as
    planned, so that a vehicle stays aside until the other is past.
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
            pz = position[j, 2] - position[i, 2]
            if np.hypot(px, py) > 2 * apart + (speed[i] + speed[j] + CREEP * pace[i]) * HORIZON:
                continue
            still = speed[j] < 0.3 and (not np.any(leg[j] != 0.0) or (stands[i] and place[i] < place[j]))
            if still and np.any(leg[i] != 0.0):
                # Pass it by, on the side where that is the smaller detour; also where it climbs or sinks.
                along = px * leg[i, 0] + py * leg[i, 1] + pz * leg[i, 2]
                aft = px * side[i, 0] + py * side[i, 1]  # to starboard
                off = px * px + py * py + pz * pz - along * along - aft * aft
                aft += offset[i]  # of the leg
                berth = max(BERTH * apart, 1.05 * TOUCH * (reach[i] + reach[j]))  # lest it has to brake
                passing = -berth if aside[i] != 0.0 else 0.0  # aside until it is past
                ahead = berth + min(max(speed[i], CREEP * pace[i]) * HORIZON, rest[i])
                room = WIDE * apart if np.any(leg[j] != 0.0) else berth
                # In its way, or in that back to its leg.
                between = min(aside[i], 0.0) - room < aft < max(aside[i], 0.0) + room
                if passing < along < ahead and between and off < room * room:
                    one, other = max(aft + PASS * berth, 0.0), min(aft - PASS * berth, 0.0)
                    starboard = aside[i] > 0.0 if aside[i] != 0.0 else one < -other  # and it keeps to that side
                    want[i], instead[i] = (one, other) if starboard else (other, one)
                    lack = 0.9 * berth - abs(aft - offset[i])
                    if lack > 0.0:  # not yet aside: no faster than it gets there
                        soon = 0.33 * (along - berth) / lack if along > berth else 0.0
                        slow[i] = min(slow[i], pace[i] * (CREEP if stands[i] else max(soon, CREEP)))
                continue
            if stands[i] or abs(pz) > apart:
                continue
            if speed[i] < 0.2 * pace[i]:  # about to start: those before it in the list go first
                if np.hypot(px, py) < apart and i > j and pace[j] > 0.0:
                    slow[i] = 0.0
                continue
            if not going or (course[j, 0] == 0.0 and course[j, 1] == 0.0):
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
            meeting = abs(_wrap(np.arctan2(course[j, 1], course[j, 0]) - angle))
            if meeting > 2.62 and abs(bearing) < 1.6:  # head-on: both to starboard
                want[i] = MEET * apart
            elif meeting < 1.17:  # overtaking, or side by side
                if abs(bearing) < 0.8 or (i > j and abs(bearing) < 1.96):
                    slow[i] = min(slow[i], 0.7 * speed[j])
            elif bearing < 0.0:  # crossing, the other to starboard: let it pass ahead
                slow[i] = min(slow[i], 0.35 * pace[i])
                if meeting > 2.0:
                    want[i] = apart


@njit(cache=True)
def _wrap(angle: float) -> float:
    return (angle + np.pi) % (2 * np.pi) - np.pi
