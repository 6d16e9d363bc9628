"""The geofence of a vehicle: where it may be, and the no-go zones in there, as much as its board holds."""

import numpy as np
import shapely
from shapely import LineString, Polygon
from shapely.ops import unary_union

from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.limits import board, fence_fits
from quarterdeck.mission.mission import Mission

STEPS = np.geomspace(0.05, 100.0, 34)  # m by which borders are moved, until the board holds the fence


def fence_polygons(mission: Mission, vehicle: str, settings: Settings) -> tuple[Polygon, list[Polygon]]:
    """Return the inclusion polygon and the exclusion polygons, without holes and not touching, for a vehicle's id.

    An autopilot takes several inclusion polygons to mean that a vehicle must be in all of them, so of an operating area in
    several parts the one where the vehicle starts is its fence. What obstacles enclose is out of reach, and excluded.
    Where the board does not hold all vertices the inclusion shrinks and exclusions grow until it does, and that is told;
    so it is where that cannot be, for the route would be outside.
    """
    who = mission.vehicle(vehicle)
    exact = _exact(mission, vehicle)
    if fence_fits([exact[0], *exact[1]], who.domain, settings):
        return exact
    xy = next(r for r in mission.routes if r.vehicle == vehicle).xyz[:, :2]
    way = LineString(xy) if len(xy) > 1 else shapely.Point(who.start)
    count = sum(len(p.exterior.coords) - 1 for p in (exact[0], *exact[1]))
    head = f"{vehicle}: its fence has {count} vertices, more than {board(settings)} holds"
    for step in STEPS.tolist():
        inclusion, exclusions = _coarser(*exact, step)
        if not inclusion.covers(way) or any(p.intersects(way) for p in exclusions):
            break
        safe = exact[0].covers(inclusion) and all(any(p.covers(e) for p in exclusions) for e in exact[1])
        if safe and fence_fits([inclusion, *exclusions], who.domain, settings):
            fewer = sum(len(p.exterior.coords) - 1 for p in (inclusion, *exclusions))
            settings.tell(f"{head}: it is written with {fewer}, its borders moved inwards by at most {2 * step:.1f} m")
            return inclusion, exclusions
    settings.tell(f"{head}, and cannot be made simpler without shutting its route out; draw simpler areas and obstacles")
    return exact


def _exact(mission: Mission, vehicle: str) -> tuple[Polygon, list[Polygon]]:
    who = mission.vehicle(vehicle)
    start = shapely.Point(who.start)
    inclusion = min(mission.site.operating.geoms, key=lambda part: part.distance(start))
    blocking = [o.polygon for o in mission.site.obstacles if who.domain in o.blocks]
    holes = [Polygon(ring) for ring in inclusion.interiors]
    fence = Polygon(inclusion.exterior)
    merged = unary_union([*blocking, *holes]).intersection(fence) if blocking or holes else Polygon()
    return fence, _solid(merged)


def _coarser(inclusion: Polygon, exclusions: list[Polygon], step: float) -> tuple[Polygon, list[Polygon]]:
    """Fewer vertices: borders moved `step` metres to the safe side, then simplified by no more."""
    inner = inclusion.buffer(-step, quad_segs=4).simplify(0.9 * step)
    inner = max(getattr(inner, "geoms", [inner]), key=lambda p: p.area)
    outer = unary_union([p.buffer(step, quad_segs=4).simplify(0.9 * step) for p in exclusions])
    return Polygon(inner.exterior), _solid(outer)


def _solid(shape: shapely.Geometry) -> list[Polygon]:
    found = [Polygon(p.exterior) for p in getattr(shape, "geoms", [shape]) if isinstance(p, Polygon) and p.area > 0]
    return sorted(found, key=lambda p: p.bounds)
