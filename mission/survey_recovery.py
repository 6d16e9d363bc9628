"""A survey from now on, by spanning trees or lines: what is left of its lines, shared out among whoever works."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from shapely import LineString, MultiLineString, MultiPolygon, Point

from quarterdeck.coverage.metrics import swath, track_length
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Area, Scenario, Site, Vehicle, as_multipolygon
from quarterdeck.geo.transit import Roadmap
from quarterdeck.mission.changes import Changes
from quarterdeck.mission.cover import cover, roadmaps, trackable
from quarterdeck.mission.lines import plan_lines
from quarterdeck.mission.mission import Layer, Mission, Route, unbroken, undone_layer
from quarterdeck.mission.progress import Progress, with_surveyed
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.remaining import clipped, remaining_parts
from quarterdeck.mission.routes import line_routes, survey_tracks
from quarterdeck.mission.sharing import Line, Shares, Team, line_of, share_out, team_of, times
from quarterdeck.mission.timing import RESERVE, seconds_out, shortfalls

VISITED = 0.25  # spacings: a survey line is done where a track ran along it so near
ROUNDS = 2  # of sharing out again, once ways and turns are known
CUTS = 20  # tries to fit routes into the energy left


def survey_from_now(mission: Mission, scenario: Scenario, progress: Progress, changes: Changes, *, seed: int) -> Mission:
    """Return the mission that surveys what `mission` has not, of its lines and of areas that are new.

    `scenario` is the world as it is now: the site, and the vehicles that work, where they are, with the energy that they
    have left. Areas of a higher priority come first. What nobody can get to, or has the energy for, is left out, told in
    square metres, and kept in `left_out` for whoever replans when there is help.
    """
    spacing = float(mission.spacing or 0.0)
    roads = roadmaps(scenario)
    access = _Access(scenario.vehicles, roads)
    undone, cut = _undone(mission, scenario, progress, changes)
    fresh, notes = _fresh(mission, scenario, changes, seed)
    own, released = _owned(undone, fresh, scenario.vehicles, access)
    survey = _shared(mission, scenario, roads, own, released)
    left = [line.points for line in survey.left]
    ahead = [t for v, r in zip(scenario.vehicles, survey.routes, strict=True) for t in survey_tracks(v, r)]
    done = with_surveyed(mission, progress.tracks)
    driven = _swath([*(np.array(line.coords) for line in done), *ahead], spacing)
    site = scenario.site.coverable
    missed = as_multipolygon(shapely.difference(site, driven, grid_size=1e-6 * spacing))
    gaps = as_multipolygon(shapely.intersection(_swath(left, spacing), missed, grid_size=1e-6 * spacing))
    beyond = as_multipolygon(shapely.difference(missed, gaps, grid_size=1e-6 * spacing))
    rim = as_multipolygon(shapely.intersection(_swath(cut, spacing), beyond, grid_size=1e-6 * spacing))
    told = [Reason(f"{gaps.area:.6g} m2 can no longer be covered: {_why(survey.left)}")] if gaps.area > 0 else []
    return replace(
        mission,
        site=scenario.site,
        vehicles=scenario.vehicles,
        routes=survey.routes,
        figures={
            "poc": 1.0 - missed.area / site.area if site.area else 1.0,
            "length": sum(track_length(t) for t in ahead),
            "makespan": max(r.duration for r in survey.routes),
            "energy": sum(r.energy for r in survey.routes),
            "undone_m2": gaps.area + rim.area,
            "notes": notes,
            **{n: mission.figures[n] for n in ("lattice",) if n in mission.figures},
        },
        bounds={},
        reasons=(*told, *survey.reasons),
        layers=_undone_layers(gaps, rim),
        surveyed=done,
        left_out=tuple(LineString(line) for line in left),
    )


def _swath(tracks: Sequence[np.ndarray], spacing: float) -> shapely.Geometry:
    """Return what is within half the spacing of (n, 2) tracks.

    One buffer of all takes a tenth of the time of their union, but GEOS makes some that cross themselves.
    """
    lines = [t for t in tracks if len(t) > 1]
    wide = shapely.buffer(MultiLineString([LineString(t) for t in lines]), spacing / 2, quad_segs=16)
    return wide if wide.is_valid else swath(lines, spacing)


def _why(left: Sequence[Line]) -> str:
    return "no working vehicle can get there" if not any(x.able.any() for x in left) else "the energy left does not suffice"


def _undone_layers(gaps: MultiPolygon, rim: MultiPolygon) -> tuple[Layer, ...]:
    """Return the areas that are not done, with why."""
    areas = [(g, why) for g, why in ((gaps, "left out"), (rim, "too near to what is new")) if g.area > 0]
    return (undone_layer(areas),) if areas else ()


class _Access:
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


def _undone(
    mission: Mission, scenario: Scenario, progress: Progress, changes: Changes
) -> tuple[list[tuple[str | None, list[np.ndarray]]], list[np.ndarray]]:
    """Return the (n, 2) lines still to be driven, by whose they are, and those that something new may have cut."""
    short = VISITED * float(mission.spacing or 0.0)
    every = [(r.vehicle, run) for r in mission.routes for run in unbroken(r.xyz[:, :2], r.survey)]
    every += [(None, np.array(line.coords)) for line in mission.left_out]  # type: ignore[misc]
    parts = remaining_parts([run for _, run in every], progress.tracks, short)
    undone = [(owner, left) for (owner, _), left in zip(every, parts, strict=True)]
    if not (changes.obstacles or changes.withdrawn):
        return undone, []  # type: ignore[return-value]
    try:
        reach = as_multipolygon(trackable(scenario, float(mission.spacing or 0.0)).buffer(4 * short * 1e-6))
    except InputError:  # nothing is left to cover
        reach = MultiPolygon()
    return [(owner, clipped(left, reach, short)) for owner, left in undone], [x for _, left in undone for x in left]


def _fresh(mission: Mission, scenario: Scenario, changes: Changes, seed: int) -> tuple[list[np.ndarray], list[str]]:
    """Return the (n, 2) survey lines of areas that are new, and of what obstacles that are gone have kept uncovered."""
    spacing, site = float(mission.spacing or 0.0), scenario.site
    areas = list(changes.areas)
    margin = max(v.clearance for v in scenario.vehicles) + spacing / 2
    for obstacle in mission.site.obstacles:
        if obstacle.id in changes.gone:
            freed = as_multipolygon(obstacle.polygon.buffer(margin, join_style="mitre").intersection(site.area))
            areas += [Area(obstacle.id, freed)] if freed.area > 0 else []
    lines, notes = [], []
    vehicles = tuple(replace(v, share=None) for v in scenario.vehicles)
    for area in areas:
        new = replace(scenario, site=Site((area,), site.operating, site.obstacles), vehicles=vehicles, spacing=spacing)
        try:
            added = _planned(mission, new, seed)
        except InputError as error:
            notes.append(f"{area.id}: {error}")
            continue
        lines += [run for r in added.routes for run in unbroken(r.xyz[:, :2], r.survey)]
    return lines, notes


def _planned(mission: Mission, scenario: Scenario, seed: int) -> Mission:
    """Plan an area as the mission was planned."""
    given: dict[str, Any] = dict(mission.parameters)
    if mission.method == "lines":
        habits = {k: given[k] for k in ("angle", "run", "cross_every", "entry", "alternate", "lap") if k in given}
        return plan_lines(scenario, seed=seed, **habits)
    return cover(
        scenario, seed=seed, angle=mission.figures.get("lattice", {}).get("angle"), edge=given.get("edge", "cells")
    )


def _owned(
    undone: Sequence[tuple[str | None, list[np.ndarray]]],
    fresh: Sequence[np.ndarray],
    vehicles: Sequence[Vehicle],
    access: _Access,
) -> tuple[list[list[Line]], list[Line]]:
    """Return each vehicle's own lines, in order, and those that nobody has or whose vehicle cannot get there any more."""
    number = {v.id: i for i, v in enumerate(vehicles)}
    pairs = [(number.get(owner, -1) if owner else -1, line) for owner, lines in undone for line in lines]
    pairs += [(-1, line) for line in fresh]
    own: list[list[Line]] = [[] for _ in vehicles]
    released = []
    for (owner, _), line in zip(pairs, access.lines([line for _, line in pairs]), strict=True):
        if owner >= 0 and line.able[owner]:
            own[owner].append(line)
        else:
            released.append(line)
    return own, released


