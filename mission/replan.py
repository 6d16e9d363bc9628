"""When things change: the mission from now on, from what really happened. One door for every method."""

from dataclasses import replace
from typing import Any

import numpy as np
from shapely import LineString, Point
from shapely.ops import nearest_points

from quarterdeck.coverage.metrics import covered_fraction, track_length
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Scenario, Site, Vehicle
from quarterdeck.mission.changes import Changes as Changes
from quarterdeck.mission.changes import changed_site, changed_tasks, check_changes
from quarterdeck.mission.guard_recovery import guards_from_now, with_confirmed
from quarterdeck.mission.mission import Mission, Route, Waypoint
from quarterdeck.mission.progress import Progress, budget_left, with_surveyed
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.recorded import as_planned
from quarterdeck.mission.routes import survey_lines
from quarterdeck.mission.survey_recovery import survey_from_now
from quarterdeck.mission.task_recovery import assign_from_now, tasks_left
from quarterdeck.mission.timing import shortfalls, timed_route
from quarterdeck.mission.triage.carry_on import triage_from_now
from quarterdeck.mission.triage.plan import METHOD

NOTHING = Changes()
LANDED = 0.5  # m above ground, and at the least from its end: who is so near, or within its length, is at home


def replan(
    mission: Mission, progress: Progress, changes: Changes = NOTHING, *, seed: int | None = None, anew: bool = False
) -> Mission:
    """Return the mission from `progress.time` on. Its times count from then; its vehicles start where they are.

    What is done stays done. Without changes each route is what is left of it, unless all is to be shared out `anew`. After
    a change the survivors share what is left so that all are done at about the same time, with the energy that they have,
    and come home; what nobody can do any more is told in the mission's reasons. Vehicles given up are kept in `lost`: they
    may come back.

    Raises InputError if a change names what is not in the plan, means nothing to it, or nobody is left.
    """
    check_changes(mission, changes)
    triage = mission.method == METHOD
    if progress.stand is not None:  # who stopped on the way is lost, whether or not the change says so
        dead = progress.stand.memory.out & {v.id for v in mission.vehicles} - changes.back.keys()
        changes = replace(changes, lost=changes.lost | dead)
    if not (changes or anew or triage) and as_planned(mission, progress):
        return _over(mission, with_confirmed(_rest(mission, progress), progress.served), progress)
    seed = mission.seed if seed is None else seed
    site = changed_site(mission.site, changes)
    vehicles, stranded = _homes(site, _survivors(mission, progress, changes))
    scenario = Scenario(
        name=mission.name,
        frame=mission.frame,
        site=site,
        vehicles=vehicles,
        tasks=changed_tasks(mission.tasks, changes),
        casualties=mission.casualties,
        spacing=mission.spacing,
        input_hash=mission.input_hash,
    )
    if triage:
        after = triage_from_now(mission, scenario, progress, changes, seed=seed)
    elif mission.method == "guards":
        after = guards_from_now(mission, scenario, progress.served, seed=seed)
    elif mission.method == "assign":
        after = assign_from_now(mission, scenario, progress, seed=seed)
    elif mission.spacing is not None:
        after = survey_from_now(mission, scenario, progress, changes, seed=seed)
    else:
        raise InputError(f"a plan made by {mission.method!r} has no survey lines to share out; plan the rest as a site")
    gone = {v.id: _moved(v, progress) for v in (*mission.lost, *mission.vehicles)}
    working = {v.id for v in vehicles}
    own = after.parameters if triage else _lasting(mission)
    after = replace(
        after,
        routes=tuple(_airborne(r, v, progress) for v, r in zip(vehicles, after.routes, strict=True)),
        parameters={**own, "replanned_at": progress.time, "lost": sorted(changes.lost)},
        seed=seed,
        reasons=(*(r for r in stranded if r.about not in own.get("medics", ())), *after.reasons),
        lost=tuple(v for i, v in gone.items() if i not in working),
    )
    return _over(mission, after, progress)


