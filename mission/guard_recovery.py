"""A guards mission from now on: what is left to see, shared out among whoever works, from where they are."""

from collections.abc import Collection
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache

import numpy as np
import shapely

from quarterdeck.coverage.forest import ABSENT, NEVER, ROOT, Forest, in_order
from quarterdeck.coverage.guards.certificate import TOLERANCE, mend
from quarterdeck.coverage.guards.fewer import needless
from quarterdeck.coverage.guards.space import Space, border_of, space_of
from quarterdeck.coverage.network import Network, network
from quarterdeck.coverage.recovery import recover
from quarterdeck.geo.errors import QuarterdeckError
from quarterdeck.geo.scenario import Scenario, as_multipolygon
from quarterdeck.geo.triangulation import Triangulation, triangulate
from quarterdeck.geo.visibility import visibility_polygons
from quarterdeck.mission.guard_routes import Team, Tours, guard_route, shorter_tours
from quarterdeck.mission.guard_tours import STEPS, STEPS_A_GUARD
from quarterdeck.mission.guards import enter, guard_ranks, guards_mission, vehicle_ranges
from quarterdeck.mission.mission import Guard, Mission
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.task_recovery import homeward
from quarterdeck.mission.timing import shortfalls

PROPOSALS = 20_000  # of the search for short tours: robots are waiting
_sight = lru_cache(maxsize=4)(triangulate)  # of what is seen through: it does not change when a robot is lost


def guards_from_now(
    mission: Mission, scenario: Scenario, served: frozenset[str], *, effort: float | None = None, seed: int = 0
) -> Mission:
    """Return the mission that sees what `mission`, a guards plan, has not confirmed to have seen.

    `scenario` is the world as it is now: the site, and the vehicles that work, each with its start where it is, its end
    where it is to come home, and the energy that it has left. Vehicles of `mission` that are not in it are lost, new ones
    have joined. `served` are the stops (`guard-0`, ...) whose observation is confirmed. Guards of lost vehicles go to
    supportive ones (`coverage.recovery.recover`), then all orders are searched anew. Where the site has changed, guards
    are added. What cannot be seen any more, for want of a way or of energy, is told as an area, and makes it infeasible.
    Where all that was to be seen is withdrawn, everybody goes home.
    `effort` is that of the search for a whole plan; by default its PROPOSALS are as few as milliseconds allow.
    """
    if not scenario.site.coverable.area:
        return _withdrawn(mission, scenario, served)
    ranges = vehicle_ranges(scenario.vehicles, mission.parameters.get("range"))
    whole, team, lonely = enter(space_of(scenario), scenario.vehicles, ranges, under_way=True)
    if mission.parameters.get("inspect") == "border":
        whole = replace(whole, target=border_of(whole.target))
    mesh = _sight(whole.sight)
    seen = _confirmed(mission, scenario, served)
    target = _unseen(whole, mesh, seen.values())
    if target.area <= TOLERANCE * whole.target.area:
        target = shapely.MultiPolygon()
    space = replace(whole, target=target)
    same = _same_needs(mission, scenario, float(ranges.min()))
    left = _left(mission, space, mesh, team, seen, all_needed=same)
    guards, hidden = _places(mission.guards)[left], shapely.MultiPolygon()
    if same:
        known = _inside(space, _places(mission.guards))
        every, number = np.unique(_places(mission.guards)[known], axis=0, return_inverse=True)
        net = network(space.reach, every, team.starts, left=number[np.searchsorted(known, left)])
    else:
        guards, hidden = mend(space, mesh, guards, float(ranges.min()))
        net = network(space.reach, guards, team.starts)
    owners = [mission.guards[i].vehicle for i in left] + [None] * (len(guards) - len(left))
    start = Tours(guards, net, _shared(net, owners, mission, team), (), (), np.zeros(len(ranges)), 0.0)
    ranks = guard_ranks(scenario, space, mesh, guards, float(ranges.min())) if len(guards) else None
    effort = PROPOSALS / (STEPS + STEPS_A_GUARD * len(guards)) if effort is None else effort
    short = shorter_tours(space, start, team, ranks=ranks, effort=effort, seed=seed)
    tours = _affordable(space, short, team, ranks)
    # What the plan was proved to see from all its guards it sees from those that are left and those that are seen.
    proved = same and len(left) + len(seen) == len(mission.guards) and bool((tours.owners >= 0).all())
    after = guards_mission(scenario, space, mesh, tours, team, (), proved=proved)
    lost = after.figures["certificate"]["uncovered"]
    told = f"{lost:.6g} m2 can no longer be seen" + _why(hidden.area, lonely.area, lost)
    return replace(
        after,
        parameters=mission.parameters,
        seed=seed,
        figures={**after.figures, "undone_m2": lost},
        guards=(*after.guards, *(replace(g, vehicle=None, turn=None, seen=True) for g in seen.values())),
        reasons=(*([Reason(told)] if lost > 0 else []), *after.reasons),
    )


