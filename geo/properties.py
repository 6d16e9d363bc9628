"""The properties that each role may carry: their kinds, limits and meaning, in one table.

The reader checks against it, the JSON Schema and the docs page are made from it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

POLYGONS = ("Polygon", "MultiPolygon")
LINES = ("LineString", "MultiLineString")
GEOMETRIES = {
    "area": POLYGONS + LINES,
    "operating": POLYGONS,
    "obstacle": POLYGONS,
    "vehicle": ("Point",),
    "task": ("Point",),
    "casualty": ("Point",),
    "medic": ("Point",),
    "rendezvous": ("Point",),
    "sounding": ("Point",),
}
# What QGIS, geojson.io and our own PLAN put beside ours: never taken for a misspelling.
FOREIGN = {"name", "title", "description", "fid", "fill", "fill-opacity", "stroke", "stroke-width", "stroke-opacity",
           "marker-color", "marker-size", "marker-symbol", "role", "comment", "note"}  # fmt: skip
NUMBER: dict[str, Any] = {"type": "number"}
TEXTS: dict[str, Any] = {"type": "array", "items": {"type": "string"}}


@dataclass(frozen=True, slots=True)
class Property:
    """A property: the JSON Schema of its value, what the value is in words, and what it means."""

    schema: dict[str, Any]
    words: str
    meaning: str


def _number(words: str, meaning: str, **limits: float) -> Property:
    return Property(NUMBER | limits, words, meaning)


_ID = Property({"type": ["string", "integer"]}, "a text", "its name; else the feature's own `id`, else numbered")
_POSITIVE: dict[str, float] = {"exclusiveMinimum": 0}
_DOMAIN = Property({"enum": ["surface", "ground", "aerial"]}, "one of surface, ground, aerial", "the element it moves in")

PROPERTIES: dict[str, dict[str, Property]] = {
    "area": {
        "id": _ID,
        "priority": Property(
            {"type": "integer", "minimum": 0},
            "a whole number from 0",
            "areas of a higher one are covered first, by everybody",
        ),
        "spacing": _number("a number above 0", "metres between neighbouring tracks (the paper's 2 delta)", **_POSITIVE),
        "width": _number(
            "a number above 0", "metres across the corridor along a line; lines only, and they need it", **_POSITIVE
        ),
    },
    "operating": {"id": _ID},
    "obstacle": {
        "id": _ID,
        "blocks": Property(
            {"type": "array", "items": {"enum": ["surface", "ground", "aerial"]}},
            "a list of domains",
            "who may not cross it; default all. It is never covered, whoever may cross",
        ),
        "height": _number("a number above 0", "metres, in simulation; default 10", **_POSITIVE),
    },
    "vehicle": {
        "id": _ID,
        "domain": _DOMAIN,
        "model": Property(
            {"type": "string"}, "a text", "a packaged model or the path of a vehicle file; default by domain"
        ),
        "share": _number("a number above 0, at most 1", "its part of the area; all or none; sum 1", **_POSITIVE, maximum=1),
        "speed": _number("a number above 0", "m/s on survey and transit; default the model's cruise", **_POSITIVE),
        "turn_radius": _number("a number from 0", "metres; 0 turns on the spot; default the model's", minimum=0),
        "clearance": _number("a number from 0", "metres kept from obstacles; default the model's", minimum=0),
        "endurance": _number("a number above 0", "seconds it can be out; default unlimited", **_POSITIVE),
        "battery": _number("a number above 0", "watt-hours; default the model's", **_POSITIVE),
        "altitude": _number("a number above 0", "metres above ground, aerial only; default the model's", **_POSITIVE),
        "ceiling": _number(
            "a number above 0", "metres above ground that it stays below, aerial only; default 120", **_POSITIVE
        ),
        "ceiling_amsl": _number("a number above 0", "metres above mean sea level likewise; default none", **_POSITIVE),
        "end": Property(
            {"type": "array", "items": NUMBER, "minItems": 2, "maxItems": 3},
            "a position [lon, lat]",
            "where it ends; default where it starts",
        ),
        "returns": Property({"type": "boolean"}, "true or false", "false: stays where its last track ends; default true"),
        "sensor": Property(
            {"type": "object", "required": ["kind"], "properties": {"kind": {"enum": ["swath", "camera", "sonar"]}}},
            'an object with "kind": swath, camera or sonar',
            "what it surveys with: `swath` in metres; a `camera` by name or figures; a sonar's figures: see sensors.md",
        ),
        "range": _number(
            "a number above 0",
            "metres it sees (guards, triage) or speaks (all else); default no limit to speech",
            **_POSITIVE,
        ),
        "can": Property(TEXTS, "a list of texts", "its capabilities, matched with a task's `needs`"),
    },
    "task": {
        "id": _ID,
        "priority": Property({"type": "integer", "minimum": 0, "maximum": 3}, "0, 1, 2 or 3", "3 is the most urgent"),
        "service_time": _number("a number from 0", "seconds of work there", minimum=0),
        "after": Property(
            {
                "type": "array",
                "items": {
                    "anyOf": [
                        {"type": "string"},
                        {
                            "type": "object",
                            "required": ["task"],
                            "properties": {
                                "task": {"type": "string"},
                                "mode": {"enum": ["finish_to_start", "same_robot"]},
                            },
                        },
                    ]
                },
            },
            'a list of task ids or {"task": id, "mode": "finish_to_start" or "same_robot"}',
            "what has to be finished first",
        ),
        "needs": Property(TEXTS, "a list of texts", "capabilities that its robot must have"),
        "domain": _DOMAIN,
        "window": Property(
            {"type": "array", "items": NUMBER, "minItems": 2, "maxItems": 2},
            "two numbers [earliest, latest]",
            "seconds from the mission's start in which service starts",
        ),
    },
    "casualty": {
        "id": _ID,
        "colour": Property(
            {"enum": ["red", "yellow", "green", "grey", "black"]},
            "one of red, yellow, green, grey, black",
            "the sort that a robot would give it",
        ),
    },
    "medic": {"id": _ID},
    "rendezvous": {"id": _ID},
    "sounding": {
        "id": _ID,
        "depth": Property(NUMBER, "a number", "metres of water, below chart datum on a chart; needed"),
    },
}


def property_problems(role: str, properties: dict[str, Any]) -> list[str]:
    """Return what is wrong with a feature's properties, in words; null counts as absent (QGIS writes it)."""
    known = PROPERTIES[role]
    problems = []
    for name, value in properties.items():
        if name in known:
            if value is not None and not _fits(value, known[name].schema):
                problems.append(f"{name} must be {known[name].words}, not {_short(value)}{_nearest(value, known[name])}")
        elif name not in FOREIGN and (near := get_close_matches(name, known, n=1, cutoff=0.75)):
            problems.append(f"unknown property {name!r}; did you mean {near[0]!r}?")
    return problems


