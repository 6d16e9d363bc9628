"""A study: one plan under many conditions, read from TOML, and the runs that it asks for."""

import hashlib
import math
import shlex
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from difflib import get_close_matches
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.reader import read_bytes
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.planfile import read_plan
from quarterdeck.physics.faults import read_faults
from quarterdeck.physics.positioning import GNSS
from quarterdeck.physics.report import check_limits

NUMBERS = {
    "current_speed": "m/s of the water",
    "current_towards": "compass degrees that it goes to",
    "wind_speed": "m/s, mean",
    "wind_from": "compass degrees that it comes from",
    "gusts": "m/s, standard deviation",
}
FLAGS = ("lidar", "amcl")
MOST_RUNS = 1_000_000


@dataclass(frozen=True, slots=True)
class Study:
    """What to run. `fixed` conditions, `levels` those of which every value is run, `drawn` those drawn anew for each run.

    `runs` of each combination; run r of every combination has the seed `seed` + r and the same draws, so that combinations
    are compared under the same luck. `text` is the plan's, `hash` stands for all that the results depend on.
    """

    path: Path
    plan: Path
    mission: Mission
    text: str
    runs: int
    seed: int
    fixed: Mapping[str, Any]
    levels: Mapping[str, tuple[Any, ...]]
    drawn: Mapping[str, Mapping[str, tuple[float, float]]]
    limits: Mapping[str, float]
    hash: str

    @property
    def count(self) -> int:
        """How many runs there are in all."""
        return self.runs * math.prod(len(values) for values in self.levels.values())


@dataclass(frozen=True, slots=True)
class Case:
    """One run. `levels` are the values of the conditions that the study varies; the rest is what `simulate` takes."""

    number: int
    seed: int
    current: tuple[float, float]
    wind: tuple[float, float]
    gusts: float
    faults: tuple[str, ...]
    gnss: str | None
    lidar: bool
    amcl: bool
    levels: Mapping[str, Any] = field(default_factory=dict)


def read_study(path: Path) -> Study:
    """Return the study in a TOML file, its plan read and all that can be wrong checked.

    Raises InputError, in one line that names the key, if the file or a key is wrong or a fault names no vehicle of the
    plan.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error}); give the path of a study in TOML") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not valid TOML: {error}") from None
    try:
        return _study(path, document)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _study(path: Path, document: dict[str, Any]) -> Study:
    _known(document, ("plan", "runs", "seed", "conditions", "limits"), "")
    if not isinstance(document.get("plan"), str):
        raise InputError("'plan' must be the path of a PLAN file")
    runs, seed = _whole(document, "runs", 1, 100), _whole(document, "seed", 0, 0)
    conditions, limits = document.get("conditions", {}), document.get("limits", {})
    if not isinstance(conditions, dict) or not isinstance(limits, dict):
        raise InputError("[conditions] and [limits] must be tables")
    _known(conditions, (*NUMBERS, "faults", "gnss", *FLAGS), "conditions.")
    if any(isinstance(v, bool) or not isinstance(v, int | float) for v in limits.values()):
        raise InputError("[limits] must be numbers")
    check_limits(limits)
    fixed, levels, drawn = {}, {}, {}
    for name, value in conditions.items():
        if isinstance(value, dict):
            drawn[name] = _distribution(name, value)
        elif isinstance(value, list) and (name != "faults" or any(isinstance(v, list) for v in value)):
            if not value:
                raise InputError(f"conditions.{name} is an empty list")
            levels[name] = tuple(_value(name, v) for v in value)
        else:
            fixed[name] = _value(name, value)
    plan = path.parent / document["plan"]
    mission = read_plan(plan)
    text = read_bytes(plan).decode("utf-8-sig")
    told = repr((runs, seed, fixed, levels, drawn, sorted(limits.items()))) + text
    digest = hashlib.sha256(told.encode()).hexdigest()
    study = Study(path, plan, mission, text, runs, seed, fixed, levels, drawn, limits, digest)
    if study.count > MOST_RUNS:
        raise InputError(f"asks for {study.count:,} runs, more than {MOST_RUNS:,}; vary less or lower 'runs'")
    for faults in (*levels.get("faults", ()), fixed.get("faults", ())):
        read_faults(faults, [v.id for v in mission.vehicles], 1.0, 0)
    return study


def cases(study: Study) -> Iterator[Case]:
    """Yield the study's runs in order: for each combination of levels, run 0, 1, 2 and so on."""
    draws = [_draw(study, r) for r in range(study.runs)]
    number = 0
    for values in product(*study.levels.values()):
        levels = dict(zip(study.levels, values, strict=True))
        for r in range(study.runs):
            c = {**study.fixed, **levels, **draws[r]}
            yield Case(
                number=number,
                seed=study.seed + r,
                current=_vector(c.get("current_speed", 0.0), c.get("current_towards", 0.0)),
                wind=_vector(c.get("wind_speed", 0.0), c.get("wind_from", 0.0) + 180.0),
                gusts=c.get("gusts", 0.0),
                faults=c.get("faults", ()),
                gnss=c.get("gnss"),
                lidar=c.get("lidar", False),
                amcl=c.get("amcl", False),
                levels=levels,
            )
            number += 1


