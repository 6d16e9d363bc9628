"""The PLAN file: a mission as GeoJSON that opens in any viewer, and holds all that the next step needs.

Its first feature has no geometry and `role: plan`: the header. Then the site, the vehicles and tasks, a LineString a route
with its waypoints' figures as lists, and the layers for the eye. The same mission gives the same bytes.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from shapely import MultiPolygon, Polygon, get_coordinates, make_valid, set_coordinates
from shapely.errors import ShapelyError
from shapely.geometry import shape as from_geojson

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.features import collection, degrees, feature, geometry, point_feature, polygon_feature, position
from quarterdeck.geo.frame import MAX_RADIUS, Frame
from quarterdeck.geo.geojson import Document, opened
from quarterdeck.geo.kinds import kind_of_json
from quarterdeck.geo.models import VehicleModel
from quarterdeck.geo.palette import CASUALTY
from quarterdeck.geo.properties import PROPERTIES, property_problems
from quarterdeck.geo.scenario import Area, Casualty, Obstacle, Precedence, Sensor, Site, Task, Vehicle, as_multipolygon
from quarterdeck.geo.typed import fits, wrong_field
from quarterdeck.mission.layers import drawn, fleet_colours, undrawn
from quarterdeck.mission.mission import Leg, Mission, Route, Waypoint
from quarterdeck.mission.reason import HEADS, Reason, reason_of

FORMAT = 1
DAMAGE = (KeyError, TypeError, ValueError, ArithmeticError, IndexError, AttributeError, ShapelyError)
PARAMETERS: dict[str, Any] = {  # those that later steps read
    "angle": float | None,
    "edge": Literal["whole", "cells", "lap"],
    "inspect": Literal["area", "border"],
    "range": float | None,
    "lost_at": dict[str, float],
}
LEGS = set(get_args(Leg))
LISTS = ("leg", "speed", "hold", "time", "task", "ground")  # of a route's waypoints, in the order of its positions


def plan_text(mission: Mission) -> str:
    """Return the PLAN file's text, one feature a line."""
    features = [_header(mission), *_site(mission), *_fleet(mission), *_layers(mission), *_routes(mission)]
    return collection(mission.name, features)


def _header(mission: Mission) -> dict[str, Any]:
    return feature(
        "plan",
        None,
        format=FORMAT,
        version=mission.version,
        method=mission.method,
        feasible=mission.feasible,
        reasons=[str(r) for r in mission.reasons],
        reason_kinds=[[r.kind, r.about] for r in mission.reasons],
        seed=mission.seed,
        spacing=mission.spacing,
        origin=[mission.frame.lon, mission.frame.lat],
        parameters=_plain(mission.parameters, digits=17),  # exactly: it is planned again with them
        figures=_plain(mission.figures),
        bounds=_plain(mission.bounds),
        input_hash=mission.input_hash,
    )


def plan_outcome(mission: Mission) -> dict[str, Any]:
    """Return what a plan comes to, for programs: `feasible`, `reasons`, `figures` and `bounds` as its file tells them."""
    header = _header(mission)["properties"]
    return {name: header[name] for name in ("feasible", "reasons", "figures", "bounds")}


