"""Nav2's GPS waypoints (navigation2_tutorials, nav2_gps_waypoint_follower_demo): a YAML file a vehicle that does not fly.

`yaw` is radians counter-clockwise from east, the heading on arrival; speeds and waits are Nav2's own parameters.
"""

import json

import numpy as np

from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.places import degrees, distinct, file_stems
from quarterdeck.mission.mission import Mission, Route


def files(mission: Mission, settings: Settings) -> dict[str, str]:
    """Return `<vehicle>.yaml` for each vehicle on land or water."""
    _, stems = file_stems(mission)
    made = {}
    for route in mission.routes:
        if mission.vehicle(route.vehicle).domain == "aerial":
            settings.tell(f"nav2: {route.vehicle} flies and gets no waypoints")
            continue
        if any(w.hold > 0 for w in route.waypoints):
            settings.tell(f"nav2: {route.vehicle}: the times it waits are not carried; set waypoint_pause_duration")
        made[f"{stems[route.vehicle]}.yaml"] = _waypoints(mission, route)
    return made


def _waypoints(mission: Mission, route: Route) -> str:
    numbers = distinct(route)
    xy = route.xyz[numbers, :2]
    step = np.diff(xy, axis=0)
    yaw = np.arctan2(step[:, 1], step[:, 0])
    rows = [f"# {json.dumps(route.vehicle)}", "waypoints:"]
    for (lon, lat), heading in zip(degrees(mission.frame, xy)[1:], yaw, strict=True):
        rows += [f"- latitude: {lat:.8f}", f"  longitude: {lon:.8f}", f"  yaw: {heading:.5f}"]
    return "\n".join(rows if len(yaw) else [*rows[:1], "waypoints: []"]) + "\n"
