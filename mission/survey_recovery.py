"""A survey from now on, by spanning trees or lines: what is left of its lines, shared out among whoever works."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from shapely import LineString, MultiLineString, MultiPolygon

from quarterdeck.coverage.metrics import swath, track_length
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Area, Scenario, Site, Vehicle, as_multipolygon
from quarterdeck.mission.changes import Changes
from quarterdeck.mission.cover import cover, roadmaps, trackable
from quarterdeck.mission.lines import plan_lines
from quarterdeck.mission.mission import Layer, Mission, unbroken, undone_layer
from quarterdeck.mission.progress import Progress, with_surveyed
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.remaining import clipped, remaining_parts
from quarterdeck.mission.routes import survey_lines, survey_tracks
from quarterdeck.mission.sharing import Line
from quarterdeck.mission.survey_shares import VISITED, Access, shared, survey_paces

TOO_NEAR = "too near to what is new"


def survey_from_now(mission: Mission, scenario: Scenario, progress: Progress, changes: Changes, *, seed: int) -> Mission:
    """Return the mission that surveys what `mission` has not, of its lines and of areas that are new.

    `scenario` is the world as it is now: the site, and the vehicles that work, where they are, with the energy that they
    have left. Areas of a higher priority come first. What nobody can get to, or has the energy for, is left out, told in
    square metres, and kept in `left_out` for whoever replans when there is help.
    """
    spacing = float(mission.spacing or 0.0)
    roads = roadmaps(scenario)
    access = Access(scenario.vehicles, roads)
    undone, cut = _undone(mission, scenario, progress, changes)
    done = with_surveyed(mission, progress.tracks)
    fresh, notes = _fresh(mission, scenario, changes, done, seed)
    own, released = _owned(undone, fresh, scenario.vehicles, access)
    paces = survey_paces(mission.routes, mission.vehicles, scenario.vehicles, spacing)
    survey = shared(scenario, roads, own, released, paces, spacing)
    left = [line.points for line in survey.left]
    ahead = [t for v, r in zip(scenario.vehicles, survey.routes, strict=True) for t in survey_tracks(v, r)]
    earlier = [np.array(line.coords) for line in done]
    driven = _swath([*earlier, *ahead], spacing)
    site = scenario.site.coverable
    missed = as_multipolygon(shapely.difference(site, driven, grid_size=1e-6 * spacing))
    along = _swath([*earlier, *survey_lines(survey.routes)], spacing)  # a plan's coverage counts corners that turns cut
    bare = shapely.difference(site, along, grid_size=1e-6 * spacing)
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
            "poc": 1.0 - bare.area / site.area if site.area else 1.0,
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


def without_corners(mission: Mission) -> Mission:
    """Return a survey from now on whose area too near to what is new has no corners: only turns cut lines short there."""
    lines = [*(np.array(line.coords) for line in mission.surveyed), *survey_lines(mission.routes)]
    along = _swath(lines, float(mission.spacing or 0.0))
    layers, less = [], 0.0
    for layer in mission.layers:
        areas = [(g, told["why"]) for g, told in zip(layer.geometries, layer.properties, strict=True)]
        kept = [(as_multipolygon(g.difference(along)) if why == TOO_NEAR else g, why) for g, why in areas]
        less += sum(g.area for g, _ in areas) - sum(g.area for g, _ in kept)
        kept = [(g, why) for g, why in kept if g.area > 0]
        layers += [undone_layer(kept)] if kept else []
    return replace(
        mission, layers=tuple(layers), figures={**mission.figures, "undone_m2": mission.figures["undone_m2"] - less}
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
    areas = [(g, why) for g, why in ((gaps, "left out"), (rim, TOO_NEAR)) if g.area > 0]
    return (undone_layer(areas),) if areas else ()


def _undone(
    mission: Mission, scenario: Scenario, progress: Progress, changes: Changes
) -> tuple[list[tuple[str | None, list[np.ndarray]]], list[np.ndarray]]:
    """Return the (n, 2) lines still to be driven, by whose they are, and those that something new may have cut."""
    spacing = float(mission.spacing or 0.0)
    short = VISITED * spacing
    every = [(r.vehicle, run) for r in mission.routes for run in unbroken(r.xyz[:, :2], r.survey)]
    every += [(None, np.array(line.coords)) for line in mission.left_out]  # type: ignore[misc]
    parts = remaining_parts([run for _, run in every], progress.tracks, short)
    undone = [(owner, left) for (owner, _), left in zip(every, parts, strict=True)]
    if not (changes.obstacles or changes.withdrawn):
        return undone, []  # type: ignore[return-value]
    try:
        reach = as_multipolygon(trackable(scenario, spacing).buffer(1e-6 * spacing))
    except InputError:  # nothing is left to cover
        reach = MultiPolygon()
    return [(owner, clipped(left, reach, short)) for owner, left in undone], [x for _, left in undone for x in left]


def _fresh(
    mission: Mission, scenario: Scenario, changes: Changes, done: Sequence[LineString], seed: int
) -> tuple[list[np.ndarray], list[str]]:
    """Return the (n, 2) survey lines of areas that are new, and of what obstacles that are gone have kept uncovered.

    What those `done` have covered is not covered again, but where what is left of it has no room for tracks by itself.
    """
    spacing, site = float(mission.spacing or 0.0), scenario.site
    areas: list[tuple[Area, ...]] = [(area,) for area in changes.areas]
    margin = max(v.clearance for v in scenario.vehicles) + spacing / 2
    sliver = VISITED * spacing / 2
    for obstacle in mission.site.obstacles:
        if obstacle.id in changes.gone:
            around = obstacle.polygon.buffer(margin, join_style="mitre").intersection(site.area)
            near = [np.array(line.coords) for line in done if shapely.dwithin(line, around, spacing / 2)]
            bare = around.difference(_swath(near, spacing))
            freed = as_multipolygon(bare.buffer(-sliver).buffer(sliver).intersection(bare))
            areas += [(Area(obstacle.id, freed), Area(obstacle.id, as_multipolygon(around)))] if freed.area > 0 else []
    lines, notes = [], []
    vehicles = tuple(replace(v, share=None) for v in scenario.vehicles)
    for choices in areas:
        why = ""
        for area in choices:
            new = replace(scenario, site=Site((area,), site.operating, site.obstacles), vehicles=vehicles, spacing=spacing)
            try:
                added = _planned(mission, new, seed)
            except InputError as error:
                why = f"{area.id}: {error}"
                continue
            lines += [run for r in added.routes for run in unbroken(r.xyz[:, :2], r.survey)]
            break
        else:
            notes.append(why)
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
    access: Access,
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
