"""Random missions with random faults, each from one seed: small sites with holes, fleets of every domain, every planner."""

import runpy
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon, affinity, box

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Obstacle, Precedence, Scenario, Site, Task, Vehicle, as_multipolygon
from quarterdeck.geo.terrain import Terrain
from quarterdeck.mission.assign import assign
from quarterdeck.mission.cover import cover
from quarterdeck.mission.guards import plan_guards
from quarterdeck.mission.lines import plan_lines
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.timing import RESERVE
from quarterdeck.mission.triage.plan import run_plan
from quarterdeck.physics.faults import Fault

_drills = runpy.run_path(str(Path(__file__).with_name("random_triage.py")))
draw_drill, draw_hills = _drills["draw_drill"], _drills["draw_hills"]
KINDS = ("stc", "lines", "guards", "tasks")
WIDER = 1000  # seeds from here on draw triage drills and ranges of radios too; those before draw what they always drew
# Track spacings and how long a site's side is in them; a vehicle of each model surveys for some minutes.
SPACING = {"husky": 5.0, "jackal": 5.0, "otter": 16.0, "wam-v": 25.0, "survey-quad": 40.0, "crazyflie": 1.5}
FLEETS = {"ground": ("husky", "jackal"), "surface": ("otter", "wam-v"), "aerial": ("survey-quad", "crazyflie")}
TRIES = 40  # sites drawn until one can be planned


@dataclass(frozen=True, slots=True)
class Case:
    """A mission and what befalls it. `current` m/s east and north; `delay` seconds until a silent vehicle is given up;
    `terrain` is the ground, flat where there is none.
    """

    seed: int
    kind: str
    domain: str
    mission: Mission
    faults: tuple[Fault, ...]
    delay: float
    current: tuple[float, float]
    terrain: Terrain | None = None


def draw_case(seed: int) -> Case:
    """Return the case of a seed."""
    rng = np.random.default_rng([seed, 0x50AC])
    kind = str(rng.choice(KINDS if seed < WIDER else (*KINDS, "triage")))
    if kind == "triage":
        return _drill(seed, rng)
    for _ in range(TRIES):
        domain = str(rng.choice(list(FLEETS)))
        try:
            mission = _planned(kind, _scenario(kind, domain, rng), rng)
        except InputError:  # the site is too narrow for this fleet
            continue
        if mission.feasible and sum(len(r.waypoints) > 1 for r in mission.routes):
            break
    else:
        raise RuntimeError(f"seed {seed}: no site could be planned in {TRIES} tries")
    mission = _powered(mission, rng)
    mission = mission if seed < WIDER else _ranged(mission, rng)
    delay = float(rng.choice([0.0, 5.0, 20.0, 60.0]))
    current = tuple(rng.uniform(-0.15, 0.15, 2).tolist()) if domain == "surface" and rng.random() < 0.5 else (0.0, 0.0)
    span = max(r.duration for r in mission.routes)
    return Case(seed, kind, domain, mission, _faults(mission, span, delay, rng), delay, current)


def _drill(seed: int, rng: np.random.Generator) -> Case:
    for _ in range(TRIES):
        side = rng.uniform(14.0, 30.0)
        field = _outline(side, rng)
        try:
            mission = draw_drill(field, _holes(field, side, 3.0, rng), rng)
            span = run_plan(mission).end
        except InputError:  # too narrow for the team, or a casualty lies where no way leads
            continue
        break
    else:
        raise RuntimeError(f"seed {seed}: no drill could be planned in {TRIES} tries")
    medics = mission.parameters["medics"]
    faults = [f for f in _faults(mission, span, 60.0, rng) if f.vehicle not in medics or f.kind in ("lost", "comms")]
    return Case(seed, "triage", "team", mission, tuple(faults), 0.0, (0.0, 0.0), draw_hills(mission, rng))


