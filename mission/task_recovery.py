"""An inspection mission from now on: the tasks not yet done, shared out anew among whoever works, from where they are."""

from dataclasses import replace

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Scenario, Task
from quarterdeck.mission.assign import assign
from quarterdeck.mission.cover import roadmaps
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.progress import Progress
from quarterdeck.mission.routes import line_routes

GENERATIONS = 30  # of the search: robots are waiting


def assign_from_now(mission: Mission, scenario: Scenario, progress: Progress, *, seed: int = 0) -> Mission:
    """Return the mission that does what `mission`, a plan of tasks, has not done.

    `scenario` is the world as it is now: the vehicles that work, each with its start where it is and the energy that it has
    left, and every task, done or not. Predecessors that are done bind no more, but a task in the `same_robot` as one that
    is done is kept to that robot. What nobody can do any more is left out, with what comes after it, and told.
    """
    doer = {w.task: r.vehicle for r in mission.routes for w in r.waypoints if w.task in progress.served}
    vehicles = tuple(replace(v, can=v.can | {_itself(v.id)}) for v in scenario.vehicles)
    left = [_freed(t, doer, progress.time) for t in scenario.tasks if t.id not in progress.served]
    reasons: list[str] = []
    while left:
        try:
            after = assign(replace(scenario, vehicles=vehicles, tasks=tuple(left)), iterations=GENERATIONS, seed=seed)
        except InputError as error:
            lost = next((t for t in left if str(error).startswith(f"task {t.id!r}:")), None)
            if lost is None:
                raise
            gone = _with_successors(lost.id, left)
            reasons += [str(error), *(f"task {i!r}: comes after {lost.id!r}" for i in sorted(gone - {lost.id}))]
            left = [t for t in left if t.id not in gone]
            continue
        return replace(after, vehicles=scenario.vehicles, parameters=mission.parameters, reasons=(*reasons, *after.reasons))
    routes, missing = line_routes(scenario.vehicles, [[] for _ in vehicles], roadmaps(scenario))
    return replace(
        mission,
        site=scenario.site,
        vehicles=scenario.vehicles,
        routes=routes,
        tasks=(),
        seed=seed,
        figures={"makespan": max(r.duration for r in routes), "energy": sum(r.energy for r in routes)},
        bounds={},
        reasons=(*reasons, *missing),
        layers=(),
    )


def _itself(vehicle: str) -> str:
    """Return the capability of being this very vehicle."""
    return f"is {vehicle}"


def _freed(task: Task, doer: dict[str, str], time: float) -> Task:
    """Return a task without the predecessors that are done, its window counted from now."""
    kept = {_itself(doer[a.task]) for a in task.after if a.task in doer and a.mode == "same_robot"}
    return replace(
        task,
        after=tuple(a for a in task.after if a.task not in doer),
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
