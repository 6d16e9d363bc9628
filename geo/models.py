"""Vehicle models: one readable TOML file each, that a user can copy and change.

A file has `name`, `domain`, `source`, and the tables `[limits]` (what planners obey), `[energy]` (what it uses) and
`[dynamics]` (what the simulation integrates). The packaged ones are in `data/vehicles/`.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from quarterdeck.geo.errors import InputError

if TYPE_CHECKING:
    import numpy as np

_Speed = TypeVar("_Speed", float, "np.ndarray")
DEFAULT_MODEL = {"surface": "otter", "ground": "husky", "aerial": "survey-quad"}


@dataclass(frozen=True, slots=True)
class VehicleModel:
    """What is true of every vehicle of a kind: `length`, `width` m; `speed` cruise and `max_speed` m/s; `turn_radius` m
    at cruise (0: turns on the spot); `turn_rate` rad/s when it turns on the spot; `acceleration` m/s2; `climb_rate` and
    `descent_rate` m/s (0: descends as it climbs); `clearance` m kept from obstacles; `battery` Wh; `power_idle` W at rest
    or hovering; `power_cruise` W at cruise; `file` is the path it was read from, none for a packaged model.
    """

    name: str
    domain: Literal["surface", "ground", "aerial"]
    source: str
    length: float
    width: float
    speed: float
    max_speed: float
    turn_radius: float
    turn_rate: float
    acceleration: float
    clearance: float
    battery: float
    power_idle: float
    power_cruise: float
    power_exponent: float
    climb_rate: float = 0.0
    descent_rate: float = 0.0
    altitude: float = 0.0
    dynamics: Mapping[str, Any] = field(default_factory=dict, hash=False)
    file: str = ""

    def __post_init__(self) -> None:
        """Raise InputError for figures that no vehicle has."""
        for key in (*_LIMITS, *_ENERGY, *_OPTIONAL):
            value = getattr(self, key)
            if not 0 <= value < 1e9 or (value == 0 and key not in _MAY_BE_ZERO):
                raise InputError(f"{key} = {value:g} must be positive and below 1e9")
        if self.speed > self.max_speed:
            raise InputError(f"speed {self.speed:g} exceeds max_speed {self.max_speed:g}")
        if self.domain == "aerial" and not self.climb_rate:
            raise InputError("climb_rate of an aerial vehicle must be a number above 0, m/s")

    @property
    def sink_rate(self) -> float:
        """Metres per second that it descends."""
        return self.descent_rate or self.climb_rate

    def power(self, speed: _Speed) -> _Speed:
        """Return watts drawn at `speed` m/s, one or (n,): idle plus a power law through the cruise figure."""
        return self.power_idle + (self.power_cruise - self.power_idle) * (speed / self.speed) ** self.power_exponent


def model_names() -> list[str]:
    """Return the names of the packaged models."""
    return sorted(p.name[: -len(".toml")] for p in _folder().iterdir() if p.name.endswith(".toml"))


@cache
def load_model(name: str) -> VehicleModel:
    """Return a packaged model by name, or the one in the TOML file that `name` is a path of.

    Raises InputError if there is no such model, or its file lacks a figure or has one of the wrong kind.
    """
    if name.endswith(".toml"):
        try:
            text = Path(name).read_text(encoding="utf-8")
        except (OSError, ValueError) as error:
            raise InputError(f"vehicle file {name}: cannot be read ({error}); give the path of a TOML file") from None
    elif name in model_names():
        text = (_folder() / f"{name}.toml").read_text(encoding="utf-8")
    else:
        near = get_close_matches(name, model_names(), n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(model_names())}"
        raise InputError(f"unknown vehicle model {name!r}; {hint}")
    try:
        return _model(tomllib.loads(text), name if name.endswith(".toml") else "")
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"vehicle file {name}: not valid TOML: {error}") from None
    except InputError as error:
        raise InputError(f"vehicle file {name}: {error}") from None


_LIMITS = ("length", "width", "speed", "max_speed", "turn_radius", "turn_rate", "acceleration", "clearance")
_OPTIONAL = ("climb_rate", "descent_rate", "altitude")
_ENERGY = ("battery", "power_idle", "power_cruise", "power_exponent")
_MAY_BE_ZERO = ("turn_radius", "clearance", "power_idle", "power_exponent", "climb_rate", "descent_rate", "altitude")


def _model(document: dict[str, Any], file: str) -> VehicleModel:
    for key in ("name", "domain", "source"):
        if not isinstance(document.get(key), str):
            raise InputError(f"{key!r} must be a text")
    if document["domain"] not in DEFAULT_MODEL:
        raise InputError(f"domain {document['domain']!r} is not one of {', '.join(DEFAULT_MODEL)}")
    for table in ("limits", "energy", "dynamics"):
        if not isinstance(document.get(table), dict):
            raise InputError(f"table [{table}] is missing")
    limits, energy = document["limits"], document["energy"]
    for table, known in (("limits", (*_LIMITS, *_OPTIONAL)), ("energy", _ENERGY)):
        for key in document[table]:
            if key not in known:
                near = get_close_matches(key, known, n=1)
                raise InputError(f"[{table}] has no {key!r}; {f'did you mean {near[0]!r}?' if near else ', '.join(known)}")
    figures = {key: _number(limits, "limits", key) for key in _LIMITS}
    figures |= {key: _number(limits, "limits", key) for key in _OPTIONAL if key in limits}
    figures |= {key: _number(energy, "energy", key) for key in _ENERGY}
    return VehicleModel(
        name=document["name"],
        domain=document["domain"],
        source=document["source"],
        dynamics=document["dynamics"],
        file=file,
        **figures,
    )


def _number(table: dict[str, Any], name: str, key: str) -> float:
    value = table.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"[{name}] {key} must be a number, not {str(value)[:40]!r}")
    if not 0 <= value < 1e9:
        raise InputError(f"[{name}] {key} = {value:.6g} must be positive and below 1e9")
    return float(value)


def _folder() -> Any:
    return files("quarterdeck") / "data" / "vehicles"
