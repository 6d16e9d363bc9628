"""Depths between soundings: on the triangles of a Delaunay triangulation, beyond them the nearest sounding's.

The least depth on a part of the bottom is then at a sounding or on the part's border. What stands between two soundings is
not known: a chart has the shoalest, but a survey finds more.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import KDTree, QhullError
from shapely import Point
from shapely.geometry.base import BaseGeometry
from shapely.ops import unary_union

from quarterdeck.geo.frame import Frame

LEAST = 0.5  # m: shoaler water has the swath of this depth, for no line could be near enough to the next


Soundings = tuple[tuple[float, float, float], ...]  # x, y and depth, metres


def read_soundings(features: Sequence[dict[str, Any]], frame: Frame) -> Soundings:
    """Return the soundings among a site's features that have been looked at; one whose depth is wrong is left out."""
    features = [f for f in features if f["properties"].get("depth") is not None]
    if not features:
        return ()
    xy = frame.to_metres(np.array([f["geometry"]["coordinates"][:2] for f in features], dtype=float)).tolist()
    return tuple((x, y, float(f["properties"]["depth"])) for (x, y), f in zip(xy, features, strict=True))


def least_depth(soundings: Soundings, areas: Sequence[BaseGeometry]) -> float | None:
    """Return the least depth sounded in the areas, or of all where none is there; None without soundings."""
    area = unary_union(areas)
    inside = [depth for x, y, depth in soundings if area.covers(Point(x, y))]
    return max(LEAST, min(inside or [depth for _, _, depth in soundings])) if soundings else None


def depths_at(soundings: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """Return (m,) metres of depth at (m, 2) places from (n, 3) soundings x, y, depth in metres, none below `LEAST`."""
    soundings, xy = np.asarray(soundings, dtype=float), np.asarray(xy, dtype=float)
    nearest = soundings[KDTree(soundings[:, :2]).query(xy)[1], 2]
    if len(soundings) < 3:
        return np.maximum(nearest, LEAST)
    middle = soundings[:, :2].mean(axis=0)
    try:
        between = LinearNDInterpolator(soundings[:, :2] - middle, soundings[:, 2])(xy - middle)
    except QhullError:  # all on a line
        return np.maximum(nearest, LEAST)
    return np.maximum(np.where(np.isnan(between), nearest, between), LEAST)
