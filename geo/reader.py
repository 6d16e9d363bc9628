"""From a site's GeoJSON to a `Scenario`: everything is checked here, once, and every problem told with its place."""

import hashlib
from collections.abc import Collection, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from shapely import MultiPoint, MultiPolygon, Point
from shapely.ops import unary_union

from quarterdeck.geo.depths import least_depth, read_soundings
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.geojson import Document, opened, position_problem, positions, read_corridor, read_polygon
from quarterdeck.geo.kinds import CHANGES, SITE, kind_of_json
from quarterdeck.geo.models import DEFAULT_MODEL, load_model
from quarterdeck.geo.properties import GEOMETRIES, LINES, property_problems
from quarterdeck.geo.scenario import (
    CEILING,
    DOMAINS,
    Area,
    Casualty,
    Obstacle,
    Precedence,
    Scenario,
    Site,
    Task,
    Vehicle,
    as_multipolygon,
)
from quarterdeck.geo.sensors import fit

POINTS = ("casualty", "medic", "rendezvous")
MAX_RADIUS = 200_000.0  # m from the frame's origin: beyond it the projection's scale is off by more than 0.05 %


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
        more = f" (and {len(problems) - 1} more; `quarterdeck check` lists them)" if len(problems) > 1 else ""
        raise InputError(f"{document.name}: {problems[0]}{more}")
    return scenario


def examine(source: str | Path | Document) -> tuple[Scenario | None, list[str]]:
    """Return the scenario in a GeoJSON file, None where it has problems, and every problem, one line each.

    Raises InputError if it is no GeoJSON in WGS84.
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
        return None, [f"is {kind}"]
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
    vehicles = [_vehicle(f, frame, problems, least) for f in features if f["role"] == "vehicle"]
    problems += [*_repeated(features, "area"), *_repeated(features, "vehicle")]
    tasks = tuple(_task(f, frame) for f in features if f["role"] == "task")
    if len(features) == len(counted):  # else what a task comes after may be among those left out
        problems += _task_problems(tasks, others)
    if problems:
        return None, problems
    fleet = tuple(v for v in vehicles if v is not None)
    points = {role: tuple((f["id"], _xy(f, frame)) for f in features if f["role"] == role) for role in POINTS}
    site = _site(features, shapes, [*fleet, *tasks], [xy for r in points for _, xy in points[r]])
    scenario = Scenario(
        name=content["name"] if isinstance(content.get("name"), str) else document.stem,
        frame=frame,
        site=site,
        vehicles=fleet,
        tasks=tasks,
        casualties=tuple(
            Casualty(f["id"], _xy(f, frame), f["properties"].get("colour") or "red")
            for f in features
            if f["role"] == "casualty"
        ),
        medics=points["medic"],
        rendezvous=points["rendezvous"],
        spacing=spacings[0] if spacings else None,
        input_hash=hashlib.sha256(document.data).hexdigest(),
        soundings=soundings,
    )
    problems += _vehicle_problems(features, scenario)
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


def _xy(feature: dict[str, Any], frame: Frame) -> tuple[float, float]:
    x, y = frame.to_metres(np.array(feature["geometry"]["coordinates"][:2], dtype=float))[0]
    return float(x), float(y)


def _vehicle(feature: dict[str, Any], frame: Frame, problems: list[str], depth: float | None) -> Vehicle | None:
    """Return a vehicle, its model's figures where it gives none of its own; None where something is wrong with it."""
    given = {k: v for k, v in feature["properties"].items() if v is not None}
    found, end, sensor, model = list[str](), None, None, load_model(DEFAULT_MODEL[given.get("domain", "surface")])
    try:
        model = load_model(given.get("model", model.name))
        if given.get("domain", model.domain) != model.domain:
            found.append(f"domain {given['domain']} contradicts model {model.name} ({model.domain})")
        elif given.get("speed", 0) > model.max_speed:
            found.append(f"speed {given['speed']:g} m/s exceeds {model.name}'s {model.max_speed:g} m/s")
    except InputError as error:
        found.append(str(error))
    if problem := position_problem(given["end"]) if "end" in given else None:
        found.append(f"end: {problem}")
    elif "end" in given:
        x, y = frame.to_metres(np.array(given["end"][:2], dtype=float))[0]
        end = (float(x), float(y))
        if not np.hypot(x, y) <= MAX_RADIUS:
            found.append(f"end is more than {MAX_RADIUS / 1000:.0f} km from the site's centre")
    altitude = float(given.get("altitude", model.altitude))
    if "sensor" in given and feature["whole"] and not found:  # what it sees depends on the rest
        try:
            sensor, altitude = fit(given["sensor"], given.get("altitude"), model.altitude, depth)
        except InputError as error:
            found.append(f"sensor: {error}")
    if found:
        problems += [f"{feature['place']}: {problem}" for problem in found]
        return None
    return Vehicle(
        id=feature["id"],
        model=model,
        start=_xy(feature, frame),
        end=end,
        share=given.get("share"),
        speed=float(given.get("speed", model.speed)),
        turn_radius=float(given.get("turn_radius", model.turn_radius)),
        clearance=float(given.get("clearance", model.clearance)),
        endurance=float(given.get("endurance", float("inf"))),
        battery=float(given.get("battery", model.battery)),
        altitude=altitude if model.domain == "aerial" else 0.0,
        sensor=sensor,
        range=given.get("range"),
        can=frozenset(given.get("can", ())),
        returns=given.get("returns", True),
        ceiling=float(given.get("ceiling", CEILING)),
        ceiling_amsl=float(given.get("ceiling_amsl", float("inf"))),
    )


