"""Keeping clear of one another: who gives way, in the manner of the collision regulations at sea (COLREG rules 13 to 17).

The vehicle that has the other on its starboard side gives way, one that overtakes keeps clear, two that meet head-on both
turn to starboard. Where the rules are silent (launching from one place, both lying still) the first in the list goes
first.
"""

from typing import Any

import numpy as np
from numba import njit

from quarterdeck.physics.braking import TOUCH
from quarterdeck.physics.legs import SIDEWAYS, wrapped

HORIZON = 20.0  # s that conflicts are looked for ahead
STILL = 0.3  # m/s: who is slower lies still
STARTS = 0.2  # of its pace: who is slower is about to set out
TURNS = 0.1  # of its pace: who is slower turns on the spot, and is not about to get out of the way
CREEP = 0.25  # of its pace that one makes at the least who passes another by, or sets out after it stood for long

# Of the distance kept from others:
BERTH = 0.45  # how near one may pass what lies still; less than routes keep from wrecks
WIDE = 0.8  # how near one may pass what stands and wants to go on
MEET = 0.6  # how far each of two goes aside that meet head-on
ROUND = 1.3  # how far one goes aside for what turns on the spot before it
CLOSE = 0.5  # so near, one abaft the beam is not the other's business alone

PASS = 1.25  # berths off one passes it
SPARE = 1.05  # times as far off as where it would have to brake
CLEAR = 0.9  # berths: who is so far to the side of another need not slow down to get there

# Bearings off the bow, and angles between two courses, radians:
ABAFT = 1.96  # 22.5 degrees abaft the beam, from where rule 13 has one overtake
BEAM = 1.6  # about abeam: up to there one that meets it is still to be passed
BOW = 0.8  # up to there one that goes the same way is ahead
ALIKE = 1.17  # courses less apart go the same way: 180 degrees less ABAFT, as rule 13 has it
ACROSS = 2.0  # courses farther apart that cross come towards each other: giving way in time takes going aside too
OPPOSITE = 2.62  # courses farther apart, 150 degrees, meet head-on

TRAIL = 0.7  # of the speed of the one ahead, while one is too near to it
YIELD = 0.35  # of its pace, while one lets another pass ahead

TRAFFIC = np.dtype(
    [("position", float, 3), ("course", float, 2), ("leg", float, 3), ("side", float, 2)]
    + [(n, float) for n in ("speed", "pace", "aside", "offset", "rest", "keep", "reach")]
    + [("present", np.bool_), ("place", np.int64), ("stands", np.bool_)]
    + [(n, float) for n in ("slow", "want", "instead")]
)


@njit(cache=True)
def give_way(traffic: np.ndarray) -> None:
    """Set of the `traffic`, (k,) TRAFFIC, `slow`, the speed allowed, m/s, and `want`, how far to starboard of its path each
    is to go, metres; `instead` is where to go if there is no room for that, to port of what lies still or to starboard of
    it; NaN where going to starboard is the rule.

    Given are of each its `position` (3), metres; `course` (2) the level direction of the leg, `leg` (3) that in space,
    zeros for one that lies still, `side` (2) what is to starboard; `speed` over ground and `pace` as planned, m/s, 0 for
    one that is done; `aside` how far off its leg it has already gone for that, `offset` how far to starboard of it it is,
    `rest` how far it has to the leg's end, metres; `keep` the distance kept and `reach` half the hull's diagonal, metres;
    whether it is `present`, out there; its `place` in the order in which they go. One that `stands` too long passes by
    those that stand and come after it, and obeys no other rule. Conflicts are looked for between the legs as planned, so
    that a vehicle stays aside until the other is past.
    """
    for i in range(len(traffic)):
        me = traffic[i]
        me.slow, me.want, me.instead = np.inf, 0.0, np.nan
        for j in range(len(traffic)):
            other = traffic[j]
            if j == i or not me.present or not other.present or not _near(me, other):
                continue
            still = other.speed < STILL and (not _has_leg(other) or (me.stands and me.place < other.place))
            if still and _has_leg(me):
                _pass_by(me, other)
            elif me.stands or abs(other.position[2] - me.position[2]) > _apart(me, other):
                continue
            elif me.speed < STARTS * me.pace:
                if i > j and other.pace > 0.0 and _distance(me, other) < _apart(me, other):
                    me.slow = 0.0  # those before it in the list set out first
            elif _has_course(me) and _has_course(other):
                _obey_rules(me, other, i < j)


