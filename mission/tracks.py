"""What really happened, from logs: where each vehicle of a plan was, on the mission's clock, and what is wrong with it."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.logs import Log, read_logs
from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.mission import Mission, Route

GAP, OFTEN = 10.0, 10.0  # s, and times the usual interval: a longer silence is a gap
DAY = 86_400.0  # s: what is farther from the rest is of another mission, or has a wrong time
LEAP = 10.0  # m beyond twice the greatest speed: a longer step is a jump
BRIEF = 5.0  # s: fixes that jump away for no longer are wrong; for longer, it was moved
FAR = 100_000.0  # m from the site: not this plan's
SPELL = 3600.0  # s between the first and the last to set off, beyond the plan's: not one mission
PLACES, LITTLE = 500, 0.2  # of a track looked at; a part that is too little
NEAR = 4.0  # lengths: so near its start or end a vehicle is there


@dataclass(frozen=True, slots=True)
class Track:
    """Where a vehicle was. Arrays are (n,), in the order of `time`, seconds since the mission's start.

    `x`, `y`, `z` metres in the frame, z above where it was launched; `heading` radians counter-clockwise from east, `speed`
    m/s, `energy` Wh used since the mission's start: NaN where the log does not say. `broken`: how it came there from the
    place before is not known. `arrived` is when it had come home for good, inf if it never did.
    """

    vehicle: str
    time: np.ndarray
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    heading: np.ndarray
    speed: np.ndarray
    energy: np.ndarray
    broken: np.ndarray
    arrived: float = float("inf")

    @property
    def xy(self) -> np.ndarray:
        """(n, 2) metres."""
        return np.column_stack([self.x, self.y])


@dataclass(frozen=True, slots=True)
class Record:
    """The tracks of a plan's vehicles, in its order; `notes` is what was left out or taken for granted, `reasons` why the
    logs are not of this plan, one line each. `start` is the mission's start in Unix seconds, where known.
    """

    tracks: tuple[Track, ...]
    notes: tuple[str, ...]
    reasons: tuple[str, ...]
    start: float | None = None


def read_tracks(mission: Mission, files: Sequence[str], *, start: float | None = None) -> Record:
    """Return the tracks in log files, each `FILE` or `VEHICLE=FILE`, the latter also `VEHICLE=FILE#NAME IN THE FILE`.

    A file that names its vehicles as the plan does needs no more; else its name, without the ending, is the vehicle's.
    `start` is the mission's start in Unix seconds; by default that at which the autopilots took up their missions, or else
    at which the vehicles set off.

    Raises InputError if a file cannot be read, or it is not clear whose it is.
    """
    return record(mission, [_assigned(mission, given) for given in files], start=start)


def _assigned(mission: Mission, given: str) -> list[tuple[str, Log]]:
    """Return (vehicle, log) of the vehicles of one file."""
    ids = [v.id for v in mission.vehicles]
    vehicle, equals, path = given.partition("=")
    if not equals or (vehicle not in ids and Path(given).exists()):
        vehicle, path = "", given
    if vehicle and vehicle not in ids:
        raise InputError(f"--track {given}: unknown vehicle {vehicle!r}; the plan has {', '.join(ids)}")
    name = ""
    if "#" in path and not Path(path).exists():
        path, _, name = path.rpartition("#")
    logs = read_logs(path)
    inside = [log.vehicle for log in logs]
    if name:
        logs = [log for log in logs if log.vehicle == name]
        if not logs:
            raise InputError(f"--track {given}: no {name!r} in the file; it has {', '.join(map(repr, inside))}")
    if not vehicle and (named := [(log.vehicle, log) for log in logs if log.vehicle in ids]):
        return named
    vehicle = vehicle or Path(path).stem
    if vehicle not in ids:
        raise InputError(f"{path}: whose is it? Write --track VEHICLE={path}, with one of {', '.join(ids)}")
    own = [log for log in logs if log.vehicle == vehicle] or logs
    if len({log.vehicle for log in own}) > 1:
        raise InputError(
            f"{path}: has {len(own)} tracks; write --track {vehicle}={path}#NAME, with one of {', '.join(inside)}"
        )
    return [(vehicle, log) for log in own]


def record(mission: Mission, files: Sequence[Sequence[tuple[str, Log]]], *, start: float | None = None) -> Record:
    """Return the tracks of (vehicle, log) pairs, cleaned, on the mission's clock and in the order of its vehicles.

    Raises InputError if a vehicle has two logs on different clocks.
    """
    notes: list[str] = []
    reasons: list[str] = []
    logs: dict[str, list[Log]] = {}
    for name, log in (pair for file in files for pair in file):
        logs.setdefault(name, []).append(log)
        notes += [n for n in log.notes if n not in notes]
    raw = {}
    routes = {r.vehicle: r for r in mission.routes if r.waypoints}
    for vehicle in mission.vehicles:
        if vehicle.id not in routes:
            reasons.append(f"{vehicle.id}: the plan has no route for it")
            continue
        if vehicle.id not in logs:
            reasons.append(f"{vehicle.id}: no track given")
            continue
        whole = _joined(vehicle.id, logs[vehicle.id])
        track, told, wrong = _cleaned(mission, vehicle, whole)
        notes += told
        reasons += wrong
        if track is not None:
            raw[vehicle.id] = (whole, track)
    began = {i: _began(mission.vehicle(i), routes[i], log, track) for i, (log, track) in raw.items()}
    clocked = {i: began[i] for i, (log, _) in raw.items() if log.clock == "unix"}
    if start is None and clocked:
        start = min(clocked.values())
    tracks = []
    for vehicle_id, (log, track) in raw.items():
        zero = {"mission": 0.0, "boot": began[vehicle_id], "unix": start or 0.0}[log.clock]
        moved = _since(track, zero)
        late = began[vehicle_id] - zero
        if len(moved.time) < 2:
            reasons.append(f"{vehicle_id}: its log ends {zero - track.time[-1]:,.0f} s before the mission's start")
            continue
        if abs(late) > SPELL:
            reasons.append(f"{vehicle_id}: sets off {late:,.0f} s after the mission's start; is its log of another day?")
        tracks.append(_until_home(mission.vehicle(vehicle_id), routes[vehicle_id], moved))
    reasons += _on_other_routes(mission, tracks)
    return Record(tuple(tracks), tuple(notes), tuple(reasons), start)


def _on_other_routes(mission: Mission, tracks: Sequence[Track]) -> list[str]:
    """Return a line for each track that hardly touches its own route; it names another's that it is all along."""
    lines = {r.vehicle: shapely.LineString(r.xyz[:, :2]) for r in mission.routes if len(r.waypoints) > 1}
    told = []
    for track in tracks:
        near = 0.25 * mission.spacing if mission.spacing else max(5.0, 2 * mission.vehicle(track.vehicle).model.length)
        way = np.r_[0.0, np.cumsum(np.hypot(*np.diff(track.xy, axis=0).T))]
        if track.vehicle not in lines or way[-1] <= 2 * near:
            continue
        at = np.searchsorted(way, np.linspace(0.0, way[-1], PLACES))
        places = shapely.points(track.xy[np.minimum(at, len(way) - 1)])
        share = {vehicle: float(shapely.dwithin(places, line, near).mean()) for vehicle, line in lines.items()}
        other = max(share, key=lambda v: share[v])
        if share[track.vehicle] < LITTLE:
            also = f"; it follows that of {other}: are the files exchanged?" if share[other] > 1 - LITTLE else ""
            told.append(f"{track.vehicle}: only {share[track.vehicle]:.0%} of its way is along its route{also}")
    return told