def _fits(value: Any, schema: dict[str, Any]) -> bool:
    """Check a value against the few words of JSON Schema that PROPERTIES uses."""
    if "anyOf" in schema:
        return any(_fits(value, s) for s in schema["anyOf"])
    if "enum" in schema:
        return isinstance(value, str) and value in schema["enum"]
    types = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    if not any(_KINDS[t](value) for t in types):
        return False
    if isinstance(value, list):
        return schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value)) and all(
            _fits(v, schema["items"]) for v in value
        )
    if isinstance(value, dict):
        return all(k in value for k in schema.get("required", ())) and all(
            _fits(v, schema["properties"][k]) for k, v in value.items() if k in schema.get("properties", {})
        )
    if isinstance(value, int | float):
        return (
            value >= schema.get("minimum", value)
            and value <= schema.get("maximum", value)
            and value > schema.get("exclusiveMinimum", value - 1)
        )
    return True


_KINDS: dict[str, Callable[[Any], bool]] = {
    "boolean": lambda v: isinstance(v, bool),
    "string": lambda v: isinstance(v, str),
    "integer": lambda v: isinstance(v, int) and not isinstance(v, bool),
    "number": lambda v: isinstance(v, int | float) and not isinstance(v, bool) and abs(v) < 1e12,
    "array": lambda v: isinstance(v, list),
    "object": lambda v: isinstance(v, dict),
}


def _nearest(value: Any, known: Property) -> str:
    near = get_close_matches(value, known.schema.get("enum", ()), n=1) if isinstance(value, str) else []
    return f"; did you mean {near[0]!r}?" if near else ""


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a site."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Quarterdeck site",
        "description": "A GeoJSON FeatureCollection (RFC 7946, WGS84) whose features carry a role.",
        "type": "object",
        "required": ["type", "features"],
        "properties": {
            "type": {"const": "FeatureCollection"},
            "name": {"type": "string"},
            "features": {"type": "array", "minItems": 1, "items": {"anyOf": [_feature_schema(r) for r in PROPERTIES]}},
        },
    }


def _feature_schema(role: str) -> dict[str, Any]:
    properties: dict[str, Any] = {"role": {"const": role}}
    for name, known in PROPERTIES[role].items():
        properties[name] = {"description": known.meaning, "anyOf": [known.schema, {"type": "null"}]}
    return (_CORRIDOR if "width" in properties else {}) | {
        "title": role,
        "type": "object",
        "required": ["type", "geometry", "properties"],
        "properties": {
            "type": {"const": "Feature"},
            "geometry": {"type": "object", "properties": {"type": {"enum": list(GEOMETRIES[role])}}},
            "properties": {"type": "object", "required": ["role"], "properties": properties},
        },
    }


_CORRIDOR: dict[str, Any] = {  # a line has a width, a polygon has none
    "if": {"properties": {"geometry": {"properties": {"type": {"enum": list(LINES)}}}}},
    "then": {"properties": {"properties": {"required": ["width"], "properties": {"width": NUMBER}}}},
    "else": {"properties": {"properties": {"properties": {"width": {"type": "null"}}}}},
}
