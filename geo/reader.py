"""From a site's GeoJSON to a `Scenario`: everything is checked here, once, and every problem told with its place."""

import hashlib
from collections.abc import Collection, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from shapely import MultiPoint, MultiPolygon
from shapely.ops import unary_union

from quarterdeck.geo.actors import read_task, read_vehicle, task_problems, vehicle_problems, xy_of
from quarterdeck.geo.depths import least_depth, read_soundings
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import MAX_RADIUS, Frame
from quarterdeck.geo.geojson import Document, opened, position_problem, positions, read_corridor, read_polygon
from quarterdeck.geo.kinds import CHANGES, SITE, kind_of_json
from quarterdeck.geo.properties import GEOMETRIES, LINES, property_problems
from quarterdeck.geo.scenario import (
    DOMAINS,
    Area,
    Casualty,
    Obstacle,
    Scenario,
    Site,
    Task,
    Vehicle,
    as_multipolygon,
)

POINTS = ("casualty", "medic", "rendezvous")


def read_scenario(source: str | Path | Document) -> Scenario:
    """Return the scenario in a GeoJSON file, or in one that has been read; `-` reads standard input.

    Raises InputError with the first problem, in one line that names the feature, its place and what to do.
    """
    return _scenario(source, None)


def read_additions(source: str | Path | Document, frame: Frame, *, tasks: Collection[str] = ()) -> Scenario:
    """Return what a GeoJSON file adds to a mission, in metres of its `frame`: any roles, none required.

    New tasks may come after those of the ids `tasks`. Features that change something else are passed over (see
    `mission.changes`). Raises InputError as `read_scenario` does.
    """
    return _scenario(source, frame, tasks)


def _scenario(source: str | Path | Document, frame: Frame | None, tasks: Collection[str] = ()) -> Scenario:
    document = opened(source)
    scenario, problems = _read(document, frame, tasks)
    if scenario is None:
        listed = "; `quarterdeck check` lists them" if frame is None else ""
        more = f" (and {len(problems) - 1} more{listed})" if len(problems) > 1 else ""
        raise InputError(f"{document.name}: {problems[0]}{more}")
    return scenario


def examine(source: str | Path | Document) -> tuple[Scenario | None, list[str]]:
    """Return the scenario in a GeoJSON file, None where it has problems, and every problem, one line each.

    Raises InputError if it is no GeoJSON in WGS84, or no site.
    """
    return _read(opened(source))


def read_obstacles(source: str | Path | Document, frame: Frame) -> tuple[Obstacle, ...]:
    """Return the obstacles in a GeoJSON file, whatever else is in it, in metres of `frame`.

    Raises InputError as `read_scenario` does, and if there are none.
    """
    document = opened(source)
    obstacles = read_additions(document, frame).site.obstacles
    if not obstacles:
        raise InputError(f'{document.name}: no feature has the role "obstacle"')
    return obstacles


def added(raw: Any) -> bool:
    """Whether a feature of a file of changes adds something, and changes or removes nothing."""
    properties = raw.get("properties") if isinstance(raw, dict) else None
    return not isinstance(properties, dict) or properties.get("change") in (None, "add")


def _read(
    document: Document, frame: Frame | None = None, others: Collection[str] = ()
) -> tuple[Scenario | None, list[str]]:
    """Return the scenario, or None, and all problems found; with a `frame` given, nothing in particular is required."""
    content = document.content
    kind = kind_of_json(content)
    if kind not in (None, SITE, CHANGES):
        raise InputError(f"{document.name}: is {kind}")
    problems: list[str] = []
    counted = [(i, raw) for i, raw in enumerate(content["features"]) if frame is None or added(raw)]
    features = [f for i, raw in counted if (f := _feature(i, raw, problems, site=frame is None))]
    required = ("area", "task", "casualty") if frame is None else tuple(GEOMETRIES)
    if not any(f["role"] in required for f in features) and not problems:
        problems.append('no feature has the role "area" or "task"; give the polygon to be covered "role": "area"')
    frame = frame or _frame(features, problems)
    if frame is None:
        return None, problems
    shapes = _shapes(features, frame, problems)
    spacings = sorted({f["properties"]["spacing"] for f in features if f["properties"].get("spacing") is not None})
    if len(spacings) > 1:
        problems.append(f"areas give different spacings ({', '.join(f'{s:g}' for s in spacings)}); give one")
    soundings = read_soundings([f for f in features if f["role"] == "sounding"], frame)
    least = least_depth(soundings, [shapes[f["place"]] for f in features if f["role"] == "area" and f["place"] in shapes])
    vehicles = [read_vehicle(f, frame, problems, least) for f in features if f["role"] == "vehicle"]
    problems += [*_repeated(features, "area"), *_repeated(features, "vehicle")]
    tasks = tuple(read_task(f, frame) for f in features if f["role"] == "task")
    if len(features) == len(counted):  # else what a task comes after may be among those left out
        problems += task_problems(tasks, others)
    if problems:
        return None, problems
    fleet = tuple(v for v in vehicles if v is not None)
    points = {role: tuple((f["id"], xy_of(f, frame)) for f in features if f["role"] == role) for role in POINTS}
    site = _site(features, shapes, [*fleet, *tasks], [xy for r in points for _, xy in points[r]])
    scenario = Scenario(
        name=content["name"] if isinstance(content.get("name"), str) else document.stem,
        frame=frame,
        site=site,
        vehicles=fleet,
        tasks=tasks,
        casualties=tuple(
            Casualty(f["id"], xy_of(f, frame), f["properties"].get("colour") or "red")
            for f in features
            if f["role"] == "casualty"
        ),
        medics=points["medic"],
        rendezvous=points["rendezvous"],
        spacing=spacings[0] if spacings else None,
        input_hash=hashlib.sha256(document.data).hexdigest(),
        soundings=soundings,
    )
    problems += vehicle_problems([f for f in features if f["role"] == "vehicle"], fleet, site)
    return (None if problems else scenario), problems