def _scenario(kind: str, domain: str, rng: np.random.Generator) -> Scenario:
    count = int(min(1 + rng.geometric(0.3), 6 if kind == "guards" else 12)) if rng.random() < 0.92 else 1
    models = [load_model(m) for m in FLEETS[domain]]
    model = models[int(rng.integers(len(models)))]
    spacing = SPACING[model.name]
    side = spacing * (4.0 + 2.0 * np.sqrt(count) * rng.uniform(0.7, 1.3))
    area = _outline(side, rng)
    holes = _holes(area, side, spacing, rng)
    margin = rng.uniform(1.2, 3.0) * (model.clearance + max(model.turn_radius, model.length))
    operating = area.buffer(margin, join_style="mitre")
    site = Site((Area("area", as_multipolygon(area)),), as_multipolygon(operating), holes)
    room = site.navigable(domain, 1.3 * model.clearance).buffer(-0.1 * margin)
    homes = _berths(room, operating, count, 4.0 * model.length + 2.0 * model.clearance, rng)
    vehicles = tuple(
        Vehicle(
            f"v{i + 1}",
            model,
            home,
            end=_berths(room, operating, 1, 0.0, rng)[0] if rng.random() < 0.1 else None,
            speed=model.speed * (rng.uniform(0.6, 1.0) if rng.random() < 0.2 else 1.0),
            turn_radius=model.turn_radius,
            clearance=model.clearance,
            battery=model.battery * 100.0,
            altitude=model.altitude,
        )
        for i, home in enumerate(homes)
    )
    tasks = _tasks(room, count, side / model.speed, rng) if kind == "tasks" else ()
    return Scenario("soak", Frame(20.0, 60.0), site, vehicles, tasks, spacing=spacing)


def _outline(side: float, rng: np.random.Generator) -> Polygon:
    """Return a box, or an L, T or Z of two of them, turned by any angle."""
    shape = box(0.0, 0.0, side, side * rng.uniform(0.6, 1.0))
    if rng.random() < 0.6:
        x, y = rng.uniform(0.3, 0.7, 2) * side
        shape = shape.union(box(x, y, x + side * rng.uniform(0.5, 0.8), y + side * rng.uniform(0.5, 0.8)))
    return affinity.rotate(shape, rng.uniform(0.0, 90.0), origin=(0.0, 0.0))


def _holes(area: Polygon, side: float, spacing: float, rng: np.random.Generator) -> tuple[Obstacle, ...]:
    """Return up to four obstacles in the area, convex, apart from one another."""
    holes: list[Obstacle] = []
    for _ in range(int(rng.integers(0, 5))):
        radius = rng.uniform(0.3, 1.0) * spacing
        x, y = shapely.get_coordinates(area.envelope).min(axis=0) + rng.uniform(0.0, 1.0, 2) * side * 1.3
        angles = np.sort(rng.uniform(0.0, 2 * np.pi, int(rng.integers(3, 8))))
        shape = Polygon(np.column_stack([x + radius * np.cos(angles), y + radius * np.sin(angles)])).convex_hull
        apart = all(shape.distance(o.polygon) > 2.0 * spacing for o in holes)
        if shape.area > 0.05 * radius**2 and area.contains(shape) and apart:
            holes.append(Obstacle(f"hole {len(holes) + 1}", shape))
    return tuple(holes)


def _berths(
    room: MultiPolygon, operating: Polygon, count: int, apart: float, rng: np.random.Generator
) -> list[tuple[float, float]]:
    """Return starts in `room`: all at one place, side by side along the border, or anywhere."""
    if room.is_empty:
        raise InputError("no room to start")
    rim = room.exterior if isinstance(room, Polygon) else max(as_multipolygon(room).geoms, key=lambda p: p.area).exterior
    along, style = rng.uniform(0.0, rim.length), rng.random()
    if style < 0.2 or (apart * count > 0.8 * rim.length):
        places = [rim.interpolate(along)] * count
    elif style < 0.6:
        places = [rim.interpolate((along + i * apart) % rim.length) for i in range(count)]
    else:
        places = []
        for _ in range(2000):
            place = shapely.Point(rng.uniform(operating.bounds[:2], operating.bounds[2:]))
            if room.contains(place) and all(place.distance(p) > apart for p in places):
                places.append(place)
            if len(places) == count:
                break
        else:
            raise InputError("no room for all starts")
    return [(float(p.x), float(p.y)) for p in places]


