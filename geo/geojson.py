"""Reading GeoJSON text and the geometry of its features, every problem told with its place."""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from shapely import MultiLineString, MultiPolygon, Polygon, is_valid_reason, line_merge, union_all

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.files import read_bytes
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.importers import as_geojson
from quarterdeck.geo.kinds import COLLECTIONS, kind_of
from quarterdeck.geo.scenario import as_multipolygon

STDIN = "standard input"
_SURROGATE = re.compile(r"[\ud800-\udfff]")
WGS84_NAMES = ("urn:ogc:def:crs:OGC:1.3:CRS84", "urn:ogc:def:crs:OGC::CRS84", "urn:ogc:def:crs:EPSG::4326", "EPSG:4326")


@dataclass(frozen=True, slots=True)
class Document:
    """A file that has been read: its `name` for messages, its `data`, and the FeatureCollection in it, `content`."""

    name: str
    data: bytes
    content: dict[str, Any]

    @property
    def stem(self) -> str:
        """The name without folder and suffix."""
        return "site" if self.name == STDIN else Path(self.name).stem


def opened(source: str | Path | Document) -> Document:
    """Return what is in a file, or in standard input for `-`; what has been read comes back as it is.

    Raises InputError, naming the file, if it cannot be read or is none that `parse` takes.
    """
    if isinstance(source, Document):
        return source
    name, data = STDIN if str(source) == "-" else str(source), read_bytes(source)
    try:
        return Document(name, data, parse(data))
    except InputError as error:
        kind = kind_of(data)
        raise InputError(f"{name}: {error}" if kind in (None, *COLLECTIONS) else f"{name}: is {kind}") from None


def parse(data: bytes) -> dict[str, Any]:
    """Return the FeatureCollection in `data`; a single Feature becomes one, KML, KMZ, GPX and .plan are converted.

    Raises InputError if it is not JSON (RFC 8259: no NaN), not GeoJSON, or in another system than WGS84.
    """
    document = parse_json(as_geojson(data))
    if isinstance(document, dict) and document.get("type") == "Feature":
        document = {"type": "FeatureCollection", "features": [document]}
    if not isinstance(document, dict) or document.get("type") != "FeatureCollection":
        kind = document.get("type") if isinstance(document, dict) else type(document).__name__
        raise InputError(f"expected a GeoJSON FeatureCollection, found {kind!r}; export the layer as GeoJSON")
    if not isinstance(document.get("features"), list) or not document["features"]:
        raise InputError('"features" must be a list with at least one feature')
    crs = document.get("crs")
    name = crs
    if isinstance(crs, dict):
        name = crs["properties"].get("name") if isinstance(crs.get("properties"), dict) else None
    if crs is not None and name not in WGS84_NAMES:
        raise InputError(f"crs {str(name)[:60]!r} is not WGS84; export it as EPSG:4326 (longitude, latitude)")
    return document


def parse_json(data: bytes) -> Any:
    """Return the JSON in `data`. Raises InputError if it is none (RFC 8259: no NaN), or has text that no file can hold."""
    if not data.strip():
        raise InputError("is empty")
    try:
        document = json.loads(data.decode("utf-8-sig"), parse_constant=_refuse_constant)
    except UnicodeDecodeError:
        raise InputError("not UTF-8 text; save it as GeoJSON in UTF-8") from None
    except InputError:
        raise
    except json.JSONDecodeError as error:
        raise InputError(f"not JSON: {error.msg} at line {error.lineno}, column {error.colno}") from None
    except ValueError as error:  # a whole number of thousands of digits
        raise InputError(f"not JSON that can be read: {str(error)[:80]}") from None
    except RecursionError:
        raise InputError("not GeoJSON: nested too deeply") from None
    if b"\\ud" in data.lower() and _SURROGATE.search(json.dumps(document, ensure_ascii=False)):
        raise InputError("a text has half of a surrogate pair (\\ud800 to \\udfff), which no file can hold; take it out")
    return document


def _refuse_constant(text: str) -> None:
    raise InputError(f"not JSON: {text} is no number in JSON; every coordinate must be finite")


def positions(geometry: Any) -> Iterator[Any]:
    """Yield the positions of a geometry, whatever its type; nothing is checked."""
    stack = [geometry.get("coordinates")] if isinstance(geometry, dict) else []
    while stack:
        item = stack.pop()
        if isinstance(item, list):
            if item and not isinstance(item[0], list):
                yield item
            else:
                stack.extend(reversed(item))