@njit(cache=True)
def _near(me: Any, other: Any) -> bool:
    """Return whether the two can come too near to each other within the horizon."""
    reach = (me.speed + other.speed + CREEP * me.pace) * HORIZON
    return not _distance(me, other) > 2 * _apart(me, other) + reach


@njit(cache=True)
def _pass_by(me: Any, other: Any) -> None:
    """Pass what lies still on the side where that is the smaller detour; also where it climbs or sinks."""
    leg, apart = me.leg, _apart(me, other)
    px, py = other.position[0] - me.position[0], other.position[1] - me.position[1]
    pz = other.position[2] - me.position[2]
    along = px * leg[0] + py * leg[1] + pz * leg[2]
    abeam = px * me.side[0] + py * me.side[1]  # to starboard
    off = px * px + py * py + pz * pz - along * along - abeam * abeam
    beside = abeam + me.offset  # to starboard of the leg
    berth = max(BERTH * apart, SPARE * TOUCH * (me.reach + other.reach))  # lest it has to brake
    passing = -berth if me.aside != 0.0 else 0.0  # aside until it is past
    ahead = berth + min(max(me.speed, CREEP * me.pace) * HORIZON, me.rest)
    room = WIDE * apart if _has_leg(other) else berth
    # In its way, or in that back to its leg.
    between = min(me.aside, 0.0) - room < beside < max(me.aside, 0.0) + room
    if not (passing < along < ahead and between and off < room * room):
        return
    one, another = max(beside + PASS * berth, 0.0), min(beside - PASS * berth, 0.0)
    starboard = me.aside > 0.0 if me.aside != 0.0 else one < -another  # and it keeps to that side
    me.want, me.instead = (one, another) if starboard else (another, one)
    lack = CLEAR * berth - abs(beside - me.offset)
    if lack > 0.0:  # not yet aside: no faster than it gets there
        soon = SIDEWAYS * (along - berth) / lack if along > berth else 0.0
        me.slow = min(me.slow, me.pace * (CREEP if me.stands else max(soon, CREEP)))


@njit(cache=True)
def _obey_rules(me: Any, other: Any, first: bool) -> None:
    """Give way to another that is on its way too, as the rules have it; `first`: it goes first where they are silent."""
    apart = _apart(me, other)
    # Both as they would be on their legs.
    px, py = other.position[0] - me.position[0], other.position[1] - me.position[1]
    px += me.aside * me.course[1] - other.aside * other.course[1]
    py += other.aside * other.course[0] - me.aside * me.course[0]
    wx = other.speed * other.course[0] - me.pace * me.course[0]
    wy = other.speed * other.course[1] - me.pace * me.course[1]
    square = wx * wx + wy * wy
    soon = min(max(-(px * wx + py * wy) / square, 0.0), HORIZON) if square > 1e-9 else 0.0  # s to the nearest approach
    if np.hypot(px + wx * soon, py + wy * soon) > apart:
        return
    heading = np.arctan2(me.course[1], me.course[0])
    bearing = wrapped(np.arctan2(py, px) - heading)
    if abs(bearing) > ABAFT and np.hypot(px, py) > CLOSE * apart:  # the other's business
        return
    if first and other.speed < min(TURNS * other.pace, STILL):  # pass it by
        me.want = ROUND * apart
        return
    meeting = abs(wrapped(np.arctan2(other.course[1], other.course[0]) - heading))
    if meeting > OPPOSITE and abs(bearing) < BEAM:  # head-on: both to starboard
        me.want = MEET * apart
    elif meeting < ALIKE:  # overtaking, or side by side
        if abs(bearing) < BOW or (not first and abs(bearing) < ABAFT):
            me.slow = min(me.slow, TRAIL * other.speed)
    elif bearing < 0.0:  # crossing, the other to starboard: let it pass ahead
        me.slow = min(me.slow, YIELD * me.pace)
        if meeting > ACROSS:
            me.want = apart


@njit(cache=True)
def _apart(me: Any, other: Any) -> float:
    """Return the distance that two keep, metres."""
    return 0.5 * (me.keep + other.keep)


@njit(cache=True)
def _distance(me: Any, other: Any) -> float:
    """Return the level distance between two, metres."""
    return np.hypot(other.position[0] - me.position[0], other.position[1] - me.position[1])


@njit(cache=True)
def _has_leg(vehicle: Any) -> bool:
    leg = vehicle.leg
    return leg[0] != 0.0 or leg[1] != 0.0 or leg[2] != 0.0


@njit(cache=True)
def _has_course(vehicle: Any) -> bool:
    return vehicle.course[0] != 0.0 or vehicle.course[1] != 0.0