def replay(study: Study, case: Case) -> str:
    """Return the command that runs a case again, exactly."""
    words = ["quarterdeck simulate", shlex.quote(str(study.plan)), f"--seed {case.seed}"]
    motions = {"current": case.current, "wind": case.wind}
    words += [f"--{name}={east!r},{north!r}" for name, (east, north) in motions.items() if east or north]
    if case.gusts:
        words.append(f"--gusts {case.gusts!r}")
    words += [f"--fail {shlex.quote(text)}" for text in case.faults]
    words += [f"--gnss {case.gnss}"] * (case.gnss is not None)
    words += ["--lidar"] * case.lidar + ["--amcl"] * case.amcl
    words += [f"--limit {name}={float(value)!r}" for name, value in study.limits.items()]
    return " ".join(words)


def flat(case: Case) -> dict[str, Any]:
    """Return a case as columns of a table."""
    row = asdict(case)
    del row["levels"]
    for name in ("current", "wind"):
        row[f"{name}_east"], row[f"{name}_north"] = row.pop(name)
    row["faults"] = " ".join(case.faults)
    row["gnss"] = case.gnss or ""
    return row


def _draw(study: Study, r: int) -> dict[str, float]:
    """Return the drawn conditions of run `r` of each combination."""
    out = {}
    for name, what in study.drawn.items():
        random = np.random.default_rng([study.seed, r, list(NUMBERS).index(name)])
        a, b = next(iter(what.values()))
        value = random.uniform(a, b) if "uniform" in what else random.normal(a, b)
        # What is no direction is not negative; rounded so that the command that replays the run is readable.
        out[name] = round(float(value if name.endswith(("towards", "from")) else max(value, 0.0)), 6)
    return out


def _vector(speed: float, towards: float) -> tuple[float, float]:
    """Return east and north of a speed and a compass direction in degrees."""
    angle = math.radians(towards)
    return round(speed * math.sin(angle), 9) + 0.0, round(speed * math.cos(angle), 9) + 0.0


def _distribution(name: str, value: dict[str, Any]) -> dict[str, tuple[float, float]]:
    pair = next(iter(value.values()), None)
    numbers = isinstance(pair, list) and len(pair) == 2 and all(_is_number(v) for v in pair)
    if name not in NUMBERS or len(value) != 1 or next(iter(value)) not in ("uniform", "normal") or not numbers:
        raise InputError(
            f"conditions.{name} must be a value, a list, or a number drawn by {{ uniform = [low, high] }} "
            "or {{ normal = [mean, deviation] }}".replace("{{", "{").replace("}}", "}")
        )
    assert isinstance(pair, list)
    kind, (a, b) = next(iter(value)), pair
    if (kind == "uniform" and a > b) or (kind == "normal" and b < 0):
        raise InputError(f"conditions.{name}: {kind} = {pair} is the wrong way round")
    return {kind: (float(a), float(b))}


def _value(name: str, value: Any) -> Any:
    if name in NUMBERS:
        if not _is_number(value) or (value < 0 and not name.endswith(("towards", "from"))):
            raise InputError(f"conditions.{name} = {value!r} must be a number, {NUMBERS[name]}")
        return float(value)
    if name in FLAGS:
        if not isinstance(value, bool):
            raise InputError(f"conditions.{name} = {value!r} must be true or false")
        return value
    if name == "gnss":
        if value not in ("", *GNSS):
            raise InputError(f"conditions.gnss = {value!r} must be one of {', '.join(GNSS)}, or empty for perfect fixes")
        return value or None
    if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
        raise InputError(
            f"conditions.faults: {value!r} must be a list of texts, such as ['usv-2@600'], or a list of such lists"
        )
    return tuple(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _whole(document: dict[str, Any], name: str, least: int, default: int) -> int:
    value = document.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise InputError(f"{name!r} must be a whole number from {least}, not {value!r}")
    return value


def _known(table: dict[str, Any], names: tuple[str, ...], place: str) -> None:
    for name in table:
        if name not in names:
            near = get_close_matches(name, names, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(names)}"
            raise InputError(f"unknown key {place}{name}; {hint}")
