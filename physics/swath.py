"""What tracks cover: the part of the area within half the track spacing of survey legs, planned or driven."""

from collections.abc import Iterable

import numpy as np
import shapely
from shapely import LineString

from quarterdeck.coverage.metrics import uncovered
from quarterdeck.geo.scenario import Site
from quarterdeck.mission.mission import Route
from quarterdeck.physics.paths import LEGS
from quarterdeck.physics.trace import Trace

TOLERANCE = 0.02  # m: driven tracks are thinned by no more than this before they are widened


def covered_fraction(site: Site, tracks: Iterable[LineString], spacing: float) -> float:
    """Return the covered part of the coverable area, from 0 to 1, of `tracks` in metres; 0 where there is nothing to
    cover.
    """
    coverable = site.coverable
    if coverable.area == 0:
        return 0.0
    missed = uncovered([shapely.get_coordinates(track) for track in tracks], coverable, spacing)
    return 1.0 - float(missed.area / coverable.area)


def planned_tracks(routes: Iterable[Route]) -> list[LineString]:
    """Return the survey legs of routes, legs that follow one another joined."""
    return [line for route in routes for line in _runs(route.xyz[:, :2], route.survey)]


def driven_tracks(trace: Trace) -> list[LineString]:
    """Return what was driven on survey legs, thinned."""
    lines = []
    for i in range(len(trace.vehicles)):
        surveying = trace.kind[:, i] == LEGS.index("survey")
        lines += _runs(np.column_stack([trace.x[:, i], trace.y[:, i]]), surveying)
    return [shapely.simplify(line, TOLERANCE, preserve_topology=False) for line in lines]


def _runs(xy: np.ndarray, chosen: np.ndarray) -> list[LineString]:
    """Return a line for each unbroken run of chosen points, begun at the point before it."""
    edges = np.flatnonzero(np.diff(np.r_[0, chosen.astype(np.int8), 0]))
    return [LineString(xy[max(a - 1, 0) : b]) for a, b in edges.reshape(-1, 2) if b - max(a - 1, 0) >= 2]