def _plain(value: Any, digits: int = 12) -> Any:
    """Return JSON's own types: numpy's become Python's, what is not finite becomes null, figures keep so many digits."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v, digits) for k, v in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [_plain(v, digits) for v in (value.tolist() if isinstance(value, np.ndarray) else value)]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return float(f"{value:.{digits}g}") if math.isfinite(value) else None
    return value


def _site(mission: Mission) -> list[dict[str, Any]]:
    frame, site = mission.frame, mission.site
    return [
        polygon_feature(frame, "operating", site.operating),
        *(polygon_feature(frame, "area", a.polygon, a.id, priority=a.priority) for a in site.areas),
        *(
            polygon_feature(frame, "obstacle", o.polygon, o.id, blocks=sorted(o.blocks), height=o.height)
            for o in site.obstacles
        ),
    ]


def _fleet(mission: Mission) -> list[dict[str, Any]]:
    frame = mission.frame
    features = []
    palette = fleet_colours(mission)
    for role, v in (*(("vehicle", v) for v in mission.vehicles), *(("lost", v) for v in mission.lost)):
        given: dict[str, Any] = {"model": _plain(asdict(v.model))} | {n: getattr(v, n) for n in VEHICLE_FIGURES}
        given |= {"ceiling": v.ceiling, "ceiling_amsl": v.ceiling_amsl} if v.domain == "aerial" else {}
        given |= {"sensor": asdict(v.sensor) if v.sensor else None, "can": sorted(v.can), "returns": v.returns}
        given |= {"end": position(frame, v.end) if v.end else None, "marker-color": palette[v.id]}
        features.append(point_feature(frame, role, v.start, v.id, **_plain(given)))
    for t in mission.tasks:
        given = {k: v for k, v in asdict(t).items() if k not in ("id", "position")} | {"needs": sorted(t.needs)}
        features.append(point_feature(frame, "task", t.position, t.id, **_plain(given)))
    for c in mission.casualties:
        look = {"colour": c.colour, "marker-color": CASUALTY[c.colour]}
        features.append(point_feature(frame, "casualty", c.position, c.id, **look))
    return features


VEHICLE_FIGURES = ("share", "speed", "turn_radius", "clearance", "endurance", "battery", "altitude", "range")


def _layers(mission: Mission) -> list[dict[str, Any]]:
    return [
        feature("layer", geometry(mission.frame, shape), layer=layer.name, **_plain(properties))
        for layer in drawn(mission)
        for shape, properties in zip(layer.geometries, layer.properties, strict=True)
    ]


def _routes(mission: Mission) -> list[dict[str, Any]]:
    features = []
    palette = fleet_colours(mission)
    for route in mission.routes:
        xyz = route.xyz
        lonlat = degrees(mission.frame, xyz[:, :2])
        with_z = bool(np.any(xyz[:, 2] != 0))
        line = np.column_stack([lonlat, np.round(xyz[:, 2], 3)]).tolist() if with_z else lonlat.tolist()
        lists = {name: [getattr(w, name) for w in route.waypoints] for name in LISTS}
        lists["time"] = [round(t, 3) for t in lists["time"]]
        lists["speed"] = [round(s, 4) for s in lists["speed"]]
        lists["ground"] = [None if g is None else round(g, 3) for g in lists["ground"]]
        for name in ("task", "ground"):
            if all(value is None for value in lists[name]):
                del lists[name]
        figures = {"energy": route.energy, "length": round(route.length, 2), "duration": round(route.duration, 2)}
        look: dict[str, Any] = {"stroke": palette[route.vehicle], "stroke-width": 2}
        drawn = {"type": "LineString", "coordinates": line if len(line) > 1 else line * 2}
        features.append(feature("route", drawn, vehicle=route.vehicle, **look, **_plain(figures), **_plain(lists)))
    return features


def read_plan(source: str | Path | Document) -> Mission:
    """Return the mission in a PLAN file, or in one that has been read; `-` reads standard input.

    Raises InputError if it is no plan, or a part of it is missing or damaged.
    """
    document = opened(source)
    try:
        features = _features(document)
        headers = _headers(features)
        if not headers:
            kind = kind_of_json(document.content) or "another GeoJSON"
            raise InputError(f"not a PLAN, but {kind}; `plan`, `assign` and `triage --plan` make PLANs")
        if headers[0].get("format") != FORMAT:
            raise InputError(f"is a PLAN of format {headers[0].get('format')}, this version reads {FORMAT}; plan it again")
        try:
            with np.errstate(all="raise"):
                return _mission(str(document.content.get("name", "")), headers[0], features)
        except DAMAGE as error:
            what = f"{error} is missing" if isinstance(error, KeyError) else " ".join(str(error).split())[:120]
            raise InputError(f"is a damaged PLAN ({what}); plan it again") from None
    except InputError as error:
        raise InputError(f"{document.name}: {error}") from None


def is_plan(document: Document) -> bool:
    """Tell a PLAN from a site."""
    return bool(_headers(_features(document)))


def _features(document: Document) -> list[dict[str, Any]]:
    return [f for f in document.content["features"] if isinstance(f, dict) and isinstance(f.get("properties"), dict)]


def _headers(features: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [f["properties"] for f in features if f["properties"].get("role") == "plan"]


def _mission(name: str, header: dict[str, Any], features: list[dict[str, Any]]) -> Mission:
    lon, lat = map(float, header["origin"])
    if not (abs(lon) <= 180 and abs(lat) <= 90):
        raise ValueError("its origin is no place on earth")
    frame = Frame(lon, lat)

    def of(role: str) -> list[dict[str, Any]]:
        return [f for f in features if f["properties"]["role"] == role]

    def metres(f: dict[str, Any]) -> Any:
        place = from_geojson(f["geometry"])
        return set_coordinates(place, _metres(get_coordinates(place), frame))

    def polygon(f: dict[str, Any]) -> MultiPolygon:
        return _sound(as_multipolygon(metres(f)))

    def part(f: dict[str, Any]) -> Polygon:
        (one,) = polygon(f).geoms
        return one

    _check_properties(features)
    site = Site(
        areas=tuple(Area(f["id"], polygon(f), f["properties"]["priority"]) for f in of("area")),
        operating=polygon(of("operating")[0]),
        obstacles=tuple(
            Obstacle(f["id"], part(f), frozenset(f["properties"]["blocks"]), f["properties"]["height"])
            for f in of("obstacle")
        ),
    )
    vehicles = tuple(_vehicle(f, frame) for f in of("vehicle"))
    routes = {f["properties"]["vehicle"]: _route(f, frame) for f in of("route")}
    if sorted(routes) != sorted(v.id for v in vehicles):
        raise ValueError("its vehicles and its routes do not match: one route a vehicle")
    layers: dict[str, list[tuple[Any, dict[str, Any]]]] = {}
    for f in of("layer"):
        properties = {k: v for k, v in f["properties"].items() if k not in ("role", "layer")}
        layers.setdefault(f["properties"]["layer"], []).append((metres(f), properties))
    mission = Mission(
        name=name,
        frame=frame,
        site=site,
        vehicles=vehicles,
        routes=tuple(routes[v.id] for v in vehicles),
        method=header["method"],
        parameters=header["parameters"],
        seed=header["seed"],
        spacing=header["spacing"],
        tasks=tuple(_task(f, frame) for f in of("task")),
        casualties=tuple(Casualty(f["id"], _xy(f, frame), f["properties"]["colour"]) for f in of("casualty")),
        figures=header["figures"],
        bounds=header["bounds"],
        reasons=_reasons(header),
        **undrawn(layers),
        input_hash=header["input_hash"],
        version=header["version"],
        lost=tuple(_vehicle(f, frame) for f in of("lost")),
    )
    _check_types(mission)
    return mission


def _reasons(header: dict[str, Any]) -> tuple[Reason, ...]:
    """Return why the plan is infeasible; plans of before there were kinds of reasons have none of a kind."""
    lines = header["reasons"]
    kinds = header.get("reason_kinds", [["", ""]] * len(lines))
    for line, (kind, about) in zip(lines, kinds, strict=True):
        if kind not in HEADS or not fits((line, about), tuple[str, str]):
            raise TypeError("its reasons are not what they must be")
    return tuple(reason_of(line, kind, about) for line, (kind, about) in zip(lines, kinds, strict=True))


def _check_types(mission: Mission) -> None:
    """Raise TypeError where something is not of the type that later steps take it to be of; routes have been looked at."""
    if wrong := wrong_field(replace(mission, routes=())):
        raise TypeError(f"its {wrong} are not what they must be")
    for name, kind in PARAMETERS.items():
        if name in mission.parameters and not fits(mission.parameters[name], kind):
            raise TypeError(f"its parameter {name} is {str(mission.parameters[name])[:40]!r}")
    if not fits(tuple(mission.figures.get("notes", ())), tuple[str, ...]):
        raise TypeError("its notes are no texts")
    if not fits(mission.figures.get("notes", []), list) or not fits(mission.figures.get("cut", []), list):
        raise TypeError("its figures are not what they must be")
    known = {None, *(task.id for task in mission.tasks)}
    if mission.method == "assign" and any(w.task not in known for r in mission.routes for w in r.waypoints):
        raise ValueError("a route has a task that is not among its tasks")
    for i, guard in enumerate(mission.guards):
        for problem in property_problems("vehicle", {"range": guard.range}):
            raise ValueError(f"guard-{i}: {problem}")
    known = {None, *(f"guard-{i}" for i in range(len(mission.guards)))}
    if mission.method == "guards" and any(w.task not in known for r in mission.routes for w in r.waypoints):
        raise ValueError("a route has a guard that is not among its guards")


def _check_properties(features: list[dict[str, Any]]) -> None:
    """Raise ValueError where the figures of a site's feature would be refused in a site too."""
    for f in features:
        given, role = f["properties"], f["properties"].get("role")
        role = "vehicle" if role == "lost" else role
        if role not in PROPERTIES:
            continue
        # Models stand in a PLAN whole, windows may be open, and what keeps to the surface has the altitude 0.
        own = {k: v for k, v in given.items() if k in PROPERTIES[role] and k not in ("model", "window")}
        asked = {k: v for k, v in own.items() if k != "altitude" or v != 0}
        for problem in property_problems(role, asked):
            raise ValueError(f"{role} {f.get('id')!r}: {problem}")


