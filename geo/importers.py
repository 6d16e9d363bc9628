"""Other people's files as a site's GeoJSON: KML and KMZ, QGroundControl's .plan, GPX.

What a shape is for is told by its name, or its folder's, where the format has no word for it. Routes and tracks are not
read: a site says what is to be done, not how.
"""

import io
import json
import re
import zipfile
import zlib
from typing import Any

import numpy as np
from lxml import etree

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame

LARGEST_CIRCLE = 1e6  # m; a site is smaller
MOST_BYTES = 50_000_000  # of a KMZ unpacked
_OBSTACLE = re.compile(r"obstacle|no[- ]?(go|fly|entry)|exclusion|exclude|keep[- ]?out|restricted|hole", re.IGNORECASE)
_OPERATING = re.compile(r"operating|geo-?fence|\bfence\b|boundary", re.IGNORECASE)
_START = re.compile(r"\b(start|launch|home|take-?off)\b", re.IGNORECASE)
_DOMAINS = {10: "ground", 11: "surface"}  # MAV_TYPE; all others fly

Ring = list[list[float]]


def as_geojson(data: bytes) -> bytes:
    """Return the file's bytes as GeoJSON; what is no KML, KMZ, GPX or .plan comes back as it is.

    Raises InputError if it is one of these and cannot be read, or has nothing to plan in it.
    """
    head = data[:4096].lstrip(b"\xef\xbb\xbf \t\r\n")
    if data[:2] == b"PK":
        return _features(_kml(_unpacked(data)), "KMZ")
    if head.startswith(b"<"):
        root = _xml(data)
        kind = etree.QName(root).localname
        if kind == "kml":
            return _features(_kml(root), "KML")
        if kind == "gpx":
            return _features(_gpx(root), "GPX")
        raise InputError(f"is XML of the kind <{kind}>; give GeoJSON, KML, GPX or a .plan")
    if b'"fileType"' in data[:100_000] and head.startswith(b"{"):
        try:
            document = json.loads(data)
        except ValueError:
            return data  # the reader of GeoJSON says what is wrong and where
        if isinstance(document, dict) and document.get("fileType") == "Plan":
            try:
                return _features(_plan(document), ".plan")
            except (KeyError, TypeError, ValueError, OverflowError, IndexError, AttributeError) as error:
                raise InputError(f"is a damaged .plan ({type(error).__name__}: {error})") from None
    return data


def _features(features: list[dict[str, Any]], kind: str) -> bytes:
    if not features:
        raise InputError(f"the {kind} file has no polygon to be an area and no point to be a task")
    taken: dict[tuple[str, str], int] = {}
    for feature in features:
        role, name = feature["properties"]["role"], feature["id"]
        count = taken[role, name] = taken.get((role, name), 0) + 1
        if count > 1:
            feature["id"] = f"{name}-{count}"
    return json.dumps({"type": "FeatureCollection", "features": features}, ensure_ascii=False).encode()


def _feature(role: str, name: str, kind: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "id": name or role, "properties": {"role": role} | properties, "geometry": geometry}


def _xml(data: bytes) -> Any:
    try:
        return etree.fromstring(data, etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=False))
    except etree.XMLSyntaxError as error:
        raise InputError(f"is no sound XML: {' '.join(str(error.msg).split())}") from None


def _unpacked(data: bytes) -> Any:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = [e for e in archive.infolist() if e.filename.lower().endswith(".kml")]
            if not entries:
                raise InputError("is a zip file without a .kml in it; give a KMZ")
            if entries[0].file_size > MOST_BYTES:
                raise InputError(f"unpacks to more than {MOST_BYTES // 1_000_000} MB; give a smaller KMZ")
            return _xml(archive.read(entries[0]))
    except InputError:
        raise
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OSError, ValueError) as error:
        raise InputError(f"is a damaged KMZ ({error})") from None


