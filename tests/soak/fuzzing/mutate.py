"""Damaging files at random: structure, geometry, numbers, texts, encodings, sizes; each format in its own way."""

import copy
import io
import json
import re
import zipfile
from collections.abc import Iterator
from pathlib import PurePath
from typing import Any

import numpy as np
from fuzzing.mutate_logs import damaged_log
from lxml import etree

from quarterdeck.geo.properties import PROPERTIES

NUMBERS = (
    0,
    -0.0,
    1,
    -1,
    0.5,
    90.0,
    -90.0,
    91.0,
    180.0,
    -180.0,
    181.0,
    1e-300,
    1e-9,
    1e9,
    1e18,
    1e300,
    -1e300,
    2**63,
    10**400,
)
TEXTS = (
    "",
    " ",
    "area",
    "vehicle",
    "../../etc/passwd",
    "\x00",
    "é" * 300,
    "名前",
    "\u202e",
    "'; drop table",
    "%s{}",
    "nan",
    "1e5",
)
OTHERS = (
    None,
    True,
    False,
    [],
    {},
    [[]],
    [[[]]],
    [None],
    {"type": None},
    [[0, 0]],
    {"type": "Point", "coordinates": [0, 0]},
)


def damaged(name: str, data: bytes, rng: np.random.Generator) -> bytes:
    """Return a file's bytes with one to four random damages that suit its format, or, now and then, any."""
    if rng.random() < 0.05:
        return _bytes(data, rng)
    suffix = PurePath(name).suffix
    try:
        if suffix in (".json", ".geojson", ".plan"):
            return mutated(data, rng)
        if suffix in (".kml", ".gpx"):
            return _xml(data, rng)
        if suffix in (".kmz", ".npz"):
            return _zip(data, rng)
        if suffix in (".toml", ".yaml", ".asc", ".csv"):
            return _text(data, rng)
        if suffix in (".bin", ".tlog"):
            return damaged_log(data, rng)
    except (ValueError, KeyError, IndexError, TypeError, RecursionError):  # what cannot be damaged so, is so
        pass
    return _bytes(data, rng)


def _bytes(data: bytes, rng: np.random.Generator) -> bytes:
    """Cut, change, repeat or remove bytes."""
    raw = bytearray(data)
    for _ in range(int(rng.integers(1, 5))):
        kind, size = rng.integers(0, 5), len(raw)
        at = int(rng.integers(0, size + 1))
        if kind == 0 and size:
            for i in rng.integers(0, size, int(rng.integers(1, 9))):
                raw[i] = rng.integers(0, 256)
        elif kind == 1:
            del raw[at : at + int(rng.integers(1, 65))]
        elif kind == 2:
            raw[at:at] = raw[at : at + int(rng.integers(1, 257))] * int(rng.integers(1, 40))
        elif kind == 3:
            raw[at:at] = rng.integers(0, 256, int(rng.integers(1, 33)), dtype=np.uint8).tobytes()
        elif rng.random() < 0.3:
            del raw[at:]
    return bytes(raw)


_NUMBER = re.compile(r"-?\d+(\.\d+)?([eE][-+]?\d+)?")


def _text(data: bytes, rng: np.random.Generator) -> bytes:
    """Change numbers and words; remove, repeat and swap lines."""
    lines = data.decode("utf-8").split("\n")
    for _ in range(int(rng.integers(1, 5))):
        i, j = rng.integers(0, len(lines), 2)
        kind = rng.integers(0, 7)
        numbers = list(_NUMBER.finditer(lines[i]))
        if kind <= 2 and numbers:
            at = numbers[rng.integers(0, len(numbers))]
            other = NUMBERS[rng.integers(0, len(NUMBERS))] if kind else float(at[0]) * float(rng.normal(1, 1))
            word = ("nan", "inf", "-inf", "true", '"1"', "[1, 2]", "{}")[rng.integers(0, 7)]
            lines[i] = lines[i][: at.start()] + (word if rng.random() < 0.2 else str(other)) + lines[i][at.end() :]
        elif kind == 3:
            lines[i:i] = [lines[j]] * int(rng.integers(1, 4))
        elif kind == 4:
            lines[i], lines[j] = lines[j], lines[i]
        elif kind == 5 and len(lines) > 1:
            del lines[i]
        elif words := lines[i].split():
            words[rng.integers(0, len(words))] = TEXTS[rng.integers(0, len(TEXTS))]
            lines[i] = " ".join(words)
    return _encoded("\n".join(lines), rng)


