"""A study: a plan, or triage, under many conditions, read from TOML, and the runs that it asks for."""

import hashlib
import math
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from quarterdeck.campaign.kind import Case, Kind, is_number
from quarterdeck.campaign.plans import PLAN
from quarterdeck.campaign.triage import TEAM, TRIAGE
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.files import read_bytes
from quarterdeck.geo.kinds import STUDY, kind_of
from quarterdeck.geo.reader import read_scenario
from quarterdeck.mission.planfile import read_plan
from quarterdeck.physics.faults import read_faults
from quarterdeck.physics.report import check_limits

MOST_RUNS = 1_000_000


@dataclass(frozen=True, slots=True)
class Study:
    """What to run. `fixed` conditions, `levels` those of which every value is run, `drawn` those drawn anew for each run.

    `runs` of each combination; run r of every combination has the seed `seed` + r and the same draws, so that combinations
    are compared under the same luck. `source` is the path of the plan or site, if any, and `text` what is in it; `hash`
    stands for all that the results depend on.
    """

    path: Path
    kind: Kind
    name: str
    source: Path | None
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


def read_study(path: Path) -> Study:
    """Return the study in a TOML file, its plan read and all that can be wrong checked.

    Raises InputError, in one line that names the key, if the file or a key is wrong or a fault names no vehicle of the
    plan.
    """
    data = read_bytes(path)
    if (kind := kind_of(data)) not in (None, STUDY):
        raise InputError(f"{path}: is {kind}; a study is TOML, see docs/campaign.md")
    try:
        document = tomllib.loads(data.decode("utf-8"))
    except (UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{path}: cannot be read ({error}); give the path of a study in TOML") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not valid TOML: {error}") from None
    try:
        return _study(path, document)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _study(path: Path, document: dict[str, Any]) -> Study:
    read = _about_triage if "triage" in document else _about_plan
    kind, name, source, conditions, limits = read(path.parent, document)
    runs, seed = _whole(document, "runs", 1, 100), _whole(document, "seed", 0, 0)
    fixed, levels, drawn = {}, {}, {}
    for key, value in conditions.items():
        if isinstance(value, dict):
            drawn[key] = _distribution(kind, key, value)
        elif isinstance(value, list) and (key not in kind.lists or any(isinstance(v, list) for v in value)):
            if not value:
                raise InputError(f"{kind.table}.{key} is an empty list")
            levels[key] = tuple(kind.value(key, v) for v in value)
        else:
            fixed[key] = kind.value(key, value)
    text = "" if source is None else read_bytes(source).decode("utf-8-sig")
    told = repr((kind.table, runs, seed, fixed, levels, drawn, sorted(limits.items()))) + text
    digest = hashlib.sha256(told.encode()).hexdigest()
    study = Study(path, kind, name, source, text, runs, seed, fixed, levels, drawn, limits, digest)
    if study.count > MOST_RUNS:
        raise InputError(f"asks for {study.count:,} runs, more than {MOST_RUNS:,}; vary less or lower 'runs'")
    return study


_About = tuple[Kind, str, Path | None, dict[str, Any], dict[str, float]]


def _about_plan(folder: Path, document: dict[str, Any]) -> _About:
    """Return a plan's kind, name and path, the conditions as they stand, and the limits."""
    _known(document, ("plan", "runs", "seed", "conditions", "limits", "triage"), "")
    if not isinstance(document.get("plan"), str):
        raise InputError("'plan' must be the path of a PLAN file, or [triage] the table of a triage study")
    conditions, limits = document.get("conditions", {}), document.get("limits", {})
    if not isinstance(conditions, dict) or not isinstance(limits, dict):
        raise InputError("[conditions] and [limits] must be tables")
    _known(conditions, PLAN.names, "conditions.")
    if not all(is_number(v) or v == math.inf for v in limits.values()):
        raise InputError("[limits] must be numbers")
    check_limits(limits)
    mission = read_plan(folder / document["plan"])
    schedules = conditions.get("faults", [])
    for faults in schedules if isinstance(schedules, list) else ():
        told = PLAN.value("faults", faults if isinstance(faults, list) else schedules)
        read_faults(told, [v.id for v in mission.vehicles], 1.0, 0)
    return PLAN, mission.name, folder / document["plan"], conditions, limits


def _about_triage(folder: Path, document: dict[str, Any]) -> _About:
    """Return the same of a triage study, which has no limits."""
    _known(document, ("triage", "runs", "seed"), "")
    if not isinstance(document["triage"], dict):
        raise InputError("[triage] must be a table")
    conditions = dict(document["triage"])
    site = conditions.pop("site", None)
    if site is None:
        _known(conditions, TRIAGE.names, "triage.")
        return TRIAGE, "triage", None, conditions, {}
    if not isinstance(site, str):
        raise InputError("triage.site must be the path of a site in GeoJSON")
    for name in TEAM:
        if name in conditions:
            raise InputError(f"triage.{name} cannot be given with a site, which has a field and a team of its own")
    _known(conditions, TRIAGE.names, "triage.")
    return TRIAGE, read_scenario(folder / site).name, folder / site, conditions | dict.fromkeys(TEAM), {}


def cases(study: Study) -> Iterator[Case]:
    """Yield the study's runs in order: for each combination of levels, run 0, 1, 2 and so on."""
    draws = [_draw(study, r) for r in range(study.runs)]
    number = 0
    for values in product(*study.levels.values()):
        levels = dict(zip(study.levels, values, strict=True))
        for r in range(study.runs):
            c = {**study.fixed, **levels, **draws[r]}
            yield study.kind.case(number, study.seed + r, c, levels)
            number += 1


def _draw(study: Study, r: int) -> dict[str, float]:
    """Return the drawn conditions of run `r` of each combination."""
    out = {}
    for name, what in study.drawn.items():
        random = np.random.default_rng([study.seed, r, list(study.kind.numbers).index(name)])
        a, b = next(iter(what.values()))
        value = random.uniform(a, b) if "uniform" in what else random.normal(a, b)
        # What is no direction is not negative; rounded so that the command that replays the run is readable.
        out[name] = round(float(value if name.endswith(("towards", "from")) else max(value, 0.0)), 6)
    return out


def _distribution(kind: Kind, name: str, value: dict[str, Any]) -> dict[str, tuple[float, float]]:
    pair = next(iter(value.values()), None)
    numbers = isinstance(pair, list) and len(pair) == 2 and all(is_number(v) for v in pair)
    if name not in kind.numbers or len(value) != 1 or next(iter(value)) not in ("uniform", "normal") or not numbers:
        raise InputError(
            f"{kind.table}.{name} must be a value, a list, or a number drawn by {{ uniform = [low, high] }} "
            "or {{ normal = [mean, deviation] }}".replace("{{", "{").replace("}}", "}")
        )
    assert isinstance(pair, list)
    form, (a, b) = next(iter(value)), pair
    if (form == "uniform" and a > b) or (form == "normal" and b < 0):
        raise InputError(f"{kind.table}.{name}: {form} = {pair} is the wrong way round")
    return {form: (a + 0.0, b + 0.0)}  # 0.0 of -0.0, at which numpy takes the range for a negative one


def _whole(document: dict[str, Any], name: str, least: int, default: int) -> int:
    value = document.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= 2**53:
        raise InputError(f"{name!r} must be a whole number from {least} to 2^53, not {str(value)[:40]!r}")
    return value


def _known(table: dict[str, Any], names: tuple[str, ...], place: str) -> None:
    for name in table:
        if name not in names:
            near = get_close_matches(name, names, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(names)}"
            raise InputError(f"unknown key {place}{name}; {hint}")
