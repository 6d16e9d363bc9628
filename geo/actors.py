"""The vehicles and tasks of a site, from their features, and what is wrong with them."""

from collections.abc import Collection, Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np
from shapely import Point

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import MAX_RADIUS, Frame
from quarterdeck.geo.geojson import position_problem
from quarterdeck.geo.models import DEFAULT_MODEL, load_model
from quarterdeck.geo.scenario import CEILING, Precedence, Site, Task, Vehicle
from quarterdeck.geo.sensors import fit


def read_vehicle(feature: dict[str, Any], frame: Frame, problems: list[str], depth: float | None) -> Vehicle | None:
    """Return a vehicle, its model's figures where it gives none of its own; None where something is wrong with it."""
    given = {k: v for k, v in feature["properties"].items() if v is not None}
    found, end, sensor, model = list[str](), None, None, load_model(DEFAULT_MODEL[given.get("domain", "surface")])
    try:
        model = load_model(given.get("model", model.name))
        if given.get("domain", model.domain) != model.domain:
            found.append(f"domain {given['domain']} contradicts model {model.name} ({model.domain})")
        elif given.get("speed", 0) > model.max_speed and (feature["whole"] or {"model", "domain"} & given.keys()):
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
        start=xy_of(feature, frame),
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


def vehicle_problems(features: Sequence[dict[str, Any]], vehicles: Sequence[Vehicle], site: Site) -> list[str]:
    """Return a problem for each of the `vehicles`, made of `features`, that starts or ends where it cannot be on a site."""
    problems: list[str] = []
    for f, vehicle in zip(features, vehicles, strict=True):
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


def read_task(feature: dict[str, Any], frame: Frame) -> Task:
    """Return a task."""
    given = {k: v for k, v in feature["properties"].items() if v is not None}
    after = tuple(
        Precedence(a) if isinstance(a, str) else Precedence(a["task"], a.get("mode", "finish_to_start"))
        for a in given.get("after", ())
    )
    low, high = given.get("window", (0.0, float("inf")))
    return Task(
        id=feature["id"],
        position=xy_of(feature, frame),
        priority=given.get("priority", 0),
        service_time=float(given.get("service_time", 0.0)),
        after=after,
        needs=frozenset(given.get("needs", ())),
        domain=given.get("domain"),
        window=(float(low), float(high)),
    )


def task_problems(tasks: Sequence[Task], others: Collection[str]) -> list[str]:
    """Return what is wrong with ids, order and windows of tasks; they may come after those of the ids `others`."""
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


def xy_of(feature: dict[str, Any], frame: Frame) -> tuple[float, float]:
    """Return where a point is, in metres of the frame."""
    x, y = frame.to_metres(np.array(feature["geometry"]["coordinates"][:2], dtype=float))[0]
    return float(x), float(y)
