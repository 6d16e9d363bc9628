"""The plan as it was told in a run: of each route what was driven before it was replaced, then what replaced it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import dist

from quarterdeck.mission.mission import Guard, Mission, Route, Waypoint


@dataclass(frozen=True, slots=True)
class Telling:
    """A vehicle is told a new route, `time` seconds after the mission's start, of a plan with these `guards`.

    One waypoint, where it is, says that it is given up.
    It is at `place`, (x, y, z) metres, has passed `reached` waypoints of the route that it had, and used `energy` Wh.
    """

    time: float
    route: Route
    place: tuple[float, float, float]
    reached: int
    energy: float
    guards: tuple[Guard, ...] = ()


def passed(route: Route, way: Sequence[Waypoint], reached: int) -> int:
    """Return how many waypoints of a route are passed by who has come by `reached` of a command's `way`.

    The way is a part of the route; it may come to a place, and serve there, by two waypoints. The start is always passed.
    """
    planned, told = _places(route.waypoints), _places(way)
    wanted, behind = [place for _, place in told], sum(last < reached for last, _ in told)
    for first in range(len(planned)):
        if [place for _, place in planned[first : first + len(wanted)]] == wanted and first + behind:
            return planned[first + behind - 1][0] + 1
    return 1


def _places(way: Sequence[Waypoint]) -> list[tuple[int, tuple[float, float, float]]]:
    """Return the places that a way leads to, each with the number of the last of the waypoints in a row that are there."""
    at = [(w.x, w.y, w.z) for w in way]
    return [(i, place) for i, place in enumerate(at) if at[i + 1 : i + 2] != [place]]


def as_told(mission: Mission, told: Sequence[Telling], reliefs: Sequence[Telling] = ()) -> Mission:
    """Return the mission with the routes that its vehicles were told in a run, one after the other, times from its start.

    Who was told nothing has the route that it had: it may not have heard that others are to do the rest of it. A task is on
    the route to which it was given last, and on none if it is not asked for any more: `mission` has those that are.
    `reliefs` are of who was lost, when its part was given to others: its route ends there, and the parameter `lost_at` has
    the second, by id.
    """
    guards = list(mission.guards)
    routes = {r.vehicle: r for r in mission.routes}
    begins = dict.fromkeys(routes, 0)  # the waypoint at which the route that was told last begins
    given = {w.task: r.vehicle for r in mission.routes for w in r.waypoints if w.task}
    for telling in (*told, *reliefs):
        name, new = telling.route.vehicle, _renumbered(telling, guards)
        given |= {w.task: name for w in new if w.task}
        had = routes[name].waypoints
        before = had[: begins[name] + telling.reached]
        under_way = had[min(len(before), len(had) - 1)]
        time = max(telling.time, _planned(before[-1], under_way, telling.place))
        x, y, z = telling.place
        here = replace(under_way, x=x, y=y, z=z, hold=new[0].hold, time=time, task=new[0].task)
        ahead = [replace(w, time=w.time + time) for w in new[1:]]
        routes[name] = Route(name, (*before, here, *ahead), telling.energy + telling.route.energy)
        begins[name] = len(before)
    asked = {*(t.id for t in mission.tasks), *(f"guard-{i}" for i in range(len(guards)))}
    given = {task: name for task, name in given.items() if task in asked}
    routes = {name: replace(r, waypoints=tuple(_of(name, w, given) for w in r.waypoints)) for name, r in routes.items()}
    passes = {w.task: (v, i) for v, r in routes.items() for i, w in enumerate(w for w in r.waypoints if w.task)}
    whose = [passes.get(f"guard-{i}", (None, None)) for i in range(len(guards))]
    return replace(
        mission,
        routes=tuple(routes.values()),
        guards=tuple(replace(g, vehicle=v, turn=turn) for g, (v, turn) in zip(guards, whose, strict=True)),
        parameters={
            **mission.parameters,
            "told_at": sorted({t.time for t in (*told, *reliefs)}),
            "lost_at": {t.route.vehicle: t.time for t in reliefs},
        },
        figures={
            **mission.figures,
            "makespan": max((r.duration for r in routes.values()), default=0.0),
            "energy": sum(r.energy for r in routes.values()),
        },
    )


def _planned(last: Waypoint, under_way: Waypoint, place: tuple[float, float, float]) -> float:
    """Return when a vehicle was to be at `place` on its way to a waypoint: it may have come there sooner."""
    length = dist((last.x, last.y, last.z), (under_way.x, under_way.y, under_way.z))
    left = last.time + last.hold
    part = min(1.0, dist((last.x, last.y, last.z), place) / length) if length > 0 else 0.0
    return left + part * (under_way.time - left)


def _of(vehicle: str, waypoint: Waypoint, given: Mapping[str, str]) -> Waypoint:
    """Return a waypoint without its task where that was given to another vehicle since, or to nobody."""
    here = waypoint.task is None or given.get(waypoint.task) == vehicle
    return waypoint if here else replace(waypoint, task=None)


def _renumbered(telling: Telling, guards: list[Guard]) -> list[Waypoint]:
    """Return the waypoints of a new route; where they are guards' these are added to `guards`, and have their numbers."""
    names = {f"guard-{i}": g for i, g in enumerate(telling.guards)}
    waypoints = []
    for w in telling.route.waypoints:
        if w.task in names:
            guards.append(names[w.task])
            waypoints.append(replace(w, task=f"guard-{len(guards) - 1}"))
        else:
            waypoints.append(w)
    return waypoints
