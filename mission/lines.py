"""Parallel lines: the division of a placed grid, each region surveyed by lines, as sonar and camera teams expect."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from shapely import LineString, MultiPolygon

from quarterdeck.coverage.laps import lap_space
from quarterdeck.coverage.lines import Lines, lay_lines, split_area
from quarterdeck.coverage.metrics import covered_fraction, track_length
from quarterdeck.coverage.placement import place
from quarterdeck.coverage.shares import shares
from quarterdeck.coverage.spread import Spread
from quarterdeck.geo.deadline import time_is_up
from quarterdeck.geo.scenario import Scenario, Vehicle
from quarterdeck.geo.transit import Roadmap, shortest_paths
from quarterdeck.geo.version import VERSION
from quarterdeck.mission.cover import covering, divided, roadmaps, trackable
from quarterdeck.mission.mission import Layer, Leg, Mission, Route
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.routes import survey_lines, way_routes
from quarterdeck.mission.seafloor import seen, spreads
from quarterdeck.mission.survey_shares import ranked, urgent_first

ROUNDS = 2  # of dividing again, once it is known how much there is to drive where


def plan_lines(
    scenario: Scenario,
    *,
    spacing: float | None = None,
    seed: int = 0,
    angle: float | None = None,
    run: float = 0.0,
    cross_every: int = 0,
    entry: tuple[float, float] | None = None,
    alternate: int = 0,
    lap: bool = False,
) -> Mission:
    """Return the mission that surveys the scenario's areas by parallel lines, `spacing` metres apart.

    Without a spacing, where soundings are known, a multibeam sonar's lines follow the depth (`mission.seafloor`). `angle`
    is the lines' direction in radians counter-clockwise from east (None: each vehicle's cheapest), `run` the metres
    driven straight before and after each line, `cross_every` n > 0 adds lines across, n spacings apart. Each
    vehicle's lines begin at the end nearest to `entry`, (x, y) metres (None: where the way is short). `alternate` n > 1
    drives every nth line and the skipped ones on the way back. `lap`: before the lines, each drives what is in its part of
    one lap along the border and around obstacles, half a spacing in. Raises InputError as `cover` does.
    """
    step, wide = dividing(scenario, spacing)
    sounded = any(s is not None for s in wide)
    area = trackable(scenario, step)
    grid = place(area, step, seed=seed, angle=angle).grid
    vehicles, roads = scenario.vehicles, roadmaps(scenario)
    habits: dict[str, Any] = {
        "angle": angle,
        "run": run,
        "cross_every": cross_every,
        "entry": entry,
        "alternate": alternate,
    }
    space = lap_space(scenario.site.coverable, area, step) if lap else None

    def attempt(parts_of_all: np.ndarray) -> _Attempt:
        regions, notes = divided(scenario, grid, roads, parts_of_all, seed)
        labels = np.full(grid.hypervertices.shape, -1)
        for i, region in enumerate(regions):
            labels[region.mask] = i
        parts = split_area(area, grid, labels, len(vehicles))
        laid = [
            lay_lines(area, part, step, road, start=v.start, lap=space, spread=spread, **habits)
            for v, part, road, spread in zip(vehicles, parts, roads, wide, strict=True)
        ]
        return _Attempt(laid, notes, *_routes(vehicles, laid, roads))

    wanted = shares(vehicles)
    done = attempt(wanted)
    for _ in range(ROUNDS if sounded and len(vehicles) > 1 and vehicles[0].share is None else 0):
        if time_is_up("the even sharing of the area"):
            break
        # Where it is shoal there is more to drive: shares that count it make the slowest sooner done.
        wanted = wanted / np.array([max(r.duration, 1.0) for r in done.routes])
        wanted /= wanted.sum()
        again = attempt(wanted)
        if again.makespan >= done.makespan:
            break
        done = again
    routes, reasons = urgent_first(scenario, roads, done.routes, done.reasons, step)
    return Mission(
        name=scenario.name,
        frame=scenario.frame,
        site=scenario.site,
        vehicles=vehicles,
        routes=routes,
        method="lines",
        parameters={"spacing": None if sounded else step} | habits | {"lap": lap},
        seed=seed,
        spacing=step,
        tasks=scenario.tasks,
        figures=_figures(scenario, area, done, routes, step, sounded=sounded, lap=lap),
        reasons=tuple(reasons),
        layers=() if ranked(scenario.site) else (_named(vehicles, done.laid),),
        input_hash=scenario.input_hash,
        version=VERSION,
    )


def dividing(scenario: Scenario, spacing: float | None) -> tuple[float, list[Spread | None]]:
    """Return the spacing in metres of the grid that divides, and how far apart each vehicle's lines may be where: None
    where they are as far apart everywhere. Raises InputError as `mission.cover.covering` does.
    """
    step = covering(scenario, spacing)
    fixed = spacing is not None or scenario.spacing is not None
    wide: list[Spread | None] = [None] * len(scenario.vehicles) if fixed else spreads(scenario)
    sounded = [s.widths for s in wide if s is not None]
    return max(step, float(np.median(np.concatenate(sounded)))) if sounded else step, wide


@dataclass(frozen=True, slots=True)
class _Attempt:
    """A division's lines, notes on it, routes along them, and why they cannot be driven."""

    laid: list[Lines]
    notes: list[str]
    routes: tuple[Route, ...]
    reasons: list[Reason]

    @property
    def makespan(self) -> tuple[int, float]:
        """Less is better: what cannot be done, then seconds."""
        return len(self.reasons), max(r.duration for r in self.routes)


