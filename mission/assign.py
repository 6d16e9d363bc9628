"""Assigning tasks to vehicles: the inspection-mtsp paper's pipeline, with an objective that operators mean.

Digital twin, shortest ways between all tasks and depots, search for who does what when, routes.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from typing import Any, Literal

import numpy as np
from shapely import Point

from quarterdeck.geo.deadline import running_time
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.gridpath import Heuristic
from quarterdeck.geo.occupancy import Occupancy
from quarterdeck.geo.scenario import Scenario, Task, Vehicle
from quarterdeck.geo.version import VERSION
from quarterdeck.mission.itinerary import Visit, itineraries
from quarterdeck.mission.mission import Mission, Route
from quarterdeck.mission.reason import ImpossibleError, Reason
from quarterdeck.mission.timing import RESERVE, shortfalls
from quarterdeck.mission.tours.paper import paper_search
from quarterdeck.mission.tours.problem import SHAPES, Problem, closure, problem
from quarterdeck.mission.tours.search import ITERATIONS, Solution, search
from quarterdeck.mission.travel import Travel, reachable, travel, usable

Objective = Literal["operator", "paper"]
WEIGHTS = (0.0, 0.1, 0.3, 1.0)  # seconds of makespan that a second of waiting is worth, for priorities 0..3
SHAPE = {"linear": (1.0, 1.0), "power": (600.0, 2.0), "logistic": (600.0, 120.0)}


def assign(
    scenario: Scenario,
    *,
    objective: Objective = "operator",
    weights: Sequence[float] = WEIGHTS,
    shape: str = "linear",
    shape_parameters: tuple[float, float] | None = None,
    tiers: bool = False,
    twin: Occupancy | None = None,
    resolution: float | None = None,
    heuristic: Heuristic = "none",
    quick: bool = False,
    first: Sequence[Sequence[int]] | None = None,
    iterations: int = ITERATIONS,
    time_limit: float | None = None,
    seed: int = 0,
    clock: Callable[[], float] = running_time,
    progress: Callable[[int, float, float], None] | None = None,
) -> Mission:
    """Return the mission in which the scenario's vehicles do its tasks.

    `operator` minimises makespan + sum of weights[priority] x f(start of service), ties broken by total tour time; f is the
    `shape` (`tours.schedule.shaped`) with its two parameters. `tiers`: no vehicle does a task of lower priority before one
    of higher. `paper` is eq. 4-6 of the paper, every precedence in the same robot, searched as the paper does.

    Distances are on `twin`, a map in the scenario's frame, or on a map made of the site in cells of `resolution` metres;
    `quick`: on the site's polygons. `first` are each vehicle's tasks, by number, to begin the search with; not all need be
    in it.
    The search takes `iterations`, or as many as fit into `time_limit` seconds of `clock`; `progress` gets iteration, best
    objective and bound. Raises InputError if tasks or vehicles lack, or a task cannot be done by anybody. What the plan
    found cannot meet (windows, endurance, battery) is told in the mission's `reasons`.
    """
    tasks, vehicles = scenario.tasks, scenario.vehicles
    _check(scenario, weights, shape)
    ways = travel(scenario, twin, resolution=resolution, heuristic=heuristic, plain=objective == "paper", quick=quick)
    parameters = shape_parameters or SHAPE[shape]
    p = _problem(scenario, ways, objective, weights, shape, parameters, tiers)
    if objective == "paper":
        found = paper_search(p, generations=iterations, time_limit=time_limit, seed=seed, clock=clock, progress=progress)
    else:
        found = search(
            p, iterations=iterations, time_limit=time_limit, first=first, seed=seed, clock=clock, progress=progress
        )
    before = {i: np.flatnonzero(p.pred[i]).tolist() for i in range(len(tasks))}
    routes, visits = itineraries(vehicles, tasks, found.rows, ways, before)
    reasons = [r for v, route in zip(vehicles, routes, strict=True) for r in shortfalls(v, route)]
    return Mission(
        name=scenario.name,
        frame=scenario.frame,
        site=scenario.site,
        vehicles=vehicles,
        routes=routes,
        method="assign",
        parameters={
            "objective": objective,
            "weights": list(weights),
            "shape": shape,
            "shape_parameters": list(parameters),
            "tiers": tiers,
            "map": "given" if twin is not None else "site",
            "resolution": resolution,
            "heuristic": heuristic,
            "iterations": iterations,
            "time_limit": time_limit,
        },
        seed=seed,
        tasks=tasks,
        figures=_figures(routes, found, visits, tasks, ways),
        bounds={"objective": found.bound},
        reasons=(*reasons, *_late(tasks, visits)),
        input_hash=scenario.input_hash,
        version=VERSION,
    )


def _check(scenario: Scenario, weights: Sequence[float], shape: str) -> None:
    """Raise InputError with the first thing that cannot be planned; files are checked by the reader, scenarios here."""
    if len(weights) != 4 or not all(np.isfinite(w) and w >= 0 for w in weights):
        raise InputError(f"weights {list(weights)} must be four numbers from 0, for priorities 0 to 3")
    if shape not in SHAPES:
        raise InputError(f"priority function {shape!r} is not one of {', '.join(SHAPES)}")
    for error in refusals(scenario):
        raise error


def refusals(scenario: Scenario) -> Iterator[InputError]:
    """Yield why a scenario's tasks cannot be assigned, before long work begins."""
    tasks, vehicles = scenario.tasks, scenario.vehicles
    if not tasks:
        yield InputError('no feature has the role "task"; add a Point with "role": "task" where something is to be done')
    if not vehicles:
        yield InputError('no feature has the role "vehicle"; add a Point with "role": "vehicle" where one starts')
        return
    ids = [t.id for t in tasks]
    for task in tasks:
        unknown = [a.task for a in task.after if a.task not in ids]
        if unknown:
            yield _impossible(task, f"after names the unknown task {unknown[0]!r}")
        if task.priority not in (0, 1, 2, 3):
            yield _impossible(task, f"priority {task.priority!r} must be 0, 1, 2 or 3")
        if not task.service_time >= 0:
            yield _impossible(task, f"service_time {task.service_time:g} s must not be negative")
        able = [v for v in vehicles if _may(v, task)]
        if not able:
            yield _impossible(task, f"{_unable(task)}; no vehicle is and can")
        blocks = [o for o in scenario.site.obstacles if o.polygon.contains(Point(task.position))]
        if able and blocks and all(any(v.domain in o.blocks for o in blocks) for v in able):
            yield _impossible(task, f"is inside obstacle {blocks[0].id!r}; move it out")
    after = [(ids.index(a.task), i, False) for i, task in enumerate(tasks) for a in task.after if a.task in ids]
    try:
        closure(len(tasks), after, [repr(i) for i in ids])
    except InputError as error:
        yield error


