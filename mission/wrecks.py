"""What lies in the way of those who go on: vehicles that were given up, and what robots found."""

from collections.abc import Collection, Mapping, Sequence
from math import inf

import numpy as np
import shapely
from shapely import MultiPolygon, Point

from quarterdeck.geo.scenario import Obstacle, as_multipolygon
from quarterdeck.mission.director import State
from quarterdeck.mission.mission import Mission

BERTH = 4.0  # lengths from its end: so near, whoever launches and recovers the vehicles clears the way
COASTS = 2.0  # s at its speed that a vehicle may have gone on from where it was heard last


def wreck_of(first: Mission, lost: str, working: Collection[str], states: Mapping[str, State]) -> Obstacle | None:
    """Return a vehicle that is given up as an obstacle to its kind: its hull, and as far as it went on unheard.

    None where it fell from the air, or lies at somebody's berth, where it is seen to.
    """
    vehicle, state = first.vehicle(lost), states[lost]
    here, length = Point(state.x, state.y), vehicle.model.length
    if vehicle.domain == "aerial" or any(here.distance(Point(v.home)) < BERTH * length for v in first.vehicles):
        return None
    hull = 0.5 * float(np.hypot(length, vehicle.model.width))
    free = min((here.distance(Point(states[v].x, states[v].y)) for v in working), default=inf)
    radius = min(hull + COASTS * vehicle.speed, 0.9 * free)
    if radius <= 0:
        return None
    return Obstacle(f"wreck of {lost}", here.buffer(radius, quad_segs=4), frozenset({vehicle.domain}))


def obstacles_found(found: Sequence[MultiPolygon]) -> tuple[Obstacle, ...]:
    """Return all that robots found as obstacles for vehicles on the ground."""
    parts = as_multipolygon(shapely.union_all(found)).geoms
    return tuple(Obstacle(f"found-{n}", part, frozenset({"ground"})) for n, part in enumerate(parts, start=1))
