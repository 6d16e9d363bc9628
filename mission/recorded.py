"""How far a mission has come by its logs, or by the report of them: the progress that replanning starts from."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from quarterdeck.coverage.metrics import track_length
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.files import read_bytes
from quarterdeck.geo.kinds import REPORT, kind_of
from quarterdeck.mission.matching import Followed, along_lines, follow, planned_time
from quarterdeck.mission.mission import Mission, Route, unbroken
from quarterdeck.mission.progress import Progress, ends_at, planned_progress
from quarterdeck.mission.remaining import remaining_parts
from quarterdeck.mission.served import served_tasks
from quarterdeck.mission.survey_shares import VISITED
from quarterdeck.mission.track import Track, energy_used
from quarterdeck.mission.triage.stand import read_stand, stand_document

FINE = 1e-3  # spacings: tracks are thinned by no more
JUST = 10.0  # s: what is just done, or about to be, may count as either
SILENT = 60.0  # s: who has not been heard of for longer is told


def recorded_progress(
    mission: Mission,
    tracks: Sequence[Track],
    time: float,
    *,
    stopped: Mapping[str, float] | None = None,
    lost: Sequence[Track] = (),
) -> tuple[Progress, list[str]]:
    """Return the progress at `time` by the tracks of a mission, and what was taken for granted.

    Of vehicles in `stopped` nothing counts from then on; those without a track have done nothing, and must be lost. `lost`
    are tracks of vehicles that the plan gave up: what they surveyed counts, and they may come back from where they are.
    Raises InputError if a vehicle that is not in `stopped` has no track up to then, or one in it stopped later.
    """
    ends = ends_at(mission, time, stopped or {})
    routes = {r.vehicle: r for r in mission.routes}
    known = [_until(t, ends[t.vehicle]) for t in tracks if t.time[0] <= ends[t.vehicle]]
    for vehicle in mission.vehicles:
        if vehicle.id not in {t.vehicle for t in known} and vehicle.id not in (stopped or {}):
            raise InputError(f"{vehicle.id}: no track up to {time:g} s; give its log, or say --lost {vehicle.id}")
    positions, energy, along, lines, notes = {}, {}, {}, [], []
    for track in known:
        vehicle, route = mission.vehicle(track.vehicle), routes[track.vehicle]
        last = float(track.time[-1])
        if time - last > SILENT and not track.arrived <= last and vehicle.id not in (stopped or {}):
            notes.append(f"{vehicle.id}: its log ends at {last:,.0f} s; it is taken to be there still")
        height = float(np.nan_to_num(track.z[-1]))
        positions[vehicle.id] = (float(track.x[-1]), float(track.y[-1]), height)
        on = follow(mission, track)
        home = track.arrived <= last and int(on.leg[-1]) == len(route.waypoints) - 1
        along[vehicle.id] = route.duration if home else planned_time(vehicle, route, track, on)
        if not np.isfinite(track.energy).any():
            notes.append(f"{vehicle.id}: no energy in its log; reckoned from what {vehicle.model.name} draws at its speed")
        energy[vehicle.id] = float(energy_used(vehicle, track)[-1])
        if mission.spacing is not None:
            lines += surveyed_lines(route, track, on, FINE * mission.spacing)
    for track in (_until(t, time) for t in lost if t.time[0] <= time):
        vehicle = next(v for v in mission.lost if v.id == track.vehicle)
        positions[vehicle.id] = (float(track.x[-1]), float(track.y[-1]), float(np.nan_to_num(track.z[-1])))
        energy[vehicle.id] = float(energy_used(vehicle, track)[-1])
        if mission.spacing is not None:
            lines += _thinned(track, along_lines(mission, vehicle, track), FINE * mission.spacing)
    served = frozenset(served_tasks(mission, known))
    return Progress(time, positions, energy, tuple(lines), served, along), notes


def _until(track: Track, time: float) -> Track:
    """Return a track up to a time, at which the vehicle is between its places before and after."""
    if track.time[-1] <= time:
        return track
    count = int(np.searchsorted(track.time, time, side="right"))
    end = count + int(not track.broken[count])
    names = ("x", "y", "z", "heading", "speed", "energy")
    cut = {n: getattr(track, n)[:end].copy() for n in (*names, "time", "broken")}
    if end > count:
        part = (time - track.time[count - 1]) / (track.time[count] - track.time[count - 1])
        for n in (*names, "time"):
            values = getattr(track, n)
            cut[n][-1] = values[count - 1] + part * (values[count] - values[count - 1])
    return replace(track, **cut, arrived=track.arrived if track.arrived <= time else float("inf"))


def surveyed_lines(route: Route, track: Track, on: Followed, tolerance: float) -> list[np.ndarray]:
    """Return the (n, 2) lines in metres along which a vehicle surveyed, thinned by no more than `tolerance`."""
    return _thinned(track, (route.survey[on.leg] & ~on.strayed) | on.elsewhere, tolerance)


def _thinned(track: Track, survey: np.ndarray, tolerance: float) -> list[np.ndarray]:
    lines = unbroken(track.xy, survey & ~track.broken)
    return [shapely.get_coordinates(shapely.simplify(shapely.LineString(line), tolerance)) for line in lines]


def as_planned(mission: Mission, progress: Progress) -> bool:
    """Whether what is done is what each route has had so far: nothing was left out, and nothing done in another order."""
    if progress.along is None:
        return True
    plan = planned_progress(mission, max(progress.along.values(), default=0.0), stopped=progress.along)
    if mission.spacing is None:
        due = {w.task: w.time + w.hold - progress.along[r.vehicle] for r in mission.routes for w in r.waypoints}
        return all(abs(due[task]) <= JUST for task in plan.served ^ progress.served)
    near = VISITED * mission.spacing
    runs = [run for r in mission.routes for run in unbroken(r.xyz[:, :2], r.survey)]
    coming = [line for left in remaining_parts(runs, plan.tracks, near) for line in left]
    left_out = [line for left in remaining_parts(plan.tracks, progress.tracks, near) for line in left]
    undone = remaining_parts(coming, progress.tracks, near)
    ahead = [track_length(line) - sum(map(track_length, left)) for line, left in zip(coming, undone, strict=True)]
    return max([*ahead, *map(track_length, left_out)], default=0.0) <= mission.spacing


def progress_state(mission: Mission, progress: Progress) -> dict[str, Any]:
    """Return the progress as JSON can hold it, places in degrees: what a report tells for `replan --state`."""

    def degrees(xy: Any) -> list[Any]:
        return np.round(mission.frame.to_degrees(np.asarray(xy)), 9).tolist()

    return {
        "input_hash": mission.input_hash,
        "time": progress.time,
        "vehicles": {
            v: {
                "position": [*degrees([place[:2]])[0], round(place[2], 3)],
                "energy": round(progress.energy[v], 3),
                "along": round((progress.along or {}).get(v, progress.time), 3),
            }
            for v, place in progress.positions.items()
        },
        "served": sorted(progress.served),
        "tracks": [degrees(line) for line in progress.tracks],
        **({} if progress.stand is None else {"triage": stand_document(progress.stand)}),
    }


def read_state(mission: Mission, path: str, *, lost: frozenset[str] = frozenset()) -> Progress:
    """Return the progress that a report tells. Raises InputError if it tells none, or not of this mission."""
    data = read_bytes(path)
    try:
        document = json.loads(data)
        state = document["state"]
        places = {v: s["position"] for v, s in state["vehicles"].items()}
        xy = {v: mission.frame.to_metres(np.array([place[:2]]))[0] for v, place in places.items()}
        progress = Progress(
            time=float(state["time"]),
            positions={v: (float(xy[v][0]), float(xy[v][1]), float(place[2])) for v, place in places.items()},
            energy={v: float(s["energy"]) for v, s in state["vehicles"].items()},
            tracks=tuple(mission.frame.to_metres(np.array(line, float)) for line in state["tracks"]),
            served=frozenset(map(str, state["served"])),
            along={v: float(s["along"]) for v, s in state["vehicles"].items()},
            # Of a triage team the stand tells: a medic who loses a device works on.
            lost=frozenset(str(v["id"]) for v in document["vehicles"] if v["lost"] and "triage" not in state),
        )
        of, triage = state["input_hash"], state.get("triage")
    except (ValueError, KeyError, TypeError, IndexError, AttributeError, RecursionError):
        kind = f"is {kind}" if (kind := kind_of(data)) not in (None, REPORT) else "is no report with a state in it"
        raise InputError(f"{path}: {kind}; write a report with `simulate` or `report --report`") from None
    if of != mission.input_hash:
        raise InputError(f"{path}: is the report of another plan (its site's SHA-256 differs)")
    if triage is not None:
        progress = replace(progress, stand=read_stand(triage, mission, path))
    for vehicle in mission.vehicles:
        if vehicle.id not in progress.positions and vehicle.id not in lost:
            raise InputError(f"{path}: does not say where {vehicle.id} is; say --lost {vehicle.id}")
    return progress