def _withdrawn(mission: Mission, scenario: Scenario, served: frozenset[str]) -> Mission:
    routes, missing = homeward(scenario)
    done = [g for g in with_confirmed(mission, served).guards if g.seen]
    return replace(
        mission,
        site=scenario.site,
        vehicles=scenario.vehicles,
        routes=routes,
        guards=tuple(replace(g, vehicle=None, turn=None) for g in done),
        figures={
            "guards": 0,
            "makespan": max(r.duration for r in routes),
            "energy": sum(r.energy for r in routes),
            "undone_m2": 0.0,
        },
        bounds={},
        reasons=tuple(missing),
        layers=(),
    )


def prepare(mission: Mission) -> None:
    """Work out what a loss does not change, such as ways between corners, so that the first one waits no longer."""
    scenario = Scenario(mission.name, mission.frame, mission.site, mission.vehicles, tasks=mission.tasks)
    with suppress(QuarterdeckError):  # told where it matters
        guards_from_now(mission, scenario, frozenset(), effort=0.0)


def _same_needs(mission: Mission, scenario: Scenario, reach: float) -> bool:
    """Whether each guard that is left is needed, and no more are: the site is as it was, all of it was to be seen, by
    guards none of which was spare, and nobody sees less far.
    """
    now, then = scenario.site, mission.site
    return (
        mission.feasible
        and mission.parameters.get("mode") != "paper"
        and now.obstacles == then.obstacles
        and [a.polygon for a in now.areas] == [a.polygon for a in then.areas]
        and all(g.seen or g.vehicle is not None for g in mission.guards)
        and all(g.range <= reach * (1 + 1e-9) for g in mission.guards)
    )


def with_confirmed(mission: Mission, served: frozenset[str]) -> Mission:
    """Return the mission with the guards of `served` stops marked as seen."""
    return replace(mission, guards=tuple(replace(g, seen=_done(i, g, served)) for i, g in enumerate(mission.guards)))


def _confirmed(mission: Mission, scenario: Scenario, served: frozenset[str]) -> dict[int, Guard]:
    """Return the guards, by their number, whose observation is confirmed, now or before.

    One that an obstacle stood near that is gone does not count any more: it has not seen what the obstacle hid.
    """
    gone = shapely.union_all([o.polygon for o in mission.site.obstacles if o not in scenario.site.obstacles])
    return {
        i: g
        for i, g in enumerate(mission.guards)
        if _done(i, g, served) and not shapely.dwithin(shapely.Point(g.x, g.y), gone, g.range)
    }


def _done(number: int, guard: Guard, served: frozenset[str]) -> bool:
    return guard.seen or f"guard-{number}" in served


def _unseen(space: Space, mesh: Triangulation, seen: Collection[Guard]) -> shapely.MultiPolygon:
    """Return the target less what confirmed observations have seen."""
    if not seen:
        return space.target
    views = visibility_polygons(mesh, _places(seen), np.array([g.range for g in seen]))
    return as_multipolygon(space.target.difference(shapely.union_all(views)))


