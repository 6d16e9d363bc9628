"""KML and KMZ for Google Earth and QGIS: one file of the fleet, a folder a vehicle; heights are above ground.

Elements stand in the order that OGC's schema of KML 2.2 wants: styles before shapes, names before all.
"""

import io
import zipfile
from itertools import groupby

import numpy as np
from lxml import etree

from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.places import degrees, file_stems, printable
from quarterdeck.geo.palette import FILL, SITE
from quarterdeck.mission.layers import fleet_colours
from quarterdeck.mission.mission import Mission, Route

SPACE = "http://www.opengis.net/kml/2.2"


def files(mission: Mission, settings: Settings, *, packed: bool = False) -> dict[str, str | bytes]:  # noqa: ARG001
    """Return `<mission>.kml`, or `<mission>.kmz`, the same zipped."""
    fleet, _ = file_stems(mission)
    text = _document(mission)
    return {f"{fleet}.kmz": _zipped(text)} if packed else {f"{fleet}.kml": text}


def _document(mission: Mission) -> str:
    root = etree.Element(f"{{{SPACE}}}kml", nsmap={None: SPACE})
    document = _add(root, "Document")
    _add(document, "name", printable(mission.name))
    site = _add(document, "Folder")
    _add(site, "name", "site")
    for name, shape, role in (
        *((f"area {a.id}", a.polygon, "area") for a in mission.site.areas),
        ("operating area", mission.site.operating, "operating"),
        *((f"obstacle {o.id}", o.polygon, "obstacle") for o in mission.site.obstacles),
    ):
        for part in getattr(shape, "geoms", [shape]):
            placemark = _placemark(site, name)
            style = _add(placemark, "Style")
            _add(_add(style, "LineStyle"), "color", _abgr(SITE[role], 255))
            _add(_add(style, "PolyStyle"), "color", _abgr(SITE[role], round(255 * FILL[role])))
            polygon = _add(placemark, "Polygon")
            for side, ring in (("outer", part.exterior), *(("inner", r) for r in part.interiors)):
                linear = _add(_add(polygon, f"{side}BoundaryIs"), "LinearRing")
                _add(linear, "coordinates", _text(degrees(mission.frame, np.asarray(ring.coords)[:, :2])))
    palette = fleet_colours(mission)
    for route in mission.routes:
        folder = _add(document, "Folder")
        _add(folder, "name", printable(route.vehicle))
        _route(folder, mission, route, palette[route.vehicle])
    return str(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True), "utf-8")


def _route(folder: etree._Element, mission: Mission, route: Route, colour: str) -> None:
    places = np.column_stack([degrees(mission.frame, route.xyz[:, :2]), np.round(route.xyz[:, 2], 3)])
    mode = "relativeToGround" if mission.vehicle(route.vehicle).domain == "aerial" else "clampToGround"
    covers = route.survey
    runs = groupby(range(1, len(places)), key=lambda i: bool(covers[i]))
    for number, (survey, run) in enumerate(runs, 1):
        ends = list(run)
        placemark = _placemark(folder, f"{route.vehicle} {number} {'survey' if survey else 'transit'}")
        style = _add(_add(placemark, "Style"), "LineStyle")
        _add(style, "color", _abgr(colour, 255 if survey else 150))
        _add(style, "width", "3" if survey else "1.5")
        line = _add(placemark, "LineString")
        _add(line, "tessellate", "1")
        _add(line, "altitudeMode", mode)
        _add(line, "coordinates", _text(places[[ends[0] - 1, *ends]]))
    start = _placemark(folder, f"{route.vehicle} start")
    _add(_add(_add(start, "Style"), "IconStyle"), "color", _abgr(colour, 255))
    _add(_add(start, "Point"), "coordinates", _text(places[:1, :2]))


def _placemark(folder: etree._Element, name: str) -> etree._Element:
    made = _add(folder, "Placemark")
    _add(made, "name", printable(name))
    return made


def _add(parent: etree._Element, tag: str, text: str | None = None) -> etree._Element:
    made = etree.SubElement(parent, f"{{{SPACE}}}{tag}")
    made.text = text
    return made


def _text(places: np.ndarray) -> str:
    return " ".join(",".join(f"{value:.8f}".rstrip("0").rstrip(".") for value in place) for place in places.tolist())


def _abgr(colour: str, alpha: int) -> str:
    return f"{alpha:02x}{colour[5:7]}{colour[3:5]}{colour[1:3]}"


def _zipped(text: str) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        entry = zipfile.ZipInfo("doc.kml", date_time=(1980, 1, 1, 0, 0, 0))  # no clock in our files
        entry.compress_type = zipfile.ZIP_DEFLATED
        archive.writestr(entry, text)
    return buffer.getvalue()
