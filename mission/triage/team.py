"""The team at work: what is fixed before the mission starts, made from a scenario and checked once."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import inf

import numpy as np
from shapely import MultiPolygon, Point
from shapely.ops import nearest_points

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Scenario, Vehicle, as_multipolygon
from quarterdeck.geo.transit import roadmap, shortest_path
from quarterdeck.mission.mission import Waypoint
from quarterdeck.mission.triage.berths import berths
from quarterdeck.mission.triage.chase import Ways, straight
from quarterdeck.mission.triage.records import XY, Stand
from quarterdeck.mission.triage.search import Search, search_paths
from quarterdeck.mission.triage.settings import METHODS, SORT, Colour, Settings
from quarterdeck.mission.world import Actor, Target

_MOVES = 30.0  # s between two places of a moving rendezvous
_HALT = 1.0  # s
_STANDOFF = 1.5  # m
_ABOVE = 3.0  # m, at the most, that a UAV flies above the one before it: they come and go at one rendezvous


@dataclass(frozen=True, slots=True)
class Robot:
    """A UGV or UAV, `vehicle`: `path` is what a UGV searches; `home` when a UAV hovers where, as (seconds, (x, y)).

    What bodies add: `berth` is how far from the middle of those at a rendezvous it waits, metres east and north;
    `standoff` how near a UGV drives to a casualty, metres; `halt` how many seconds a UAV that looks for somebody stops
    where it changes course, so that it does not fly past him at speed.
    """

    id: str
    vehicle: Vehicle
    start: XY
    speed: float
    sees: float
    z: float = 0.0
    path: tuple[Waypoint, ...] = ()
    home: tuple[tuple[float, XY], ...] = ()
    berth: XY = (0.0, 0.0)
    standoff: float = 0.0
    halt: float = 0.0

    @property
    def power(self) -> Callable[[np.ndarray], np.ndarray] | None:
        """The watts that it draws at (n,) speeds; None where it can be out for ever."""
        limited = min(self.vehicle.battery, self.vehicle.endurance) < inf
        return self.vehicle.model.power if limited else None


@dataclass(frozen=True, slots=True)
class Team:
    """Who works on a site, and how they get about.

    `medics` are starts by id; `ground`, `foot` and `air` are where UGVs, medics and UAVs may be. `stand` is how far the
    mission had come before; `paces` are speeds of medics in m/s, where they are not the settings'. `depots` are where spare
    devices for medics are, and where who has nobody to report to comes: the rendezvous or, without any, where medics start;
    `beside` is how far from a rendezvous the middle of the robots that wait there is, metres east and north.
    `distances` gives the medics' (n, n) metres between (n, 2) points; `on_ground`, `on_foot` and `in_air` shortest paths.
    """

    ugvs: Mapping[str, Robot]
    uavs: Mapping[str, Robot]
    medics: Mapping[str, XY]
    search: Search
    depots: tuple[XY, ...]
    ground: MultiPolygon
    foot: MultiPolygon
    air: MultiPolygon
    on_ground: Ways
    on_foot: Ways
    in_air: Ways
    distances: Callable[[np.ndarray], np.ndarray]
    stand: Stand | None = None
    paces: Mapping[str, float] = field(default_factory=dict)
    beside: XY = (0.0, 0.0)

    @property
    def began(self) -> float:
        """The seconds from the mission's beginning to this part of it."""
        return 0.0 if self.stand is None else self.stand.time

    @property
    def gone(self) -> Mapping[str, XY]:
        """Members that are not there any more, and where they were last."""
        return {} if self.stand is None else self.stand.gone

    def pace(self, medic: str, settings: Settings) -> float:
        """Return a medic's speed."""
        return self.paces.get(medic, settings.medic_speed)

    def actors(self, settings: Settings) -> list[Actor]:
        """Return everybody who is there for the world: UGVs, UAVs, medics."""
        on_the_spot = max(settings.medic_sees, 0.1)
        everybody = [
            *(Actor(u.id, *u.start, speed=u.speed, sees=u.sees, power=u.power) for u in self.ugvs.values()),
            *(Actor(u.id, *u.start, z=u.z, speed=u.speed, power=u.power) for u in self.uavs.values()),
            *(Actor(m, *xy, speed=self.pace(m, settings), sees=on_the_spot) for m, xy in self.medics.items()),
        ]
        return [a for a in everybody if a.id not in self.gone]


