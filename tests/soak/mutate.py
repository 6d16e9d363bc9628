"""Damaging JSON documents at random: structure, geometry, numbers, texts, encodings, sizes."""

import copy
import json
from collections.abc import Iterator
from typing import Any

import numpy as np

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


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """Return `data`, a JSON document, with one to four random damages."""
    document = json.loads(data)
    for _ in range(rng.integers(1, 5)):
        document = _damage(document, rng)
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
