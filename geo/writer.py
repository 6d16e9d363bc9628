"""From a `Scenario` back to a site's GeoJSON: what `read_scenario` reads, in degrees with 9 decimals."""

import math
from typing import Any

from quarterdeck.geo.features import collection, point_feature, polygon_feature, position
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.palette import CASUALTY
from quarterdeck.geo.scenario import Scenario, Task, Vehicle

UNLIMITED = 1e11  # s or Wh: a site says it with a number, for JSON has no infinity


def site_text(scenario: Scenario) -> str:
    """Return the GeoJSON text of a scenario, one feature a line; the same scenario gives the same bytes."""
    frame, site = scenario.frame, scenario.site
    spacing = {} if scenario.spacing is None else {"spacing": scenario.spacing}
    features = [
        polygon_feature(frame, "operating", site.operating, "operating"),
        *(polygon_feature(frame, "area", a.polygon, a.id, priority=a.priority, **spacing) for a in site.areas),
        *(
            polygon_feature(frame, "obstacle", o.polygon, o.id, blocks=sorted(o.blocks), height=o.height)
            for o in site.obstacles
        ),
        *(point_feature(frame, "vehicle", v.start, v.id, **_vehicle(frame, v)) for v in scenario.vehicles),
        *(point_feature(frame, "task", t.position, t.id, **_task(t)) for t in scenario.tasks),
        *(point_feature(frame, "medic", xy, i) for i, xy in scenario.medics),
        *(point_feature(frame, "rendezvous", xy, i) for i, xy in scenario.rendezvous),
        *(point_feature(frame, "sounding", (x, y), f"s{i}", depth=d) for i, (x, y, d) in enumerate(scenario.soundings, 1)),
        *(
            point_feature(frame, "casualty", c.position, c.id, colour=c.colour, **{"marker-color": CASUALTY[c.colour]})
            for c in scenario.casualties
        ),
    ]
    return collection(scenario.name, features)


def _vehicle(frame: Frame, vehicle: Vehicle) -> dict[str, Any]:
    given: dict[str, Any] = {"model": vehicle.model.file or vehicle.model.name, "domain": vehicle.domain}
    given |= {n: getattr(vehicle, n) for n in ("speed", "turn_radius", "clearance")}
    given |= {n: v for n in ("share", "range") if (v := getattr(vehicle, n)) is not None}
    if vehicle.endurance < math.inf:  # without it, it is unlimited; without a battery it is the model's
        given["endurance"] = vehicle.endurance
    given["battery"] = min(vehicle.battery, UNLIMITED)
    if vehicle.altitude > 0:
        given["altitude"] = vehicle.altitude
    if vehicle.domain == "aerial":
        given["ceiling"] = vehicle.ceiling
        given |= {"ceiling_amsl": vehicle.ceiling_amsl} if vehicle.ceiling_amsl < math.inf else {}
    if vehicle.end is not None:
        given["end"] = position(frame, vehicle.end)
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
