"""When things change: the mission from now on, from what really happened."""

from dataclasses import dataclass, replace

import numpy as np
import shapely

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.grid import Grid, lay_grid
from quarterdeck.geo.scenario import Area, Obstacle, Scenario, Site, Vehicle, as_multipolygon
from quarterdeck.mission.cover import cover_grid, trackable
from quarterdeck.mission.mission import Mission, Route, Waypoint
from quarterdeck.mission.progress import Progress, energy_left
from quarterdeck.mission.timing import shortfalls, timed_route

VISITED = 0.25  # spacings: a path cell is visited when a survey track came so near to its centre


@dataclass(frozen=True, slots=True)
class Changes:
    """What is different from now on. Ids name vehicles, obstacles, areas; what is added comes in the scenario's types."""

    lost: frozenset[str] = frozenset()
    joined: tuple[Vehicle, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    gone: frozenset[str] = frozenset()
    areas: tuple[Area, ...] = ()
    withdrawn: frozenset[str] = frozenset()

    def __bool__(self) -> bool:
        """Whether anything is different."""
        return any((self.lost, self.joined, self.obstacles, self.gone, self.areas, self.withdrawn))


def replan(mission: Mission, progress: Progress, changes: Changes = Changes(), *, seed: int | None = None) -> Mission:
    """Return the mission from `progress.time` on. Its times count from then; its vehicles start where they are.

    What is done stays done. Without changes each route is what is left of it. After a change the survivors cover what is
    left on the same grid, in the shares that they had among themselves, with the energy that they have, and come home.

    Raises InputError if a change names what is not in the plan, or nobody is left.
    """
    _check(mission, changes)
    if not changes:
        return _rest(mission, progress)
    if mission.method != "stc":
        raise InputError(f"a plan made by {mission.method!r} cannot be replanned yet; plan the rest as a site of its own")
    vehicles = _survivors(mission, progress, changes)
    site = _changed_site(mission.site, changes)
    scenario = Scenario(
        name=mission.name,
        frame=mission.frame,
        site=site,
        vehicles=vehicles,
        tasks=mission.tasks,
        casualties=mission.casualties,
        spacing=mission.spacing,
        input_hash=mission.input_hash,
    )
    grid = _remaining(_same_lattice(mission, scenario), progress)
    told = {"replanned_at": progress.time, "lost": sorted(changes.lost)}
    after = cover_grid(scenario, grid, seed=mission.seed if seed is None else seed, parameters=told)
    return replace(after, routes=tuple(_airborne(r, after.vehicle(r.vehicle), progress) for r in after.routes))


def _check(mission: Mission, changes: Changes) -> None:
    for what, ids, known in (
        ("vehicle", changes.lost, [v.id for v in mission.vehicles]),
        ("obstacle", changes.gone, [o.id for o in mission.site.obstacles]),
        ("area", changes.withdrawn, [a.id for a in mission.site.areas]),
    ):
        for unknown in sorted(set(ids) - set(known)):
            raise InputError(f"unknown {what} {unknown!r}; the plan has {', '.join(known)}")
    twice = {v.id for v in changes.joined} & {v.id for v in mission.vehicles} - changes.lost
    if twice:
        raise InputError(f"vehicle {min(twice)!r} is in the plan already; give the one that joins another id")


def _rest(mission: Mission, progress: Progress) -> Mission:
    """Return the mission with what is left of each route, times counted from now."""
    routes = tuple(_route_left(r, progress, mission.vehicle(r.vehicle)) for r in mission.routes)
    vehicles = tuple(_moved(v, progress) for v in mission.vehicles)
    reasons = [reason for v, r in zip(vehicles, routes, strict=True) for reason in shortfalls(v, r)]
    told = dict(mission.parameters) | {"replanned_at": progress.time, "lost": []}
    return replace(mission, routes=routes, vehicles=vehicles, parameters=told, reasons=tuple(reasons))


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
    return timed_route(vehicle, points, [w.leg for w in route.waypoints], holds=[w.hold for w in route.waypoints])


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


def _same_lattice(mission: Mission, scenario: Scenario) -> Grid:
    """Lay the plan's lattice over what is to be tracked now."""
    spacing, angle = float(mission.parameters["spacing"]), float(mission.parameters["angle"])
    x, y = mission.parameters["origin"]
    cos, sin = np.cos(angle), np.sin(angle)
    return lay_grid(trackable(scenario, spacing), spacing, angle, (x * cos + y * sin, y * cos - x * sin))


def _remaining(grid: Grid, progress: Progress) -> Grid:
    """Return the grid without the hypervertices whose four path cells survey tracks have visited."""
    if not progress.tracks:
        return grid
    tree = shapely.STRtree([shapely.LineString(t) for t in progress.tracks if len(t) > 1])
    cells = np.argwhere(grid.cells)
    hits = tree.query(shapely.points(grid.centres(cells)), predicate="dwithin", distance=VISITED * grid.spacing)[0]
    visited = np.zeros(grid.cells.shape, dtype=bool)
    visited[tuple(cells[np.unique(hits)].T)] = True
    rows, columns = grid.hypervertices.shape
    done = visited.reshape(rows, 2, columns, 2).all(axis=(1, 3))
    return replace(grid, hypervertices=grid.hypervertices & ~done)
