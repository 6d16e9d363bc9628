"""Multibeam surveys by soundings: how far apart lines may be where, and what of the seafloor the driven lines then see.

A beam fan of the whole opening `angle` sees what lies no farther abeam than depth times tan(angle / 2), the depth being
that of the bottom there (de Jong and others, Hydrography, ch. 9). A strip is no wider than the least depth in it allows.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from quarterdeck.coverage.spread import Spread
from quarterdeck.geo.depths import depths_at
from quarterdeck.geo.scenario import Scenario
from quarterdeck.geo.sensors import follows_depth, sonar_swath
from quarterdeck.mission.mission import Route

PLACES = 60_000  # at which the bottom is looked at, about


def spreads(scenario: Scenario) -> list[Spread | None]:
    """Return for each vehicle how far apart its lines may be where; None where its sensor has one swath everywhere."""
    if not scenario.soundings or not any(follows_depth(v.sensor) for v in scenario.vehicles):
        return [None] * len(scenario.vehicles)
    places, depths = bottom(scenario, scenario.site.area)
    return [
        Spread(places, sonar_swath({**v.sensor.parameters, "depth": 1.0}) * depths)
        if v.sensor is not None and follows_depth(v.sensor)
        else None
        for v in scenario.vehicles
    ]


def bottom(scenario: Scenario, area: BaseGeometry) -> tuple[np.ndarray, np.ndarray]:
    """Return (n, 2) places all over an area, its soundings among them, and the (n,) depths there, in metres."""
    soundings = np.array(scenario.soundings)
    west, south, east, north = area.bounds
    step = math.sqrt((east - west) * (north - south) / PLACES)
    x, y = np.meshgrid(np.arange(west + step / 2, east, step), np.arange(south + step / 2, north, step))
    places = np.concatenate([np.column_stack([x.ravel(), y.ravel()]), soundings[:, :2]])
    places = places[shapely.contains_xy(area, *places.T)]
    return places, depths_at(soundings, places)


def seen(scenario: Scenario, reach: BaseGeometry, routes: Sequence[Route]) -> dict[str, Any]:
    """Return as figures what survey legs see of the seafloor to be covered, from their places and the soundings alone.

    `seafloor_coverage` is the part of the places looked at that lies within a fan; `least_overlap` the least part by which
    a half fan sees too far, of places farther than a half fan and a turn from the border of where tracks may lie, `reach`.
    """
    vehicles = scenario.vehicles
    if not all(follows_depth(v.sensor) for v in vehicles):
        return {}
    places, depths = bottom(scenario, scenario.site.coverable)
    use = np.full(len(places), np.inf)  # of the half fan, by the leg that needs least of it
    for vehicle, route in zip(vehicles, routes, strict=True):
        if vehicle.sensor is None:
            continue
        half = depths * math.tan(math.radians(vehicle.sensor.parameters["angle"] / 2))
        xy = route.xyz[:, :2]
        for i in np.flatnonzero(route.survey):
            a, b = xy[i - 1], xy[i]
            length = float(np.hypot(*(b - a)))
            if length == 0:
                continue
            along, abeam = (places - a) @ (b - a) / length, (places - a) @ np.array([a[1] - b[1], b[0] - a[0]]) / length
            beside = (along >= -0.01) & (along <= length + 0.01)
            use[beside] = np.minimum(use[beside], np.abs(abeam[beside]) / half[beside])
    fan = max(math.tan(math.radians(v.sensor.parameters["angle"] / 2)) for v in vehicles if v.sensor is not None)
    turn = 3 * max(v.turn_radius for v in vehicles)  # what turns between close lines take off their ends
    spots = shapely.points(places)
    inner = shapely.intersects(reach, spots) & (shapely.distance(reach.boundary, spots) > depths * fan + turn)
    worst = float(use[inner].max()) if inner.any() else 1.0
    return {"seafloor_coverage": float((use <= 1.0).mean()), "least_overlap": max(0.0, 1.0 - worst)}
