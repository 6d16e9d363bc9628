"""What tracks cover: the part of the area within half the track spacing of survey legs, planned or driven."""

from collections.abc import Iterable, Sequence

import numpy as np
import shapely
from shapely import LineString

from quarterdeck.coverage.metrics import uncovered
from quarterdeck.geo.scenario import Site
from quarterdeck.mission.mission import Route, unbroken
from quarterdeck.physics.paths import LEGS
from quarterdeck.physics.trace import Trace

TOLERANCE = 0.02  # m: driven tracks are thinned by no more than this before they are widened


def covered_fraction(site: Site, tracks: Sequence[LineString], spacing: float) -> float:
    """Return the covered part of the coverable area, from 0 to 1; 0 where there is nothing to cover."""
    coverable = site.coverable
    if coverable.area == 0 or not tracks:
        return 0.0
    return float(1.0 - uncovered([shapely.get_coordinates(t) for t in tracks], coverable, spacing).area / coverable.area)


def planned_tracks(routes: Iterable[Route]) -> list[LineString]:
    """Return the survey legs of routes, legs that follow one another joined."""
    return [LineString(line) for route in routes for line in unbroken(route.xyz[:, :2], route.survey)]


def driven_tracks(trace: Trace) -> list[LineString]:
    """Return what was driven on survey legs, thinned."""
    tracks: list[LineString] = []
    for i in range(len(trace.vehicles)):
        surveying = trace.kind[:, i] == LEGS.index("survey")
        tracks += [LineString(line) for line in unbroken(np.column_stack([trace.x[:, i], trace.y[:, i]]), surveying)]
    return list(shapely.simplify(tracks, TOLERANCE, preserve_topology=False))