def _impossible(task: Task, why: str) -> ImpossibleError:
    return ImpossibleError(Reason(why, "task", task.id))


def _may(vehicle: Vehicle, task: Task) -> bool:
    return task.needs <= vehicle.can and task.domain in (None, vehicle.domain)


def _unable(task: Task) -> str:
    return f"needs {' and '.join([*sorted(task.needs), *([f'domain {task.domain}'] if task.domain else [])])}"


def _problem(
    scenario: Scenario,
    ways: Travel,
    objective: Objective,
    weights: Sequence[float],
    shape: str,
    shape_parameters: tuple[float, float],
    tiers: bool,
) -> Problem:
    """Return the search's arrays. Raises InputError naming a task that nobody can reach, do, or do in time."""
    tasks, vehicles = scenario.tasks, scenario.vehicles
    index = {t.id: i for i, t in enumerate(tasks)}
    paper = objective == "paper"
    reach = reachable(ways)
    may = np.array([[_may(v, t) for t in tasks] for v in vehicles])
    for i, task in enumerate(tasks):
        if not (reach & may)[:, i].any():
            who = " or ".join(v.id for v, ok in zip(vehicles, may[:, i], strict=True) if ok)
            raise _impossible(task, f"there is no way for {who} to it and home, with its clearance; move it")
    for r, v in enumerate(vehicles):
        if not np.isfinite(ways.idle[r]):
            why = "there is no way from its start to its end, with its clearance; move one"
            raise ImpossibleError(Reason(why, "vehicle", v.id))
    service = np.array([t.service_time for t in tasks])
    limit = usable(vehicles, RESERVE)
    _check_endurance(scenario, ways, reach & may, service, limit)
    priority = np.array([t.priority for t in tasks])
    p = problem(
        np.where(np.isfinite(ways.seconds), ways.seconds, 1e9),
        np.where(reach, ways.out, 1e9),
        np.where(reach, ways.home, 1e9),
        idle=ways.idle,
        kind=ways.kind,
        service=service,
        weight=None if paper else np.array(weights, dtype=float)[priority],
        windows=np.array([t.window for t in tasks]),
        tier=priority if tiers else None,
        can=reach & may,
        endurance=limit,
        after=[(index[a.task], i, paper or a.mode == "same_robot") for i, t in enumerate(tasks) for a in t.after],
        level=priority.astype(float),
        shape=shape,
        shape_parameters=shape_parameters,
        paper=paper,
        names=[repr(t.id) for t in tasks],
    )
    for i in np.flatnonzero(~p.can.any(axis=0)).tolist():
        ring = [tasks[j] for j in np.flatnonzero(p.group == p.group[i])]
        last = next(t for t in ring if not any(a.task == t.id for other in ring for a in other.after))
        others = ", ".join(repr(t.id) for t in ring if t is not last)
        raise _impossible(
            last, f"must be done by the robot that does {others}, and no vehicle can reach and do all of them"
        )
    return p


