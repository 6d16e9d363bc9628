"""Coverage by robots of limited visibility: guards, tours past them, and the proof that all is seen."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import shapely
from shapely import MultiPolygon

from quarterdeck.coverage.guards.bound import guards_bound
from quarterdeck.coverage.guards.certificate import TOLERANCE, mend, uncovered
from quarterdeck.coverage.guards.fewer import fewer_guards, needless
from quarterdeck.coverage.guards.pieces import paper_guards
from quarterdeck.coverage.guards.space import Space, border_of, space_of
from quarterdeck.geo.deadline import abandoning, time_is_up
from quarterdeck.geo.errors import InputError, OutOfTimeError
from quarterdeck.geo.scenario import Scenario, Vehicle, as_multipolygon
from quarterdeck.geo.triangulation import Triangulation, triangulate
from quarterdeck.geo.version import VERSION
from quarterdeck.geo.visibility import visibility_polygons
from quarterdeck.mission.guard_routes import Team, Tours, guard_layers, guard_route, guards_of, paper_tours, shorter_tours
from quarterdeck.mission.mission import Mission, undone_layer
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.timing import shortfalls

Mode = Literal["optimised", "paper"]
MOST_GUARDS = 400  # by area alone: the tours past them are searched over all distances between them
ADVICE = "give it longer, or the site longer ranges or obstacles of fewer corners"
METHOD = "target less the union of range-limited visibility polygons, discs inscribed"


def plan_guards(
    scenario: Scenario,
    *,
    range: float | None = None,  # noqa: A002 - the vehicles' own word
    mode: Mode = "optimised",
    inspect: Literal["area", "border"] = "area",
    seed: int = 0,
) -> Mission:
    """Return the mission that sees every point of the area, or of its borders and obstacles' edges, from within `range` m.

    `range` is that of the vehicles that have none of their own. As every robot may have to stand in for every other, guards
    are placed for the shortest; a robot that sees farther then leaves out those that it does not need. `paper` does what
    fault-tolerant-cdt does; `optimised` begins there and is never worse, neither in guards nor in makespan, and sees areas
    of a higher priority first (which may cost makespan). Raises InputError if a range is missing or not positive, a
    vehicle starts outside, or a part of the area cannot be reached by any; what cannot be seen because of the clearance
    makes the mission infeasible.
    """
    ranges = vehicle_ranges(scenario.vehicles, range)
    space, team, lonely = enter(space_of(scenario), scenario.vehicles, ranges)
    _refuse_lonely(space, lonely)
    if inspect == "border":
        space = replace(space, target=border_of(space.target))
    reach = float(ranges.min())
    if (least := space.target.area / (np.pi * reach**2)) > MOST_GUARDS:
        raise InputError(
            f"a range of {reach:g} m over {space.target.area:.4g} m2 takes at least {least:,.0f} guards; "
            f"up to {MOST_GUARDS:,} are planned: give a longer range, a smaller area, or sweep it with --method stc"
        )
    with abandoning(ADVICE):
        mesh = triangulate(space.sight)
        guards, unseen = mend(space, mesh, paper_guards(space, reach), reach)
        seeable = space if unseen.is_empty else replace(space, target=as_multipolygon(space.target.difference(unseen)))
        if seeable.target.is_empty:
            raise InputError(
                f"no part of the area can be seen from within {reach:g} m of where the vehicles may be; "
                "draw the operating area about it, or give a longer range"
            )
        paper = paper_tours(space, guards, team)
        paper_will_do = mode == "paper" or time_is_up("the search for fewer guards and shorter tours")
        tours = paper if paper_will_do else _optimised(scenario, seeable, mesh, paper, team, seed)
        least = guards_bound(seeable, mesh, reach, seed=seed)
    reasons = [] if unseen.is_empty else [Reason(f"{unseen.area:.6g} m2 cannot be seen from where the vehicles may be")]
    mission = guards_mission(scenario, space, mesh, tours, team, reasons, proved=tours is paper and unseen.is_empty)
    compared = {"guards": len(paper.guards), "makespan": paper.makespan, "bound": paper.bound}
    return replace(
        mission,
        parameters={"range": range, "mode": mode, "inspect": inspect},
        seed=seed,
        figures={**mission.figures, "paper": compared},
        bounds={**mission.bounds, "guards": least},
    )


def guards_mission(
    scenario: Scenario,
    space: Space,
    mesh: Triangulation,
    tours: Tours,
    team: Team,
    reasons: Sequence[Reason],
    *,
    proved: bool = False,
) -> Mission:
    """Return the mission that follows tours, with its figures and its certificate, where it is not `proved` already."""
    routes = tuple(guard_route(v, tours, i) for i, v in enumerate(team.vehicles))
    passed = np.flatnonzero(tours.owners >= 0)
    rest = MultiPolygon()
    if not proved:
        rest = uncovered(space, visibility_polygons(mesh, tours.guards[passed], team.ranges[tours.owners[passed]]))
    short = [line for vehicle, route in zip(team.vehicles, routes, strict=True) for line in shortfalls(vehicle, route)]
    figures: dict[str, Any] = {
        "guards": len(passed),
        "makespan": tours.makespan,
        "ratio": tours.makespan / tours.bound if tours.bound > 0 else 1.0,
        "duration": max(r.duration for r in routes),
        "length": sum(r.length for r in routes),
        "energy": sum(r.energy for r in routes),
        "area": space.target.area,
        "certificate": {"uncovered": float(rest.area), "tolerance": TOLERANCE, "method": METHOD},
    }
    return Mission(
        name=scenario.name,
        frame=scenario.frame,
        site=scenario.site,
        vehicles=team.vehicles,
        routes=routes,
        method="guards",
        tasks=scenario.tasks,
        casualties=scenario.casualties,
        figures=figures,
        bounds={"makespan": tours.bound},
        reasons=(*reasons, *short),
        guards=guards_of(tours, team),
        layers=(*guard_layers(tours, team), *((undone_layer([(rest, "unseen")]),) if rest.area > 0 else ())),
        input_hash=scenario.input_hash,
        version=VERSION,
    )


def _optimised(scenario: Scenario, space: Space, mesh: Triangulation, paper: Tours, team: Team, seed: int) -> Tours:
    """Return tours past few guards; past the paper's own where those would not be shorter, or at the limit."""
    reach = float(team.ranges.min())
    tours = paper
    with suppress(OutOfTimeError):
        few = fewer_guards(space, mesh, paper.guards, reach, seed=seed)
        begun = paper_tours(space, few, team)
        tours = min(paper, begun, key=lambda t: t.makespan)
        ranks = guard_ranks(scenario, space, mesh, few, reach)
        tours = shorter_tours(space, begun, team, ranks=ranks, seed=seed)
        if ranks is None and tours.makespan > paper.makespan:
            tours = paper
            tours = shorter_tours(space, paper, team, seed=seed)
        tours = _seen_from_afar(space, mesh, tours, team, ranks, seed)
    return tours


