"""GPX 1.1 routes: what chart plotters, OpenCPN and hand-held receivers read; one file a vehicle and one of the fleet.

GPX has no place for speeds, holds or heights above ground: they are told in each point's description.
"""

import gpxpy.gpx

from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.places import degrees, distinct, file_stems, printable
from quarterdeck.mission.mission import Mission, Route, Waypoint


def files(mission: Mission, settings: Settings) -> dict[str, str]:  # noqa: ARG001 - no autopilot reads it
    """Return `<vehicle>.gpx` for each vehicle and `<mission>.gpx` with all routes."""
    fleet, stems = file_stems(mission)
    made = {f"{stems[route.vehicle]}.gpx": _document(mission, [route]) for route in mission.routes}
    return made | {f"{fleet}.gpx": _document(mission, list(mission.routes))}


def _document(mission: Mission, routes: list[Route]) -> str:
    gpx = gpxpy.gpx.GPX()
    gpx.creator = "Quarterdeck"
    gpx.name = printable(mission.name)
    for route in routes:
        made = gpxpy.gpx.GPXRoute(name=printable(route.vehicle))
        numbers = distinct(route)
        for number, (lon, lat) in zip(numbers, degrees(mission.frame, route.xyz[numbers, :2]), strict=True):
            waypoint = route.waypoints[number]
            name = printable(waypoint.task) if waypoint.task else f"{printable(route.vehicle)}-{number:03d}"
            point = gpxpy.gpx.GPXRoutePoint(lat, lon, name=name, description=_words(waypoint))
            point.type = waypoint.leg
            made.points.append(point)
        gpx.routes.append(made)
    return str(gpx.to_xml(version="1.1")) + "\n"


def _words(waypoint: Waypoint) -> str:
    words = [f"{waypoint.leg} at {waypoint.speed:.2f} m/s"] if waypoint.speed else [waypoint.leg]
    words += [f"{waypoint.z:g} m above ground"] if waypoint.z else []
    words += [f"hold {waypoint.hold:.0f} s"] if waypoint.hold else []
    return ", ".join(words)
