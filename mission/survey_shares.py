"""Who drives which survey lines: those of areas of a higher priority first, shared out so that all are done at one time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely import MultiPolygon, Point

from quarterdeck.coverage.metrics import track_length
from quarterdeck.geo.scenario import Scenario, Site, Vehicle, as_multipolygon
from quarterdeck.geo.transit import Roadmap
from quarterdeck.mission.mission import Route, unbroken
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.remaining import clipped
from quarterdeck.mission.routes import line_routes
from quarterdeck.mission.sharing import Line, Shares, Team, line_of, share_out, team_of, times
from quarterdeck.mission.timing import seconds_out, shortfalls

VISITED = 0.25  # spacings: a survey line is done where a track ran along it so near, and no piece is shorter
ROUNDS = 2  # of sharing out again, once ways and turns are known
FINE, CRUMB = 0.005, 1.0  # of a vehicle's lines, and metres: its lines are cut so near to where its energy ends


def urgent_first(
    scenario: Scenario, roads: Sequence[Roadmap], routes: Sequence[Route], reasons: Sequence[Reason], spacing: float
) -> tuple[tuple[Route, ...], list[Reason]]:
    """Return planned routes, and why some cannot be done, such that areas of a higher priority are surveyed first, by all.

    Who has a `share` keeps its own lines, in their order within each priority; without shares they are shared out anew.
    """
    vehicles = scenario.vehicles
    if not ranked(scenario.site):
        return tuple(routes), list(reasons)
    access = Access(vehicles, roads)
    own = [access.lines(unbroken(r.xyz[:, :2], r.survey)) for r in routes]
    others = [r for r in reasons if r.kind != "energy"]
    if all(v.share is None for v in vehicles):
        survey = shared(scenario, roads, own, [], survey_paces(routes, vehicles, vehicles, spacing), spacing)
        if not survey.left:
            return survey.routes, [*others, *survey.reasons]
    # A plan leaves nothing out: it tells whose energy does not suffice.
    classes = classes_of(scenario.site, own, [], VISITED * spacing)
    ordered = [[x.points for lines, _ in classes for x in lines[i]] for i in range(len(vehicles))]
    routes, missing = line_routes(vehicles, ordered, roads)
    return routes, [*others, *missing]


def ranked(site: Site) -> bool:
    """Return whether some areas are of a higher priority than others."""
    return len({a.priority for a in site.areas}) > 1


@dataclass(frozen=True, slots=True)
class Survey:
    """Routes along lines, why some cannot be done, and the lines left out."""

    routes: tuple[Route, ...]
    reasons: tuple[Reason, ...]
    left: list[Line]

    @property
    def merit(self) -> tuple[float, int, float]:
        """Less is better: metres left out, what cannot be done, the makespan in seconds."""
        return round(sum(x.length for x in self.left)), len(self.reasons), max(r.duration for r in self.routes)


class Access:
    """Who can get where: by vehicle, the connected part of the water, ground or air that it is in, grown by a hair."""

    def __init__(self, vehicles: Sequence[Vehicle], roads: Sequence[Roadmap]) -> None:
        grown: dict[tuple[int, int], shapely.Geometry] = {}
        self.keys = []
        for vehicle, road in zip(vehicles, roads, strict=True):
            parts = shapely.get_parts(road.polygon)
            at = int(np.argmin(shapely.distance(parts, Point(vehicle.start)))) if len(parts) else -1
            if (id(road), at) not in grown:
                grown[id(road), at] = parts[at].buffer(0.01) if at >= 0 else MultiPolygon()
                shapely.prepare(grown[id(road), at])
            self.keys.append((id(road), at))
        self.grown = grown

    def lines(self, every: Sequence[np.ndarray]) -> list[Line]:
        """Return the lines along (n, 2) points, with who can drive them."""
        if not every:
            return []
        shapes = shapely.linestrings(
            np.concatenate(every), indices=np.repeat(np.arange(len(every)), [len(x) for x in every])
        )
        inside = {key: shapely.covers(polygon, shapes) for key, polygon in self.grown.items()}
        able = np.column_stack([inside[key] for key in self.keys])
        return [line_of(points, who) for points, who in zip(every, able, strict=True)]


def shared(
    scenario: Scenario,
    roads: Sequence[Roadmap],
    own: list[list[Line]],
    released: list[Line],
    paces: np.ndarray,
    spacing: float,
) -> Survey:
    """Share lines out, and again once it is known what ways and turns add to straight lines; keep the best.

    `own` are each vehicle's, `released` nobody's, `paces` (k,) seconds a metre (`survey_paces`).
    """
    vehicles = scenario.vehicles
    limits = np.array([seconds_out(v) for v in vehicles])
    spent = np.zeros(len(vehicles))
    classes = classes_of(scenario.site, own, released, VISITED * spacing)
    best: Survey | None = None
    for _ in range(1 + ROUNDS):
        team = team_of(vehicles, paces, spent, limits)
        shares = _by_priority(team, classes, spacing)
        survey, taken = _affordable(vehicles, shares, roads)
        if best is not None and survey.merit >= best.merit:
            break
        best = survey
        spent = spent + taken - times(team, shares.lines)
    assert best is not None
    return best


def survey_paces(
    routes: Sequence[Route], planned: Sequence[Vehicle], vehicles: Sequence[Vehicle], spacing: float
) -> np.ndarray:
    """Return (k,) seconds that a metre of survey takes `vehicles`, turns counted, as routes of those `planned` show it."""
    speeds, shown = {v.id: v.speed for v in planned}, {}
    for route in routes:
        metres = sum(track_length(line) for line in unbroken(route.xyz[:, :2], route.survey))
        busy = np.array([w.leg in ("survey", "turn") for w in route.waypoints])
        taken = float(np.diff([w.time for w in route.waypoints])[busy[1:]].sum())
        if metres > spacing:
            shown[route.vehicle] = taken / metres * speeds[route.vehicle]
    usual = float(np.median(list(shown.values()))) if shown else 1.0
    return np.array([max(1.0, shown.get(v.id, usual)) / v.speed for v in vehicles])


def classes_of(
    site: Site, own: list[list[Line]], released: list[Line], short: float
) -> list[tuple[list[list[Line]], list[Line]]]:
    """Return own and released lines by the priority of the areas that they are in, the highest first."""
    if not ranked(site):
        return [(own, released)]
    levels = sorted({a.priority for a in site.areas}, reverse=True)
    classes = []
    higher = MultiPolygon()
    for level in levels:
        part = as_multipolygon(shapely.union_all([a.polygon for a in site.areas if a.priority == level]).difference(higher))
        higher = shapely.union(higher, part)
        *mine, free = [
            [line_of(piece, x.able) for x in lines for piece in clipped([x.points], part, short)]
            for lines in (*own, released)
        ]
        classes.append((mine, free))
    return classes


def _by_priority(team: Team, classes: Sequence[tuple[list[list[Line]], list[Line]]], crumb: float) -> Shares:
    """Share one class of lines out after the other, each from where the one before it ends."""
    k = len(team.here)
    lines: list[list[Line]] = [[] for _ in range(k)]
    left: list[Line] = []
    for own, released in classes:
        shares = share_out(team, own, released, crumb=crumb)
        left += shares.left
        ends = [own[-1].points[-1] if own else here for own, here in zip(shares.lines, team.here, strict=True)]
        home = np.array([float(team.home(i, end)) for i, end in enumerate(ends)])
        team = replace(team, here=np.array(ends), spent=shares.times - home)
        for mine, more in zip(lines, shares.lines, strict=True):
            mine += more
    return Shares(lines, shares.times, left)


def _affordable(vehicles: Sequence[Vehicle], shares: Shares, roads: Sequence[Roadmap]) -> tuple[Survey, np.ndarray]:
    """Return the routes along lines, each cut, by bisection, where the energy of its vehicle ends; and the (k,) seconds
    that they would take uncut.
    """
    whole = np.array([sum(x.length for x in own) for own in shares.lines])
    keep, pays, fails = whole, np.zeros(len(vehicles)), whole
    taken = None
    while True:
        cut = [_cut(own, metres) for own, metres in zip(shares.lines, keep.tolist(), strict=True)]
        routes, reasons = line_routes(vehicles, [[x.points for x in kept] for kept, _ in cut], roads)
        taken = np.array([r.duration for r in routes]) if taken is None else taken
        poor = np.array([bool(c[0] and shortfalls(v, r)) for v, r, c in zip(vehicles, routes, cut, strict=True)])
        pays, fails = np.where(poor, pays, keep), np.where(poor, keep, fails)
        between = fails - pays > np.maximum(FINE * whole, CRUMB)
        if not (poor | between).any():
            return Survey(routes, tuple(reasons), [*shares.left, *(x for _, over in cut for x in over)]), taken
        keep = np.where(between, (pays + fails) / 2, pays)


def _cut(lines: Sequence[Line], metres: float) -> tuple[list[Line], list[Line]]:
    """Return the first `metres` of a vehicle's lines, and the rest."""
    kept, rest = list[Line](), list[Line]()
    for line in lines:
        if metres > 0.0 and line.length <= metres + 1e-6:
            kept.append(line)
        elif min(metres, line.length - metres) < CRUMB:
            rest.append(line)
        else:
            kept.append(line.part(0.0, metres))
            rest.append(line.part(metres, line.length))
        metres = max(0.0, metres - line.length)
    return kept, rest