def _figures(
    scenario: Scenario,
    area: MultiPolygon,
    done: _Attempt,
    routes: Sequence[Route],
    step: float,
    *,
    sounded: bool,
    lap: bool,
) -> dict[str, Any]:
    """Return what `routes` along the lines that are `done` come to, `step` metres apart where they are not `sounded`."""
    site, laid = scenario.site.coverable, done.laid
    tracks = [t for lines in laid for t in lines.tracks]
    length, covered = sum(track_length(t) for t in tracks), covered_fraction(tracks, site, step) * site.area
    figures: dict[str, Any] = {
        "poc": covered_fraction(survey_lines(routes), site, step),
        "length": length,
        "length_per_1000_m2": 1000.0 * length / site.area,
        "overlap": length * step / covered - 1.0 if covered > 0 else 0.0,
    }
    if sounded:  # one width does not say what is covered
        del figures["overlap"]
        figures |= seen(scenario, area, routes)
        figures["poc"] = figures.pop("seafloor_coverage", figures["poc"])
    return figures | {
        "lines": sum(len(lines.swaths) for lines in laid),
        **({"laps": sum(len(lines.laps) for lines in laid)} if lap else {}),
        "makespan": max(r.duration for r in routes),
        "energy": sum(r.energy for r in routes),
        "notes": done.notes,
    }


def _routes(
    vehicles: Sequence[Vehicle], laid: Sequence[Lines], roads: Sequence[Roadmap]
) -> tuple[tuple[Route, ...], list[Reason]]:
    ways = [_way(v, lines, road) for v, lines, road in zip(vehicles, laid, roads, strict=True)]
    routes, reasons = way_routes(vehicles, [(points, legs) for points, legs, _ in ways], roads)
    missing = [Reason(line) for _, _, found in ways for line in found]
    missing += [
        Reason(f"{v.id}: no way to {lines.unreached} pieces of its lines")
        for v, lines in zip(vehicles, laid, strict=True)
        if lines.unreached
    ]
    return routes, missing + reasons


def _way(vehicle: Vehicle, lines: Lines, road: Roadmap) -> tuple[np.ndarray, list[Leg], list[str]]:
    """Return (n, 2) metres out, along all lines with their runs and links, and home; the kind of each leg; what fails."""
    points: list[tuple[float, float]] = [vehicle.start]
    legs: list[Leg] = ["start"]
    tracks = lines.driven
    if not tracks and not vehicle.returns:
        return np.array(points), legs, []
    if not tracks:
        home = shortest_paths(road, np.array(vehicle.start), np.array(vehicle.home))[1][0][0]
        if home is None:
            return np.array(points), legs, [f"{vehicle.id}: no way from its start to its end; move them"]
        for point in home[1:].tolist():
            _add(points, legs, point, "transit")
        return np.array(points), legs, []
    way_out = shortest_paths(road, np.array(vehicle.start), tracks[0][0])[1][0][0]
    way_home = shortest_paths(road, tracks[-1][-1], np.array(vehicle.home))[1][0][0]
    if way_out is None or way_home is None:
        return np.array(points), legs, [f"{vehicle.id}: no way between its start, its region and its end; move them"]
    links = [way_out, *lines.links, way_home]
    for i, (link, track) in enumerate(zip(links, tracks, strict=False)):
        for point in link[1:].tolist():
            _add(points, legs, point, "transit")
        kinds: list[Leg] = ["survey"] * (len(track) - 1) if i < len(lines.laps) else ["transit", "survey", "transit"]
        for point, kind in zip(track[1:].tolist(), kinds, strict=True):
            _add(points, legs, point, kind)
    if not vehicle.returns:
        return np.array(points), legs, []
    for point in way_home[1:].tolist():
        _add(points, legs, point, "transit")
    return np.array(points), legs, []


def _add(points: list[tuple[float, float]], legs: list[Leg], point: Sequence[float], leg: Leg) -> None:
    if np.hypot(point[0] - points[-1][0], point[1] - points[-1][1]) > 1e-6:
        points.append((float(point[0]), float(point[1])))
        legs.append(leg)


def _named(vehicles: Sequence[Vehicle], laid: Sequence[Lines]) -> Layer:
    """Return the lines with their names, for the eye and for the log; laps are P1, P2, ... (perimeter)."""
    laps = [(v.id, f"P{n + 1}", lap) for v, own in zip(vehicles, laid, strict=True) for n, lap in enumerate(own.laps)]
    swaths = [(v.id, s) for v, lines in zip(vehicles, laid, strict=True) for s in lines.swaths]
    properties = [{"name": name, "vehicle": owner, "cross": False, "lap": True} for owner, name, _ in laps]
    properties += [{"name": s.name, "vehicle": owner, "cross": s.cross} for owner, s in swaths]
    shapes = [*(LineString(lap) for _, _, lap in laps), *(LineString([s.start, s.end]) for _, s in swaths)]
    return Layer("line", tuple(shapes), tuple(properties))
