"""An inspection mission from now on: the tasks not yet done, shared out anew among whoever works, from where they are."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from quarterdeck.geo.scenario import Scenario, Task, Vehicle
from quarterdeck.mission.assign import assign
from quarterdeck.mission.itinerary import itineraries
from quarterdeck.mission.mission import Mission, Route
from quarterdeck.mission.progress import Progress
from quarterdeck.mission.reason import ImpossibleError, Reason
from quarterdeck.mission.timing import seconds_out, shortfalls
from quarterdeck.mission.travel import travel

GENERATIONS = 3  # of the search, which begins with what is left of the plan: robots are waiting
HABITS = ("objective", "weights", "shape", "shape_parameters", "tiers")  # of a plan that hold for what is left of it too
THERE = 1.0  # m beyond its clearance: a vehicle so near to where it serves a task is there


def assign_from_now(mission: Mission, scenario: Scenario, progress: Progress, *, seed: int = 0) -> Mission:
    """Return the mission that does what `mission`, a plan of tasks, has not done.

    `scenario` is the world as it is now: the vehicles that work, each with its start where it is and the energy that it has
    left, and every task, done or not. Predecessors that are done bind no more, but a task in the `same_robot` as one that
    is done is kept to that robot; a service that is under way is finished by the robot that began it. What nobody can do
    any more is left out of the routes, with what comes after it, and told; it stays among the mission's tasks.
    """
    vehicles = tuple(replace(v, can=v.can | {_itself(v.id)}) for v in scenario.vehicles)
    working = {v.id for v in scenario.vehicles}
    tasks = tasks_left(mission, scenario.tasks, progress, working)
    begun = {t: v for t, (v, _) in _under_way(mission, progress).items() if v in working}
    # Who began a task finishes it; the mission's own tasks stay free of that, for a replan after he is lost in his turn.
    bound = [replace(t, needs=t.needs | {_itself(begun[t.id])}) if t.id in begun else t for t in tasks]
    left, reasons, undone = bound, list[Reason](), list[str]()
    while left:
        given: dict[str, Any] = {
            "first": _rows(mission, vehicles, left),
            "quick": True,
            "iterations": GENERATIONS,
            "seed": seed,
        }
        try:
            after = assign(replace(scenario, vehicles=vehicles, tasks=tuple(left)), **given, **_habits(mission.parameters))
            dropped = dict.fromkeys(_too_much(after), "the energy left does not suffice")
        except ImpossibleError as error:
            reason = error.reason
            if reason.kind == "vehicle":
                reasons.append(reason)
                vehicles = tuple(replace(v, end=v.start) if v.id == reason.about else v for v in vehicles)
                continue
            dropped = {reason.about: reason.why}
        if dropped:
            for task, why in dropped.items():
                gone = _with_successors(task, left) & {t.id for t in left}
                reasons += [Reason(why, "undone", task)] if task in gone else []
                reasons += [Reason(f"it comes after {task!r}", "undone", i) for i in sorted(gone - {task})]
                undone += [t.id for t in left if t.id in gone]
                left = [t for t in left if t.id not in gone]
            continue
        return replace(
            after,
            vehicles=scenario.vehicles,
            tasks=tasks,
            figures={**after.figures, "undone": undone},
            reasons=(*reasons, *after.reasons),
        )
    routes, missing = homeward(scenario)
    return replace(
        mission,
        site=scenario.site,
        vehicles=scenario.vehicles,
        routes=routes,
        tasks=tasks,
        figures={
            "makespan": max(r.duration for r in routes),
            "energy": sum(r.energy for r in routes),
            "undone": undone,
        },
        bounds={},
        reasons=(*reasons, *missing),
        layers=(),
    )


def homeward(scenario: Scenario) -> tuple[tuple[Route, ...], list[Reason]]:
    """Return the vehicles' ways home, as plans of tasks go, and why some cannot go it or stay where they are."""
    ways = travel(replace(scenario, tasks=()), quick=True)
    shut = ~np.isfinite(ways.idle)
    ways = replace(ways, idle=np.where(shut, 0.0, ways.idle))
    routes, _ = itineraries(scenario.vehicles, (), [[] for _ in scenario.vehicles], ways, {})
    stay = [v.id for v, stays in zip(scenario.vehicles, shut, strict=True) if stays]
    reasons = [Reason("there is no way from its start to its end, with its clearance", "vehicle", v) for v in stay]
    return routes, reasons + [r for v, route in zip(scenario.vehicles, routes, strict=True) for r in shortfalls(v, route)]