def _feature(index: int, raw: Any, problems: list[str], *, site: bool) -> dict[str, Any] | None:
    """Check one feature's form; return it with `place`, `role`, `id` and the properties that are right (`whole`: all are),
    or None where it has no role or no place.
    """
    if not isinstance(raw, dict) or raw.get("type") != "Feature":
        problems.append(f'features[{index}]: not a Feature; every item of "features" must be one')
        return None
    properties = raw.get("properties") or {}
    if not isinstance(properties, dict):
        problems.append(f"features[{index}]: properties must be an object")
        return None
    place = place_of(index, raw)
    if site and properties.get("change") is not None:
        problems.append(f'{place}: "change" belongs into a file for `quarterdeck replan --changes`; a site has none')
        return None
    role = properties.get("role")
    if role is None:
        problems.append(f'{place}: has no role; give it the property "role": one of {", ".join(GEOMETRIES)}')
        return None
    if not isinstance(role, str) or role not in GEOMETRIES:
        near = get_close_matches(str(role), GEOMETRIES, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"use one of {', '.join(GEOMETRIES)}"
        problems.append(f"{place}: unknown role {str(role)[:40]!r}; {hint}")
        return None
    geometry: dict[str, Any] = raw["geometry"] if isinstance(raw.get("geometry"), dict) else {}
    kind = geometry.get("type")
    if not isinstance(kind, str) or kind not in GEOMETRIES[role]:
        problems.append(f"{place}: a feature of role {role} must be a {' or '.join(GEOMETRIES[role])}, not {kind}")
        return None
    wrong = {name: p for name, value in properties.items() for p in property_problems(role, {name: value})}
    problems += [f"{place}: {p}" for p in wrong.values()]
    found = []
    if role == "sounding" and properties.get("depth") is None:
        found.append("a sounding needs its depth in metres")
    if kind in LINES and properties.get("width") is None:
        found.append(f'a {kind} needs the property "width", metres across the corridor along it; or draw a polygon')
    if kind not in LINES and role == "area" and properties.get("width") is not None:
        found.append(f"width belongs to a LineString; a {kind} has its own, remove it")
    places = [geometry.get("coordinates")] if kind == "Point" else positions(geometry)
    found += [p for p in map(position_problem, places) if p][:1]
    problems += [f"{place}: {p}" for p in found]
    if found:
        return None
    right = {name: value for name, value in properties.items() if name not in wrong}
    identity = f"{role}-{index}" if (given := _given_id(raw)) is None else str(given)
    return {"place": place, "role": role, "id": identity, "geometry": geometry, "properties": right, "whole": not wrong}


def place_of(index: int, raw: dict[str, Any]) -> str:
    """Return how messages name the feature at an index."""
    return f"features[{index}]" + ("" if (given := _given_id(raw)) is None else f" ({given!r})")


def _given_id(raw: dict[str, Any]) -> Any:
    return raw.get("id") if (own := (raw.get("properties") or {}).get("id")) is None else own


def _frame(features: Sequence[dict[str, Any]], problems: list[str]) -> Frame | None:
    """Centre the frame on what is to be covered or visited, whatever the order of features, over any meridian; None where
    there is no such thing.
    """
    work = [f for f in features if f["role"] == "area"] or [
        f for f in features if f["role"] in ("task", "casualty", "operating")
    ]
    lonlat = np.array([p[:2] for f in work for p in positions(f["geometry"])], dtype=float).reshape(-1, 2)
    if not len(lonlat):
        problems += [f"{f['place']}: the geometry has no positions" for f in work]
        return None
    # Longitudes are unwrapped at the largest gap, so that a site over the antimeridian is one piece.
    lon = np.sort(np.unique(lonlat[:, 0] % 360.0))
    gaps = np.diff(np.append(lon, lon[0] + 360.0))
    west = lon[(int(gaps.argmax()) + 1) % len(lon)]
    east = west + (360.0 - gaps.max())
    centre = ((west + east) / 2 + 180.0) % 360.0 - 180.0
    return Frame(round(float(centre), 7), round(float(lonlat[:, 1].min() + lonlat[:, 1].max()) / 2, 7))


def _shapes(features: Sequence[dict[str, Any]], frame: Frame, problems: list[str]) -> dict[str, MultiPolygon]:
    """Return the shape of each polygon, and of the corridor along each line, in metres, by place."""
    shapes = {}
    for f in features:
        xy = frame.to_metres(np.array([p[:2] for p in positions(f["geometry"])], dtype=float))
        if not len(xy):
            problems.append(f"{f['place']}: the geometry has no positions")
            continue
        kind, width = f["geometry"]["type"], float(f["properties"].get("width") or 0.0)
        far = float(np.hypot(*xy.T).max()) if np.isfinite(xy).all() else float("inf")
        far += width / 2.0 if kind in LINES else 0.0
        if far > MAX_RADIUS and kind == "Point":
            problems.append(
                f"{f['place']}: is {far / 1000:,.0f} km from the site's centre, more than {MAX_RADIUS / 1000:.0f} km"
            )
        elif far > MAX_RADIUS:
            problems.append(f"{f['place']}: reaches {far / 1000:,.0f} km from the site's centre, more than "
                            f"{MAX_RADIUS / 1000:.0f} km; split it into sites")  # fmt: skip
        elif kind != "Point":
            try:
                drawn = f["geometry"]
                shape = read_corridor(drawn, width, frame) if kind in LINES else read_polygon(drawn, frame)
                shapes[f["place"]] = shape
            except InputError as error:
                problems.append(f"{f['place']}: {error}")
    return shapes


def _site(
    features: Sequence[dict[str, Any]],
    shapes: dict[str, MultiPolygon],
    actors: Sequence[Vehicle | Task],
    points: Sequence[tuple[float, float]],
) -> Site:
    """Put the site together; without an operating area it is the hull of all that is to be reached, and clearance."""
    areas = [
        Area(f["id"], shapes[f["place"]], f["properties"].get("priority") or 0) for f in features if f["role"] == "area"
    ]
    obstacles = [
        Obstacle(p_id, part, blocks, height)
        for f in features
        if f["role"] == "obstacle"
        for p_id, part, blocks, height in _obstacle_parts(f, shapes[f["place"]])
    ]
    operating = [shapes[f["place"]] for f in features if f["role"] == "operating"]
    if operating:
        return Site(tuple(areas), as_multipolygon(unary_union(operating)), tuple(obstacles))
    vehicles = [a for a in actors if isinstance(a, Vehicle)]
    reach = [*points, *(t.position for t in actors if isinstance(t, Task))]
    reach += [xy for v in vehicles for xy in (v.start, v.home)]
    hull = unary_union([*(a.polygon for a in areas), MultiPoint(reach)]).convex_hull
    margin = max((v.clearance for v in vehicles), default=0.0) + max((2 * v.turn_radius for v in vehicles), default=0.0)
    return Site(tuple(areas), as_multipolygon(hull.buffer(max(margin, 1.0), quad_segs=8)), tuple(obstacles))


def _obstacle_parts(feature: dict[str, Any], shape: MultiPolygon) -> list[tuple[str, Any, frozenset[str], float]]:
    given = feature["properties"]
    blocks = frozenset(DOMAINS if given.get("blocks") is None else given["blocks"])
    height = float(given.get("height") or 10.0)
    ids = [feature["id"]] if len(shape.geoms) == 1 else [f"{feature['id']}/{i}" for i in range(len(shape.geoms))]
    return [(i, part, blocks, height) for i, part in zip(ids, shape.geoms, strict=True)]


def _repeated(features: Sequence[dict[str, Any]], role: str) -> list[str]:
    """Return a problem for each feature of a role whose id another has."""
    problems: list[str] = []
    seen: dict[str, str] = {}
    for f in (f for f in features if f["role"] == role):
        if f["id"] in seen:
            problems.append(f"{f['place']}: the id {f['id']!r} belongs to {seen[f['id']]} too; give each its own")
        seen[f["id"]] = f["place"]
    return problems
