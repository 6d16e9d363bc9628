"""GeoJSON for the eye: routes and site with simplestyle colours, as geojson.io, GitHub, Mapbox and QGIS draw them.

Simplestyle 1.1.0 (mapbox/simplestyle-spec). It is a picture, not the plan: PLAN holds everything, this what one looks at.
"""

import json
from collections.abc import Iterator
from itertools import groupby
from typing import Any

import antimeridian
import numpy as np
import shapely
from shapely.geometry import mapping
from shapely.geometry.base import BaseGeometry

from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.places import file_stems
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.palette import FILL, SITE, TASK
from quarterdeck.mission.layers import fleet_colours
from quarterdeck.mission.mission import Mission, Route

SURVEY_WIDTH, TRANSIT_WIDTH = 3, 1.5


def files(mission: Mission, settings: Settings) -> dict[str, str]:  # noqa: ARG001 - no autopilot reads it
    """Return one FeatureCollection, `<mission>.geojson`: site, tasks, and each vehicle's survey and other legs."""
    stem = file_stems(mission)[0]
    document = {"type": "FeatureCollection", "features": [*site_features(mission), *route_features(mission)]}
    return {f"{stem}.geojson": json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1) + "\n"}


def site_features(mission: Mission) -> Iterator[dict[str, Any]]:
    """Yield the operating area, the areas, the obstacles and the tasks."""
    site, frame = mission.site, mission.frame
    yield _feature(frame, site.operating, name="operating area", **_look("operating"))
    for area in site.areas:
        yield _feature(frame, area.polygon, name=area.id, **_look("area"))
    for obstacle in site.obstacles:
        yield _feature(frame, obstacle.polygon, name=obstacle.id, **_look("obstacle"))
    for task in mission.tasks:
        point = shapely.Point(task.position)
        yield _feature(frame, point, name=task.id, **{"marker-color": TASK, "marker-size": "small"})


def route_features(mission: Mission) -> Iterator[dict[str, Any]]:
    """Yield each vehicle's runs of legs, and its start with the route's figures."""
    frame = mission.frame
    palette = fleet_colours(mission)
    for route in mission.routes:
        colour = palette[route.vehicle]
        yield from _legs(frame, route, colour)
        figures: dict[str, Any] = {"length_m": round(route.length, 1), "duration_s": round(route.duration, 1)}
        figures |= {"energy_Wh": round(route.energy, 2), "marker-color": colour, "marker-symbol": "circle"}
        yield _feature(frame, shapely.Point(route.xyz[0, :2]), name=route.vehicle, **figures)


def _look(role: str) -> dict[str, Any]:
    return {"stroke": SITE[role], "fill": SITE[role], "fill-opacity": FILL[role], "stroke-width": 1}


def _legs(frame: Frame, route: Route, colour: str) -> Iterator[dict[str, Any]]:
    """One line for each run of legs that are all survey, or none of them."""
    xy, covers = route.xyz[:, :2], route.survey
    runs = groupby(range(1, len(xy)), key=lambda i: bool(covers[i]))
    for number, (survey, run) in enumerate(runs, 1):
        ends = list(run)
        line = shapely.LineString(xy[[ends[0] - 1, *ends]])
        style: dict[str, Any] = {"stroke": colour, "stroke-width": SURVEY_WIDTH if survey else TRANSIT_WIDTH}
        style |= {"stroke-opacity": 1.0 if survey else 0.6, "vehicle": route.vehicle, "order": number, "survey": survey}
        yield _feature(frame, line, name=f"{route.vehicle} {number}", **style)


def _feature(frame: Frame, geometry: BaseGeometry, **properties: Any) -> dict[str, Any]:
    degrees = shapely.transform(geometry, lambda xy: np.round(frame.to_degrees(xy), 9))
    feature = {"type": "Feature", "geometry": mapping(degrees), "properties": properties}
    west, _, east, _ = degrees.bounds or (0.0, 0.0, 0.0, 0.0)
    return antimeridian.fix_geojson(feature) if east - west > 180.0 else feature
