"""QGC WPL 110: the text files that ArduPilot's, PX4's and most ground stations' tools load.

The strictest reader (QGroundControl) wants exactly 12 columns parted by tabs, no blank line and no comment; pymavlink
accepts `nan` and `1e-05`, Mission Planner skips short lines. So: plain decimals, LF, rows numbered without a gap.
"""

import numpy as np
from shapely import Polygon

from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.fence import fence_polygons
from quarterdeck.exporters.mavlink import (
    GLOBAL,
    RELATIVE,
    WAYPOINT,
    Item,
    home_ground,
    mission_items,
    tell_limits,
)
from quarterdeck.exporters.places import file_stems
from quarterdeck.mission.mission import Mission

INCLUSION_VERTEX, EXCLUSION_VERTEX, RALLY_POINT = 5001, 5002, 5100


def files(mission: Mission, settings: Settings) -> dict[str, str]:
    """Return each vehicle's `<vehicle>.waypoints`, and its geofence and rally point as `.fence.txt` and `.rally.txt`."""
    _, stems = file_stems(mission)
    made: dict[str, str] = {}
    tell_limits(mission, settings)
    for route in mission.routes:
        stem = stems[route.vehicle]
        lon, lat = mission.frame.to_degrees(route.xyz[:1, :2])[0]
        home = Item(WAYPOINT, GLOBAL, lat=lat, lon=lon, z=home_ground(route, settings))
        items = mission_items(mission, route, settings)
        made[f"{stem}.waypoints"] = wpl([home, *items])
        made[f"{stem}.fence.txt"] = wpl(_fence_items(mission, route.vehicle, settings))
        made[f"{stem}.rally.txt"] = wpl(
            [Item(RALLY_POINT, RELATIVE, lat=lat, lon=lon, z=mission.vehicle(route.vehicle).altitude)]
        )
    return made


def wpl(items: list[Item]) -> str:
    """Return the text of a QGC WPL 110 file; the first item is the current one."""
    rows = ["QGC WPL 110"]
    for number, item in enumerate(items):
        free = "\t".join(_decimal(value) for value in item.p)
        place = f"{item.lat:.8f}\t{item.lon:.8f}\t{item.z:.6f}"
        rows.append(f"{number}\t{int(number == 0)}\t{item.frame}\t{item.command}\t{free}\t{place}\t1")
    return "\n".join(rows) + "\n"


def _decimal(value: float) -> str:
    return f"{value:.6f}"


def _fence_items(mission: Mission, vehicle: str, settings: Settings) -> list[Item]:
    inclusion, exclusions = fence_polygons(mission, vehicle, settings)
    items = _ring(mission, inclusion, INCLUSION_VERTEX)
    for polygon in exclusions:
        items += _ring(mission, polygon, EXCLUSION_VERTEX)
    return items


def _ring(mission: Mission, polygon: Polygon, command: int) -> list[Item]:
    places = mission.frame.to_degrees(np.asarray(polygon.exterior.coords)[:-1])
    count = float(len(places))  # every vertex says how many its ring has; the ring is not closed
    return [Item(command, GLOBAL, (count, 0.0, 0.0, 0.0), lat, lon) for lon, lat in places]