@dataclass(frozen=True, slots=True)
class _Survey:
    """Routes along lines, why some cannot be done, and the lines left out."""

    routes: tuple[Route, ...]
    reasons: tuple[Reason, ...]
    left: list[Line]

    @property
    def merit(self) -> tuple[float, int, float]:
        """Less is better: metres left out, what cannot be done, the makespan in seconds."""
        return round(sum(x.length for x in self.left)), len(self.reasons), max(r.duration for r in self.routes)


def _shared(
    mission: Mission, scenario: Scenario, roads: Sequence[Roadmap], own: list[list[Line]], released: list[Line]
) -> _Survey:
    """Share lines out, and again once it is known what ways and turns add to straight lines; keep the best."""
    vehicles, crumb = scenario.vehicles, float(mission.spacing or 0.0)
    paces = _paces(mission, vehicles)
    limits = np.array([seconds_out(v) for v in vehicles])
    spent = np.zeros(len(vehicles))
    classes = _classes(scenario.site, own, released, VISITED * crumb)
    best: _Survey | None = None
    for _ in range(1 + ROUNDS):
        team = team_of(vehicles, paces, spent, limits)
        shares = _by_priority(team, classes, crumb)
        survey, taken = _affordable(vehicles, shares, roads, paces)
        if best is not None and survey.merit >= best.merit:
            break
        best = survey
        spent = spent + taken - times(team, shares.lines)
    assert best is not None
    return best


