"""Studies of triage: seeded cases by method, team and assumption, on the paper's field or on a site."""

import math
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from quarterdeck.campaign.kind import BETWEEN, Kind, is_number
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Scenario
from quarterdeck.mission.triage.figures import figures
from quarterdeck.mission.triage.generate import FEWEST, FIELD, MOST
from quarterdeck.mission.triage.settings import COLOURS, METHODS, ORDERS, RENDEZVOUS, Settings
from quarterdeck.mission.triage.study import Variant, case_outcome

# The conditions are the options of `quarterdeck triage`.
NUMBERS = {
    "treat": "s",
    "talk": "m",
    "medic_speed": "m/s",
    "medic_sees": "m",
    "ugv_sees": "m",
    "spacing": "m",
    "fatigue": "part of the speed lost in 100 m",
    "confidence": "a probability",
    "position_error": "m",
}
TEAM = {"ugvs": 3, "uavs": 1, "medics": 1, "field": FIELD}  # what a site has of its own
OTHERS = {
    "method": "relay",
    "casualties": (FEWEST, MOST),
    "clustered": False,
    "order": None,
    "rendezvous": "fixed",
    "medic_unknown": False,
    "clusters": 5,
    "helpers": 0,
}
LEAST = {"ugvs": 1, "uavs": 0, "medics": 1, "clusters": 1, "helpers": 0}
WORDS = {"method": tuple(METHODS), "order": ("", *ORDERS), "rendezvous": RENDEZVOUS}
DEFAULTS: Mapping[str, Any] = (
    TEAM | OTHERS | {name: getattr(Settings(), name) for name in NUMBERS if name != "treat"} | {"treat": 10.0}
)
FIGURES = (
    "time", "score", "ugv_distance", "medic_distance", "red_wait", "yellow_wait", "green_wait", "value_weighted_wait",
    "medic_idle", "reached_5_min", "reached_10_min", "reached_30_min",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class TriageCase:
    """One mission. `conditions` are all of them, defaults too; the team's are None where a site has them."""

    number: int
    seed: int
    conditions: Mapping[str, Any]
    levels: Mapping[str, Any] = field(default_factory=dict)

    def row(self) -> dict[str, Any]:
        """Return the case as columns of a table."""
        told = {
            n: " ".join(map(str, v)) if isinstance(v, tuple) else v for n, v in self.conditions.items() if v is not None
        }
        return {"number": self.number, "seed": self.seed} | told

    def run(self, text: str, limits: dict[str, float]) -> dict[str, Any]:  # noqa: ARG002
        """Return the figures, None where there is nobody whom they are about; passed is all found, told and treated."""
        outcome = case_outcome(_variant(self.conditions), self.seed, _site(text) if text else None)
        numbers = {name: value if math.isfinite(value) else None for name, value in figures(outcome).items()}
        return {"passed": not outcome.reasons, "reasons": BETWEEN.join(outcome.reasons)} | _apart(numbers, self.conditions)

    def replay(self, source: str, limits: Mapping[str, float]) -> str:  # noqa: ARG002
        """Return the commands that make the case and run it again."""
        c = self.conditions
        make = ["quarterdeck triage", *([shlex.quote(source)] if source else []), f"--generate 1 --seed {self.seed}"]
        make += ["--casualties {} {}".format(*c["casualties"]), *(["--clustered"] if c["clustered"] else [])]
        if not source:
            make += ["--team {ugvs} {uavs} {medics}".format(**c), "--field {!r} {!r}".format(*c["field"])]
        run = [f"quarterdeck triage - --seed {self.seed} --method {c['method']}"]
        run += ["--medic-unknown"] if c["medic_unknown"] else []
        options = ("order", "rendezvous", "clusters", "helpers", *NUMBERS)
        run += [f"--{n.replace('_', '-')} {c[n]}" for n in options if c[n] != DEFAULTS[n]]
        return f"{' '.join(make)} | {' '.join(run)}"


def _apart(numbers: dict[str, Any], conditions: Mapping[str, Any]) -> dict[str, Any]:
    """Rename what is both a condition and a figure, such as `casualties`, the range asked for and the number there was."""
    return {f"{name}_count" if name in conditions else name: value for name, value in numbers.items()}


@lru_cache(maxsize=2)
def _site(text: str) -> Scenario:
    """Return the scenario in a site's text, read once a process."""
    from quarterdeck.geo.geojson import Document, parse
    from quarterdeck.geo.reader import read_scenario

    data = text.encode("utf-8")
    return read_scenario(Document("site.geojson", data, parse(data)))


def _case(number: int, seed: int, conditions: Mapping[str, Any], levels: Mapping[str, Any]) -> TriageCase:
    full = {**DEFAULTS, **conditions}
    _variant(full)
    return TriageCase(number, seed, full, levels)


def _variant(conditions: Mapping[str, Any]) -> Variant:
    """Return what the conditions ask for. Raises InputError if a number is out of its range."""
    c = {name: DEFAULTS[name] if value is None else value for name, value in conditions.items()}
    names = ("order", "rendezvous", "clusters", "helpers", *(n for n in NUMBERS if n != "treat"))
    settings = Settings(
        treat=dict.fromkeys(COLOURS, c["treat"]), knows_medic=not c["medic_unknown"], **{n: c[n] for n in names}
    )
    return Variant(
        method=c["method"],
        settings=settings,
        ugvs=c["ugvs"],
        uavs=c["uavs"],
        medics=c["medics"],
        size=c["field"],
        casualties=c["casualties"],
        clustered=c["clustered"],
    )


def _value(name: str, value: Any) -> Any:
    place = f"triage.{name} = {value!r}"
    if value is None:  # TOML has no None: the site has what this is
        return None
    if name in WORDS:
        if value not in WORDS[name]:
            raise InputError(f"{place} must be one of {', '.join(filter(None, WORDS[name]))}")
        return value or None
    if name in LEAST:
        if isinstance(value, bool) or not isinstance(value, int) or value < LEAST[name]:
            raise InputError(f"{place} must be a whole number from {LEAST[name]}")
        return value
    if name in ("clustered", "medic_unknown"):
        if not isinstance(value, bool):
            raise InputError(f"{place} must be true or false")
        return value
    if name in ("field", "casualties"):
        return _pair(name, value, place)
    if not is_number(value):
        raise InputError(f"{place} must be a number, {NUMBERS[name]}")
    try:
        _variant({**DEFAULTS, name: float(value)})
    except InputError as error:
        raise InputError(f"triage.{error}") from None
    return float(value)


def _pair(name: str, value: Any, place: str) -> tuple[Any, Any]:
    numbers = isinstance(value, list) and len(value) == 2 and all(map(is_number, value))
    if name == "field":
        if not numbers or min(value) <= 0:
            raise InputError(f"{place} must be [width, height] in m")
        return float(value[0]), float(value[1])
    if not numbers or not all(isinstance(v, int) for v in value) or not 0 <= value[0] <= value[1]:
        raise InputError(f"{place} must be [fewest, most], whole numbers")
    return value[0], value[1]


TRIAGE = Kind(
    table="triage",
    names=(*DEFAULTS, "site"),
    numbers=NUMBERS,
    lists=("field", "casualties"),
    value=_value,
    case=_case,
    figures=FIGURES,
)