def _survivors(mission: Mission, progress: Progress, changes: Changes) -> tuple[Vehicle, ...]:
    """Return the vehicles that go on, where they are, with what they have left, in the shares they had among themselves."""
    staying = [_moved(v, progress) for v in mission.vehicles if v.id not in changes.lost]
    heard = [_moved(v, progress) for v in mission.lost if v.id in changes.back]
    back = [replace(v, start=changes.back[v.id] or v.start) for v in heard]
    vehicles = [
        replace(
            v,
            speed=changes.speeds.get(v.id, v.speed),
            battery=changes.batteries.get(v.id, v.battery),
            endurance=changes.endurances.get(v.id, v.endurance),
        )
        for v in (*staying, *back, *changes.joined)
    ]
    if not vehicles:
        raise InputError("every vehicle is lost and none joins or comes back; nobody is left to replan for")
    given = [v.share for v in vehicles]
    if any(share is None for share in given):
        return tuple(replace(v, share=None) for v in vehicles)
    total = sum(share for share in given if share is not None)
    return tuple(replace(v, share=v.share / total) for v in vehicles if v.share is not None)


def _moved(vehicle: Vehicle, progress: Progress) -> Vehicle:
    x, y, z = progress.positions.get(vehicle.id, (*vehicle.start, 0.0))
    if z < LANDED and np.hypot(x - vehicle.home[0], y - vehicle.home[1]) < max(LANDED, vehicle.model.length):
        x, y = vehicle.home  # lest it sets out to come home by inches
    used = progress.energy.get(vehicle.id, 0.0)
    left = budget_left(vehicle.battery, used)
    endurance = budget_left(vehicle.endurance, progress.time)
    heading = progress.headings.get(vehicle.id)
    return replace(vehicle, start=(x, y), end=vehicle.home, battery=left, endurance=endurance, heading=heading)


def _homes(site: Site, vehicles: tuple[Vehicle, ...]) -> tuple[tuple[Vehicle, ...], list[Reason]]:
    """Return the vehicles, each with a home that it can stand at, and why that is not the one that it had.

    Raises InputError if a vehicle stands inside an obstacle.
    """
    settled, reasons = [], []
    for vehicle in vehicles:
        blocking = [o for o in site.obstacles if vehicle.domain in o.blocks]
        inside = next((o.id for o in blocking if o.polygon.contains(Point(vehicle.start))), None)
        if inside is not None:
            raise InputError(
                f"vehicle {vehicle.id!r} is inside obstacle {inside!r}; draw the obstacle without it, or give it as lost"
            )
        taken = next((o.id for o in blocking if o.polygon.contains(Point(vehicle.home))), None)
        if taken is not None and vehicle.returns:
            free = site.navigable(vehicle.domain, vehicle.clearance)
            near = nearest_points(free, Point(vehicle.home))[0] if free.area else Point(vehicle.start)
            away = near.distance(Point(vehicle.home))
            why = f"its end is inside obstacle {taken!r}; it stops {away:.0f} m before it"
            reasons.append(Reason(why, "end", vehicle.id))
            settled.append(replace(vehicle, end=(near.x, near.y)))
        else:
            settled.append(vehicle)
    return tuple(settled), reasons


def _rest(mission: Mission, progress: Progress) -> Mission:
    """Return the mission with what is left of each route, times counted from now."""
    routes = tuple(_route_left(r, progress, mission.vehicle(r.vehicle)) for r in mission.routes)
    vehicles, lost = (tuple(_moved(v, progress) for v in some) for some in (mission.vehicles, mission.lost))
    reasons = [reason for v, r in zip(vehicles, routes, strict=True) for reason in shortfalls(v, r)]
    told = _lasting(mission) | {"replanned_at": progress.time, "lost": []}
    surveyed = () if mission.spacing is None else with_surveyed(mission, progress.tracks)
    return replace(
        mission,
        routes=routes,
        vehicles=vehicles,
        lost=lost,
        parameters=told,
        surveyed=surveyed,
        tasks=tasks_left(mission, mission.tasks, progress, {v.id for v in vehicles}) if mission.tasks else (),
        figures=_figures_left(mission, routes, surveyed),
        bounds={},
        reasons=(*(r for r in mission.reasons if r.kind != "energy"), *reasons),
    )