def _paces(mission: Mission, vehicles: Sequence[Vehicle]) -> np.ndarray:
    """Return (k,) seconds that a metre of survey takes, turns counted, as the plan's routes show them."""
    shown = {}
    for route in mission.routes:
        metres = sum(track_length(line) for line in unbroken(route.xyz[:, :2], route.survey))
        busy = np.array([w.leg in ("survey", "turn") for w in route.waypoints])
        taken = float(np.diff([w.time for w in route.waypoints])[busy[1:]].sum())
        if metres > float(mission.spacing or 0.0):
            shown[route.vehicle] = taken / metres * mission.vehicle(route.vehicle).speed
    usual = float(np.median(list(shown.values()))) if shown else 1.0
    return np.array([max(1.0, shown.get(v.id, usual)) / v.speed for v in vehicles])


def _classes(
    site: Site, own: list[list[Line]], released: list[Line], short: float
) -> list[tuple[list[list[Line]], list[Line]]]:
    """Return own and released lines by the priority of the areas that they are in, the highest first."""
    levels = sorted({a.priority for a in site.areas}, reverse=True)
    if len(levels) < 2:
        return [(own, released)]
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


def _affordable(
    vehicles: Sequence[Vehicle], shares: Shares, roads: Sequence[Roadmap], paces: np.ndarray
) -> tuple[_Survey, np.ndarray]:
    """Return the routes along lines, each cut at its end until its vehicle has the energy for it; and the (k,) seconds that
    they would take uncut.
    """
    lines, left = [list(own) for own in shares.lines], list(shares.left)
    taken = np.zeros(len(vehicles))
    for attempt in range(CUTS):
        routes, reasons = line_routes(vehicles, [[x.points for x in own] for own in lines], roads)
        taken = taken if attempt else np.array([r.duration for r in routes])
        poor = [i for i, (v, r) in enumerate(zip(vehicles, routes, strict=True)) if lines[i] and shortfalls(v, r)]
        if not poor:
            break
        for i in poor:
            metres = _excess(vehicles[i], routes[i]) / paces[i] if attempt < CUTS - 2 else np.inf
            left += _dropped(lines[i], metres)
    return _Survey(routes, tuple(reasons), left), taken


def _excess(vehicle: Vehicle, route: Route) -> float:
    """Return about how many seconds a route is too long for the energy and time that its vehicle has."""
    over = 1.0 - seconds_out(vehicle) / max(route.duration, 1e-9)
    return float(1.05 * max(over, 1.0 - (1 - RESERVE) * vehicle.battery / max(route.energy, 1e-9)) * route.duration)


def _dropped(lines: list[Line], metres: float) -> list[Line]:
    """Cut `metres` off the end of a vehicle's lines; return what is cut off."""
    left: list[Line] = []
    while lines and metres > 0:
        last = lines.pop()
        if last.length > metres + 1.0:
            lines.append(last.part(0.0, last.length - metres))
            left.append(last.part(last.length - metres, last.length))
            break
        left.append(last)
        metres -= last.length
    return left
