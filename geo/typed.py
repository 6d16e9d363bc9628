"""Whether values are of the types that their dataclass declares: for files of our own that anybody may have changed."""

import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np


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