def _kml(root: Any) -> list[dict[str, Any]]:
    """Polygons are areas, points are tasks, unless their name or folder says obstacle, fence or start."""
    found = []
    for placemark in root.iter("{*}Placemark"):
        folders = [f.findtext("{*}name") or "" for f in placemark.iterancestors("{*}Folder")]
        name = (placemark.findtext("{*}name") or "").strip()
        words = " ".join([name, *folders])
        for polygon in placemark.iter("{*}Polygon"):
            rings = [_places(ring) for ring in polygon.iterfind("{*}outerBoundaryIs//{*}coordinates")]
            rings += [_places(ring) for ring in polygon.iterfind("{*}innerBoundaryIs//{*}coordinates")]
            role = "obstacle" if _OBSTACLE.search(words) else "operating" if _OPERATING.search(words) else "area"
            found.append(_feature(role, name, "Polygon", rings))
        for point in placemark.iterfind("{*}Point/{*}coordinates"):
            role = "vehicle" if _START.search(words) else "task"
            own = re.sub(r"\s*\bstart$", "", name) if role == "vehicle" else name
            found.append(_feature(role, own, "Point", _places(point)[0]))
    return found


def _places(element: Any) -> Ring:
    try:
        places = [[float(part) for part in place.split(",")][:2] for place in (element.text or "").split()]
    except ValueError:
        raise InputError(f"line {element.sourceline}: a coordinate is not a number") from None
    if not places or any(len(place) < 2 for place in places):
        raise InputError(f"line {element.sourceline}: a coordinate lacks its latitude")
    return places


def _gpx(root: Any) -> list[dict[str, Any]]:
    found = []
    for point in [*root.iter("{*}wpt"), *root.iter("{*}rtept")]:
        try:
            place = [float(point.get("lon")), float(point.get("lat"))]
        except (TypeError, ValueError):
            raise InputError(f"line {point.sourceline}: a point without lon and lat in degrees") from None
        found.append(_feature("task", (point.findtext("{*}name") or "").strip(), "Point", place))
    return found


def _plan(document: dict[str, Any]) -> list[dict[str, Any]]:
    """Survey polygons are areas, or else the fence is; inclusion is the operating area, exclusion obstacles."""
    mission, fence = document["mission"], document.get("geoFence") or {}
    found = []
    for item in mission.get("items", []):
        if item.get("complexItemType") == "survey":
            spacing = item.get("TransectStyleComplexItem", {}).get("CameraCalc", {}).get("AdjustedFootprintSide")
            extra = {"spacing": spacing} if isinstance(spacing, int | float) and spacing > 0 else {}
            found.append(_feature("area", "survey", "Polygon", [_ring(item["polygon"])], **extra))
    for polygon in fence.get("polygons", []):
        role = "operating" if polygon["inclusion"] else "obstacle"
        found.append(
            _feature(role, "fence" if polygon["inclusion"] else "exclusion", "Polygon", [_ring(polygon["polygon"])])
        )
    for circle in fence.get("circles", []):
        role = "operating" if circle["inclusion"] else "obstacle"
        lat, lon = circle["circle"]["center"][:2]
        ring = _circle(lat, lon, circle["circle"]["radius"])
        found.append(_feature(role, "fence" if circle["inclusion"] else "exclusion", "Polygon", [ring]))
    fences = [f for f in found if f["properties"]["role"] == "operating"]
    if fences and not any(f["properties"]["role"] == "area" for f in found):
        found += [_feature("area", "fence", "Polygon", f["geometry"]["coordinates"]) for f in fences]
    if found and isinstance(mission.get("plannedHomePosition"), list):
        lat, lon = mission["plannedHomePosition"][:2]
        domain = _DOMAINS.get(mission.get("vehicleType", 2), "aerial")
        found.append(_feature("vehicle", "vehicle-1", "Point", [lon, lat], domain=domain))
    return found


def _ring(corners: list[list[float]]) -> Ring:
    """QGroundControl's rings are latitude first and open."""
    return [[lon, lat] for lat, lon in (*corners, corners[0])]


def _circle(lat: float, lon: float, radius: float) -> Ring:
    if not (abs(lat) <= 90 and abs(lon) <= 180 and 0 < radius <= LARGEST_CIRCLE):
        raise ValueError(f"a circle of {radius:.6g} m about {lat:.6g}, {lon:.6g}")
    angles = np.append(np.arange(64) * (2 * np.pi / 64), 0.0)
    # Around the circle, not in it: what is excluded stays excluded.
    xy = radius / np.cos(np.pi / 64) * np.column_stack([np.cos(angles), np.sin(angles)])
    return Frame(float(lon), float(lat)).to_degrees(xy).round(9).tolist()