def _joined(vehicle: str, logs: list[Log]) -> Log:
    """Return the logs of one vehicle, such as of several flights, as one."""
    if len(logs) == 1:
        return logs[0]
    if len({log.clock for log in logs}) > 1 or logs[0].clock == "boot":
        raise InputError(f"{vehicle}: its logs are on different clocks ({', '.join(log.source for log in logs)}); give one")
    logs = sorted(logs, key=lambda log: float(np.nanmin(log.time)))
    columns: dict[str, Any] = {
        n: np.concatenate([getattr(log, n) for log in logs])
        for n in ("time", "lon", "lat", "height", "heading", "speed", "energy")
    }
    level = 0.0
    parts = []
    for log in logs:  # each counts its energy from its own beginning
        parts.append(log.energy - np.nan_to_num(log.energy[:1]) + level)
        level = float(parts[-1][-1]) if len(parts[-1]) and np.isfinite(parts[-1][-1]) else level
    columns["energy"] = np.concatenate(parts)
    begun = tuple(sorted(b for log in logs for b in log.begun))
    return Log(vehicle, ", ".join(log.source for log in logs), logs[0].clock, **columns, begun=begun)


def _cleaned(mission: Mission, vehicle: Vehicle, log: Log) -> tuple[Track | None, list[str], list[str]]:
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
    kept = kept[away <= 2 * FAR]
    time = log.time[kept]
    rising = _rising(time)
    back = int(np.count_nonzero(np.diff(time) < 0))
    if back:
        left = len(time) - int(np.count_nonzero(rising))
        at = float(time[np.flatnonzero(np.diff(time) < 0)[0] + 1] - time[0])
        notes.append(f"{who}: its clock goes back {back} times, first {at:,.0f} s into it; {left:,} positions are left out")
    kept, time = kept[rising], time[rising]
    days = np.split(np.arange(len(time)), np.flatnonzero(np.diff(time) > DAY) + 1)
    if len(days) > 1:
        most = max(days, key=len)
        notes.append(f"{who}: {len(time) - len(most):,} positions are more than a day from the rest and left out")
        kept, time = kept[most], time[most]
    xy = mission.frame.to_metres(np.column_stack([log.lon[kept], log.lat[kept]]))
    good, leapt, told = _without_leaps(xy, time, 2 * vehicle.model.max_speed, who)
    notes += told
    kept, time, xy = kept[good], time[good], xy[good]
    silence = np.diff(time)
    gaps = silence > max(GAP, OFTEN * float(np.median(silence))) if len(silence) else np.zeros(0, bool)
    if gaps.any():
        first = int(np.argmax(gaps))
        notes.append(
            f"{who}: gaps: {np.count_nonzero(gaps)}, of {silence[gaps].sum():,.0f} s in all, the longest "
            f"{silence.max():,.0f} s, the first {time[first] - time[0]:,.0f} s into it; nothing counts as covered in them"
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


def _began(vehicle: Vehicle, route: Route, log: Log, track: Track) -> float:
    """Return when, on the log's clock, the mission began, by one vehicle: when its autopilot last took it up before it set
    off, or else when it set off, less the wait that the plan has.
    """
    away = np.hypot(track.x - vehicle.start[0], track.y - vehicle.start[1])
    near = away <= NEAR * vehicle.model.length
    if not near.any():
        left = float(track.time[0])
    else:
        first = int(np.argmax(near))
        out = first + int(np.argmin(np.r_[near[first:], False]))  # the first after it that is not near
        left = at_rest(track, slice(first, out), last=True)
    taken = [b for b in log.begun if b <= left + 1.0]
    wait = route.waypoints[0].hold if route.waypoints else 0.0
    return max(taken) if taken else left - wait


MOMENT, CREEP = 5.0, 0.03  # s, m: who moves less in that time, but for the receiver's noise, is at rest


def at_rest(track: Track, stay: slice, *, last: bool) -> float:
    """Return when in a stay the vehicle was last at rest, or first to stay so to its end; its border if it never was."""
    xyz, time = np.column_stack([track.x, track.y, np.nan_to_num(track.z)])[stay], track.time[stay]
    if last:  # seen backwards, it is to come to rest
        xyz, time = xyz[::-1], -time[::-1]
    bend = xyz[2:] - 2 * xyz[1:-1] + xyz[:-2]
    noise = float(np.median(np.abs(bend))) * 1.5 / np.sqrt(6.0) if len(bend) else 0.0
    later = np.minimum(np.searchsorted(time, time + MOMENT), len(time) - 1)
    moving = np.flatnonzero(np.linalg.norm(xyz[later] - xyz, axis=1) >= CREEP + 5.0 * noise)
    at = min(int(moving[-1]) + 1, len(time) - 1) if len(moving) else 0
    return -float(time[at]) if last else float(time[at])


def _since(track: Track, zero: float) -> Track:
    """Return a track on the mission's clock from its start on, heights and energy counted from there."""
    first = max(int(np.searchsorted(track.time, zero, side="right")) - 1, 0)  # the last place before the start is kept
    cut = {n: getattr(track, n)[first:] for n in ("x", "y", "z", "heading", "speed", "energy", "broken")}
    for name in ("z", "energy"):
        known = np.flatnonzero(np.isfinite(cut[name]))
        cut[name] = cut[name] - cut[name][known[0]] if len(known) else cut[name]
    return Track(track.vehicle, np.maximum(track.time[first:] - zero, 0.0), **cut)


def _until_home(vehicle: Vehicle, route: Route, track: Track) -> Track:
    """Return a track with the time at which the vehicle had come to its route's end for good, and nothing after it."""
    if not route.waypoints:
        return track
    end = route.xyz[-1, :2]
    there = np.hypot(track.x - end[0], track.y - end[1]) <= NEAR * vehicle.model.length
    if not there[-1] or there.all():
        return track
    first = len(there) - int(np.argmin(there[::-1]))
    arrived = at_rest(track, slice(first, len(there)), last=False)
    stays = track.time <= arrived
    cut = {n: getattr(track, n)[stays] for n in ("time", "x", "y", "z", "heading", "speed", "energy", "broken")}
    return Track(track.vehicle, **cut, arrived=arrived)