def _encoded(text: str, rng: np.random.Generator) -> bytes:
    encodings = ("utf-16", "utf-8-sig", "latin-1", "utf-32")
    encoding = encodings[rng.integers(0, 4)] if rng.random() < 0.05 else "utf-8"
    return text.encode(encoding, "replace")


def _xml(data: bytes, rng: np.random.Generator) -> bytes:
    """Change texts, attributes and names of elements; remove, repeat, nest them; entities that grow."""
    root = etree.fromstring(data)
    for _ in range(int(rng.integers(1, 5))):
        every = [e for e in root.iter() if isinstance(e.tag, str)]
        one, other = (every[i] for i in rng.integers(0, len(every), 2))
        parent, kind = one.getparent(), rng.integers(0, 8)
        if kind == 0 and parent is not None:
            parent.remove(one)
        elif kind == 1 and parent is not None:
            for _ in range(int(rng.integers(1, 30))):
                parent.append(copy.deepcopy(one))
        elif kind == 2 and other not in set(one.iter()):
            other.append(copy.deepcopy(one))
        elif kind == 3 and one.attrib:
            key = sorted(one.attrib)[rng.integers(0, len(one.attrib))]
            one.attrib[key] = str(NUMBERS[rng.integers(0, len(NUMBERS))])
        elif kind == 4 and one.attrib:
            del one.attrib[sorted(one.attrib)[0]]
        elif kind == 5 and one.text and _NUMBER.search(one.text):
            one.text = _NUMBER.sub(str(NUMBERS[rng.integers(0, len(NUMBERS))]), one.text, count=int(rng.integers(1, 4)))
        elif kind == 6:
            one.text = TEXTS[rng.integers(0, len(TEXTS))].replace("\x00", " ")
        else:
            one.tag = etree.QName(other).text
    text = etree.tostring(root, encoding="unicode")
    if rng.random() < 0.05:
        text = f"<!DOCTYPE {etree.QName(root).localname} [{LAUGHS}]>" + text.replace("<name>", "<name>&l9;", 1)
    return _encoded(text, rng)


LAUGHS = '<!ENTITY l0 "lol">' + "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 10))


