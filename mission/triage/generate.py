"""Seeded cases to study: casualties scattered over a field, evenly or in clusters, and the paper's team beside them."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import shapely
from shapely import MultiPolygon, box

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Casualty, Scenario, Site, Vehicle, as_multipolygon

FIELD = (80.0, 50.0)  # m, the paper's
FEWEST, MOST = 8, 14  # casualties a case; the paper says "a random number"
_SPREAD = 4.0  # m, standard deviation of a cluster
_ORIGIN = Frame(-78.5, 38.03)  # the south-western corner; the paper has no place
_SORTS = ("red", "yellow", "green")


def paper_team(
    *,
    ugvs: int = 3,
    uavs: int = 1,
    medics: int = 1,
    size: tuple[float, float] = FIELD,
    speeds: tuple[float, float] = (2.5, 8.0),
) -> Scenario:
    """Return the paper's field without casualties: UGVs along the southern edge, UAVs and medics at the rendezvous.

    `size` is the field's width and height in metres, `speeds` those of UGVs and UAVs in m/s.
    """
    return _team(ugvs, uavs, medics, size, speeds)


@lru_cache(maxsize=32)
def _team(ugvs: int, uavs: int, medics: int, size: tuple[float, float], speeds: tuple[float, float]) -> Scenario:
    if min(size) <= 0 or min(speeds) <= 0 or min(ugvs, uavs, medics) < 0:
        raise InputError("the field's sides and the speeds must be above 0, the numbers of robots and medics not below")
    width, height = size
    field = MultiPolygon([box(0, 0, width, height)])
    middle = (width / 2, height / 2)
    rover, drone = load_model("triage-rover"), load_model("survey-quad")
    starts = [(round(width * (i + 0.5) / ugvs, 3), min(1.0, height / 2)) for i in range(ugvs)]
    vehicles = [
        Vehicle(f"ugv{i + 1}", rover, xy, speed=speeds[0], clearance=rover.clearance) for i, xy in enumerate(starts)
    ]
    vehicles += [
        Vehicle(f"uav{i + 1}", drone, middle, speed=speeds[1], altitude=10.0, clearance=drone.clearance)
        for i in range(uavs)
    ]
    return Scenario(
        name="triage",
        frame=_ORIGIN,
        site=Site((Area("field", field),), field),
        vehicles=tuple(vehicles),
        medics=tuple((f"medic{i + 1}", middle) for i in range(medics)),
        rendezvous=(("rendezvous", middle),),
    )


def generate(
    scenario: Scenario, seed: int, *, casualties: tuple[int, int] = (FEWEST, MOST), clustered: bool = False
) -> Scenario:
    """Return the scenario with new casualties: a number between the two given, both included, each colour as likely.

    `clustered` gathers them around one place for every four casualties. Raises InputError if there is nowhere to be.
    """
    low, high = casualties
    if not 0 <= low <= high:
        raise InputError(f"casualties {low} to {high}: give the fewest and the most, not below 0")
    rng = np.random.default_rng(seed)
    count = int(rng.integers(low, high + 1))
    where = as_multipolygon(scenario.site.navigable("ground").intersection(scenario.site.area))
    if where.area == 0.0:
        raise InputError("the field has no place for casualties: it is all obstacle")
    places = _clusters(where, count, rng) if clustered else _anywhere(where, count, rng)
    colours = rng.integers(0, 3, count)
    made = tuple(
        Casualty(f"c{i + 1:0{len(str(max(count, 1)))}d}", (float(x), float(y)), _SORTS[k])  # type: ignore[arg-type]
        for i, ((x, y), k) in enumerate(zip(places, colours, strict=True))
    )
    return replace(scenario, name=f"{scenario.name}-{seed}", casualties=made)


def _anywhere(where: MultiPolygon, count: int, rng: np.random.Generator) -> np.ndarray:
    """Return (count, 2) points, evenly distributed."""
    x0, y0, x1, y1 = where.bounds
    found = np.empty((0, 2))
    while len(found) < count:
        tries = rng.uniform((x0, y0), (x1, y1), (2 * count + 16, 2))
        found = np.concatenate([found, tries[shapely.contains_xy(where, *tries.T)]])
    return found[:count]


def _clusters(where: MultiPolygon, count: int, rng: np.random.Generator) -> np.ndarray:
    centres = _anywhere(where, -(-count // 4), rng)
    found = np.empty((0, 2))
    while len(found) < count:
        tries = centres[rng.integers(0, len(centres), 2 * count + 16)] + rng.normal(0.0, _SPREAD, (2 * count + 16, 2))
        found = np.concatenate([found, tries[shapely.contains_xy(where, *tries.T)]])
    return found[:count]
