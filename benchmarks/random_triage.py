"""Random triage drills: fields with obstacles, flat or hilly, teams of any size, casualties scattered or in clusters."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely import Polygon

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Area, Obstacle, Site, as_multipolygon
from quarterdeck.geo.terrain import Terrain
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.triage.generate import generate, paper_team
from quarterdeck.mission.triage.plan import plan_triage
from quarterdeck.mission.triage.settings import Settings

METHODS = ("relay", "no-relay", "no-priority", "constant")
CHANCES = (0.55, 0.2, 0.15, 0.1)  # of each
APART = 3.0  # m between starts, walls and one another
MARGIN = 2.0  # m about the field
CELL = 1.0  # m, of hilly ground


def draw_drill(field: Polygon, holes: Sequence[Obstacle], rng: np.random.Generator) -> Mission:
    """Return a triage mission on a field; some of its holes are low, or walls for robots alone.

    Raises InputError where the field is too narrow for the team.
    """
    method = str(rng.choice(METHODS, p=CHANCES))
    solid = frozenset({"ground"})
    walls = tuple(replace(h, blocks=solid, height=float(rng.choice([0.2, 1.0, 2.5]))) for h in holes)
    site = Site((Area("field", as_multipolygon(field)),), as_multipolygon(field.buffer(MARGIN, join_style="mitre")), walls)
    team = paper_team(ugvs=int(rng.integers(1, 5)), uavs=1 + (rng.random() < 0.25), medics=1 + (rng.random() < 0.2))
    room = site.navigable("ground", APART / 2)
    vehicles = (
        team.vehicles if method in ("relay", "no-priority") else tuple(v for v in team.vehicles if v.domain == "ground")
    )
    places = _apart(room, len(vehicles) + len(team.medics) + 1, rng)
    scenario = replace(
        team,
        site=site,
        vehicles=tuple(replace(v, start=xy) for v, xy in zip(vehicles, places, strict=False)),
        medics=tuple((m, xy) for (m, _), xy in zip(team.medics, places[len(vehicles) :], strict=False)),
        rendezvous=(("rendezvous", places[-1]),),
    )
    scenario = generate(scenario, int(rng.integers(1000)), casualties=(2, 9), clustered=bool(rng.random() < 0.3))
    settings = Settings(
        talk=float(rng.uniform(2.0, 6.0)),
        clusters=int(rng.integers(1, 6)),
        patience=float(rng.choice([30.0, 120.0])),
        confidence=float(rng.choice([1.0, 0.8])),
        position_error=float(rng.choice([0.0, 0.0, 1.0])),
    )
    return plan_triage(scenario, method, settings, seed=int(rng.integers(1000)))


def _apart(room: shapely.MultiPolygon, count: int, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Return places in the largest part of `room`, `APART` metres from one another."""
    part = max(room.geoms, key=lambda p: p.area, default=Polygon())
    places: list[tuple[float, float]] = []
    for _ in range(2000 if part.area else 0):
        x, y = rng.uniform(part.bounds[:2], part.bounds[2:])
        if part.contains(shapely.Point(x, y)) and all(np.hypot(x - a, y - b) > APART for a, b in places):
            places.append((float(x), float(y)))
        if len(places) == count:
            return places
    raise InputError("no room for all starts")


def draw_hills(mission: Mission, rng: np.random.Generator) -> Terrain | None:
    """Return the ground of a mission: flat, or hills of up to 1.5 m that all can climb."""
    if rng.random() < 0.7:
        return None
    west, south, east, north = mission.site.operating.buffer(5.0).bounds
    x, y = np.meshgrid(np.arange(west, east + CELL, CELL), np.arange(south, north + CELL, CELL))
    across, along = rng.uniform(4.0, 8.0, 2)
    return Terrain((west, south), CELL, rng.uniform(0.3, 1.5) * np.sin(x / across) * np.cos(y / along))