def _sound(polygon: MultiPolygon) -> MultiPolygon:
    """Return a polygon whose rings do not cross. Raises ValueError where they do by more than positions are rounded."""
    if polygon.is_valid:
        return polygon
    mended = as_multipolygon(make_valid(polygon))
    if abs(mended.area - polygon.area) > 0.001 * (1.0 + polygon.length):
        raise ValueError("a polygon crosses itself")
    return mended


def _metres(lonlat: np.ndarray, frame: Frame) -> np.ndarray:
    """Return (n, 2) metres. Raises ValueError for what is no place near the site."""
    xy = frame.to_metres(lonlat)
    if not (np.hypot(*xy.T) < 2 * MAX_RADIUS).all():
        raise ValueError(f"a position is more than {2 * MAX_RADIUS / 1000:.0f} km from the origin")
    return xy


def _xy(feature: dict[str, Any], frame: Frame) -> tuple[float, float]:
    return _place(feature["geometry"]["coordinates"], frame)


def _place(lonlat: list[float], frame: Frame) -> tuple[float, float]:
    x, y = _metres(np.array(lonlat[:2], dtype=float), frame)[0]
    return float(x), float(y)


def _vehicle(feature: dict[str, Any], frame: Frame) -> Vehicle:
    given = feature["properties"]
    figures: dict[str, Any] = {n: None if given[n] is None else float(given[n]) for n in VEHICLE_FIGURES}
    for unlimited in ("endurance", "battery"):
        figures[unlimited] = math.inf if figures[unlimited] is None else figures[unlimited]
    for ceiling in ("ceiling", "ceiling_amsl"):
        if given.get(ceiling) is not None:  # plans of before there were any have none
            figures[ceiling] = float(given[ceiling])
    return Vehicle(
        id=feature["id"],
        model=VehicleModel(**given["model"]),
        start=_xy(feature, frame),
        end=_place(given["end"], frame) if given["end"] else None,
        sensor=Sensor(**given["sensor"]) if given["sensor"] else None,
        can=frozenset(given["can"]),
        returns=given["returns"],
        **figures,
    )


