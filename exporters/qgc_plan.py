"""QGroundControl's .plan: mission, geofence and rally points in one JSON file a vehicle.

Only SimpleItems are written: every version of QGroundControl and MAVSDK reads them. Geofence and rally points are of
version 2: version 1 is silently ignored by QGroundControl and refused by MAVSDK, as is a plan without them.
"""

import json
from typing import Any

import numpy as np
from shapely import Polygon

from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.fence import fence_polygons
from quarterdeck.exporters.mavlink import FRAMES, GLOBAL, RELATIVE, TERRAIN, Item, home_ground, mission_items, tell_limits
from quarterdeck.exporters.places import degrees, file_stems
from quarterdeck.geo.frame import Frame
from quarterdeck.mission.mission import Mission, Route

FIRMWARE = {"ardupilot": 3, "px4": 12}  # MAV_AUTOPILOT
KIND = {"aerial": 2, "ground": 10, "surface": 11}  # MAV_TYPE
MODES = {RELATIVE: 1, GLOBAL: 2, TERRAIN: 4}  # QGroundControlQmlGlobal::AltMode


def files(mission: Mission, settings: Settings) -> dict[str, str]:
    """Return `<vehicle>.plan` for each vehicle."""
    tell_limits(mission, settings)
    _, stems = file_stems(mission)
    return {
        f"{stems[route.vehicle]}.plan": json.dumps(_plan(mission, route, settings), indent=1, allow_nan=False) + "\n"
        for route in mission.routes
    }


def _plan(mission: Mission, route: Route, settings: Settings) -> dict[str, Any]:
    vehicle = mission.vehicle(route.vehicle)
    lon, lat = degrees(mission.frame, route.xyz[:1, :2])[0].tolist()
    inclusion, exclusions = fence_polygons(mission, route.vehicle, settings)
    items = mission_items(mission, route, settings)
    return {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": {
            "version": 2,
            "firmwareType": FIRMWARE[settings.autopilot],
            "vehicleType": KIND[vehicle.domain],
            "globalPlanAltitudeMode": MODES[FRAMES[settings.altitude]],
            "cruiseSpeed": vehicle.speed,
            "hoverSpeed": vehicle.speed,
            "plannedHomePosition": [lat, lon, home_ground(route, settings)],
            "items": [_item(item, number) for number, item in enumerate(items, 1)],
        },
        "geoFence": {
            "version": 2,
            "circles": [],
            "polygons": [
                _polygon(mission.frame, inclusion, inside=True),
                *(_polygon(mission.frame, polygon, inside=False) for polygon in exclusions),
            ],
        },
        "rallyPoints": {"version": 2, "points": [[lat, lon, vehicle.altitude]]},
    }


def _item(item: Item, number: int) -> dict[str, Any]:
    made: dict[str, Any] = {
        "type": "SimpleItem",
        "command": item.command,
        "frame": item.frame,
        "autoContinue": True,
        "doJumpId": number,
        "params": [*item.p, round(float(item.lat), 8), round(float(item.lon), 8), float(item.z)],
    }
    if item.frame in MODES:
        made |= {"AltitudeMode": MODES[item.frame], "Altitude": float(item.z), "AMSLAltAboveTerrain": None}
    return made


def _polygon(frame: Frame, polygon: Polygon, *, inside: bool) -> dict[str, Any]:
    lonlat = degrees(frame, np.asarray(polygon.exterior.coords)[:-1])
    return {"version": 1, "inclusion": inside, "polygon": lonlat[:, ::-1].tolist()}
