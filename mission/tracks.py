"""What really happened, from logs: where each vehicle of a plan was, on the mission's clock, and what is wrong with it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.logs import Log, read_logs
from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.cleaning import cleaned
from quarterdeck.mission.mission import Mission, Route
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.track import Track, set_off, since, until_home
from quarterdeck.mission.triage.plan import METHOD

LATE, ANOTHER_DAY = 60.0, 43_200.0  # s after the plan: told, and taken for another mission
PLACES, LITTLE = 500, 0.2  # of a track looked at; a part that is too little


@dataclass(frozen=True, slots=True)
class Record:
    """The tracks of a plan's vehicles, in its order, and of those that it gave up (`lost`); `notes` is what was left out or
    taken for granted, `reasons` why the logs are not of this plan, one line each. `start` is the mission's start in Unix
    seconds, where known.
    """

    tracks: tuple[Track, ...]
    notes: tuple[str, ...]
    reasons: tuple[Reason, ...]
    start: float | None = None
    lost: tuple[Track, ...] = ()


def read_tracks(mission: Mission, files: Sequence[str], *, start: float | None = None) -> Record:
    """Return the tracks in log files, each `FILE` or `VEHICLE=FILE`, the latter also `VEHICLE=FILE#NAME IN THE FILE`.

    A file that names its vehicles as the plan does needs no more; else its name, without the ending, is the vehicle's.
    `start` is the mission's start in Unix seconds; by default that at which the autopilots took up their missions, or else
    at which the vehicles set off.

    Raises InputError if a file cannot be read, or it is not clear whose it is.
    """
    return record(mission, [_assigned(mission, given) for given in files], start=start)


def track_file(ids: Sequence[str], given: str) -> tuple[str, str, str]:
    """Return vehicle, path and the name in the file of `[VEHICLE=]FILE[#NAME]`, "" for what is not said.

    Raises InputError for a vehicle that is none of `ids`.
    """
    vehicle, equals, path = given.partition("=")
    if not equals or (vehicle not in ids and Path(given).exists()):
        vehicle, path = "", given
    if not path:
        raise InputError(f"--track {given}: there is no path; give that of a log")
    if vehicle and vehicle not in ids:
        raise InputError(f"--track {given}: unknown vehicle {vehicle!r}; the plan has {', '.join(ids)}")
    name = ""
    if "#" in path and not Path(path).exists():
        path, _, name = path.rpartition("#")
    return vehicle, path, name


def _assigned(mission: Mission, given: str) -> list[tuple[str, Log]]:
    """Return (vehicle, log) of the vehicles of one file."""
    ids = [v.id for v in (*mission.vehicles, *mission.lost)]
    vehicle, path, name = track_file(ids, given)
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
        whose = f"is of {', '.join(filter(None, inside))}, none of them in this plan" if any(inside) else "whose is it?"
        raise InputError(f"{path}: {whose}; write --track VEHICLE={path}, with one of {', '.join(ids)}")
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
    reasons: list[Reason] = []
    logs: dict[str, list[Log]] = {}
    for name, log in (pair for file in files for pair in file):
        logs.setdefault(name, []).append(log)
        notes += [n for n in log.notes if n not in notes]
    raw = {}
    routes, triage = {r.vehicle: r for r in mission.routes if r.waypoints}, mission.method == METHOD
    for vehicle in mission.vehicles:
        if vehicle.id not in routes:
            reasons.append(Reason(f"{vehicle.id}: the plan has no route for it"))
            continue
        if vehicle.id not in logs:
            reasons.append(Reason("no track given", "track", vehicle.id))
            continue
        whole = _joined(vehicle.id, logs[vehicle.id])
        track, told, wrong = cleaned(mission, vehicle, whole)
        notes += told
        reasons += map(Reason, wrong)
        if track is not None:
            raw[vehicle.id] = (whole, track)
    began = {i: _began(mission.vehicle(i), routes[i], log, track) for i, (log, track) in raw.items()}
    clocked = {i: began[i] for i, (log, _) in raw.items() if log.clock == "unix"}
    if start is None and clocked:
        start = min(clocked.values())
    tracks = []
    for vehicle_id, (log, track) in raw.items():
        zero = {"mission": 0.0, "boot": began[vehicle_id], "unix": start or 0.0}[log.clock]
        moved = since(track, zero)
        late = began[vehicle_id] - zero
        if len(moved.time) < 2:
            reasons.append(Reason(f"{vehicle_id}: its log ends {zero - track.time[-1]:,.0f} s before the mission's start"))
            continue
        if abs(late) > ANOTHER_DAY:
            why = f"{vehicle_id}: sets off {late:,.0f} s after the mission's start; is its log of another day?"
            reasons.append(Reason(why))
        elif abs(late) > LATE and not triage:
            notes.append(f"{vehicle_id}: sets off {late:,.0f} s later than planned, counted from the mission's start")
        # A triage plan's routes are what everybody would do if nobody were found: they tell neither when nor where.
        tracks.append(moved if triage else until_home(mission.vehicle(vehicle_id), routes[vehicle_id], moved))
    reasons += [] if triage else map(Reason, _on_other_routes(mission, tracks))
    lost, told = _lost_tracks(mission, logs, start)
    notes += told
    return Record(tuple(tracks), tuple(notes), tuple(reasons), start, tuple(lost))


def _lost_tracks(mission: Mission, logs: Mapping[str, list[Log]], start: float | None) -> tuple[list[Track], list[str]]:
    """Return the tracks of vehicles that the plan has given up, as far as they are known, and what is to be told of them.

    `start` is the mission's, in Unix seconds, where it is known.
    """
    lost, notes = list[Track](), list[str]()
    for vehicle in mission.lost:  # it has no route: its clock is the others', or the mission's
        if vehicle.id not in logs:
            notes.append(f"{vehicle.id}: lost before this plan began; it has no route in it, and nothing is expected of it")
        else:
            whole = _joined(vehicle.id, logs[vehicle.id])
            track, told, wrong = cleaned(mission, vehicle, whole)
            notes += [*told, *wrong]
            began_at = {"mission": 0.0, "unix": start}.get(whole.clock)
            heard = None if track is None or began_at is None else since(track, began_at)
            if heard is None or len(heard.time) < 2:
                notes.append(f"{vehicle.id}: given up by this plan; by its log it is not known where it is now")
            else:
                lost.append(heard)
                notes.append(f"{vehicle.id}: given up by this plan; where it is and what it surveyed is taken from its log")
    return lost, notes


def _began(vehicle: Vehicle, route: Route, log: Log, track: Track) -> float:
    """Return when, on the log's clock, the mission began, by one vehicle: when its autopilot last took it up before it set
    off, or else when it set off, less the wait that the plan has.
    """
    left = set_off(vehicle, track)
    return max((b for b in log.begun if b <= left + 1.0), default=left - route.waypoints[0].hold)


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