def make_team(
    scenario: Scenario,
    method: str,
    settings: Settings,
    search: Search | None = None,
    *,
    bodies: bool = False,
    stand: Stand | None = None,
) -> Team:
    """Return the team of a scenario for a method; `search` gives the UGVs other paths than their tours.

    With `bodies` nobody is a point: medics keep clear of walls, robots wait side by side beside the rendezvous. From a
    `stand` the mission goes on, with the search that belongs to it: what was checked at its beginning is so no more. Raises
    InputError, in one line, if there is no UGV or medic, no UAV for a method that needs one, or a casualty, medic or
    rendezvous is where nobody can get.
    """
    if method not in METHODS:
        raise InputError(f"unknown method {method!r}; use one of {', '.join(METHODS)}")
    policy = METHODS[method]
    ugvs = [v for v in scenario.vehicles if v.domain == "ground"]
    uavs = [v for v in scenario.vehicles if v.domain == "aerial"]
    if not ugvs:
        raise InputError('no UGV to search with; add a vehicle with "domain": "ground"')
    if not scenario.medics:
        raise InputError('no medic; add a Point with "role": "medic"')
    if not scenario.site.areas and stand is None:
        raise InputError('no field to search; give the polygon to be searched "role": "area"')
    if policy.receiver == "uav" and not uavs:
        raise InputError(f'method {method} needs a UAV; add a vehicle with "domain": "aerial", or use --method no-relay')
    clearance = max(u.clearance for u in ugvs)
    ground = scenario.site.navigable("ground", clearance)
    foot = scenario.site.navigable("ground", load_model("walker").clearance if bodies else 0.0)
    on_ground, on_foot = ways_in(ground), ways_in(foot)
    air = scenario.site.navigable("aerial", max((u.clearance for u in uavs), default=0.0))
    if stand is None:
        _check(scenario)
    spacing = scenario.spacing or settings.spacing
    sees = [u.range or settings.ugv_sees for u in ugvs]
    field = field_of(scenario)
    starts = tuple((float(u.start[0]), float(u.start[1])) for u in ugvs)
    if search is None:
        search = search_paths(field, ground, starts, spacing, min(sees), on_ground)
    points: tuple[XY, ...] = ()
    if policy.receiver == "uav":
        points = stand.depots if stand else _rendezvous(scenario, search)
    routes = [tuple(Waypoint(float(x), float(y), leg="survey", speed=u.speed) for x, y in p)
              for u, p in zip(ugvs, search.paths, strict=True)]  # fmt: skip
    robots = {
        u.id: Robot(u.id, u, u.start, u.speed, s, path=r, standoff=_STANDOFF * bodies)
        for u, s, r in zip(ugvs, sees, routes, strict=True)
    }
    homes: list[tuple[tuple[float, XY], ...]] = [((0.0, p),) for p in _in_turn(points, len(uavs))]
    if settings.rendezvous == "moving" and points:
        homes = [_moving(robots, ground) or homes[0]] * len(uavs)
    if stand is not None and points:
        homes = [stand.homes.get(u.id, ((0.0, p),)) for u, p in zip(uavs, _in_turn(points, len(uavs)), strict=False)]
    used = uavs if policy.receiver == "uav" else []
    room = min((u.ceiling - u.altitude for u in used), default=0.0) / max(len(used), 1)
    step = min(_ABOVE, max(room, 0.0)) * bodies
    flyers = {
        u.id: Robot(u.id, u, u.start, u.speed, 0.0, u.altitude + i * step, home=h, halt=_HALT * bodies)
        for i, (u, h) in enumerate(zip(used, homes, strict=True))
    }
    beside = (0.0, 0.0)
    if bodies and used:
        beside, *waiting = berths(scenario.site, ground, ugvs, search.paths, used, homes, settings.talk)
        robots, flyers = (
            {r.id: replace(r, berth=b) for r, b in zip(kind.values(), places, strict=True)}
            for kind, places in zip((robots, flyers), waiting, strict=True)
        )
    return Team(
        ugvs=robots,
        uavs=flyers,
        medics=dict(scenario.medics),
        search=search,
        depots=tuple(points) or tuple(xy for _, xy in scenario.medics),
        ground=ground,
        foot=foot,
        air=air,
        on_ground=on_ground,
        on_foot=on_foot,
        in_air=ways_in(air),
        distances=_distances(on_foot),
        stand=stand,
        beside=beside,
    )


def _in_turn(points: Sequence[XY], count: int) -> list[XY]:
    return [points[i % len(points)] for i in range(count if points else 0)]


def field_of(scenario: Scenario) -> MultiPolygon:
    """Return what is to be searched: the areas, less what stands on them."""
    return as_multipolygon(scenario.site.area.intersection(scenario.site.navigable("ground")))


def targets(scenario: Scenario, settings: Settings, seed: int) -> list[Target]:
    """Return the casualties: robots see `sort`, at times wrong, and where they are off by `error`; medics see `category`.

    A robot takes no casualty to be where nobody can stand: the error ends there.
    """
    foot = scenario.site.navigable("ground")
    rng = np.random.default_rng([seed, 0x5A17])
    sorts: tuple[Colour, ...] = ("red", "yellow", "green")
    made = []
    for c in scenario.casualties:
        wrong, other = rng.random() >= settings.confidence, int(rng.integers(1, 3))
        sort = SORT[c.colour]
        seen = sorts[(sorts.index(sort) + other) % 3] if wrong else sort
        error = rng.normal(0.0, 1.0, 2) * settings.position_error
        if settings.position_error > 0:
            told = nearest_points(foot, Point(np.array(c.position) + error))[0]
            error = np.array([told.x, told.y]) - c.position
        made.append(Target(c.id, *c.position, {"sort": seen, "category": c.colour, "error": tuple(error.tolist())}))
    return made