def position_problem(position: Any) -> str | None:
    """Return what is wrong with a position, or None."""
    if not isinstance(position, list) or len(position) < 2:
        return f"a position must be [longitude, latitude], not {str(position)[:40]}"
    if any(isinstance(v, bool) or not isinstance(v, int | float) for v in position):
        return f"position {str(position)[:40]} must be numbers"
    if not all(abs(v) < 1e12 for v in position):  # so written it refuses NaN too, and whole numbers of any size
        return f"position {str(position)[:40]} is not a place"
    lon, lat = position[:2]
    if abs(lat) > 90:
        swapped = "; is the order swapped? GeoJSON is longitude, latitude" if abs(lon) <= 90 and abs(lat) <= 180 else ""
        return f"latitude {lat} is outside -90..90{swapped}"
    if abs(lon) > 180:
        return f"longitude {lon} is outside -180..180"
    return None


def read_polygon(geometry: dict[str, Any], frame: Frame) -> MultiPolygon:
    """Return a (Multi)Polygon in metres. Ring direction, repeated vertices and overlapping parts are repaired.

    Raises InputError, naming the ring, if a ring is unclosed, has fewer than 4 positions or crosses itself, or a hole lies
    outside its ring: what was meant is not known.
    """
    parts = geometry["coordinates"] if geometry["type"] == "MultiPolygon" else [geometry["coordinates"]]
    if not isinstance(parts, list) or not parts:
        raise InputError("the geometry has no coordinates")
    polygons = []
    for p, rings in enumerate(parts):
        place = f"part {p}, " if geometry["type"] == "MultiPolygon" else ""
        if not isinstance(rings, list) or not rings:
            raise InputError(f"{place}polygon without rings")
        shell, *holes = [_ring(ring, f"{place}ring {r}", frame) for r, ring in enumerate(rings)]
        polygon = Polygon(shell, holes)
        if not polygon.is_valid:
            raise InputError(f"{place}{_reason(polygon, frame)}")
        polygons.append(polygon)
    # A part cut at the antimeridian meets its other half again here, but for rounding: a micrometre grid closes it.
    return as_multipolygon(union_all(polygons, grid_size=1e-6) if len(polygons) > 1 else polygons[0])


def read_corridor(geometry: dict[str, Any], width: float, frame: Frame) -> MultiPolygon:
    """Return what is within half of `width` metres of a (Multi)LineString, in metres; it ends square where the line ends.

    Raises InputError, naming the line, if one has fewer than 2 different positions.
    """
    several = geometry["type"] == "MultiLineString"
    parts = geometry["coordinates"] if several else [geometry["coordinates"]]
    if not isinstance(parts, list) or not parts:
        raise InputError("the geometry has no coordinates")
    lines = []
    for p, line in enumerate(parts):
        place = f"line {p}" if several else "the line"
        if not isinstance(line, list) or len(line) < 2:
            raise InputError(f"{place} has {len(line) if isinstance(line, list) else 0} positions; a line needs at least 2")
        for i, position in enumerate(line):
            if problem := position_problem(position):
                raise InputError(f"{place}, position {i}: {problem}")
        # Rounded to a micrometre, lines that meet, or were cut at the antimeridian, share their point.
        xy = np.round(frame.to_metres(np.array([p[:2] for p in line], dtype=float)), 6)
        if (xy == xy[0]).all():
            raise InputError(f"{place} has no length; it needs 2 different positions")
        lines.append(xy)
    merged = line_merge(MultiLineString(lines))  # one line where parts meet, else a bend there would have a notch
    return as_multipolygon(merged.buffer(width / 2.0, quad_segs=8, cap_style="flat"))


def _ring(ring: Any, place: str, frame: Frame) -> np.ndarray:
    if not isinstance(ring, list) or len(ring) < 4:
        raise InputError(f"{place} has {len(ring) if isinstance(ring, list) else 0} positions; a ring needs at least 4")
    for i, position in enumerate(ring):
        if problem := position_problem(position):
            raise InputError(f"{place}, position {i}: {problem}")
    if ring[0][:2] != ring[-1][:2]:
        raise InputError(f"{place} is not closed: its last position must repeat its first")
    xy = frame.to_metres(np.array([p[:2] for p in ring], dtype=float))
    keep = np.concatenate([[True], np.any(np.abs(np.diff(xy, axis=0)) > 1e-6, axis=1)])
    xy = xy[keep]
    if len(xy) < 4:
        raise InputError(f"{place} has fewer than 3 different positions")
    if not Polygon(xy).is_valid:
        raise InputError(f"{place} {_reason(Polygon(xy), frame)}")
    return xy


def _reason(polygon: Polygon, frame: Frame) -> str:
    """Put shapely's reason into the user's words and degrees."""
    reason, _, where = is_valid_reason(polygon).partition("[")
    lon, lat = frame.to_degrees(np.array([float(v) for v in where.rstrip("]").split()[:2]]))[0]
    words = {"Self-intersection": "crosses itself", "Ring Self-intersection": "touches itself"}
    return f"{words.get(reason.strip(), reason.strip().lower())} at {lon:.6f}, {lat:.6f}; redraw it there"