def _task(feature: dict[str, Any], frame: Frame) -> Task:
    given = {k: v for k, v in feature["properties"].items() if v is not None}
    after = tuple(
        Precedence(a) if isinstance(a, str) else Precedence(a["task"], a.get("mode", "finish_to_start"))
        for a in given.get("after", ())
    )
    low, high = given.get("window", (0.0, float("inf")))
    return Task(
        id=feature["id"],
        position=_xy(feature, frame),
        priority=given.get("priority", 0),
        service_time=float(given.get("service_time", 0.0)),
        after=after,
        needs=frozenset(given.get("needs", ())),
        domain=given.get("domain"),
        window=(float(low), float(high)),
    )


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


def _vehicle_problems(features: Sequence[dict[str, Any]], scenario: Scenario) -> list[str]:
    problems: list[str] = []
    site = scenario.site
    for f, vehicle in zip([f for f in features if f["role"] == "vehicle"], scenario.vehicles, strict=True):
        for what, xy in (("stands", vehicle.start), ("ends", vehicle.home)):
            point = Point(xy)
            inside = [o.id for o in site.obstacles if vehicle.domain in o.blocks and o.polygon.contains(point)]
            if inside:
                problems.append(f"{f['place']}: {what} inside obstacle {inside[0]!r}; move it out")
            elif not site.operating.covers(point):
                problems.append(
                    f"{f['place']}: {what} outside the operating area, by {site.operating.distance(point):,.0f} m"
                )
            if vehicle.end is None:
                break
    return problems


def _task_problems(tasks: Sequence[Task], others: Collection[str]) -> list[str]:
    ids = [t.id for t in tasks]
    problems = [f"task {i!r}: its id is given twice" for i in sorted({i for i in ids if ids.count(i) > 1})]
    ids += others
    for task in tasks:
        for before in task.after:
            if before.task not in ids:
                near = get_close_matches(before.task, ids, n=1)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                problems.append(f"task {task.id!r}: after names the unknown task {before.task!r}{hint}")
        if not 0 <= task.window[0] <= task.window[1]:
            problems.append(f"task {task.id!r}: window {list(task.window)} must be [earliest, latest], earliest first")
    return problems
