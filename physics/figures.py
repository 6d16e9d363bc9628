"""Reading the figures of a model's [dynamics] table: each missing or wrong one is a line that names it."""

from math import isfinite
from typing import Any

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.models import VehicleModel


def number(model: VehicleModel, key: str, *, least: float = -float("inf")) -> float:
    """Return [dynamics] `key` as a float. Raises InputError if missing, not a number or below `least`."""
    return _check(model, key, _entry(model, key), least)


def numbers(model: VehicleModel, key: str, count: int, *, least: float = -float("inf")) -> tuple[float, ...]:
    """Return [dynamics] `key` as `count` floats. Raises InputError as `number` does."""
    values = _entry(model, key)
    if not isinstance(values, list) or len(values) != count:
        raise InputError(
            f"vehicle model {model.name!r}: [dynamics] {key} must be a list of {count} numbers, not {values!r}"
        )
    return tuple(_check(model, key, value, least) for value in values)


def _entry(model: VehicleModel, key: str) -> Any:
    if key not in model.dynamics:
        raise InputError(f"vehicle model {model.name!r}: [dynamics] lacks {key!r}; copy it from a packaged model")
    return model.dynamics[key]


def _check(model: VehicleModel, key: str, value: Any, least: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise InputError(f"vehicle model {model.name!r}: [dynamics] {key} must be a number, not {value!r}")
    if value < least:
        raise InputError(f"vehicle model {model.name!r}: [dynamics] {key} = {value} is below {least}")
    return float(value)
