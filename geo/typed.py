"""Whether values are of the types that their dataclass declares: for files of our own that anybody may have changed."""

import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
from shapely.geometry import mapping, shape
from shapely.geometry.base import BaseGeometry


def wrong_field(thing: Any) -> str:
    """Return the name of the first field of a dataclass, or of one within it, that is not of its type, or "".

    Whole numbers are numbers, true and false are not, and no number is NaN.
    """
    return next((name for name, kind in _hints(thing.__class__).items() if not fits(getattr(thing, name), kind)), "")


@cache
def _hints(kind: Any) -> dict[str, Any]:
    hints = get_type_hints(kind)
    return {f.name: hints[f.name] for f in fields(kind)}


def fits(value: Any, kind: Any) -> bool:
    """Tell whether a value is of a type; a dict of types stands for dicts that have its keys, each of its type."""
    if isinstance(kind, dict):
        return isinstance(value, dict) and all(name in value and fits(value[name], k) for name, k in kind.items())
    origin, inner = get_origin(kind), get_args(kind)
    if kind is Any:
        return True
    if origin is Literal:
        return isinstance(value, str) and value in inner
    if origin in (Union, types.UnionType):
        return any(fits(value, k) for k in inner)
    if origin is tuple and inner[-1] is not Ellipsis:
        return isinstance(value, tuple) and len(value) == len(inner) and all(map(fits, value, inner))
    if origin in (tuple, frozenset):
        return isinstance(value, origin) and all(fits(v, inner[0]) for v in value)
    if origin in (dict, Mapping):
        return isinstance(value, dict) and all(fits(v, inner[1]) for v in value.values())
    if kind is float:
        return isinstance(value, float | int) and not isinstance(value, bool) and not np.isnan(value)
    if kind is int:
        return isinstance(value, int) and not isinstance(value, bool)
    return isinstance(value, kind) and not (is_dataclass(kind) and wrong_field(value))


def as_json(thing: Any) -> Any:
    """Return a dataclass, or what fields of one hold, as JSON can hold it; `from_json` makes it again. Infinity is null.

    Geometries are as in GeoJSON, but in what units they are.
    """
    if is_dataclass(thing) and not isinstance(thing, type):
        return {f.name: as_json(getattr(thing, f.name)) for f in fields(thing)}
    if isinstance(thing, Mapping):
        return {str(k): as_json(v) for k, v in thing.items()}
    if isinstance(thing, BaseGeometry):
        return as_json(mapping(thing))
    if isinstance(thing, frozenset):
        return sorted(as_json(v) for v in thing)
    if isinstance(thing, tuple | list):
        return [as_json(v) for v in thing]
    if isinstance(thing, np.generic):
        thing = thing.item()
    return None if isinstance(thing, float) and np.isinf(thing) else thing


def from_json(value: Any, kind: Any) -> Any:
    """Return what `as_json` has written of a `kind`, such as a dataclass. Raises TypeError or KeyError for anything else.

    Of several dataclasses the first is meant whose fields the value has.
    """
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        options = [k for k in inner if k is not type(None)]
        if value is None and len(options) < len(inner):
            return None
        names = set(value) if isinstance(value, dict) else set()
        fitting = [k for k in options if not is_dataclass(k) or {f.name for f in fields(k)} == names]
        if not fitting:
            raise TypeError(f"{str(value)[:40]!r} is none of {kind}")
        return from_json(value, fitting[0])
    if isinstance(kind, type) and issubclass(kind, BaseGeometry):
        value = shape(value)
    if is_dataclass(kind):
        hints: dict[str, Any] = _hints(kind)  # type: ignore[arg-type]
        return kind(**{name: from_json(value[name], k) for name, k in hints.items()})  # type: ignore[operator]
    if origin in (dict, Mapping) and isinstance(value, dict):
        return {str(k): from_json(v, inner[1]) for k, v in value.items()}
    if origin in (tuple, frozenset) and isinstance(value, list):
        if origin is frozenset or inner[-1] is Ellipsis:
            return origin(from_json(v, inner[0]) for v in value)
        return tuple(from_json(v, k) for v, k in zip(value, inner, strict=True))
    if kind is float:
        value = np.inf if value is None else value
    if not fits(value, kind):
        raise TypeError(f"{str(value)[:40]!r} is no {kind}")
    return float(value) if kind is float else value
