"""A real mission measured as a simulated one: the trace that its logs come to, and the report of it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from quarterdeck.coverage.metrics import uncovered
from quarterdeck.geo.angles import wrap
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.matching import Followed, follow, off_legs, tolerance
from quarterdeck.mission.mission import Mission, Route
from quarterdeck.mission.recorded import progress_state, recorded_progress
from quarterdeck.mission.routes import survey_lines
from quarterdeck.mission.served import served_tasks
from quarterdeck.mission.track import NEAR, Track, energy_used, pace
from quarterdeck.mission.tracks import Record
from quarterdeck.mission.triage.plan import METHOD, run_plan, scenario_of
from quarterdeck.mission.triage.sight import seen_by
from quarterdeck.mission.triage.team import field_of
from quarterdeck.physics.measure import measure
from quarterdeck.physics.paths import LEGS, vehicle_limits
from quarterdeck.physics.report import Report
from quarterdeck.physics.seen import unseen, whole_tracks
from quarterdeck.physics.simulate import LATE, Run
from quarterdeck.physics.swath import TOLERANCE, driven_tracks
from quarterdeck.physics.trace import COLUMNS, UNKNOWN, Trace
from quarterdeck.physics.triage import expected, side_by_side, told_by_tracks

FINEST, COARSEST = 0.1, 1.0  # s between samples
MOST = 1_000_000  # samples: of longer missions they are farther apart
OTHERS = 0.05  # of its time along others' lines: more is no detour
STILL = 0.05  # m/s: slower, it stands
HULL = 1.0  # m over which a course is taken for the heading, where the log has none


def report_tracks(
    mission: Mission,
    record: Record,
    *,
    limits: Mapping[str, float] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> Run:
    """Measure what logs tell (`mission.tracks.read_tracks`) against the plan, as `simulate` measures a run.

    The reasons of `record` fail it, its notes go with it. Where a log has no energy it is reckoned from the vehicle's
    power at its speed, and where it has no heading from its course. Raises InputError for an unknown limit.
    """
    followed = [follow(mission, t) for t in record.tracks]
    trace, notes = observed_trace(mission, record.tracks, followed)
    if mission.method == METHOD:
        return _triage_tracks(mission, record, trace, notes, limits or {}, settings or {})
    served = served_tasks(mission, record.tracks)
    gone: dict[str, float] = mission.parameters.get("lost_at", {})
    arrived = {t.vehicle for t in record.tracks if np.isfinite(t.arrived)} - gone.keys()
    short = [t for t in record.tracks if t.vehicle not in arrived | gone.keys()]
    notes += [f"{t.vehicle}: its log ends at {t.time[-1]:,.0f} s, before it was home" for t in short]
    swapped = [t.vehicle for t, on in zip(record.tracks, followed, strict=True) if _on_others(mission, t, on)]
    if swapped:
        notes.append(
            f"{', '.join(swapped)}: surveyed lines that the plan gives to others; a run that replanned is measured by the "
            "plan as it was told (simulate --told)"
        )
    report = measure(
        mission,
        trace,
        finished=[v.id in arrived for v in mission.vehicles],
        aground=[False] * len(mission.vehicles),
        served={task: when for task, (when, _) in served.items()},
        servers={task: vehicle for task, (_, vehicle) in served.items()},
        lost=[v.id in gone for v in mission.vehicles],
        relieved=gone,
        limits=limits or {},
        settings=settings or {},
        trouble=[str(r) for r in record.reasons],
        notes=(*record.notes, *notes),
    )
    return Run(trace, report)


def _on_others(mission: Mission, track: Track, on: Followed) -> bool:
    """Return whether a vehicle spent more than OTHERS of its time along survey lines that are not of its route."""
    apart = np.flatnonzero(on.elsewhere)
    if len(apart) <= OTHERS * len(on.elsewhere):
        return False
    route = next(r for r in mission.routes if r.vehicle == track.vehicle)
    own = shapely.MultiLineString(survey_lines([route]))
    near = tolerance(mission, mission.vehicle(track.vehicle))
    return bool((~shapely.dwithin(shapely.points(track.xy[apart]), own, near)).sum() > OTHERS * len(on.elsewhere))


def _triage_tracks(
    mission: Mission,
    record: Record,
    trace: Trace,
    notes: Sequence[str],
    limits: Mapping[str, float],
    settings: Mapping[str, Any],
) -> Run:
    """Measure a triage mission by its tracks: what was searched, who could be found and treated, energy, fence, encounters.

    There is no route to be off, nor an end to come to: both follow from who is found where.
    """
    fast = run_plan(mission)
    trace = replace(trace, cross=np.zeros_like(trace.cross))
    driven = told_by_tracks(mission, trace, fast)
    report = measure(
        expected(mission, fast),
        trace,
        finished=[True] * len(mission.vehicles),
        aground=[False] * len(mission.vehicles),
        served={},
        limits={"delay": LATE} | dict(limits),
        settings=settings,
        trouble=[*(str(r) for r in record.reasons), *driven.reasons],
        notes=(*record.notes, *notes, "who was told of whom, and when, tracks do not tell"),
        triage=side_by_side(fast, driven, ("undeliverable", "medic_idle")),
    )
    field = field_of(scenario_of(mission))
    planned, searched = (seen_by(o.team, o.run.tracks).intersection(field).area / field.area for o in (fast, driven))
    figures = {**report.figures, "coverage_planned": planned, "coverage_driven": searched}
    allowed = report.limits["coverage_loss"]
    short = f"searched {searched:.2%} of the field, {planned:.2%} in the fast world"
    reasons = (*report.reasons, *([short] if allowed is not None and planned - searched > allowed else []))
    return Run(trace, replace(report, figures=figures, reasons=reasons))


def with_state(mission: Mission, run: Run, tracks: Sequence[Track]) -> Report:
    """Return the report with where the mission stands at the end of its tracks; as it is where that is not known.

    It is not where a vehicle has no route, and of a triage mission that was not simulated.
    """
    report = run.report
    if run.triage is not None:
        return replace(report, state=progress_state(mission, run.triage.progress))
    if mission.method == METHOD:
        return report
    if {r.vehicle for r in mission.routes if r.waypoints} != {v.id for v in mission.vehicles}:
        return report
    until = max((float(t.time[-1]) for t in tracks), default=0.0)
    unheard = {v.id: 0.0 for v in mission.vehicles if v.id not in {t.vehicle for t in tracks}}
    progress, _ = recorded_progress(mission, tracks, until, stopped=unheard)
    return replace(report, state=progress_state(mission, progress))


def missed(mission: Mission, trace: Trace) -> BaseGeometry:
    """Return what of the area the run left uncovered, or where guards cover unseen, metres.

    Raises InputError if the plan covers nothing.
    """
    if mission.method == "guards":
        return unseen(mission, whole_tracks(trace, TOLERANCE))
    if mission.spacing is None:
        raise InputError(f"a plan made by {mission.method!r} covers nothing; it leaves no gaps")
    return uncovered(driven_tracks(trace), mission.site.coverable, mission.spacing)


def observed_trace(mission: Mission, tracks: Sequence[Track], followed: Sequence[Followed]) -> tuple[Trace, list[str]]:
    """Return the trace of all vehicles at common times, and what had to be reckoned.

    In gaps, before a log's beginning and after its end `kind` is UNKNOWN. After it has come home a vehicle lies there.
    """
    usual = [float(np.median(np.diff(t.time))) for t in tracks if len(t.time) > 1]
    step = round(float(np.clip(min(usual, default=COARSEST), FINEST, COARSEST)), 3)
    until = max((float(t.time[-1]) for t in tracks), default=0.0)
    step = max(step, until / MOST)
    time = np.arange(int(np.ceil(until / step - 1e-9)) + 1) * step
    vehicles, count = mission.vehicles, len(mission.vehicles)
    table: dict[str, np.ndarray] = {n: np.zeros((len(time), count), dtype) for n, dtype in COLUMNS.items()}
    table["kind"][:] = UNKNOWN
    zones = vehicle_limits(vehicles)["zone"]
    by_vehicle = {t.vehicle: (t, f) for t, f in zip(tracks, followed, strict=True)}
    gone = mission.parameters.get("lost_at", {})
    routes = {r.vehicle: r for r in mission.routes}
    notes = []
    for i, vehicle in enumerate(vehicles):
        if vehicle.id not in by_vehicle:
            table["x"][:, i], table["y"][:, i] = vehicle.start
            continue
        track, on = by_vehicle[vehicle.id]
        reckoned = not np.isfinite(track.energy).any()
        if reckoned:
            notes.append(
                f"{vehicle.id}: no energy in its log; reckoned from the power of {vehicle.model.name} at its speed"
            )
        for name, values in _columns(vehicle, routes[vehicle.id], track, on, time, float(zones[i])).items():
            table[name][:, i] = values
        if vehicle.id in gone and vehicle.domain != "aerial":  # where it was lost is no berth: others pass its wreck
            off = np.hypot(*(np.column_stack([table["x"][:, i], table["y"][:, i]]) - vehicle.start).T)
            table["underway"][:, i] = (table["kind"][:, i] != UNKNOWN) & (off > NEAR * vehicle.model.length)
    return Trace(vehicles=tuple(v.id for v in vehicles), time=time, **table), notes


def _columns(
    vehicle: Vehicle, route: Route, track: Track, on: Followed, time: np.ndarray, zone: float
) -> dict[str, np.ndarray]:
    """Return the (t,) columns of one vehicle in the trace."""
    aerial = vehicle.domain == "aerial" and bool(np.isfinite(track.z).any())
    heights = track.z if aerial else np.zeros(len(track.time))
    x, y, z = (_known(time, track.time, a) for a in (track.x, track.y, heights))
    latest = np.clip(np.searchsorted(track.time, time, side="right") - 1, 0, len(track.time) - 1)
    coming = np.minimum(latest + 1, len(track.time) - 1)
    home = time > track.arrived
    known = (time >= track.time[0]) & (time <= track.time[-1]) & ~(track.broken[coming] & (coming > latest))
    leg = _wheeled_over(vehicle, route, on.leg[latest], np.column_stack([x, y]))
    places = np.column_stack([x, y, z]) if aerial else np.column_stack([x, y])
    along, length, off = off_legs(route, leg, places)
    beyond = np.maximum(-along, along - length)
    cross = np.linalg.norm(off, axis=1)
    if not aerial:  # to port of the leg
        span = route.xyz[leg, :2] - route.xyz[np.maximum(leg - 1, 0), :2]
        cross = np.where(span[:, 0] * off[:, 1] < span[:, 1] * off[:, 0], -cross, cross)
    # Off the line through the leg, as the simulation has it; but far beyond its ends off the leg.
    cross = np.where(beyond <= zone, cross, np.hypot(cross, beyond))
    speed = np.interp(time, track.time, pace(track))
    waiting = np.array([w.hold > 0 for w in route.waypoints])
    holding = (speed < STILL) & (waiting[leg] | waiting[np.maximum(leg - 1, 0)])
    turning = ((beyond > -zone) & (beyond <= zone)) | holding | home
    start, end = np.array(vehicle.start), route.xyz[-1, :2]
    harbour = NEAR * vehicle.model.length
    near = np.minimum(np.hypot(x - start[0], y - start[1]), np.hypot(x - end[0], y - end[1])) <= harbour
    codes = np.array([LEGS.index(w.leg) for w in route.waypoints], np.int8)
    surveying = (route.survey[leg] & ~on.strayed[latest]) | on.elsewhere[latest]
    kind = np.where(surveying, LEGS.index("survey"), np.where(route.survey[leg], LEGS.index("transit"), codes[leg]))
    return {
        "x": x,
        "y": y,
        "z": z,
        "heading": _heading(track, time),
        "speed": np.where(home, 0.0, speed),
        "energy": np.interp(time, track.time, energy_used(vehicle, track)),
        "cross": np.where(holding | home, 0.0, cross),
        "leg": leg,
        "kind": np.where(known | home, kind, UNKNOWN),
        "turning": turning,
        "underway": known & ~near & ~home,
    }


def _wheeled_over(vehicle: Vehicle, route: Route, leg: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """Return (t,) legs with each corner's turn in the leg after it, as the guidance of vessels counts (`guidance.py`)."""
    if vehicle.domain != "surface" or len(route.waypoints) < 3:
        return leg
    limits = vehicle_limits([vehicle])[0]
    step = np.diff(route.xyz[:, :2], axis=0)
    length, course = np.hypot(*step.T), np.arctan2(step[:, 1], step[:, 0])
    half = np.abs(wrap(np.diff(course))) / 2
    radius = max(limits["speed"] / limits["rate"], limits["radius"])
    turn = radius * np.minimum(np.tan(np.minimum(half, 1.5)), 2.0) + 0.5 * limits["speed"] * np.minimum(2 * half, 1.0)
    stops = np.array([w.hold > 0 for w in route.waypoints])
    over = np.zeros(len(route.waypoints))
    over[1:-1] = np.where(stops[1:-1], -np.inf, np.minimum(turn, 0.5 * np.minimum(length[:-1], length[1:])))
    over[-1] = -np.inf
    along, whole, _ = off_legs(route, leg, xy)
    return leg + (whole - along <= over[leg])


def _known(when: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values at `when` from those that are not NaN."""
    sure = np.isfinite(values)
    return np.interp(when, time[sure], values[sure])


def _heading(track: Track, time: np.ndarray) -> np.ndarray:
    """Return (t,) radians: as logged, or else the course over at least HULL metres."""
    if np.isfinite(track.heading).any():
        return _known(time, track.time, track.heading)
    step = np.hypot(np.diff(track.x), np.diff(track.y))
    way = np.r_[0.0, np.cumsum(step)]
    whole = np.floor(way / HULL)
    kept = np.flatnonzero(np.r_[True, np.diff(whole) > 0])
    if len(kept) < 2:
        return np.zeros(len(time))
    course = np.unwrap(np.arctan2(np.diff(track.y[kept]), np.diff(track.x[kept])))
    middle = (track.time[kept[:-1]] + track.time[kept[1:]]) / 2
    return np.interp(time, middle, course)
