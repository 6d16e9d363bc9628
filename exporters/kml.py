"""KML and KMZ for Google Earth and QGIS: one file of the fleet, a folder a vehicle; heights are above ground."""

import io
import zipfile
from itertools import groupby

import numpy as np
import shapely
import simplekml

from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.places import degrees, file_stems, printable
from quarterdeck.geo.palette import FILL, SITE, colours
from quarterdeck.mission.mission import Mission, Route


def files(mission: Mission, settings: Settings, *, packed: bool = False) -> dict[str, str | bytes]:  # noqa: ARG001
    """Return `<mission>.kml`, or `<mission>.kmz`, the same zipped."""
    fleet, _ = file_stems(mission)
    text = _document(mission)
    return {f"{fleet}.kmz": _zipped(text)} if packed else {f"{fleet}.kml": text}


def _document(mission: Mission) -> str:
    simplekml.Kml.resetidcounter()  # ids count on through a process: the same mission must give the same bytes
    kml = simplekml.Kml(name=printable(mission.name))
    site = kml.newfolder(name="site")
    for name, polygon, role in (
        *((f"area {a.id}", a.polygon, "area") for a in mission.site.areas),
        ("operating area", mission.site.operating, "operating"),
        *((f"obstacle {o.id}", o.polygon, "obstacle") for o in mission.site.obstacles),
    ):
        for part in getattr(polygon, "geoms", [polygon]):
            made = site.newpolygon(
                name=printable(name),
                outerboundaryis=_ring(mission, part.exterior),
                innerboundaryis=[_ring(mission, ring) for ring in part.interiors],
            )
            made.style.linestyle.color = _abgr(SITE[role], 255)
            made.style.polystyle.color = _abgr(SITE[role], round(255 * FILL[role]))
    for route, colour in zip(mission.routes, colours(len(mission.routes)), strict=True):
        _route(kml.newfolder(name=printable(route.vehicle)), mission, route, colour)
    return str(kml.kml())


def _route(folder: simplekml.Folder, mission: Mission, route: Route, colour: str) -> None:
    places = degrees(mission.frame, route.xyz[:, :2])
    coordinates = np.column_stack([places, np.round(route.xyz[:, 2], 3)]).tolist()
    flies = mission.vehicle(route.vehicle).domain == "aerial"
    mode = simplekml.AltitudeMode.relativetoground if flies else simplekml.AltitudeMode.clamptoground
    covers = route.survey
    runs = groupby(range(1, len(coordinates)), key=lambda i: bool(covers[i]))
    for number, (survey, run) in enumerate(runs, 1):
        ends = list(run)
        kind = "survey" if survey else "transit"
        line = folder.newlinestring(name=f"{printable(route.vehicle)} {number} {kind}", altitudemode=mode)
        line.coords = [tuple(coordinates[i]) for i in (ends[0] - 1, *ends)]
        line.tessellate = 1
        line.style.linestyle.color = _abgr(colour, 255 if survey else 150)
        line.style.linestyle.width = 3 if survey else 1.5
    start = folder.newpoint(name=f"{printable(route.vehicle)} start", coords=[tuple(places[0].tolist())])
    start.style.iconstyle.color = _abgr(colour, 255)


def _ring(mission: Mission, ring: shapely.LinearRing) -> list[tuple[float, ...]]:
    return [tuple(place) for place in degrees(mission.frame, np.asarray(ring.coords)[:, :2]).tolist()]


def _abgr(colour: str, alpha: int) -> str:
    return f"{alpha:02x}{colour[5:7]}{colour[3:5]}{colour[1:3]}"


def _zipped(text: str) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        entry = zipfile.ZipInfo("doc.kml", date_time=(1980, 1, 1, 0, 0, 0))  # no clock in our files
        entry.compress_type = zipfile.ZIP_DEFLATED
        archive.writestr(entry, text)
    return buffer.getvalue()
