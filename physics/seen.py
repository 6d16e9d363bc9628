"""What robots of limited range see from their tracks: what of the area is in sight of some place on them, walls counted."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import LineString
from shapely.geometry.base import BaseGeometry

from quarterdeck.coverage.guards.certificate import uncovered
from quarterdeck.coverage.guards.space import space_of
from quarterdeck.geo.scenario import Scenario
from quarterdeck.geo.triangulation import triangulate
from quarterdeck.geo.visibility import visibility_polygons
from quarterdeck.mission.guards import least_range
from quarterdeck.mission.mission import Mission
from quarterdeck.physics.trace import Trace

STRIDE = 0.1  # of the range: how far apart the looks along a track are
BATCH = 500  # views united at a time


def seen_fraction(mission: Mission, tracks: Sequence[LineString]) -> float:
    """Return the part of the coverable area, from 0 to 1, that is seen from `tracks` in metres within the plan's range.

    Looks are STRIDE of the range apart, and at every vertex; views are polygons inscribed in what is seen, so that the
    figure is never too high.
    """
    space = space_of(Scenario(mission.name, mission.frame, mission.site, mission.vehicles))
    return float(1.0 - unseen(mission, tracks).area / space.target.area)


def unseen(mission: Mission, tracks: Sequence[LineString]) -> BaseGeometry:
    """Return the part of the area that is not seen from `tracks` in metres within the plan's range."""
    reach = least_range(mission)
    space = space_of(Scenario(mission.name, mission.frame, mission.site, mission.vehicles))
    # GEOS cannot segmentize the line of who never moved.
    ways = [track if track.length == 0 else shapely.segmentize(track, STRIDE * reach) for track in tracks]
    places = [shapely.get_coordinates(way) for way in ways]
    if not places:
        return space.target
    looks = np.unique(np.round(np.vstack(places), 3), axis=0)
    mesh = triangulate(space.sight)
    views = [
        shapely.union_all(visibility_polygons(mesh, looks[first : first + BATCH], reach))
        for first in range(0, len(looks), BATCH)
    ]
    return uncovered(space, np.array(views))


def whole_tracks(trace: Trace, tolerance: float) -> list[LineString]:
    """Return everything that was driven, as far as it is known, thinned by no more than `tolerance` metres."""
    lines = [
        LineString(np.column_stack([trace.x[run, i], trace.y[run, i]]))
        for i in range(len(trace.vehicles))
        for run in trace.known(i)
        if run.stop - run.start > 1
    ]
    return list(shapely.simplify(lines, tolerance, preserve_topology=False))