def guard_ranks(
    scenario: Scenario, space: Space, mesh: Triangulation, guards: np.ndarray, reach: float
) -> np.ndarray | None:
    """Return (m,) ranks of guards: as high as the area that needs them; None where all areas are of one priority."""
    priorities = sorted({area.priority for area in scenario.site.areas}, reverse=True)
    if len(priorities) < 2:
        return None
    views = visibility_polygons(mesh, guards, reach)
    ranks = np.full(len(guards), priorities[-1])
    for priority in priorities[:-1]:
        part = shapely.union_all([a.polygon for a in scenario.site.areas if a.priority == priority])
        rest = space.target.intersection(part).difference(shapely.union_all(views[ranks >= priority]))
        while rest.area > TOLERANCE * space.target.area:
            gains = shapely.area(shapely.intersection(views, rest))
            best = int(np.argmax(gains))
            if gains[best] <= 0:
                break
            ranks[best] = priority
            rest = rest.difference(views[best])
    return ranks


def _seen_from_afar(
    space: Space, mesh: Triangulation, tours: Tours, team: Team, ranks: np.ndarray | None, seed: int
) -> Tours:
    """Leave out guards that robots of longer range see for; they stay as spare ones, for when such a robot is lost."""
    if np.ptp(team.ranges) == 0:
        return tours
    owners = tours.owners
    spare = needless(space.target, visibility_polygons(mesh, tours.guards, team.ranges[owners]))
    kept = tuple(tuple(g for g in order if not spare[g]) for order in tours.order)
    return shorter_tours(space, replace(tours, order=kept), team, ranks=ranks, exchange=False, seed=seed)


