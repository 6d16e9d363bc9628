"""What lies in the way of those who go on: vehicles that were given up, and what robots found."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import inf

import numpy as np
import shapely
from shapely import MultiPolygon, Point

from quarterdeck.geo.scenario import Obstacle, Vehicle, as_multipolygon
from quarterdeck.mission.changes import Changes, wreck_name
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.progress import Progress
from quarterdeck.mission.triage.plan import METHOD

BERTH = 4.0  # lengths from its end: so near, whoever launches and recovers the vehicles clears the way
COASTS = 2.0  # s at its speed that a vehicle may have gone on from where it was heard last


def wreck_of(
    vehicle: Vehicle,
    here: tuple[float, float],
    berths: Iterable[tuple[float, float]],
    working: Iterable[tuple[float, float]],
) -> Obstacle | None:
    """Return a vehicle that is given up as an obstacle to its kind: its hull, and as far as it went on unheard.

    `here` is where it was last, in metres, `working` where those who go on are. None where it fell from the air, or lies at
    one of the `berths`, the ends of all, where it is seen to.
    """
    place, length = Point(here), vehicle.model.length
    if vehicle.domain == "aerial" or any(place.distance(Point(end)) < BERTH * length for end in berths):
        return None
    hull = 0.5 * float(np.hypot(length, vehicle.model.width))
    free = min((place.distance(Point(other)) for other in working), default=inf)
    radius = min(hull + COASTS * vehicle.speed, 0.9 * free)
    if radius <= 0:
        return None
    return Obstacle(wreck_name(vehicle.id), place.buffer(radius, quad_segs=4), frozenset({vehicle.domain}))


def with_wrecks(mission: Mission, progress: Progress, changes: Changes) -> Changes:
    """Return the changes with who is lost as an obstacle where it was last, unless one of that name is given or gone.

    The wreck of who is back is gone. Triage teams see to their losses themselves, and know no wrecks.
    """
    if mission.method == METHOD:
        return changes
    there = {o.id for o in mission.site.obstacles}
    given = changes.gone | {o.id for o in changes.obstacles}
    staying = [v for v in mission.vehicles if v.id not in changes.lost]
    back = [v for v in mission.lost if v.id in changes.back]
    berths = [v.home for v in (*mission.vehicles, *back, *changes.joined)]
    places = {v.id: progress.positions.get(v.id, v.start)[:2] for v in (*mission.vehicles, *back)}
    places |= {v: place for v, place in changes.back.items() if place is not None}
    working = [*(places[v.id] for v in (*staying, *back)), *(v.start for v in changes.joined)]
    dead = (v for v in mission.vehicles if v.id in changes.lost and wreck_name(v.id) not in given)
    wrecks = [wreck_of(v, places[v.id], berths, working) for v in dead]
    return replace(
        changes,
        obstacles=(*changes.obstacles, *(w for w in wrecks if w is not None)),
        gone=changes.gone | {*map(wreck_name, changes.back)} & there,
    )


def obstacles_found(found: Sequence[MultiPolygon]) -> tuple[Obstacle, ...]:
    """Return all that robots found as obstacles for vehicles on the ground."""
    parts = as_multipolygon(shapely.union_all(found)).geoms
    return tuple(Obstacle(f"found-{n}", part, frozenset({"ground"})) for n, part in enumerate(parts, start=1))
