"""The geofence of a vehicle: where it may be, and the no-go zones in there."""

import shapely
from shapely import Polygon
from shapely.ops import unary_union

from quarterdeck.mission.mission import Mission


def fence_polygons(mission: Mission, vehicle: str) -> tuple[Polygon, list[Polygon]]:
    """Return the inclusion polygon and the exclusion polygons, without holes and not touching, for a vehicle's id.

    An autopilot takes several inclusion polygons to mean that a vehicle must be in all of them, so of an operating area in
    several parts the one where the vehicle starts is its fence. What obstacles enclose is out of reach, and excluded.
    """
    who = mission.vehicle(vehicle)
    parts = list(mission.site.operating.geoms)
    start = shapely.Point(who.start)
    inclusion = min(parts, key=lambda part: part.distance(start))
    blocking = [o.polygon for o in mission.site.obstacles if who.domain in o.blocks]
    holes = [Polygon(ring) for ring in inclusion.interiors]
    fence = Polygon(inclusion.exterior)
    merged = unary_union([*blocking, *holes]).intersection(fence) if blocking or holes else Polygon()
    found = [Polygon(p.exterior) for p in getattr(merged, "geoms", [merged]) if isinstance(p, Polygon) and p.area > 0]
    return fence, sorted(found, key=lambda p: p.bounds)