@lru_cache(maxsize=64)
def ways_in(polygon: MultiPolygon) -> Ways:
    """Return the shortest paths in a polygon; straight lines where it is convex."""
    if len(polygon.geoms) == 1 and polygon.convex_hull.area - polygon.area < 1e-6 * polygon.area:
        return straight
    road = roadmap(polygon)

    @lru_cache(maxsize=100_000)
    def ways(a: XY, b: XY) -> Sequence[XY]:
        path = shortest_path(road, a, b)
        if path is None:
            raise InputError(f"no way from ({a[0]:.1f}, {a[1]:.1f}) to ({b[0]:.1f}, {b[1]:.1f}) m around the obstacles")
        return tuple((float(x), float(y)) for x, y in path[1:])

    return ways


@lru_cache(maxsize=64)
def _distances(ways: Ways) -> Callable[[np.ndarray], np.ndarray]:
    def straight_distances(points: np.ndarray) -> np.ndarray:
        dx = points[:, None, :] - points[None, :, :]
        return np.hypot(dx[..., 0], dx[..., 1])

    @lru_cache(maxsize=100_000)
    def distance(a: XY, b: XY) -> float:
        path = np.array([a, *ways(a, b)])
        return float(np.hypot(*np.diff(path, axis=0).T).sum())

    def around(points: np.ndarray) -> np.ndarray:
        xy = [(float(x), float(y)) for x, y in points]
        matrix = np.zeros((len(xy), len(xy)))
        for i in range(len(xy)):
            for j in range(i):
                matrix[i, j] = matrix[j, i] = distance(*sorted((xy[i], xy[j])))
        return matrix

    return straight_distances if ways is straight else around


def _check(scenario: Scenario) -> None:
    ids = [*(v.id for v in scenario.vehicles), *(m for m, _ in scenario.medics)]
    for kind, names in (("vehicles and medics", ids), ("casualties", [c.id for c in scenario.casualties])):
        if twice := sorted({n for n in names if names.count(n) > 1}):
            raise InputError(f"{kind}: the id {twice[0]!r} is given twice; give each its own")
    operating = scenario.site.operating
    foot = scenario.site.navigable("ground")
    for kind, named in (("medic", scenario.medics), ("rendezvous", scenario.rendezvous)):
        for name, xy in named:
            if not operating.covers(Point(xy)):
                away = operating.distance(Point(xy))
                raise InputError(f"{kind} {name!r} is {away:,.1f} m outside the field; move it in")
            if not foot.buffer(1e-6).covers(Point(xy)):
                raise InputError(f"{kind} {name!r} is inside an obstacle; move it out")
    for c in scenario.casualties:
        if not foot.buffer(1e-6).covers(Point(c.position)):
            inside = [o.id for o in scenario.site.obstacles if o.polygon.covers(Point(c.position))]
            where = f"inside obstacle {inside[0]!r}" if inside else "outside the field"
            raise InputError(f"casualty {c.id!r} is {where}, where no medic can get; move it, or the outline")


def _rendezvous(scenario: Scenario, search: Search) -> tuple[XY, ...]:
    """Return the given points or, if none, the place from which the search paths are nearest on average."""
    if scenario.rendezvous:
        return tuple(xy for _, xy in scenario.rendezvous)
    centre = Point(*np.concatenate(search.paths).mean(axis=0))
    free = scenario.site.navigable("ground")
    near = centre if free.covers(centre) else free.boundary.interpolate(free.boundary.project(centre))
    return ((near.x, near.y),)


def _moving(ugvs: Mapping[str, Robot], free: MultiPolygon) -> tuple[tuple[float, XY], ...]:
    """Return the middle of where the UGVs would be without finds, every half minute: all robots can work it out."""
    courses = []
    for u in ugvs.values():
        xy = np.array([u.start, *((w.x, w.y) for w in u.path)])
        courses.append((np.concatenate([[0.0], np.hypot(*np.diff(xy, axis=0).T).cumsum() / u.speed]), xy))
    end = max(t[-1] for t, _ in courses)
    times = np.arange(0.0, end + _MOVES, _MOVES)
    middle = np.mean([np.column_stack([np.interp(times, t, xy[:, i]) for i in (0, 1)]) for t, xy in courses], axis=0)
    inside = [free.covers(Point(p)) for p in middle]  # where the middle is in an obstacle, the last place is kept
    return tuple((float(t), (float(x), float(y))) for t, (x, y), ok in zip(times, middle, inside, strict=True) if ok)
