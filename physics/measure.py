"""Measure a run: what it came to, beside what was planned and what is allowed."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from shapely import LineString

from quarterdeck.coverage.metrics import covered_fraction
from quarterdeck.geo.scenario import Site, Vehicle
from quarterdeck.geo.version import VERSION
from quarterdeck.mission.fast import FastRun
from quarterdeck.mission.mission import Mission, Route
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.routes import survey_lines
from quarterdeck.physics.report import CrossTrack, Localisation, Report, VehicleReport, check_limits
from quarterdeck.physics.seen import seen_fraction, whole_tracks
from quarterdeck.physics.swath import driven_tracks
from quarterdeck.physics.swept import Swept, closest_approaches, excursion, sweep
from quarterdeck.physics.task_report import task_reports
from quarterdeck.physics.trace import Trace


def measure(
    mission: Mission,
    trace: Trace,
    *,
    finished: Sequence[bool],
    aground: Sequence[bool],
    served: Mapping[str, float],
    limits: Mapping[str, float],
    settings: Mapping[str, Any],
    lost: Sequence[bool] | None = None,
    trouble: Sequence[str] = (),
    localisation: Sequence[Mapping[str, Any]] | None = None,
    notes: Sequence[str] = (),
    triage: Mapping[str, Any] | None = None,
    servers: Mapping[str, str] | None = None,
    undone: Sequence[Reason] = (),
    relieved: Mapping[str, float] | None = None,
    left_out: Sequence[Reason] = (),
    during: Mapping[str, tuple[float, float]] | None = None,
    was: Site | None = None,
    fast: FastRun | None = None,
) -> Report:
    """Measure a trace against the mission and judge it.

    `finished` and `aground` are (k,), `served` the times at which tasks were, `lost` (k,) the vehicles lost by a fault
    (default: none), `trouble` what went wrong, a line each, `localisation` what `Senses.report` returns, `notes` what is
    told of a log, `triage` what `triage.Compared.document` returns; `servers` the vehicles that served tasks, `undone` why
    others were not served, as `task_reports` takes them; `fast` what the fast world came to. `relieved` are vehicles that
    were lost and when their part was given to others, `left_out` what the plan by then told that nobody can do any more:
    a loss that was recovered from is told, and does not fail the run. `was` has all obstacles that there ever were where
    some came or went, `during` from when and until when, by id.
    Raises InputError for an unknown limit.
    """
    allowed = check_limits(limits)
    size = np.array([np.hypot(v.model.length, v.model.width) for v in mission.vehicles])
    thin = max(1, round(0.5 / max(float(np.diff(trace.time[:2]).sum()), 1e-9))) if len(trace.time) > 1 else 1
    x, y, z, underway = (np.ascontiguousarray(a[::thin]) for a in (trace.x, trace.y, trace.z, trace.underway))
    near = closest_approaches(x, y, z, underway, size)
    routes = {route.vehicle: route for route in mission.routes}
    vehicles = tuple(
        _vehicle(
            mission,
            trace,
            i,
            bool(finished[i]),
            bool(aground[i]),
            routes,
            near,
            thin,
            sweep(was or mission.site, mission.vehicles[i], trace, i, during),
        )
        for i in range(len(trace.vehicles))
    )
    gone = lost or [False] * len(vehicles)
    places = [None if localisation is None else Localisation(**localisation[i]) for i in range(len(vehicles))]
    vehicles = tuple(replace(v, lost=g, localisation=p) for v, g, p in zip(vehicles, gone, places, strict=True))
    figures = _figures(mission, trace, vehicles, served)
    over = relieved or {}
    reasons = [*trouble, *_reasons(mission, vehicles, figures, allowed, over)]
    tasks = task_reports(mission, trace, served, servers or {}, undone)
    if fast is not None:
        figures |= _fast_figures(mission, fast) | {"tasks_served_fast": len(fast.served.keys() & {t.id for t in tasks})}
        vehicles = tuple(replace(v, time_fast=fast.times[v.id], energy_fast=fast.energy[v.id]) for v in vehicles)
        tasks = tuple(replace(t, fast=fast.served.get(t.id)) for t in tasks)
    told = [f"{v}: lost; at {time:.0f} s others were given its part" for v, time in over.items()]
    told += map(str, left_out) if over else []
    excused = {r.about for r in left_out if r.kind == "undone"} if over else set()
    missed = [t for t in tasks if t.reason and t.id not in excused]
    reasons += [f"task {t.id!r} not served: {t.reason}" for t in missed] if allowed["unserved"] == 0 else []
    reasons += [str(r) for r in undone if r.kind != "undone"]
    return Report(
        mission.name,
        VERSION,
        settings,
        allowed,
        figures,
        vehicles,
        tuple(reasons),
        trace.hash,
        tasks,
        notes=(*notes, *told),
        triage=triage,
    )


def _vehicle(
    mission: Mission,
    trace: Trace,
    i: int,
    finished: bool,
    aground: bool,
    routes: Mapping[str, Route],
    near: tuple[np.ndarray, np.ndarray, np.ndarray],
    thin: int,
    swept: Swept,
) -> VehicleReport:
    vehicle = mission.vehicles[i]
    route = routes.get(vehicle.id, Route(vehicle.id, ()))
    moving = trace.kind[:, i] > 0
    cross = np.abs(trace.cross[:, i].astype(float))
    contact = trace.contact[:, i]
    track = np.column_stack([trace.x[:, i], trace.y[:, i], trace.z[:, i]])
    moved = np.linalg.norm(np.diff(track, axis=0), axis=1)
    last = np.flatnonzero(moved > 0)
    separation, other, when = near[0][i], near[1][i], near[2][i]
    return VehicleReport(
        id=vehicle.id,
        domain=vehicle.domain,
        finished=finished,
        aground=aground,
        legs=_cross_track(cross[moving & ~trace.turning[:, i]]),
        turns=_cross_track(cross[moving & trace.turning[:, i] & (cross > 0)]),
        touched=int(np.count_nonzero(contact & ~np.r_[False, contact[:-1]])),
        hits=swept.hits,
        outside=excursion(mission.site, trace, i),
        clearance=float(swept.clearance) if np.isfinite(swept.clearance) else None,
        clearance_time=swept.time,
        clearance_obstacle=swept.obstacle,
        separation=float(separation) if np.isfinite(separation) else None,
        separation_time=float(trace.time[when * thin]) if other >= 0 else 0.0,
        separation_vehicle=trace.vehicles[other] if other >= 0 else "",
        time_planned=route.duration,
        time=float(trace.time[last[-1] + 1]) if len(last) else 0.0,
        energy_planned=route.energy,
        energy=float(trace.energy[-1, i]),
        length_planned=route.length,
        length=float(moved.sum()),
    )


def _cross_track(errors: np.ndarray) -> CrossTrack:
    if not len(errors):
        return CrossTrack(0.0, 0.0, 0.0, 0)
    return CrossTrack(float(errors.mean()), float(np.percentile(errors, 95)), float(errors.max()), len(errors))


def _figures(
    mission: Mission, trace: Trace, vehicles: Sequence[VehicleReport], served: Mapping[str, float]
) -> dict[str, float | int | None]:
    """The fleet's figures. Coverage is what lies within half the spacing of survey legs, planned and driven by one
    measure.
    """
    planned = driven = None
    if mission.spacing is not None and any(route.survey.any() for route in mission.routes):
        area = mission.site.coverable
        planned = covered_fraction(survey_lines(mission.routes), area, mission.spacing)
        driven = covered_fraction(driven_tracks(trace), area, mission.spacing)
    elif mission.method == "guards" and mission.site.coverable.area:
        routes = [LineString(route.xyz[:, :2]) for route in mission.routes if len(route.waypoints) > 1]
        planned, driven = seen_fraction(mission, routes), seen_fraction(mission, whole_tracks(trace, 0.02))
    moving, sharp = trace.kind > 0, trace.turning
    cross = np.abs(trace.cross.astype(float))
    legs, turns = _cross_track(cross[moving & ~sharp]), _cross_track(cross[moving & sharp & (cross > 0)])
    tasks = {w.task for route in mission.routes for w in route.waypoints if w.task is not None}
    clear = [v.clearance for v in vehicles if v.clearance is not None]
    apart = [v.separation for v in vehicles if v.separation is not None]
    return {
        "coverage_planned": planned,
        "coverage_driven": driven,
        "tasks_planned": len(tasks),
        "tasks_served": len(tasks & set(served)),
        "finished": sum(v.finished for v in vehicles),
        "collisions": sum(v.touched > 0 or bool(v.hits) for v in vehicles),
        "outside": max((v.outside for v in vehicles), default=0.0),
        "clearance": min(clear, default=None),
        "separation": min(apart, default=None),
        "legs_mean": legs.mean,
        "legs_p95": legs.p95,
        "legs_max": legs.max,
        "turns_mean": turns.mean,
        "turns_p95": turns.p95,
        "turns_max": turns.max,
        "time_planned": max((v.time_planned for v in vehicles), default=0.0),
        "time": max((v.time for v in vehicles), default=0.0),
        "energy_planned": sum(v.energy_planned for v in vehicles),
        "energy": sum(v.energy for v in vehicles),
        "length_planned": sum(v.length_planned for v in vehicles),
        "length": sum(v.length for v in vehicles),
        "lost": sum(v.lost for v in vehicles),
        "localisation_p95": max((v.localisation.p95 for v in vehicles if v.localisation), default=None),
    }


def _fast_figures(mission: Mission, fast: FastRun) -> dict[str, float | int | None]:
    """What the fast world came to, by the measures of the run."""
    covered = None
    if mission.spacing is not None and any(route.survey.any() for route in mission.routes):
        covered = covered_fraction(fast.surveyed, mission.site.coverable, mission.spacing)
    elif mission.method == "guards" and mission.site.coverable.area:
        covered = seen_fraction(mission, [LineString(track[:, 1:]) for track in fast.tracks.values() if len(track) > 1])
    return {
        "time_fast": fast.time,
        "coverage_fast": covered,
        "finished_fast": len(fast.finished),
        "energy_fast": sum(fast.energy.values()),
    }


def _reasons(
    mission: Mission,
    vehicles: Sequence[VehicleReport],
    figures: Mapping[str, Any],
    allowed: Mapping[str, float | None],
    relieved: Collection[str],
) -> list[str]:
    """Return why the run fails: what of the fleet, then of each vehicle, is over its limit."""
    reasons: list[str] = []
    driven, covering = figures["coverage_driven"], figures["coverage_planned"]
    if covering is not None and _over(allowed, "coverage_loss", covering - driven):
        reasons.append(
            f"coverage {driven:.2%} driven of {covering:.2%} planned; "
            f"{allowed['coverage_loss']:.2%} of the area may be lost (--limit coverage_loss=...)"
        )
    touched = [v.id for v in vehicles if v.touched or v.hits]
    reasons += [f"collision: {_list(touched)}"] if _over(allowed, "collisions", len(touched)) else []
    late = [v.id for v in vehicles if not v.finished and v.id not in relieved]
    reasons += [f"did not finish: {_list(late)}"] if _over(allowed, "unfinished", len(late)) else []
    planned = figures["tasks_planned"]
    unserved = planned - figures["tasks_served"]
    reasons += [f"{unserved} of {planned} tasks not served"] if _over(allowed, "unserved", unserved) else []
    for vehicle, v in zip(mission.vehicles, vehicles, strict=True):
        reasons += [f"{v.id}: {why}" for why in _vehicle_reasons(vehicle, v, allowed)]
    if figures["time_planned"] > 0 and _over(allowed, "delay", figures["time"] / figures["time_planned"]):
        times = f"took {figures['time']:.0f} s, planned {figures['time_planned']:.0f} s"
        reasons.append(f"{times} (allowed: {allowed['delay']:g} times)")
    return reasons


def _vehicle_reasons(vehicle: Vehicle, v: VehicleReport, allowed: Mapping[str, float | None]) -> list[str]:
    """Return what of a vehicle is over its limit."""
    reasons = []
    margin = vehicle.clearance / 2 if vehicle.clearance > 0 else vehicle.model.width
    track, fence = (margin if (limit := allowed[name]) is None else limit for name in ("cross_track", "outside"))
    if v.legs.p95 > track:
        reasons.append(f"off its straight legs by up to {v.legs.p95:.2f} m for 95 % of the way, allowed {track:.2f} m")
    if v.outside > fence:
        reasons.append(f"{v.outside:.2f} m outside the operating area, allowed {fence:.2f} m")
    if v.clearance is not None and v.clearance < (allowed["clearance"] or 0.0):
        reasons.append(f"{v.clearance:.2f} m from obstacle {v.clearance_obstacle!r} at {v.clearance_time:.0f} s")
    if v.separation is not None and v.separation < (allowed["separation"] or 0.0):
        reasons.append(f"{v.separation:.2f} m from {v.separation_vehicle} at {v.separation_time:.0f} s")
    if v.localisation is not None and _over(allowed, "localisation", v.localisation.p95):
        reasons.append(f"95 % of localisation errors up to {v.localisation.p95:.2f} m")
    if _over(allowed, "battery", v.energy / vehicle.battery):
        reasons.append(f"used {v.energy:.0f} Wh of a battery of {vehicle.battery:.0f} Wh")
    if _over(allowed, "endurance", v.time / vehicle.endurance):
        reasons.append(f"{v.time:.0f} s under way, endurance {vehicle.endurance:.0f} s")
    return reasons


def _over(allowed: Mapping[str, float | None], name: str, value: float) -> bool:
    """Return whether a value is over the limit of a name, if there is one."""
    limit = allowed[name]
    return limit is not None and value > limit + 1e-12


def _list(ids: Sequence[str]) -> str:
    return ", ".join(ids[:5]) + (f" and {len(ids) - 5} more" if len(ids) > 5 else "")