def _rows(mission: Mission, vehicles: Sequence[Vehicle], left: Sequence[Task]) -> list[list[int]]:
    """Return each vehicle's tasks of those that are left, by number, in the plan's order."""
    number = {t.id: i for i, t in enumerate(left)}
    planned = {r.vehicle: [number[w.task] for w in r.waypoints if w.task in number] for r in mission.routes}
    return [planned.get(v.id, []) for v in vehicles]


def _too_much(mission: Mission) -> list[str]:
    """Return the tasks for which the energy or time of their vehicles does not suffice: the last on each route, one at the
    least, less urgent ones first.
    """
    urgency = {t.id: t.priority for t in mission.tasks}
    found = []
    for vehicle, route in zip(mission.vehicles, mission.routes, strict=True):
        if not shortfalls(vehicle, route):
            continue
        visits = [w for w in route.waypoints if w.task]
        share = min(seconds_out(vehicle), 0.99 * route.duration) / route.duration
        spare = max(1, len(visits) - int(share * len(visits)))
        last = sorted(enumerate(visits), key=lambda v: (urgency[v[1].task or ""], -v[0]))[:spare]
        found += [w.task for _, w in last if w.task]
    return found


def _habits(parameters: Mapping[str, Any]) -> dict[str, Any]:
    return {name: parameters[name] for name in HABITS if name in parameters}


def tasks_left(mission: Mission, tasks: Sequence[Task], progress: Progress, working: set[str]) -> tuple[Task, ...]:
    """Return the tasks that are not done as they are from now on; `working` are the ids of the vehicles that go on."""
    doer = {w.task: r.vehicle for r in mission.routes for w in r.waypoints if w.task in progress.served}
    doer |= progress.servers
    old = {t.id: t for t in mission.tasks}
    begun = {t: b for t, b in _under_way(mission, progress).items() if b[0] in working and t not in progress.served}
    left = []
    for task in tasks:
        if task.id in progress.served:
            continue
        if task.id in begun:
            service = max(0.0, begun[task.id][1] + task.service_time - old[task.id].service_time)
            left.append(replace(task, service_time=service, after=(), window=(0.0, float("inf"))))
        else:
            left.append(_freed(task, doer, progress))
    return tuple(left)


def _under_way(mission: Mission, progress: Progress) -> dict[str, tuple[str, float]]:
    """Return the tasks whose service has begun: by which vehicle, and how many seconds are left of it."""
    if progress.begun is not None:
        service = {t.id: t.service_time for t in mission.tasks}
        return {t: (v, max(0.0, service[t] - so_far)) for t, (v, so_far) in progress.begun.items() if t in service}
    found = {}
    for route in mission.routes:
        x, y, _ = progress.positions[route.vehicle]
        near = THERE + mission.vehicle(route.vehicle).clearance
        for w in route.waypoints:
            if w.task and w.time <= progress.time < w.time + w.hold and np.hypot(w.x - x, w.y - y) <= near:
                found[w.task] = (route.vehicle, w.time + w.hold - progress.time)
    return found


def _itself(vehicle: str) -> str:
    """Return the capability of being this very vehicle."""
    return f"is {vehicle}"


def _freed(task: Task, doer: dict[str, str], progress: Progress) -> Task:
    """Return a task without the predecessors that are done, its window counted from now."""
    time = progress.time
    kept = {_itself(doer[a.task]) for a in task.after if a.task in doer and a.mode == "same_robot"}
    return replace(
        task,
        after=tuple(a for a in task.after if a.task not in progress.served),
        needs=task.needs | kept,
        window=(max(0.0, task.window[0] - time), max(0.0, task.window[1] - time)),
    )


def _with_successors(first: str, tasks: list[Task]) -> set[str]:
    """Return a task's id and those of all that comes after it, over any number of others."""
    gone = {first}
    while True:
        more = {t.id for t in tasks if any(a.task in gone for a in t.after)} - gone
        if not more:
            return gone
        gone |= more
