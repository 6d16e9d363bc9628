"""MOOS-IvP: a behaviour file for each vehicle, and the origin that its metres count from.

MOOSGeodesy turns degrees into metres by the origin's UTM zone, less the origin: that is not this mission's frame (true
scale, north up at its centre) but turned and scaled against it, by metres in a kilometre far from the zone's meridian. So
metres are made anew, as MOOS will read them.
"""

from functools import cache

import numpy as np
from pyproj import Transformer

from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.mavlink import acceptance_radius
from quarterdeck.exporters.places import distinct, file_stems, printable
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.mission import Mission, Route

POINTS_A_LINE = 50


def files(mission: Mission, settings: Settings) -> dict[str, str]:
    """Return `<vehicle>.bhv` for each vehicle that does not fly, and `<mission>.moos` with the origin to be included."""
    fleet, stems = file_stems(mission)
    origin = f"LatOrigin  = {mission.frame.lat:.9f}\nLongOrigin = {mission.frame.lon:.9f}\n"
    note = "// The origin of the metres in the .bhv files: put it into every vehicle's and the shore's .moos file.\n"
    made = {f"{fleet}.moos": note + origin}
    for route in mission.routes:
        vehicle = mission.vehicle(route.vehicle)
        if vehicle.domain == "aerial":
            settings.tell(f"moos: {route.vehicle} flies and gets no behaviour file")
            continue
        made[f"{stems[route.vehicle]}.bhv"] = _behaviours(mission, vehicle, route, origin)
    return made


def local_metres(frame: Frame, xy: np.ndarray) -> np.ndarray:
    """Return (n, 2) metres east and north of the frame's origin as MOOSGeodesy's LatLong2LocalUTM counts them."""
    zone = int((frame.lon + 180.0) % 360.0 // 6.0) + 1
    south = " +south" if frame.lat < 0 else ""
    utm = _utm(f"+proj=utm +zone={zone}{south} +ellps=WGS84 +units=m +no_defs")
    lonlat = frame.to_degrees(xy)
    east, north = utm.transform(lonlat[:, 0], lonlat[:, 1])
    east0, north0 = utm.transform(frame.lon, frame.lat)
    return np.column_stack([east - east0, north - north0])


@cache
def _utm(crs: str) -> Transformer:
    return Transformer.from_crs("EPSG:4326", crs, always_xy=True)


def _behaviours(mission: Mission, vehicle: Vehicle, route: Route, origin: str) -> str:
    """One waypoint behaviour for each run of one speed without a wait, one that keeps station for each wait; in a chain."""
    metres = local_metres(mission.frame, route.xyz[:, :2])
    steps: list[str] = []
    points: list[str] = []
    speed = 0.0

    def close() -> None:
        if points:
            steps.append(_waypoints(len(steps), _lines(points), speed, acceptance_radius(vehicle)))
            points.clear()

    for i in distinct(route):
        waypoint, (x, y) = route.waypoints[i], metres[i]
        if i > 0:
            if abs(waypoint.speed - speed) > 0.005:
                close()
                speed = waypoint.speed
            points.append(f"{x:.3f},{y:.3f}")
        if waypoint.hold > 0:
            close()
            steps.append(_station(len(steps), x, y, waypoint.hold))
    close()
    flag = f"initialize DEPLOY = false\ninitialize STEP   = 0\n// STEP = {len(steps)}: all is done\n"
    head = "".join(f"// {line}\n" for line in (f"{printable(mission.name)}: {printable(vehicle.id)}", *origin.splitlines()))
    return head + flag + "\n" + "\n".join(steps)


def _lines(points: list[str]) -> str:
    """All points on what the helm takes for one line: it reads 5000 characters at most, and goes on after a backslash."""
    rows = [points[i : i + POINTS_A_LINE] for i in range(0, len(points), POINTS_A_LINE)]
    return " : \\\n      ".join(" : ".join(row) for row in rows)


def _waypoints(step: int, points: str, speed: float, radius: float) -> str:
    return (
        f"Behavior = BHV_Waypoint\n{{\n  name           = route_{step}\n  pwt            = 100\n"
        f"  condition      = DEPLOY = true\n  condition      = STEP = {step}\n  endflag        = STEP = {step + 1}\n"
        f"  speed          = {speed:.3f}\n  capture_line   = true\n  capture_radius = {radius:g}\n"
        f"  slip_radius    = {3 * radius:g}\n  lead           = 8\n  lead_to_start  = true\n  order          = normal\n"
        f"  repeat         = 0\n  points         = {points}\n}}\n"
    )


def _station(step: int, x: float, y: float, seconds: float) -> str:
    return (
        f"Behavior = BHV_StationKeep\n{{\n  name           = wait_{step}\n  pwt            = 100\n"
        f"  condition      = DEPLOY = true\n  condition      = STEP = {step}\n  endflag        = STEP = {step + 1}\n"
        f"  station_pt     = {x:.3f},{y:.3f}\n  inner_radius   = 2\n  outer_radius   = 5\n  outer_speed    = 1\n"
        f"  duration       = {seconds:.0f}\n  duration_idle_decay = false\n}}\n"
    )
