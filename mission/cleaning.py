"""A log as a track in the plan's frame: what cannot be true of it is left out, and told."""

from bisect import bisect_left

import numpy as np

from quarterdeck.geo.logs import Log
from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.track import Track

GAP, OFTEN = 10.0, 10.0  # s, and times the usual interval: a longer silence is a gap
DAY = 86_400.0  # s: what is farther from the rest is of another mission, or has a wrong time
LEAP = 10.0  # m beyond twice the greatest speed: a longer step is a jump
BRIEF = 5.0  # s: fixes that jump away for no longer are wrong; for longer, it was moved
FAR = 100_000.0  # m from the site: not this plan's


def cleaned(mission: Mission, vehicle: Vehicle, log: Log) -> tuple[Track | None, list[str], list[str]]:
    """Return the track of a log, on the log's own clock, with what was left out of it and why it is not of this plan."""
    who, notes = f"{vehicle.id} ({log.source})", []
    fix = np.isfinite(log.lon) & np.isfinite(log.lat) & np.isfinite(log.time) & (np.abs(log.lat) <= 90)
    fix &= (np.abs(log.lon) <= 180) & ((log.lon != 0) | (log.lat != 0))
    if not fix.all():
        notes.append(f"{who}: {np.count_nonzero(~fix):,} of {len(fix):,} positions are no fix and left out")
    kept = np.flatnonzero(fix)
    if not len(kept):
        return None, notes, [f"{who}: there is no fix in it"]
    origin = np.radians([mission.frame.lon, mission.frame.lat])
    lon, lat = np.radians(log.lon[kept]), np.radians(log.lat[kept])
    part = np.sin((lat - origin[1]) / 2) ** 2 + np.cos(lat) * np.cos(origin[1]) * np.sin((lon - origin[0]) / 2) ** 2
    away = 2 * 6371000.0 * np.arcsin(np.sqrt(part))
    if np.median(away) > FAR:
        return None, notes, [f"{who}: is {np.median(away) / 1000:,.0f} km from the plan's site; it is of another mission"]
    if (away > FAR).any():
        notes.append(f"{who}: {np.count_nonzero(away > FAR):,} positions far from the site are left out")
    kept = kept[away <= FAR]
    time = log.time[kept]
    rising = _rising(time)
    cut = np.r_[False, np.diff(np.flatnonzero(rising)) > 1]  # the clock went back before it
    back = int(np.count_nonzero(np.diff(time) < 0))
    if back:
        left = len(time) - int(np.count_nonzero(rising))
        at = float(time[np.flatnonzero(np.diff(time) < 0)[0] + 1] - time[0])
        often = f"{back} times, first" if back > 1 else "once,"
        notes.append(f"{who}: its clock goes back {often} {at:,.0f} s into it; {left:,} positions are left out")
    told_back = len(notes) - 1
    kept, time = kept[rising], time[rising]
    days = np.split(np.arange(len(time)), np.flatnonzero(np.diff(time) > DAY) + 1)
    if len(days) > 1:
        most = max(days, key=len)
        notes.append(f"{who}: {len(time) - len(most):,} positions are more than a day from the rest and left out")
        kept, time, cut = kept[most], time[most], cut[most]
    xy = mission.frame.to_metres(np.column_stack([log.lon[kept], log.lat[kept]]))
    good, leapt, told = _without_leaps(xy, time, 2 * vehicle.model.max_speed, who)
    notes += told
    kept, time, xy, cut = kept[good], time[good], xy[good], cut[good]
    silence = np.diff(time)
    gaps = silence > max(GAP, OFTEN * float(np.median(silence))) if len(silence) else np.zeros(0, bool)
    by_clock = gaps & cut[1:]
    if by_clock.any():
        notes[told_back] += f", {silence[by_clock].sum():,.0f} s, in which nothing counts as covered"
    other = gaps & ~cut[1:]
    if other.any():
        first = int(np.argmax(other))
        notes.append(
            f"{who}: gaps: {np.count_nonzero(other)}, of {silence[other].sum():,.0f} s in all, the longest "
            f"{silence[other].max():,.0f} s, the first {time[first] - time[0]:,.0f} s into it; nothing counts as covered "
            "in them"
        )
    values = {n: getattr(log, n)[kept] for n in ("heading", "speed", "energy")}
    height = log.height[kept] if vehicle.domain == "aerial" else np.zeros(len(kept))
    track = Track(vehicle.id, time, xy[:, 0], xy[:, 1], height, **values, broken=np.r_[True, gaps] | leapt)
    return track, notes, []


def _rising(time: np.ndarray) -> np.ndarray:
    """Return (n,) bool: the most times, in their order, of which each is later than the one before."""
    if (np.diff(time) > 0).all():
        return np.ones(len(time), bool)
    ends: list[float] = []  # the least last time of a rising row of each length
    holders: list[int] = []
    before = np.full(len(time), -1)
    for i, t in enumerate(time.tolist()):
        length = bisect_left(ends, t)
        before[i] = holders[length - 1] if length else -1
        if length == len(ends):
            ends.append(t)
            holders.append(i)
        else:
            ends[length], holders[length] = t, i
    kept = np.zeros(len(time), bool)
    i = holders[-1]
    while i >= 0:
        kept[i] = True
        i = before[i]
    return kept


def _without_leaps(xy: np.ndarray, time: np.ndarray, speed: float, who: str) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Return which positions to keep, before which of the kept there is a jump all the same, and what to tell."""
    kept = np.arange(len(time))
    while True:
        leap = _leaps(xy[kept], time[kept], speed)
        runs = np.split(kept, np.flatnonzero(leap) + 1)
        longest = max(len(run) for run in runs)
        sound = [run for run in runs if len(run) == longest or time[run[-1]] - time[run[0]] >= BRIEF]
        if len(sound) == len(runs):
            break
        kept = np.concatenate(sound)
    told = []
    if len(kept) < len(time):
        told.append(f"{who}: {len(time) - len(kept):,} positions that jump away and back are left out")
    if leap.any():
        size = np.hypot(*np.diff(xy[kept], axis=0).T)[leap]
        at = time[kept][np.flatnonzero(leap)[0] + 1] - time[0]
        told.append(f"{who}: {len(size)} jumps of up to {size.max():,.0f} m, the first {at:,.0f} s into it")
    return kept, np.r_[False, leap], told


def _leaps(xy: np.ndarray, time: np.ndarray, speed: float) -> np.ndarray:
    return np.hypot(*np.diff(xy, axis=0).T) > LEAP + speed * np.diff(time)