def _left(
    mission: Mission,
    space: Space,
    mesh: Triangulation,
    team: Team,
    seen: Collection[int],
    *,
    all_needed: bool,
) -> list[int]:
    """Return the guards, by number, that are still needed; in the order of the plan's tours."""
    places = _places(mission.guards)
    inside = set(_inside(space, places).tolist())
    turns = [(g.turn is None, g.turn or 0, i) for i, g in enumerate(mission.guards)]
    order = [i for _, _, i in sorted(turns) if i in inside and i not in seen]
    kept = order
    if order and not all_needed:
        views = visibility_polygons(mesh, places[order], float(team.ranges.min()))
        kept = [i for i, drop in zip(order, needless(space.target, views), strict=True) if not drop]
    return kept


def _inside(space: Space, places: np.ndarray) -> np.ndarray:
    return np.flatnonzero(shapely.contains_xy(space.reach, places[:, 0], places[:, 1]))


def _places(guards: Collection[Guard]) -> np.ndarray:
    return np.array([(g.x, g.y) for g in guards], dtype=float).reshape(-1, 2)


def _shared(net: Network, owners: list[str | None], mission: Mission, team: Team) -> tuple[tuple[int, ...], ...]:
    """Return per working robot its guards: those it had, and those that it takes over from lost ones."""
    names = [v.id for v in team.vehicles]
    k, lost_names = len(names), [v.id for v in mission.vehicles if v.id not in {w.id for w in team.vehicles}]
    number = {name: robot for robot, name in enumerate([*names, *lost_names])}
    n = len(net.cdt.points)
    parents = np.full((len(number), n), ABSENT, dtype=np.int64)
    ticks = np.full((len(number), n), NEVER, dtype=np.int64)
    parents[np.arange(k), net.entries] = ROOT
    for tick, (vertex, owner) in enumerate(zip(net.guards, owners, strict=True)):
        if owner is not None:
            parents[number[owner], vertex] = ROOT  # whatever the search has given it, connected or not, is its tree
            ticks[number[owner], vertex] = tick
    lost = np.arange(len(number)) >= k
    forest = Forest(parents, in_order(ticks), ticks)
    after = recover(net.reduced, net.guards, forest, seen=np.zeros(n, dtype=np.bool_), lost=lost).forest
    guard_of = {int(v): i for i, v in enumerate(net.guards)}
    mine = after.owners
    return tuple(tuple(guard_of[int(v)] for v in after.chosen[robot] if mine[v] == robot) for robot in range(k))


def _affordable(space: Space, tours: Tours, team: Team, ranks: np.ndarray | None) -> Tours:
    """Take the last guards from robots that cannot pay for them, and give them to others that can."""
    orders = [list(order) for order in tours.order]

    def driven() -> Tours:
        given = replace(tours, order=tuple(map(tuple, orders)))
        return shorter_tours(space, given, team, ranks=ranks, exchange=False, effort=0.0)

    def pays(robot: int) -> bool:
        return not shortfalls(team.vehicles[robot], guard_route(team.vehicles[robot], tours, robot))

    dropped: list[int] = []
    poor = [robot for robot in range(len(orders)) if not pays(robot)]
    while poor:
        dropped += [orders[robot].pop() for robot in poor if orders[robot]]
        tours = driven()
        poor = [robot for robot in poor if orders[robot] and not pays(robot)]
    for guard in dropped:
        for robot in np.argsort(tours.times, kind="stable").tolist():
            before = tours
            orders[robot].append(guard)
            tours = driven()
            if pays(robot):
                break
            orders[robot].pop()
            tours = before
    return tours


def _why(hidden: float, lonely: float, lost: float) -> str:
    if lonely > 0.5 * lost:
        return ": no working vehicle can get there"
    return ": it is hidden from where the vehicles may be" if hidden > 0.5 * lost else ": the energy left does not suffice"
