"""What the team can do (`Settings`) and how the four methods differ (`Policy`): everything that the paper leaves open."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from math import inf
from types import MappingProxyType
from typing import Any, Literal, get_args

from quarterdeck.geo.errors import InputError

Colour = Literal["red", "yellow", "green", "grey", "black"]
COLOURS: tuple[Colour, ...] = get_args(Colour)
# SALT's sort sees only who is still, who waves and who walks: a robot takes the expectant and the dead for red.
SORT: Mapping[str, Colour] = MappingProxyType(
    {"red": "red", "grey": "red", "black": "red", "yellow": "yellow", "green": "green"}
)
RANK: Mapping[str, int] = MappingProxyType({"red": 0, "yellow": 1, "green": 2})
ORDERS = ("priority", "nearest", "first-come")
RENDEZVOUS = ("fixed", "moving", "round-robin")


@dataclass(frozen=True, slots=True)
class Settings:
    """The assumptions. Metres, seconds, m/s; ranges are measured on the plan.

    `spacing` of the search lanes, where the site gives none; `ugv_sees`, where a vehicle gives no `range`, and
    `medic_sees`; `talk` the communication range; `treat` seconds a casualty by category; `clusters` N of the paper, how
    many urgent casualties a UGV gathers before it reports; `patience` seconds that a UGV waits for the UAV before it takes
    it for lost; `linger` seconds waited at the end of a medic's queue before all the field is searched for him, `sweeps`
    times before he is given up.
    Ideas that the paper only names: `order` of the medics (None: the method's own), `rendezvous` of the UAVs,
    `helpers` who shorten treatment (each green treated, at most this many, by `help_gain` each), `fatigue` the part of
    the speed lost in 100 m walked (to half at the least). `confidence` is the probability that a robot sorts right,
    `position_error` the standard deviation, each way, of where it says a casualty is.
    `knows_medic`: without a relay, the UGVs know at any time where the medics are and go.
    """

    spacing: float = 2.5
    ugv_sees: float = 3.0
    medic_sees: float = 3.0
    medic_speed: float = 1.4
    talk: float = 2.0
    treat: Mapping[str, float] = field(default_factory=lambda: dict.fromkeys(COLOURS, 10.0))
    clusters: int = 5
    patience: float = 120.0
    linger: float = 20.0
    sweeps: int = 5
    order: str | None = None
    rendezvous: str = "fixed"
    helpers: int = 0
    help_gain: float = 0.25
    fatigue: float = 0.0
    confidence: float = 1.0
    position_error: float = 0.0
    knows_medic: bool = True

    def __post_init__(self) -> None:
        for name in ("spacing", "ugv_sees", "medic_speed", "talk", "patience", "linger"):
            if not 0 < getattr(self, name) < inf:
                raise InputError(f"{name} must be a number above 0, not {getattr(self, name)}")
        for name in ("medic_sees", "help_gain", "fatigue", "position_error"):
            if not 0 <= getattr(self, name) < inf:
                raise InputError(f"{name} must be a number from 0, not {getattr(self, name)}")
        if set(self.treat) != set(COLOURS) or not all(0 <= s < inf for s in self.treat.values()):
            raise InputError(f"treat must give seconds from 0 for each of {', '.join(COLOURS)}")
        if self.clusters < 1 or self.sweeps < 1 or self.helpers < 0:
            raise InputError("clusters and sweeps must be at least 1, helpers at least 0")
        if not 0 <= self.confidence <= 1:
            raise InputError(f"confidence must be between 0 and 1, not {self.confidence}")
        if self.order not in (None, *ORDERS):
            raise InputError(f"order must be one of {', '.join(ORDERS)}, not {self.order!r}")
        if self.rendezvous not in RENDEZVOUS:
            raise InputError(f"rendezvous must be one of {', '.join(RENDEZVOUS)}, not {self.rendezvous!r}")


def as_parameters(settings: Settings) -> dict[str, Any]:
    """Return the settings as JSON can hold them, of which `Settings(**...)` makes them again."""
    return {f.name: getattr(settings, f.name) for f in fields(settings)} | {"treat": dict(settings.treat)}


@dataclass(frozen=True, slots=True)
class Policy:
    """How a method differs from the others, and in nothing else.

    `receiver`: to whom UGVs report. `urgent`: the sorts that make a UGV look around and report at once. `order`: how medics
    choose. `everywhere`: communication has no range, so UGVs report in the moment and never leave their path.
    """

    receiver: Literal["uav", "medic"]
    urgent: frozenset[str]
    order: str
    everywhere: bool = False


METHODS: Mapping[str, Policy] = MappingProxyType(
    {
        "relay": Policy("uav", frozenset({"red"}), "priority"),
        "no-relay": Policy("medic", frozenset({"red"}), "priority"),
        "no-priority": Policy("uav", frozenset({"red", "yellow", "green"}), "nearest"),
        "constant": Policy("medic", frozenset(), "priority", everywhere=True),
    }
)
