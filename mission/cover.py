"""Covering an area: place the grid, divide it, make a tour of each region, and a route of each tour.

The pipeline of ecdis-sa-darp: WGS84 area and obstacles, grid placement by annealing, proportional division, spanning tree
coverage, paths.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import shapely
from shapely import MultiPolygon

from quarterdeck.coverage.division import Division, distinct_entries, divide
from quarterdeck.coverage.edge import Edge, lay_tracks
from quarterdeck.coverage.metrics import covered_fraction, measure, track_length
from quarterdeck.coverage.parts import allot, connected_parts, whole_targets
from quarterdeck.coverage.placement import Method, place
from quarterdeck.coverage.shares import even_shares, shares
from quarterdeck.coverage.tour import tours
from quarterdeck.geo.deadline import time_is_up
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.grid import Grid
from quarterdeck.geo.scenario import Scenario, Vehicle, as_multipolygon
from quarterdeck.geo.transit import Roadmap, roadmap, shortest_paths
from quarterdeck.geo.version import VERSION
from quarterdeck.mission.mission import Layer, Mission, Route, unbroken
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.routes import survey_lines, survey_routes
from quarterdeck.mission.survey_shares import ranked, urgent_first
from quarterdeck.mission.timing import seconds_out

MAX_HYPERVERTICES = 800_000  # which take 1.75 GB in all (benchmarks/limits.py --sizes 815000): 2 GB are enough
ROUNDS = 2  # of dividing again, once ways and turns are known


def cover(
    scenario: Scenario,
    *,
    spacing: float | None = None,
    seed: int = 0,
    placement: Method = "annealed",
    angle: float | None = None,
    edge: Edge = "cells",
) -> Mission:
    """Return the mission that covers the scenario's areas with all its vehicles.

    `spacing` is metres between neighbouring tracks (the paper's 2 delta), `angle` fixes the lattice's direction in radians
    counter-clockwise from east, `edge` is how far tracks reach out to borders (`coverage.edge`). Raises InputError if
    there is nothing to cover or nobody to cover it, or no spacing, or the area holds no free cell at this spacing. What
    vehicles cannot do is told in the mission's `reasons`.
    """
    step = covering(scenario, spacing)
    grid = place(trackable(scenario, step), step, seed=seed, method=placement, angle=angle).grid
    parameters = {"spacing": step, "placement": placement, "angle": angle, "edge": edge}
    return cover_grid(scenario, grid, edge=edge, seed=seed, parameters=parameters)


def covering(scenario: Scenario, spacing: float | None) -> float:
    """Return the track spacing in metres of a scenario that is to be covered, before long work begins.

    Raises InputError with the first of `refusals`.
    """
    for _, why in refusals(scenario, spacing):
        raise InputError(why)
    return track_spacing(scenario, spacing)


def refusals(scenario: Scenario, spacing: float | None = None) -> Iterator[tuple[str, str]]:
    """Yield why a scenario cannot be covered, before long work begins: no area, no vehicle, wrong shares, no spacing or one
    that makes too many cells. Each with the role of the features that are to be changed, "" where the line names them.
    """
    if not scenario.site.areas:
        yield "", 'no feature has the role "area"; draw what is to be covered'
    if not scenario.vehicles:
        yield "", 'no feature has the role "vehicle"; add a Point with "role": "vehicle" where one starts'
    else:
        try:
            shares(scenario.vehicles)
        except InputError as error:
            yield "", str(error)
    try:
        track_spacing(scenario, spacing)
    except InputError as error:
        yield "area", str(error)


def cover_grid(
    scenario: Scenario, grid: Grid, *, edge: Edge = "cells", seed: int = 0, parameters: Mapping[str, Any] | None = None
) -> Mission:
    """Return the mission that covers the hypervertices of a placed grid; `parameters` tell how it was."""
    vehicles, site, step = scenario.vehicles, scenario.site, grid.spacing
    roads = roadmaps(scenario)
    length = 4 * step * float(grid.hypervertices.sum())
    even = even_shares(length, *_figures_alone(vehicles))
    done = _attempt(scenario, grid, roads, shares(vehicles, even), edge, seed)
    for _ in range(ROUNDS if len(vehicles) > 1 and all(v.share is None for v in vehicles) else 0):
        if time_is_up("the even sharing of the area"):
            break
        # Ways out and home, and turns, are known now: shares that count them make the slowest sooner done.
        again = _attempt(scenario, grid, roads, even_shares(*_figures_on(vehicles, done.routes)), edge, seed)
        if again.merit >= done.merit:
            break
        done = again
    regions = done.regions
    routes, reasons = urgent_first(scenario, roads, done.routes, done.reasons, step)
    figures = asdict(measure([t for own in done.tracks for t in own], site.coverable, grid))
    cells = np.array([region.cells for region in regions])
    figures |= {
        "poc": covered_fraction(survey_lines(routes), site.coverable, step),  # turns have shortened some tracks
        "hypervertices": int(grid.hypervertices.sum()),
        "lattice": {"angle": grid.angle, "origin": grid.origin},
        "makespan": max(r.duration for r in routes),
        "energy": sum(r.energy for r in routes),
        "shares": cells / max(1, cells.sum()),
        "notes": done.notes,
        "share_error_hypervertices": float(np.abs(cells - done.shares * cells.sum()).max()),
    }
    return Mission(
        name=scenario.name,
        frame=scenario.frame,
        site=site,
        vehicles=vehicles,
        routes=routes,
        method="stc",
        parameters={"spacing": step, "edge": edge} | dict(parameters or {}),
        seed=seed,
        spacing=step,
        tasks=scenario.tasks,
        figures=figures,
        bounds={} if ranked(site) else {"moves": max(region.bound for region in regions)},
        reasons=tuple(reasons),
        layers=() if ranked(site) else (_region_layer(grid, vehicles, regions),),
        input_hash=scenario.input_hash,
        version=VERSION,
    )


@dataclass(frozen=True, slots=True)
class _Attempt:
    """A division by `shares` and what comes of it."""

    shares: np.ndarray
    regions: list["Region"]
    tracks: list[list[np.ndarray]]
    routes: tuple[Route, ...]
    reasons: list[Reason]
    notes: list[str]

    @property
    def merit(self) -> tuple[int, float]:
        """Less is better: what cannot be done, then the makespan in seconds."""
        return len(self.reasons), max(r.duration for r in self.routes)


def _attempt(
    scenario: Scenario, grid: Grid, roads: Sequence[Roadmap], parts_of_all: np.ndarray, edge: Edge, seed: int
) -> _Attempt:
    regions, notes = divided(scenario, grid, roads, parts_of_all, seed)
    tours_of_all = [t for region in regions for t in region.tours]
    area = trackable(scenario, grid.spacing)
    laid = iter(lay_tracks(area, grid, tours_of_all, edge=edge, target=scenario.site.coverable))
    tracks = [[next(laid) for _ in region.tours] for region in regions]
    routes, reasons = survey_routes(scenario.vehicles, tracks, roads)
    return _Attempt(parts_of_all, regions, tracks, routes, reasons, notes)


def _figures_alone(vehicles: Sequence[Vehicle]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (k,) speeds on survey in m/s, seconds on the way out and home, seconds that each can be out."""
    limits = np.array([seconds_out(v) for v in vehicles])
    return np.array([v.speed for v in vehicles]), np.zeros(len(vehicles)), limits


def _figures_on(vehicles: Sequence[Vehicle], routes: Sequence[Route]) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Return the metres surveyed on routes, and the figures of `_figures_alone` as the routes show them, turns counted."""
    speeds, away, limits = _figures_alone(vehicles)
    total = 0.0
    for i, route in enumerate(routes):
        surveyed = sum(track_length(line) for line in unbroken(route.xyz[:, :2], route.survey))
        surveying = float(np.diff([w.time for w in route.waypoints])[route.survey[1:]].sum())
        away[i] = route.duration - surveying
        speeds[i] = surveyed / surveying if surveying > 0 else speeds[i]
        total += surveyed
    return total, speeds, away, limits


def track_spacing(scenario: Scenario, given: float | None = None) -> float:
    """Return metres between neighbouring tracks: as given, else the scenario's, else the least swath of its sensors.

    Raises InputError if none says it, or the area would need more hypervertices than this machine can hold.
    """
    swaths = [v.sensor.swath for v in scenario.vehicles if v.sensor is not None and v.sensor.swath is not None]
    spacing = (
        given if given is not None else scenario.spacing if scenario.spacing is not None else min(swaths, default=None)
    )
    if spacing is None:
        raise InputError('no spacing: give --spacing METRES, or an area the property "spacing", or vehicles a sensor')
    if not (np.isfinite(spacing) and spacing > 0):
        raise InputError(f"spacing {spacing:g} m must be a positive number of metres")
    least = float(np.sqrt(scenario.site.coverable.area / (4 * MAX_HYPERVERTICES)))
    if spacing < least:
        raise InputError(
            f"spacing {spacing:g} m makes more than {MAX_HYPERVERTICES:,} hypervertices; at least {least:.3g} m works"
        )
    return float(spacing)


def trackable(scenario: Scenario, spacing: float) -> MultiPolygon:
    """Return where survey tracks may lie: in the areas, off every obstacle, with the vehicles' clearance. Metres.

    Raises InputError if that is nowhere.
    """
    space = scenario.site.coverable
    if space.is_empty:
        raise InputError("obstacles take up all of the area; nothing is left to cover")
    for domain in sorted({v.domain for v in scenario.vehicles}):
        clearance = max(v.clearance for v in scenario.vehicles if v.domain == domain)
        space = as_multipolygon(space.intersection(scenario.site.navigable(domain, clearance)))
    if space.is_empty:
        raise InputError(
            f"no part of the area is free at spacing {spacing:g} m and the vehicles' clearance; lessen one of them"
        )
    return space


def roadmaps(scenario: Scenario) -> list[Roadmap]:
    """Return each vehicle's roadmap; vehicles of one domain and clearance share it."""
    made: dict[tuple[str, float], Roadmap] = {}
    for v in scenario.vehicles:
        if (v.domain, v.clearance) not in made:
            made[v.domain, v.clearance] = roadmap(scenario.site.navigable(v.domain, v.clearance))
    return [made[v.domain, v.clearance] for v in scenario.vehicles]


@dataclass(frozen=True, slots=True)
class Region:
    """What one vehicle covers: (R, C) bool `mask` of hypervertices, closed `tours` of (n, 2) path cells, one a part.

    `bound` is the path moves that the longest tour of its parts has at least.
    """

    mask: np.ndarray
    tours: list[np.ndarray]
    bound: int

    @property
    def cells(self) -> int:
        """Hypervertices covered."""
        return int(self.mask.sum())


def divided(
    scenario: Scenario, grid: Grid, roads: Sequence[Roadmap], parts_of_all: np.ndarray, seed: int
) -> tuple[list[Region], list[str]]:
    """Divide the free hypervertices, each connected part among those that a transport problem sends there.

    `parts_of_all` (k,) are the shares. Returns the vehicles' regions, and notes on shares that could not be had.
    """
    vehicles = scenario.vehicles
    free, k = grid.hypervertices, len(vehicles)
    if not free.any():  # all is covered already, or all that is left has no room: everyone goes home
        return [Region(np.zeros_like(free), [], 0)] * k, []
    numbers, count = connected_parts(free)
    sizes = np.bincount(numbers[free], minlength=count)
    counts = allot(sizes, whole_targets(int(sizes.sum()), parts_of_all), _distances(grid, numbers, count, vehicles, roads))
    masks = np.zeros((k, *free.shape), dtype=bool)
    walks: list[list[np.ndarray]] = [[] for _ in range(k)]
    bounds = [0] * k
    notes: list[str] = []
    starts = np.array([v.start for v in vehicles])
    for part in range(count):
        here = np.flatnonzero(counts[:, part])
        inside = numbers == part
        entries = distinct_entries(inside, (grid.cells_at(starts[here]) + 0.5) / 2)
        names = [vehicles[i].id for i in here]
        division: Division = divide(inside, entries, counts[here, part] / sizes[part], seed=seed, names=names)
        for vehicle, walk, own in zip(here, tours(division.labels, entries), range(len(here)), strict=True):
            masks[vehicle] |= division.labels == own
            walks[vehicle].append(walk)
            bounds[vehicle] = max(bounds[vehicle], division.bound_moves)
        notes += division.reasons
    return [Region(masks[i], walks[i], bounds[i]) for i in range(k)], notes


def _distances(
    grid: Grid, numbers: np.ndarray, count: int, vehicles: Sequence[Vehicle], roads: Sequence[Roadmap]
) -> np.ndarray:
    """Return the (k, p) metres from each vehicle's start to the nearest hypervertex of each part."""
    distances = np.zeros((len(vehicles), count))
    if count == 1:
        return distances
    for part in range(count):
        centres = grid.centres(2 * np.argwhere(numbers == part) + 0.5)
        for i, vehicle in enumerate(vehicles):
            nearest = centres[np.argmin(((centres - vehicle.start) ** 2).sum(axis=1))]
            distances[i, part] = shortest_paths(roads[i], np.array([vehicle.start]), nearest)[0][0, 0]
    return distances


def _region_layer(grid: Grid, vehicles: Sequence[Vehicle], regions: Sequence[Region]) -> Layer:
    """Return each vehicle's region as an outline in metres."""
    shapes: list[Any] = []
    for region in regions:
        rows, starts = np.nonzero(np.diff(region.mask.astype(np.int8), axis=1, prepend=0, append=0) == 1)
        ends = np.nonzero(np.diff(region.mask.astype(np.int8), axis=1, prepend=0, append=0) == -1)[1]
        boxes = shapely.box(starts, rows, ends, rows + 1)
        outline = shapely.union_all(boxes)
        corners = shapely.get_coordinates(outline)
        shapes.append(shapely.set_coordinates(outline, grid.centres(2 * corners[:, ::-1] - 0.5)))
    return Layer("region", tuple(shapes), tuple({"vehicle": v.id} for v in vehicles))