def _zip(data: bytes, rng: np.random.Generator) -> bytes:
    """Damage a member, its name or its number; or unpack to far more than there is."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = [(entry.filename, archive.read(entry)) for entry in archive.infolist()]
    i, kind = int(rng.integers(0, len(members))), rng.integers(0, 6)
    name, content = members[i]
    if kind <= 2:
        members[i] = name, _array(rng) if name.endswith(".npy") and kind else damaged(name, content, rng)
    elif kind == 3:
        members[i] = ("../" * int(rng.integers(0, 3)) + TEXTS[rng.integers(0, len(TEXTS))] + PurePath(name).suffix), content
    elif kind == 4:
        del members[i]
    else:
        members[i] = name, content + b" " * int(rng.choice([1000, 10**6, 6 * 10**7], p=[0.5, 0.45, 0.05]))
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members:
            archive.writestr(name, content)
    return _bytes(packed.getvalue(), rng) if rng.random() < 0.2 else packed.getvalue()


def _array(rng: np.random.Generator) -> bytes:
    """Return an .npy file of any shape, kind and values."""
    shape = tuple(rng.integers(0, 5, int(rng.integers(0, 4))).tolist())
    kind = ("f8", "f4", "i8", "u1", "c16", "U3", "?")[rng.integers(0, 7)]
    values = rng.choice([float(n) for n in NUMBERS if abs(n) < 1e18] + [np.nan, np.inf, 1.0, 2.0], shape)
    array = values if kind == "f8" else np.nan_to_num(values, posinf=9).clip(0, 9).astype(kind)
    made = io.BytesIO()
    np.save(made, array)
    return made.getvalue()


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """Return `data`, a JSON document, with a few random changes: most of them leave a GeoJSON that makes sense."""
    document = json.loads(data)
    gentle = rng.random() < 0.6 and isinstance(document, dict) and "features" in document
    for _ in range(int(rng.geometric(0.5))):
        document = _changed(document, rng) if gentle else _damage(document, rng)
    if gentle:
        return json.dumps(document).encode("utf-8")
    text = json.dumps(document)
    kind = rng.integers(0, 40)
    if kind == 0:
        return text.encode("utf-8")[: rng.integers(0, len(text) + 1)]
    if kind == 1:
        raw = bytearray(text.encode("utf-8"))
        for _ in range(rng.integers(1, 9)):
            raw[rng.integers(0, len(raw))] = rng.integers(0, 256)
        return bytes(raw)
    if kind == 2:
        return text.encode(("utf-16", "utf-8-sig", "utf-32")[rng.integers(0, 3)])
    if kind == 3:
        return text.replace("0", ("NaN", "Infinity", "1e999")[rng.integers(0, 3)], 1).encode("utf-8")
    return text.encode("utf-8")


def _changed(document: Any, rng: np.random.Generator) -> Any:
    """Change a feature of GeoJSON as one who knows the format might: moved, resized, other figures, more, less."""
    features = document["features"]
    if not features:
        return document
    feature = features[rng.integers(0, len(features))]
    properties, geometry = feature.get("properties") or {}, feature.get("geometry") or {}
    kind = rng.integers(0, 10)
    if kind <= 2 and geometry.get("coordinates"):
        old = json.dumps(geometry["coordinates"])
        pairs = np.array([float(x[0]) for x in _NUMBER.finditer(old)]).reshape(-1, 2)
        scale = 10.0 ** float(rng.uniform(-7, -2))
        if kind == 0:
            pairs += rng.normal(0, scale, 2)
        elif kind == 1:
            pairs = pairs.mean(axis=0) + (pairs - pairs.mean(axis=0)) * float(
                rng.choice([0, 1e-6, 0.1, 0.5, 2, 5, -1, 100])
            )
        else:
            moved = rng.random(len(pairs)) < 0.3
            pairs += np.where(moved[:, None], rng.normal(0, scale, pairs.shape), 0.0)
            pairs[-1] = pairs[0] if geometry["type"] == "Polygon" and len(pairs) > 4 else pairs[-1]
        texts = iter([repr(v) for v in pairs.ravel().tolist()])
        geometry["coordinates"] = json.loads(_NUMBER.sub(lambda _: next(texts), old))
    elif kind <= 6:
        known = PROPERTIES.get(properties.get("role"), {})
        if known and rng.random() < 0.5:
            name = list(known)[rng.integers(0, len(known))]
            properties[name] = _fitting(known[name].schema, rng)
        elif properties:
            name = list(properties)[rng.integers(0, len(properties))]
            value = properties[name]
            if isinstance(value, int | float) and not isinstance(value, bool):
                properties[name] = value * 10.0 ** float(rng.uniform(-4, 4))
            elif isinstance(value, list) and value and isinstance(value[0], int | float):
                i = int(rng.integers(0, len(value)))
                value[i] = value[i] * float(rng.normal(1, 1)) if isinstance(value[i], int | float) else value[i]
            elif name != "role":
                del properties[name]
    elif kind == 7:
        for i in range(int(rng.choice([1, 2, 40]))):
            twin = copy.deepcopy(feature)
            twin.get("properties", {})["id"] = f"twin-{i}"
            features.append(twin)
    elif kind == 8:
        features.remove(feature)
    elif rng.random() < 0.5:
        features.append(features.pop(0))
    else:
        document = json.loads(json.dumps(document).replace(*_SWAPS[rng.integers(0, len(_SWAPS))]))
    return document


_SWAPS = (
    ("ground", "aerial"),
    ("ground", "surface"),
    ("surface", "aerial"),
    ("aerial", "ground"),
    ('"area"', '"operating"'),
    ('"task"', '"casualty"'),
    ('"obstacle"', '"area"'),
    ('"medic"', '"vehicle"'),
    ("Polygon", "LineString"),
)


def _fitting(schema: dict[str, Any], rng: np.random.Generator) -> Any:
    """Return a value that the words of JSON Schema allow."""
    if "anyOf" in schema:
        return _fitting(schema["anyOf"][rng.integers(0, len(schema["anyOf"]))], rng)
    if "enum" in schema:
        return schema["enum"][rng.integers(0, len(schema["enum"]))]
    kind = schema["type"] if isinstance(schema["type"], str) else schema["type"][0]
    if kind in ("number", "integer"):
        least = max(schema.get("minimum", 0), schema.get("exclusiveMinimum", 0))
        value = min(least + 10.0 ** float(rng.uniform(-6, 9)), schema.get("maximum", 1e9)) if rng.random() < 0.9 else least
        return round(value) if kind == "integer" else value
    if kind == "array":
        count = int(rng.integers(schema.get("minItems", 0), schema.get("maxItems", 3) + 1))
        return [_fitting(schema["items"], rng) for _ in range(count)]
    if kind == "object":
        return {name: _fitting(inner, rng) for name, inner in schema.get("properties", {}).items()}
    return bool(rng.integers(0, 2)) if kind == "boolean" else ("t1", "v2", "look", "otter", "crazyflie")[rng.integers(0, 5)]


def _damage(document: Any, rng: np.random.Generator) -> Any:
    """Change, remove, repeat or swap something at a random place."""
    document = copy.deepcopy(document)
    places = list(_places(document))
    if not places:
        return document
    # Half of all damage goes to a place near the top or to a property: coordinates are far more, and would take it all.
    few = [p for p in places if not isinstance(p[0], list) or len(p[0]) > 3 or not isinstance(p[0][p[1]], int | float)]
    pool = few if few and rng.random() < 0.5 else places
    parent, key = pool[rng.integers(0, len(pool))]
    kind = rng.integers(0, 8)
    value = parent[key]
    if kind == 0:
        del parent[key]
    elif kind == 1 and isinstance(parent, list):
        parent.insert(key, copy.deepcopy(value))
    elif kind == 2 and isinstance(parent, list) and len(parent) > 1:
        other = rng.integers(0, len(parent))
        parent[key], parent[other] = parent[other], parent[key]
    elif kind == 3 and isinstance(value, int | float) and abs(value) < 1e15:
        parent[key] = value + float(rng.normal()) * 10.0 ** int(rng.integers(-9, 3))
    elif kind == 4 and isinstance(value, list) and value:
        value *= int(rng.integers(2, 40))
    elif kind == 5:
        parent[key] = TEXTS[rng.integers(0, len(TEXTS))]
    elif kind == 6:
        parent[key] = copy.deepcopy(OTHERS[rng.integers(0, len(OTHERS))])
    else:
        parent[key] = NUMBERS[rng.integers(0, len(NUMBERS))]
    return document


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Yield every (container, key) in a document."""
    keys = range(len(value)) if isinstance(value, list) else list(value) if isinstance(value, dict) else ()
    for key in keys:
        yield value, key
        yield from _places(value[key])