def vehicle_ranges(vehicles: Sequence[Vehicle], default: float | None) -> np.ndarray:
    """Return (k,) metres that vehicles see: their own, or the default. Raises InputError if one is missing or wrong."""
    if default is not None and not (0 < default < float("inf")):
        raise InputError(f"range {default} must be positive and finite; give metres, such as --range 20")
    ranges = []
    for vehicle in vehicles:
        value = default if vehicle.range is None else vehicle.range
        if value is None:
            raise InputError(f"vehicle {vehicle.id!r} has no range; give it one, or --range for all")
        if not 0 < value < float("inf"):
            raise InputError(f"vehicle {vehicle.id!r}: range {value} must be positive and finite")
        ranges.append(value)
    return np.array(ranges, dtype=float)


def least_range(mission: Mission) -> float:
    """Return how far, in metres, every vehicle of a guards mission sees: guards are planned for the one that sees least."""
    return float(vehicle_ranges(mission.vehicles, mission.parameters.get("range")).min())


def enter(
    space: Space, vehicles: tuple[Vehicle, ...], ranges: np.ndarray, *, under_way: bool = False
) -> tuple[Space, Team, MultiPolygon]:
    """Return the space with only the parts that a robot starts in, the robots with where they enter and leave it, and
    what of the target is in the other parts. Raises InputError if a robot starts outside or cannot come home. One that is
    `under_way` starts where it has come to, such as without fixes, and enters the nearest part from there.
    """
    parts = shapely.get_parts(space.reach)
    starts = [_enter(space, parts, v, v.start, "" if under_way else "starts") for v in vehicles]
    homes = [_enter(space, parts, v, v.home, "ends") for v in vehicles]
    for vehicle, (start, _), (home, _) in zip(vehicles, starts, homes, strict=True):
        if start != home:
            raise InputError(f"vehicle {vehicle.id!r} cannot get from its start to its end; move one of them")
    used = sorted({part for part, _ in starts})
    lonely = as_multipolygon(shapely.intersection(space.target, shapely.union_all(np.delete(parts, used))))
    entries, exits = (np.array([xy for _, xy in ends]) for ends in (starts, homes))
    reach = as_multipolygon(shapely.multipolygons(parts[used]))
    return replace(space, reach=reach), Team(vehicles, entries, exits, ranges), lonely


def _refuse_lonely(space: Space, lonely: MultiPolygon) -> None:
    if lonely.area <= TOLERANCE * space.target.area:
        return
    point = shapely.get_coordinates(shapely.point_on_surface(lonely))
    place = "" if space.frame is None else ", such as {:.6f}, {:.6f}".format(*space.frame.to_degrees(point)[0])
    raise InputError(
        f"{lonely.area:.6g} m2 of the area can be reached by no vehicle{place}; start one there, or leave that part out"
    )


def _enter(
    space: Space, parts: np.ndarray, vehicle: Vehicle, xy: tuple[float, float], word: str
) -> tuple[int, tuple[float, float]]:
    """Return the part nearest to a place that a vehicle may be in, and the place there; a berth may be near the quay.

    `word` is what it does there; empty where it is there already, wherever that is.
    """
    away = shapely.distance(parts, shapely.Point(xy))
    part = int(np.argmin(away))
    if word and away[part] > 1.2 * vehicle.clearance + 1e-6:
        holes = space.sight.buffer(0).envelope.covers(shapely.Point(xy))
        where = "in an obstacle or outside the area" if holes else "outside the area"
        raise InputError(f"vehicle {vehicle.id!r} {word} {where}, {away[part]:.3g} m from where it may be; move it inside")
    if away[part] == 0:
        return part, xy
    x, y = shapely.get_coordinates(shapely.shortest_line(parts[part], shapely.Point(xy)))[0]
    return part, (float(x), float(y))
