"""Whether a guards plan sees what it says: found anew from the plan alone, by shadows instead of a triangulation."""

import numpy as np
import shapely

from quarterdeck.coverage.guards.certificate import TOLERANCE, uncovered_by_shadows
from quarterdeck.coverage.guards.space import border_of
from quarterdeck.geo.scenario import as_multipolygon
from quarterdeck.mission.mission import Mission

ROUNDING = 2e-4  # m: a PLAN holds positions to 0.1 mm; what is thinner than twice this is no gap
NEAR = 0.01  # m: a route passes a guard that is so near to a waypoint with its name


def unproved(mission: Mission) -> list[str]:
    """Return what is wrong with the coverage of a guards plan, a line each: stops that no route makes, and unseen area."""
    if mission.method != "guards":
        return []
    places = np.array([(g.x, g.y) for g in mission.guards], dtype=float).reshape(-1, 2)
    stops = {w.task: (r.vehicle, w.x, w.y) for r in mission.routes for w in r.waypoints if w.task}
    problems, proved = [], []
    for i, guard in enumerate(mission.guards):
        vehicle, x, y = stops.get(f"guard-{i}", (None, np.inf, np.inf))
        if guard.seen or (vehicle == guard.vehicle and np.hypot(*(places[i] - (x, y))) < NEAR):
            proved.append(i)
        elif guard.vehicle is not None:
            problems.append(f"{guard.vehicle}: does not pass guard-{i}")
    site = mission.site
    blocking = [o.polygon for o in site.obstacles if any(v.domain in o.blocks for v in mission.vehicles)]
    sight = as_multipolygon(shapely.union(site.area, site.operating).difference(shapely.union_all(blocking)))
    target = border_of(site.coverable) if mission.parameters.get("inspect") == "border" else site.coverable
    ranges = np.array([mission.guards[i].range for i in proved], dtype=float)
    rest = uncovered_by_shadows(target, sight, places[proved], ranges)
    gaps = as_multipolygon(rest.buffer(-ROUNDING).buffer(ROUNDING))
    if gaps.area > TOLERANCE * target.area and mission.feasible:
        x, y = shapely.get_coordinates(shapely.point_on_surface(gaps))[0]
        lon, lat = mission.frame.to_degrees(np.array([[x, y]]))[0]
        problems.append(f"{gaps.area:.6g} m2 are in no guard's view, such as {lon:.6f}, {lat:.6f}")
    return problems