def _tasks(room: MultiPolygon, robots: int, across: float, rng: np.random.Generator) -> tuple[Task, ...]:
    """Return tasks anywhere in `room`, some after others; `across` is the seconds from side to side."""
    count = int(rng.integers(robots, min(4 * robots, 16) + 2))
    tasks: list[Task] = []
    while len(tasks) < count:
        place = rng.uniform(room.bounds[:2], room.bounds[2:])
        if not room.contains(shapely.Point(place)):
            continue
        after: tuple[Precedence, ...] = ()
        if tasks and rng.random() < 0.4:
            after = (Precedence(tasks[int(rng.integers(len(tasks)))].id, rng.choice(["finish_to_start", "same_robot"])),)
        tasks.append(
            Task(
                f"t{len(tasks) + 1}",
                (float(place[0]), float(place[1])),
                priority=int(rng.integers(4)),
                service_time=float(rng.uniform(0.0, 0.5 * across)),
                after=after,
            )
        )
    return tuple(tasks)


def _planned(kind: str, scenario: Scenario, rng: np.random.Generator) -> Mission:
    seed = int(rng.integers(1000))
    if kind == "guards":
        return plan_guards(scenario, range=float(scenario.spacing or 0.0) * rng.uniform(2.0, 3.5), seed=seed)
    if kind == "tasks":
        return assign(scenario, iterations=30, seed=seed)
    if kind == "lines":
        return plan_lines(scenario, seed=seed)
    return cover(scenario, edge=str(rng.choice(["whole", "cells", "lap"])), seed=seed)  # type: ignore[arg-type]


def _powered(mission: Mission, rng: np.random.Generator) -> Mission:
    """Give a third of the fleets batteries and endurances that last for their routes and 5 to 100 % more, no longer."""
    if rng.random() > 0.35:
        return mission
    spare = rng.uniform(1.05, 2.0) / (1 - RESERVE)
    longest = max(r.duration for r in mission.routes)
    hungriest = max(r.energy for r in mission.routes)
    vehicles = tuple(replace(v, battery=spare * hungriest, endurance=spare * longest) for v in mission.vehicles)
    return replace(mission, vehicles=vehicles)


def _ranged(mission: Mission, rng: np.random.Generator) -> Mission:
    """Let a quarter of the fleets speak no further than a part of the site; guards' range is how far they see."""
    if mission.method == "guards" or rng.random() > 0.25:
        return mission
    west, south, east, north = mission.site.operating.bounds
    reach = rng.uniform(0.15, 0.7) * np.hypot(east - west, north - south)
    return replace(mission, vehicles=tuple(replace(v, range=float(reach)) for v in mission.vehicles))


def _faults(mission: Mission, span: float, delay: float, rng: np.random.Generator) -> tuple[Fault, ...]:
    """Return faults: up to all but one lost, at any time, often at once, while others recover or on the way home; half
    power, no fixes, and silences, of which some are false alarms and some end only after the vehicle was given up. The
    mission takes `span` seconds without them.
    """
    ids = [v.id for v in mission.vehicles]
    lost = rng.permutation(ids)[: int(rng.integers(0, len(ids)))]
    times = rng.uniform(0.0, 1.1 * span, len(lost))
    style = rng.random()
    if style < 0.2:
        times[:] = times[:1].sum()  # all at once
    elif style < 0.5:
        times = np.sort(times)[:1].sum() + rng.uniform(0.0, 1.5 * delay + 60.0, len(lost))  # during the recovery
    elif style < 0.6:
        times = rng.uniform(0.85, 1.0, len(lost)) * span  # returning
    faults = [Fault("lost", str(v), round(float(t), 1)) for v, t in zip(lost, times, strict=True)]
    for _ in range(int(rng.integers(0, 3))):
        kind, vehicle = str(rng.choice(["comms", "comms", "thruster", "gnss"])), str(rng.choice(ids))
        start = round(float(rng.uniform(0.0, span)), 1)
        lasts = round(float(rng.choice([rng.uniform(1.0, max(delay, 2.0)), rng.uniform(delay + 1.0, delay + span)])), 1)
        if kind == "gnss":
            lasts = min(lasts, 20.0)
        end = float("inf") if kind == "thruster" or (kind == "comms" and rng.random() < 0.2) else round(start + lasts, 1)
        faults.append(Fault(kind, vehicle, start, end))
    return tuple(sorted(faults, key=lambda f: (f.start, f.vehicle, f.kind)))


def told(faults: Sequence[Fault]) -> list[str]:
    """Return the faults as `--fail` takes them."""
    return [str(f) for f in faults]
