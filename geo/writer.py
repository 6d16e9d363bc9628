"""From a `Scenario` back to a site's GeoJSON: what `read_scenario` reads, in degrees with 9 decimals."""

import json
import math
from typing import Any

import numpy as np
from shapely import get_coordinates, orient_polygons, set_coordinates
from shapely.geometry import mapping

from quarterdeck.geo.frame import Frame
from quarterdeck.geo.scenario import Scenario, Task, Vehicle

UNLIMITED = 1e11  # s or Wh: a site says it with a number, for JSON has no infinity
_LOOK = {"area": "#2b8cbe", "operating": "#555555", "obstacle": "#a63603"}
_MARK = {"red": "#d62728", "yellow": "#f2c200", "green": "#2ca02c", "grey": "#7f7f7f", "black": "#000000"}


def site_text(scenario: Scenario) -> str:
    """Return the GeoJSON text of a scenario, one feature a line; the same scenario gives the same bytes."""
    frame, site = scenario.frame, scenario.site
    spacing = {} if scenario.spacing is None else {"spacing": scenario.spacing}
    features = [
        _polygon(frame, "operating", site.operating, "operating"),
        *(_polygon(frame, "area", a.polygon, a.id, priority=a.priority, **spacing) for a in site.areas),
        *(_polygon(frame, "obstacle", o.polygon, o.id, blocks=sorted(o.blocks), height=o.height) for o in site.obstacles),
        *(_point(frame, "vehicle", v.start, v.id, **_vehicle(frame, v)) for v in scenario.vehicles),
        *(_point(frame, "task", t.position, t.id, **_task(t)) for t in scenario.tasks),
        *(_point(frame, "medic", xy, i) for i, xy in scenario.medics),
        *(_point(frame, "rendezvous", xy, i) for i, xy in scenario.rendezvous),
        *(
            _point(frame, "casualty", c.position, c.id, colour=c.colour, **{"marker-color": _MARK[c.colour]})
            for c in scenario.casualties
        ),
    ]
    lines = ",\n".join(json.dumps(f, allow_nan=False, ensure_ascii=False) for f in features)
    name = json.dumps(scenario.name, ensure_ascii=False)
    return f'{{"type": "FeatureCollection", "name": {name}, "features": [\n{lines}\n]}}\n'


def _vehicle(frame: Frame, vehicle: Vehicle) -> dict[str, Any]:
    given: dict[str, Any] = {"model": vehicle.model.file or vehicle.model.name, "domain": vehicle.domain}
    given |= {n: getattr(vehicle, n) for n in ("speed", "turn_radius", "clearance")}
    given |= {n: v for n in ("share", "range") if (v := getattr(vehicle, n)) is not None}
    if vehicle.endurance < math.inf:  # without it, it is unlimited; without a battery it is the model's
        given["endurance"] = vehicle.endurance
    given["battery"] = min(vehicle.battery, UNLIMITED)
    if vehicle.altitude > 0:
        given["altitude"] = vehicle.altitude
    if vehicle.end is not None:
        given["end"] = _degrees(frame, [vehicle.end])[0].tolist()
    if vehicle.sensor is not None:
        swath = {} if vehicle.sensor.swath is None else {"swath": vehicle.sensor.swath}
        given["sensor"] = {"kind": vehicle.sensor.kind} | swath | vehicle.sensor.parameters
    if not vehicle.returns:
        given["returns"] = False
    if vehicle.can:
        given["can"] = sorted(vehicle.can)
    return given


def _task(task: Task) -> dict[str, Any]:
    given: dict[str, Any] = {"priority": task.priority, "service_time": task.service_time}
    if task.after:
        given["after"] = [{"task": a.task, "mode": a.mode} for a in task.after]
    if task.needs:
        given["needs"] = sorted(task.needs)
    if task.domain is not None:
        given["domain"] = task.domain
    if task.window != (0.0, math.inf):
        given["window"] = [task.window[0], min(task.window[1], UNLIMITED)]
    return given


def _polygon(frame: Frame, role: str, polygon: Any, identity: str, **properties: Any) -> dict[str, Any]:
    polygon = orient_polygons(polygon)
    degrees = set_coordinates(polygon, _degrees(frame, get_coordinates(polygon)))
    look = {"stroke": _LOOK[role], "fill": _LOOK[role], "fill-opacity": 0.5 if role == "obstacle" else 0.05}
    return _feature(role, dict(mapping(degrees)), identity, **properties, **look)


def _point(frame: Frame, role: str, xy: tuple[float, float], identity: str, **properties: Any) -> dict[str, Any]:
    return _feature(role, {"type": "Point", "coordinates": _degrees(frame, [xy])[0].tolist()}, identity, **properties)


def _feature(role: str, geometry: dict[str, Any], identity: str, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "id": identity, "properties": {"role": role} | properties, "geometry": geometry}


def _degrees(frame: Frame, xy: Any) -> np.ndarray:
    return np.round(frame.to_degrees(np.asarray(xy, dtype=float)), 9)