def _lasting(mission: Mission) -> dict[str, Any]:
    """Return a plan's parameters without what was told in a run of it (`mission.told.as_told`)."""
    return {name: value for name, value in mission.parameters.items() if name not in ("told_at", "lost_at")}


def _figures_left(mission: Mission, routes: tuple[Route, ...], surveyed: tuple[LineString, ...]) -> dict[str, Any]:
    """Return the figures of what is left of a plan, those that a new plan by its method has; what is told stays told."""
    figures = {"makespan": max(r.duration for r in routes), "energy": sum(r.energy for r in routes)}
    figures |= {name: mission.figures[name] for name in ("undone", "undone_m2", "notes") if name in mission.figures}
    if mission.method == "guards":
        stops = [w for r in routes for w in r.waypoints if w.task is not None]
        last = max((w.time for w in stops), default=0.0)
        kept = {name: mission.figures[name] for name in ("area", "certificate") if name in mission.figures}
        length = sum(r.length for r in routes)
        figures["undone_m2"] = mission.figures["certificate"]["uncovered"]
        return kept | figures | {"guards": len(stops), "makespan": last, "duration": figures["makespan"], "length": length}
    if mission.spacing is not None:
        ahead = survey_lines(routes)
        done = [np.array(line.coords) for line in surveyed]
        covered = covered_fraction([*done, *ahead], mission.site.coverable, mission.spacing)
        return {"poc": covered, "length": sum(map(track_length, ahead)), "undone_m2": 0.0} | figures
    return figures


def _route_left(route: Route, progress: Progress, vehicle: Vehicle) -> Route:
    here = progress.positions[vehicle.id]
    now = progress.time if progress.along is None else progress.along[vehicle.id]
    ahead = [w for w in route.waypoints if w.time > now]
    current = [w for w in route.waypoints if w.time <= now][-1:]
    hold = max(0.0, current[0].time + current[0].hold - now) if current else 0.0
    start = Waypoint(*here, "start", 0.0, hold, 0.0, current[0].task if hold and current else None)
    moved = tuple(replace(w, time=w.time - now) for w in ahead)
    energy = route.energy * max(0.0, 1.0 - now / route.duration) if route.duration else 0.0
    return Route(route.vehicle, (start, *moved), energy)


def _over(mission: Mission, after: Mission, progress: Progress) -> Mission:
    """Return the mission from now on, with a note where nobody has anything left to do."""
    if any(r.duration > 0 for r in after.routes):
        return after
    end = max(r.duration for r in mission.routes)
    note = "nothing is left to do, and nobody moves in this plan: all is done, or told as left out"
    if progress.along is None and progress.stand is None and progress.time >= end:
        note = (
            "nothing is left to do, and nobody moves in this plan: by the times of the one before all was done at "
            f"{end:,.0f} s; if that is not what happened, say what did with --track or --state"
        )
    return replace(after, figures={**after.figures, "notes": [*after.figures.get("notes", ()), note]})


def _airborne(route: Route, vehicle: Vehicle, progress: Progress) -> Route:
    """Begin an aerial route at the altitude at which the vehicle is, not on the ground."""
    altitude = progress.positions[vehicle.id][2] if vehicle.id in progress.positions else 0.0
    if altitude == 0:
        return route
    points = route.xyz
    points[0, 2] = altitude
    return timed_route(
        vehicle,
        points,
        [w.leg for w in route.waypoints],
        holds=[w.hold for w in route.waypoints],
        tasks=[w.task for w in route.waypoints],
        pace=[1.0 if w.z != route.xyz[i - 1, 2] else w.speed / vehicle.speed for i, w in enumerate(route.waypoints)],
    )