def _task(feature: dict[str, Any], frame: Frame) -> Task:
    given = {f.name: feature["properties"][f.name] for f in fields(Task) if f.name not in ("id", "position")}
    low, high = given["window"]
    given |= {"window": (low, math.inf if high is None else high), "needs": frozenset(given["needs"])}
    given |= {"after": tuple(Precedence(**a) for a in given["after"])}
    return Task(id=feature["id"], position=_xy(feature, frame), **given)


def _route(feature: dict[str, Any], frame: Frame) -> Route:
    given = feature["properties"]
    line = np.array(feature["geometry"]["coordinates"], dtype=float)[: len(given["leg"])]
    xy = _metres(line[:, :2], frame)
    z = line[:, 2] if line.shape[1] > 2 else np.zeros(len(line))
    columns = [given.get(name) or [None] * len(line) for name in LISTS]
    if any(len(c) != len(line) for c in columns):
        raise ValueError(f"route of {given['vehicle']}: lists of different lengths")
    if not set(columns[0]) <= LEGS or not all(task is None or isinstance(task, str) for task in columns[4]):
        raise ValueError(f"route of {given['vehicle']}: a leg or a task is unknown")
    columns[5] = [None if ground is None else float(ground) for ground in columns[5]]
    waypoints = tuple(
        Waypoint(float(x), float(y), float(h), leg, float(speed), float(hold), float(time), task, ground)
        for (x, y), h, leg, speed, hold, time, task, ground in zip(xy, z, *columns, strict=True)
    )
    return Route(given["vehicle"], waypoints, float(given["energy"]))
