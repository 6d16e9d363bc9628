"""The judge of random missions: what was driven, not what a director believes, against what was planned and told.

What the last plan tells as left, areas or tasks, is excused where nobody came home with the energy for it; all else must be
covered, seen, served; who works comes home in time with what the battery holds, and nobody touches anything.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import inf
from typing import Any

import numpy as np
import shapely
import shapely.ops
from scipy.spatial import cKDTree

from quarterdeck.geo.scenario import Scenario
from quarterdeck.mission.cover import roadmaps
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.routes import line_routes, survey_tracks
from quarterdeck.mission.timing import RESERVE, shortfalls
from quarterdeck.mission.triage.plan import METHOD
from quarterdeck.physics.paths import LEGS
from quarterdeck.physics.seen import unseen, whole_tracks
from quarterdeck.physics.simulate import Run

UNSEEN = 0.005  # of what guards were to see: tracks cut corners
BLIND = 5.0  # m off, where fixes fail for a while
MARGIN = 1.25  # times what a trip takes by the plan, before it is held against those who did not make it


def judge(case: Any, run: Run, watched: Any) -> list[str]:
    """Return what is wrong with a run, a line each; `watched` is what its director heard and told."""
    mission = case.mission
    if mission.method == METHOD:
        return [*_hurt(case, run), *_drill(case, run)]
    idle = _lost(case, run) | _silent(case)
    last = watched.plans[-1][1] if watched.plans else mission
    wrong = [*_hurt(case, run), *_returns(case, run, watched)]
    wrong += [str(r) for r in watched.undone if r.kind == "plan"]
    if idle != {v.id for v in mission.vehicles}:
        wrong += _undone(case, run, watched, last)
        wrong += _needlessly_left(mission, run, watched, last, idle)
    return wrong


def _lost(case: Any, run: Run) -> set[str]:
    return {f.vehicle for f in case.faults if f.kind == "lost"} | {
        v.id for v in run.report.vehicles if v.aground and not v.hits
    }


def _silent(case: Any) -> set[str]:
    return {f.vehicle for f in case.faults if f.kind == "comms" and f.end == inf}


def _hurt(case: Any, run: Run) -> list[str]:
    """Return who touched something, though it works: what has no power drifts or falls as it may."""
    wrong, lost = [], _lost(case, run)
    if case.mission.method == METHOD:
        lost -= set(case.mission.parameters["medics"])  # what they lose is a device
    for v in run.report.vehicles:
        if (v.touched or v.hits) and v.id not in lost:
            wrong.append(f"{v.id} collided: {', '.join(v.hits) or 'a vehicle'}")
        if v.separation is not None and v.separation < 0 and v.id not in lost:
            wrong.append(f"{v.id} overlapped {v.separation_vehicle} at {v.separation_time:.0f} s")
    return wrong


def _returns(case: Any, run: Run, watched: Any) -> list[str]:
    """Return who works and is not home, or used more than its battery or time."""
    wrong, lost, silent = [], _lost(case, run), _silent(case)
    moved = {
        v.id: v.home
        for _, plan in watched.plans
        for v in plan.vehicles
        if any((r.kind, r.about) == ("end", v.id) for r in plan.reasons)
    }
    for i, (v, vehicle) in enumerate(zip(run.report.vehicles, case.mission.vehicles, strict=True)):
        if v.id in lost:
            continue
        # Who is never heard again does what it was told last: it may wait where it was to hear of others.
        home = watched.ends.get(v.id, vehicle.home) if v.id in silent else moved.get(v.id, vehicle.home)
        away = np.hypot(run.trace.x[-1, i] - home[0], run.trace.y[-1, i] - home[1])
        if not v.finished or away > 4.0 * vehicle.model.length + _blind(case):
            wrong.append(f"{v.id} is {away:.1f} m from home at the end" + (", not done" if not v.finished else ""))
        if v.energy > vehicle.battery:
            wrong.append(f"{v.id} used {v.energy:.1f} Wh of {vehicle.battery:.1f} Wh")
    return wrong


def _blind(case: Any) -> float:
    """Return how many metres off a vehicle may be that takes itself for where it should be: receivers have errors then."""
    return BLIND if any(f.kind == "gnss" for f in case.faults) else 0.0


def _undone(case: Any, run: Run, watched: Any, last: Mission) -> list[str]:
    """Return what was planned, not done and not told of by the last plan."""
    mission = case.mission
    if mission.method == "guards":
        return _unseen(mission, run, last, _blind(case))
    if mission.method == "assign":
        return _unserved(case, run, watched, last)
    return _undriven(mission, run, last, 0.5 * float(mission.spacing or 0.0) + _blind(case))


def _unseen(mission: Mission, run: Run, last: Mission, off: float) -> list[str]:
    """Return how much was not seen that was to be, but what is told and what is no wider than guards were `off`, metres."""
    told = shapely.union_all(last.layer("undone").geometries).buffer(0.01)
    before = unseen(mission, [shapely.LineString(r.xyz[:, :2]) for r in mission.routes if len(r.waypoints) > 1])
    after = unseen(mission, whole_tracks(run.trace, 0.02)).difference(told).buffer(-off)
    whole = mission.figures["area"]
    return [f"did not see {after.area / whole:.2%}"] if after.area - before.area > UNSEEN * whole else []


def _unserved(case: Any, run: Run, watched: Any, last: Mission) -> list[str]:
    """Return tasks not served, twice, or too early; where somebody was not heard a task may be done twice."""
    tasks = case.mission.tasks
    unheard = any(f.kind == "comms" for f in case.faults) or any(v.range is not None for v in case.mission.vehicles)
    left = last.figures.get("undone", ())
    undone = [t.id for t in tasks if t.id not in watched.served and t.id not in left]
    wrong = [f"not served: {', '.join(undone)}"] if undone else []
    left = watched.fast[-1].figures.get("undone", ()) if watched.fast else ()
    fast = [t.id for t in run.report.tasks if t.fast is None and t.id not in left]
    wrong += [f"not served in the fast world: {', '.join(fast)}"] if fast else []
    if unheard:
        return wrong
    place = {t: i for i, t in enumerate(watched.order)}
    early = [
        f"{t.id} before {a.task}"
        for t in tasks
        for a in t.after
        if t.id in place and place.get(a.task, len(place)) > place[t.id]
    ]
    twice = [t for t, n in watched.served.items() if n > 1]
    wrong += [f"served twice: {', '.join(twice)}"] if twice else []
    return wrong + ([f"served {', '.join(early)}"] if early else [])


def _undriven(mission: Mission, run: Run, last: Mission, within: float) -> list[str]:
    """Return pieces of planned survey tracks `within` so many metres of which nobody drove, longer than the spacing."""
    spacing = float(mission.spacing or 0.0)
    surveying = run.trace.kind == LEGS.index("survey")
    driven = np.column_stack([run.trace.x[surveying], run.trace.y[surveying]])
    step = spacing / 10
    planned = [t for v, r in zip(mission.vehicles, mission.routes, strict=True) for t in survey_tracks(v, r) if len(t) > 1]
    # GEOS cannot segmentize a line of no length: of a crumb of an area, or where corners are rounded.
    lines = [line if line.length == 0 else shapely.segmentize(line, step) for line in map(shapely.LineString, planned)]
    places = shapely.get_coordinates(lines)
    if len(driven):
        places = places[cKDTree(driven).query(places)[0] > within]
    wrecks = shapely.union_all([o.polygon for o in last.site.obstacles if o.id.startswith("wreck")])
    far = max(v.clearance for v in mission.vehicles) + spacing
    told = shapely.union_all([*last.left_out, *last.layer("undone").geometries])
    excused = shapely.union(wrecks.buffer(far) if wrecks.area else wrecks, told.buffer(0.5 * spacing))
    shapely.prepare(excused)
    places = places[~shapely.contains_xy(excused, *places.T)]
    pieces = shapely.union_all(shapely.buffer(shapely.points(places), step))
    found = [p for p in getattr(pieces, "geoms", [pieces]) if np.subtract(p.bounds[2:], p.bounds[:2]).max() > spacing]
    return [f"not driven: {p.area / 2 / step:.0f} m at {p.centroid.x:.1f}, {p.centroid.y:.1f}" for p in found[:5]]


def _needlessly_left(mission: Mission, run: Run, watched: Any, last: Mission, idle: set[str]) -> list[str]:
    """Return what the last plan left though somebody came home with the energy, by what was planned and by what was used,
    to go there once more, do it, and come back with the reserve in hand.
    """
    pieces = list(_pieces(watched, last))
    if not pieces:
        return []
    since = watched.plans[-1][0]
    wrong = []
    for vehicle, route in zip(last.vehicles, last.routes, strict=True):
        if vehicle.id in idle:
            continue
        i = [v.id for v in mission.vehicles].index(vehicle.id)
        first, driven = mission.vehicles[i], run.report.vehicles[i]
        hours = min(
            (1 - RESERVE) * first.endurance - max(since, driven.time), (1 - RESERVE) * vehicle.endurance - route.duration
        )
        energy = min((1 - RESERVE) * first.battery - driven.energy, (1 - RESERVE) * vehicle.battery - route.energy)
        spare = max(0.0, hours) / (1 - RESERVE) / MARGIN, max(0.0, energy) / (1 - RESERVE) / MARGIN
        ready = replace(vehicle, start=vehicle.home, end=vehicle.home, heading=None, endurance=spare[0], battery=spare[1])
        roads = roadmaps(Scenario(last.name, last.frame, last.site, (ready,)))
        for name, line, service, who in pieces:
            if who not in (None, vehicle.id) or not roads[0].polygon.buffer(0.01).covers(shapely.LineString(line)):
                continue
            routes, missing = line_routes((ready,), [[line]], roads)
            trip = routes[0]
            longer = replace(
                trip, energy=trip.energy + vehicle.model.power_idle * service / 3600.0, waypoints=_held(trip, service)
            )
            if not missing and not shortfalls(ready, longer):
                wrong.append(
                    f"{name} was left, though {vehicle.id} came home with {MARGIN * spare[0]:.0f} s, "
                    f"{MARGIN * spare[1]:.2g} Wh and needed {longer.duration:.0f} s, {longer.energy:.2g} Wh"
                )
                break
    return wrong[:3]


def _held(route: Any, seconds: float) -> Any:
    return (*route.waypoints[:-1], replace(route.waypoints[-1], hold=route.waypoints[-1].hold + seconds))


def _pieces(watched: Any, last: Mission) -> Iterator[tuple[str, np.ndarray, float, str | None]]:
    """Yield what was left, in the smallest pieces worth a trip: its name, (n, 2) metres to drive, the seconds it takes
    there, and the only vehicle that may do it, if there is but one.
    """
    spacing = last.spacing or 0.0
    for line in last.left_out:
        for way in (line, line.reverse()):
            piece = shapely.ops.substring(way, 0.0, 1.5 * spacing)
            if piece.length > spacing:
                yield f"a line at {way.coords[0][0]:.1f}, {way.coords[0][1]:.1f}", np.array(piece.coords), 0.0, None
    for i, guard in enumerate(last.guards):
        if not guard.seen and guard.vehicle is None and last.layer("undone").geometries:
            yield f"guard-{i}", _speck(guard.x, guard.y), 0.0, None
    left = last.figures.get("undone", ())
    for task in last.tasks:
        if task.id in left and all(a.task in watched.served for a in task.after):
            only = next((n.removeprefix("is ") for n in task.needs if n.startswith("is ")), None)
            yield f"task {task.id!r}", _speck(*task.position), task.service_time, only


def _speck(x: float, y: float) -> np.ndarray:
    return np.array([[x, y], [x + 1e-3, y]])


def _drill(case: Any, run: Run) -> list[str]:
    """Return what is wrong with what became of casualties: who was told to somebody who works and was not treated, who was
    not found though all is searched, and who did not finish.
    """
    driven, mission = run.triage.driven, case.mission
    out = _lost(case, run)
    medics = set(mission.parameters["medics"])
    dumb = {f.vehicle for f in case.faults if f.kind in ("lost", "comms")}
    wrong = [f"{v.id} was not done at the end" for v in run.report.vehicles if not v.finished and v.id not in out - medics]
    searching = driven.team.ugvs.keys() - dumb
    for fate in driven.fates:
        if fate.state == "treated":
            continue
        if not any(f"casualty {fate.id} " in line for line in driven.reasons):
            wrong.append(f"casualty {fate.id} ({fate.state}) is told of nowhere")
        if fate.delivered is not None:
            wrong.append(f"casualty {fate.id} was known to {fate.delivered_by} and not treated")
        elif fate.undeliverable and medics - dumb:
            wrong.append(f"casualty {fate.id} was told undeliverable though a medic could be told")
        elif fate.reported is not None and searching and not fate.undeliverable:
            wrong.append(f"casualty {fate.id} was reported to {fate.reported_by} and forgotten")
        elif searching and not fate.undeliverable and not mission.parameters["missed"]:
            wrong.append(f"casualty {fate.id} was {fate.state} though {min(searching)} works")
    return wrong
