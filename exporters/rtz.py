"""RTZ route exchange (IEC 61174 Annex S; CIRM's schemas 1.0, 1.1 and 1.2): what an ECDIS reads, a file a vessel.

A leg belongs to the waypoint that it ends at, so the first has none. Beyond the schema readers want the file's name to be
the route's, and no more than 400 kB: longer routes are split, each part beginning where the one before ended.

A schedule has the planned speed of each leg and the stay at each waypoint; its times of arrival and departure are dates in
the standard, so that they are there only where it is said when the mission begins.
"""

from datetime import datetime, timedelta

from lxml import etree

from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.places import degrees, distinct, file_stems, printable
from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.mission import Mission, Route, Waypoint

NAUTICAL_MILE, KNOT = 1852.0, 1852.0 / 3600.0
MOST_BYTES = 400_000
DAY = 86_400  # s: no longer stay can be said in version 1.0
WIDEST = {"1.0": 9.9, "1.1": 5.0, "1.2": 5.0}  # NM: greatest turn radius that the schema allows


def files(mission: Mission, settings: Settings, *, version: str) -> dict[str, bytes]:
    """Return `<vessel>.rtz` for each surface vehicle, or `<vessel>_1.rtz` and on where one would be too large.

    Versions other than 1.0 are named `<vessel>_v1.1.rtz`.
    """
    _, stems = file_stems(mission)
    made: dict[str, bytes] = {}
    for route in mission.routes:
        vehicle = mission.vehicle(route.vehicle)
        stem = stems[route.vehicle] + ("" if version == "1.0" else f"_v{version}")
        numbers = distinct(route)
        if vehicle.domain != "surface" or len(numbers) < 2:
            why = "is no vessel" if vehicle.domain != "surface" else "does not move"
            settings.tell(f"rtz: {route.vehicle} {why} and gets no route")
            continue
        whole = _document(mission, vehicle, route, numbers, stem, version, settings.depart)
        parts = -(-len(whole) // (MOST_BYTES - 10_000))
        if parts == 1:
            made[f"{stem}.rtz"] = whole
            continue
        settings.tell(f"rtz: {route.vehicle} is split into {parts} files, none above 400 kB")
        size = -(-len(numbers) // parts)
        for part in range(parts):
            name = f"{stem}_{part + 1}"
            some = numbers[max(part * size - 1, 0) : (part + 1) * size]
            made[f"{name}.rtz"] = _document(mission, vehicle, route, some, name, version, settings.depart)
    return made


def _document(
    mission: Mission, vehicle: Vehicle, route: Route, numbers: list[int], name: str, version: str, depart: datetime | None
) -> bytes:
    namespace = f"http://www.cirm.org/RTZ/{version.replace('.', '/')}"
    root = etree.Element(f"{{{namespace}}}route", nsmap={None: namespace}, version=version)
    etree.SubElement(root, f"{{{namespace}}}routeInfo", routeName=name, vesselName=printable(vehicle.id))
    waypoints = etree.SubElement(root, f"{{{namespace}}}waypoints")
    radius = min(vehicle.turn_radius / NAUTICAL_MILE, WIDEST[version])
    for number, (lon, lat) in zip(numbers, degrees(mission.frame, route.xyz[numbers, :2]), strict=True):
        made = etree.SubElement(
            waypoints, f"{{{namespace}}}waypoint", id=str(number), name=_name(route.waypoints[number], number)
        )
        if version == "1.2":
            made.set("revision", "0")
        if radius > 0:
            made.set("radius", f"{radius:.5f}")
        etree.SubElement(made, f"{{{namespace}}}position", lat=f"{lat:.8f}", lon=f"{lon:.8f}")
        if number != numbers[0]:
            etree.SubElement(made, f"{{{namespace}}}leg", _leg(mission, vehicle, route.waypoints[number]))
    root.append(_schedule(route, numbers, version, namespace, depart))
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _schedule(route: Route, numbers: list[int], version: str, namespace: str, depart: datetime | None) -> etree._Element:
    """The one schedule of a route: 1.0 misspells its elements and gives a stay as the time of a day."""
    schedules = etree.Element(f"{{{namespace}}}schedules")
    schedule = etree.SubElement(schedules, f"{{{namespace}}}schedule", id="1", name="planned")
    manual = etree.SubElement(schedule, f"{{{namespace}}}manual")
    kind = "sheduleElement" if version == "1.0" else "scheduleElement"
    for number in numbers:
        waypoint = route.waypoints[number]
        made = etree.SubElement(manual, f"{{{namespace}}}{kind}", waypointId=str(number))
        if depart is not None and number != numbers[-1]:
            made.set("etd", _utc(depart, waypoint.time + waypoint.hold))
        if depart is not None and number != numbers[0]:
            made.set("eta", _utc(depart, waypoint.time))
        if (stay := round(waypoint.hold)) and (version != "1.0" or stay < DAY):
            clock = f"{stay // 3600:02d}:{stay // 60 % 60:02d}:{stay % 60:02d}"
            made.set("stay", clock if version == "1.0" else f"PT{stay}S")
        if waypoint.speed > 0 and number != numbers[0]:
            made.set("speed", f"{waypoint.speed / KNOT:.3f}")
    return schedules


def _utc(depart: datetime, seconds: float) -> str:
    return (depart + timedelta(seconds=round(seconds))).strftime("%Y-%m-%dT%H:%M:%SZ")


def _name(waypoint: Waypoint, number: int) -> str:
    return printable(waypoint.task) if waypoint.task else f"{waypoint.leg}-{number}"


def _leg(mission: Mission, vehicle: Vehicle, waypoint: Waypoint) -> dict[str, str]:
    """Loxodrome, for a survey line holds its course; cross-track limits from the clearance, or half the spacing."""
    limits = [x for x in (vehicle.clearance, mission.spacing / 2 if mission.spacing else 0.0) if x > 0]
    leg: dict[str, str] = {}
    if limits:
        aside = f"{min(min(limits) / NAUTICAL_MILE, 9.9):.5f}"
        leg |= {"starboardXTD": aside, "portsideXTD": aside}
    leg["geometryType"] = "Loxodrome"
    if waypoint.speed > 0:
        leg["speedMax"] = f"{waypoint.speed / KNOT:.3f}"
    return leg
