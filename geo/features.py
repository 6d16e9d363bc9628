"""GeoJSON features: what a site, a plan and the files for the eye are written with. Degrees with 9 decimals."""

import json
from collections.abc import Iterable
from typing import Any

import numpy as np
from shapely import MultiPolygon, Polygon, get_coordinates, orient_polygons, set_coordinates
from shapely.geometry import mapping

from quarterdeck.geo.frame import Frame
from quarterdeck.geo.palette import FILL, SITE


def collection(name: str, features: Iterable[dict[str, Any]]) -> str:
    """Return the text of a FeatureCollection, one feature a line; the same features give the same bytes."""
    lines = ",\n".join(json.dumps(f, allow_nan=False, ensure_ascii=False, separators=(", ", ": ")) for f in features)
    return f'{{"type": "FeatureCollection", "name": {json.dumps(name, ensure_ascii=False)}, "features": [\n{lines}\n]}}\n'


def feature(role: str, geometry: Any, identity: str | None = None, **properties: Any) -> dict[str, Any]:
    """Return a feature of a role; `geometry` is GeoJSON or None."""
    head = {"type": "Feature"} | ({"id": identity} if identity is not None else {})
    return head | {"properties": {"role": role} | properties, "geometry": geometry}


def polygon_feature(
    frame: Frame, role: str, polygon: Any, identity: str | None = None, **properties: Any
) -> dict[str, Any]:
    """Return a polygon in metres as a feature with its role's colours."""
    look = {"stroke": SITE[role], "stroke-width": 1, "fill": SITE[role], "fill-opacity": FILL[role]}
    return feature(role, geometry(frame, polygon), identity, **properties, **look)


def point_feature(frame: Frame, role: str, xy: tuple[float, float], identity: str, **properties: Any) -> dict[str, Any]:
    """Return a point in metres as a feature."""
    return feature(role, {"type": "Point", "coordinates": position(frame, xy)}, identity, **properties)


def geometry(frame: Frame, shape: Any) -> dict[str, Any]:
    """Return a shapely geometry in metres as GeoJSON, rings wound as RFC 7946 says."""
    if isinstance(shape, Polygon | MultiPolygon):
        shape = orient_polygons(shape)
        if isinstance(shape, MultiPolygon) and len(shape.geoms) == 1:
            shape = shape.geoms[0]
    return dict(mapping(set_coordinates(shape, degrees(frame, get_coordinates(shape)))))


def position(frame: Frame, xy: tuple[float, float]) -> list[float]:
    """Return [lon, lat] of a point in metres."""
    return degrees(frame, [xy])[0].tolist()


def degrees(frame: Frame, xy: Any) -> np.ndarray:
    """Return (n, 2) lon, lat of (n, 2) metres."""
    return np.round(frame.to_degrees(np.asarray(xy, dtype=float)), 9)
