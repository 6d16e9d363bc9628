"""When things change: the mission from now on, from what really happened."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely

from quarterdeck.coverage.metrics import track_length, uncovered
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Area, Obstacle, Scenario, Site, Task, Vehicle, as_multipolygon
from quarterdeck.mission.cover import cover, roadmaps, trackable
from quarterdeck.mission.guard_recovery import guards_from_now, with_confirmed
from quarterdeck.mission.mission import Mission, Route, Waypoint, unbroken
from quarterdeck.mission.progress import Progress, energy_left
from quarterdeck.mission.routes import line_routes, survey_tracks
from quarterdeck.mission.sharing import remaining_parts, share_out
from quarterdeck.mission.task_recovery import assign_from_now
from quarterdeck.mission.timing import shortfalls, timed_route

VISITED = 0.25  # spacings: a survey line is done where a track came so near


@dataclass(frozen=True, slots=True)
class Changes:
    """What is different from now on. Ids name vehicles, obstacles, areas; what is added comes in the scenario's types."""

    lost: frozenset[str] = frozenset()
    joined: tuple[Vehicle, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    gone: frozenset[str] = frozenset()
    areas: tuple[Area, ...] = ()
    withdrawn: frozenset[str] = frozenset()
    tasks: tuple[Task, ...] = ()

    def __bool__(self) -> bool:
        """Whether anything is different."""
        return any((self.lost, self.joined, self.obstacles, self.gone, self.areas, self.withdrawn, self.tasks))


def replan(mission: Mission, progress: Progress, changes: Changes = Changes(), *, seed: int | None = None) -> Mission:
    """Return the mission from `progress.time` on. Its times count from then; its vehicles start where they are.

    What is done stays done. Without changes each route is what is left of it. After a change the survivors drive their own
    survey lines on, and share those of the lost and of new areas so that all are done at about the same time; they do it
    with the energy that they have, and come home. What does not fit is told in the mission's reasons.

    Raises InputError if a change names what is not in the plan, or nobody is left.
    """
    _check(mission, changes)
    if not changes:
        return with_confirmed(_rest(mission, progress), progress.served)
    if mission.method == "guards":
        return _guards(mission, progress, changes, mission.seed if seed is None else seed)
    if mission.method == "assign":
        return _tasks(mission, progress, changes, mission.seed if seed is None else seed)
    if mission.spacing is None:
        raise InputError(f"a plan made by {mission.method!r} has no survey lines to share out; plan the rest as a site")
    vehicles = _survivors(mission, progress, changes)
    scenario = Scenario(
        name=mission.name,
        frame=mission.frame,
        site=_changed_site(mission.site, changes),
        vehicles=vehicles,
        tasks=mission.tasks,
        casualties=mission.casualties,
        spacing=mission.spacing,
        input_hash=mission.input_hash,
    )
    roads = roadmaps(scenario)
    own, released, told = _left(mission, scenario, progress, changes, mission.seed if seed is None else seed)
    lines = share_out(vehicles, own, released, crumb=mission.spacing)
    routes, reasons = line_routes(vehicles, lines, roads)
    routes = tuple(_airborne(r, v, progress) for v, r in zip(vehicles, routes, strict=True))
    return replace(
        mission,
        site=scenario.site,
        vehicles=vehicles,
        routes=routes,
        parameters=dict(mission.parameters) | {"replanned_at": progress.time, "lost": sorted(changes.lost)},
        figures=_figures(scenario.site, mission.spacing, progress, vehicles, routes)
        | {n: mission.figures[n] for n in ("lattice",) if n in mission.figures},
        bounds={},
        seed=mission.seed if seed is None else seed,
        reasons=(*_lasting(mission), *told, *reasons),
        layers=(),
    )


def _lasting(mission: Mission) -> list[str]:
    """Return the reasons of a plan that its energy and time did not give: what was out of reach is so still."""
    return [r for r in mission.reasons if "short by" not in r]


def _guards(mission: Mission, progress: Progress, changes: Changes, seed: int) -> Mission:
    """Return a guards mission from now on: guards not confirmed go to the survivors, new ones where the site changed."""
    vehicles = _survivors(mission, progress, changes)
    site = _changed_site(mission.site, changes)
    scenario = Scenario(mission.name, mission.frame, site, vehicles, input_hash=mission.input_hash)
    after = guards_from_now(mission, scenario, progress.served, seed=seed)
    told = dict(after.parameters) | {"replanned_at": progress.time, "lost": sorted(changes.lost)}
    routes = tuple(_airborne(r, v, progress) for v, r in zip(vehicles, after.routes, strict=True))
    return replace(after, routes=routes, parameters=told)


def _tasks(mission: Mission, progress: Progress, changes: Changes, seed: int) -> Mission:
    """Return a mission of tasks from now on: those not done and not withdrawn, and new ones, go to the survivors."""
    vehicles = _survivors(mission, progress, changes)
    tasks = (*(t for t in mission.tasks if t.id not in changes.withdrawn), *changes.tasks)
    scenario = Scenario(
        mission.name, mission.frame, _changed_site(mission.site, changes), vehicles, tasks, input_hash=mission.input_hash
    )
    after = assign_from_now(mission, scenario, progress, seed=seed)
    told = dict(after.parameters) | {"replanned_at": progress.time, "lost": sorted(changes.lost)}
    routes = tuple(_airborne(r, v, progress) for v, r in zip(vehicles, after.routes, strict=True))
    return replace(after, routes=routes, parameters=told)


def _check(mission: Mission, changes: Changes) -> None:
    for what, ids, known in (
        ("vehicle", changes.lost, [v.id for v in mission.vehicles]),
        ("obstacle", changes.gone, [o.id for o in mission.site.obstacles]),
        ("area or task", changes.withdrawn, [*(a.id for a in mission.site.areas), *(t.id for t in mission.tasks)]),
    ):
        for unknown in sorted(set(ids) - set(known)):
            raise InputError(f"unknown {what} {unknown!r}; the plan has {', '.join(known)}")
    again = {t.id for t in changes.tasks} & {t.id for t in mission.tasks}
    if again:
        raise InputError(f"task {min(again)!r} is in the plan already; give the new one another id")
    if changes.tasks and mission.method != "assign":
        raise InputError(f"a plan made by {mission.method!r} has no tasks; a new one needs a plan of `quarterdeck assign`")
    twice = {v.id for v in changes.joined} & {v.id for v in mission.vehicles} - changes.lost
    if twice:
        raise InputError(f"vehicle {min(twice)!r} is in the plan already; give the one that joins another id")


def _rest(mission: Mission, progress: Progress) -> Mission:
    """Return the mission with what is left of each route, times counted from now."""
    routes = tuple(_route_left(r, progress, mission.vehicle(r.vehicle)) for r in mission.routes)
    vehicles = tuple(_moved(v, progress) for v in mission.vehicles)
    reasons = [reason for v, r in zip(vehicles, routes, strict=True) for reason in shortfalls(v, r)]
    told = dict(mission.parameters) | {"replanned_at": progress.time, "lost": []}
    left = {"makespan": max(r.duration for r in routes), "energy": sum(r.energy for r in routes)}
    return replace(
        mission,
        routes=routes,
        vehicles=vehicles,
        parameters=told,
        figures=dict(mission.figures) | left,
        reasons=(*_lasting(mission), *reasons),
    )


def _route_left(route: Route, progress: Progress, vehicle: Vehicle) -> Route:
    here = progress.positions[vehicle.id]
    ahead = [w for w in route.waypoints if w.time > progress.time]
    current = [w for w in route.waypoints if w.time <= progress.time][-1:]
    hold = max(0.0, current[0].time + current[0].hold - progress.time) if current else 0.0
    start = Waypoint(*here, "start", 0.0, hold, 0.0, current[0].task if hold and current else None)
    moved = tuple(replace(w, time=w.time - progress.time) for w in ahead)
    return Route(route.vehicle, (start, *moved), max(0.0, route.energy - progress.energy.get(vehicle.id, 0.0)))


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


def _survivors(mission: Mission, progress: Progress, changes: Changes) -> tuple[Vehicle, ...]:
    """Return the vehicles that go on, where they are, with what they have left, in the shares they had among themselves."""
    staying = [_moved(v, progress) for v in mission.vehicles if v.id not in changes.lost]
    vehicles = [*staying, *changes.joined]
    if not vehicles:
        raise InputError("every vehicle is lost and none joins; nobody is left to replan for")
    given = [v.share for v in vehicles]
    if any(share is None for share in given):
        return tuple(replace(v, share=None) for v in vehicles)
    total = sum(share for share in given if share is not None)
    return tuple(replace(v, share=v.share / total) for v in vehicles if v.share is not None)


def _moved(vehicle: Vehicle, progress: Progress) -> Vehicle:
    x, y, _ = progress.positions[vehicle.id]
    used = progress.energy.get(vehicle.id, 0.0)
    left = energy_left(vehicle.battery, used)
    endurance = energy_left(vehicle.endurance, progress.time)
    return replace(vehicle, start=(x, y), end=vehicle.home, battery=left, endurance=endurance)


def _changed_site(site: Site, changes: Changes) -> Site:
    obstacles = (*(o for o in site.obstacles if o.id not in changes.gone), *changes.obstacles)
    areas = (*(a for a in site.areas if a.id not in changes.withdrawn), *changes.areas)
    operating = as_multipolygon(shapely.union_all([site.operating, *(a.polygon for a in changes.areas)]))
    return Site(tuple(areas), operating, tuple(obstacles))


def _left(
    mission: Mission, scenario: Scenario, progress: Progress, changes: Changes, seed: int
) -> tuple[list[list[np.ndarray]], list[np.ndarray], list[str]]:
    """Return the (n, 2) survey lines still to be driven: each survivor's own in order, those that nobody has, and what
    cannot be reached of new areas.
    """
    spacing = float(mission.spacing or 0.0)
    done = shapely.union_all(
        [shapely.buffer(shapely.LineString(t), VISITED * spacing) for t in progress.tracks if len(t) > 1]
    )
    reach = None
    if changes.obstacles or changes.withdrawn:
        reach = trackable(scenario, spacing).buffer(1e-6 * spacing)
    runs = {r.vehicle: unbroken(r.xyz[:, :2], r.survey) for r in mission.routes}
    by_vehicle = {v: [line for run in own for line in remaining_parts(run, done, reach)] for v, own in runs.items()}
    released = [line for vehicle in sorted(changes.lost) for line in by_vehicle[vehicle]]
    told: list[str] = []
    if changes.areas:
        fresh = replace(scenario, site=replace(scenario.site, areas=changes.areas))
        fresh = replace(fresh, vehicles=tuple(replace(v, share=None) for v in scenario.vehicles))
        angle, edge = mission.figures.get("lattice", {}).get("angle"), mission.parameters.get("edge", "cells")
        added = cover(fresh, spacing=spacing, seed=seed, angle=angle, edge=edge)
        released += [run for r in added.routes for run in unbroken(r.xyz[:, :2], r.survey)]
        told = _lasting(added)
    own = [[] if v.id in changes.lost else by_vehicle.get(v.id, []) for v in scenario.vehicles]
    return own, released, told


def _figures(
    site: Site, spacing: float | None, progress: Progress, vehicles: Sequence[Vehicle], routes: Sequence[Route]
) -> dict[str, Any]:
    """Return what the mission comes to from now on, and with what is done already."""
    ahead = [t for v, r in zip(vehicles, routes, strict=True) for t in survey_tracks(v, r)]
    area = site.coverable
    missed = uncovered([*progress.tracks, *ahead], area, float(spacing or 0.0))
    return {
        "poc": 1.0 - missed.area / area.area if area.area > 0 else 1.0,
        "length": sum(track_length(t) for t in ahead),
        "makespan": max(r.duration for r in routes),
        "energy": sum(r.energy for r in routes),
    }