def _check_endurance(scenario: Scenario, ways: Travel, able: np.ndarray, service: np.ndarray, limit: np.ndarray) -> None:
    need = ways.out + service + ways.home
    short = np.full(need.shape, np.inf)
    short[able] = need[able] - np.broadcast_to(limit[:, None], need.shape)[able]
    for i, task in enumerate(scenario.tasks):
        best = int(np.argmin(short[:, i]))
        if short[best, i] > 0:
            raise _impossible(
                task,
                f"takes {need[best, i]:,.0f} s there and back, and no vehicle can be out so long "
                f"(best {scenario.vehicles[best].id}: {limit[best]:,.0f} s after {RESERVE:.0%} reserve)",
            )


def _figures(
    routes: Sequence[Route], found: Solution, visits: Sequence[Visit], tasks: Sequence[Task], ways: Travel
) -> dict[str, Any]:
    by_id = {t.id: t for t in tasks}
    waits = {
        str(level): max(v.start for v in visits if by_id[v.task].priority == level)
        for level in sorted({t.priority for t in tasks})
    }
    off = {t.id: float(d) for t, d in zip(tasks, ways.off.max(axis=0), strict=True) if d > 0}
    return {
        "makespan": max(r.duration for r in routes),
        "objective": found.objective,
        "total": sum(r.duration for r in routes),
        "energy": sum(r.energy for r in routes),
        "latest_start_by_priority": waits,
        "waiting": sum(v.start - v.arrival for v in visits),
        "iterations": found.iterations,
        "stopped": found.stopped,
        "served_from_metres_off": off,
        "schedule": [asdict(v) for v in visits],
    }


def _late(tasks: Sequence[Task], visits: Sequence[Visit]) -> list[Reason]:
    closes = {t.id: t.window[1] for t in tasks}
    return [
        Reason(
            f"{v.vehicle} begins at {v.start:,.0f} s, {v.start - closes[v.task]:,.0f} s after its window", "late", v.task
        )
        for v in visits
        if v.start > closes[v.task] + 1e-6
    ]
