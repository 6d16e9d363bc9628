"""Studies of a plan: what `simulate` makes of it under winds, currents, receivers and faults."""

import math
import shlex
import threading
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from typing import Any

from quarterdeck.campaign.kind import BETWEEN, Kind, is_number
from quarterdeck.geo.errors import InputError
from quarterdeck.mission.mission import Mission
from quarterdeck.physics.positioning import GNSS

NUMBERS = {
    "current_speed": "m/s of the water",
    "current_towards": "compass degrees that it goes to",
    "wind_speed": "m/s, mean",
    "wind_from": "compass degrees that it comes from",
    "gusts": "m/s, standard deviation",
}
FLAGS = ("lidar", "amcl")
FIGURES = ("coverage_driven", "time", "energy", "legs_p95", "clearance", "separation", "localisation_p95")
_ONE = threading.Lock()  # PyBullet is not made for threads; a Dask worker may have several


@dataclass(frozen=True, slots=True)
class PlanCase:
    """One run of a plan. `levels` are the values of the conditions that the study varies; the rest is what `simulate`
    takes.
    """

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

    def row(self) -> dict[str, Any]:
        """Return the case as columns of a table."""
        row = asdict(self)
        del row["levels"]
        for name in ("current", "wind"):
            row[f"{name}_east"], row[f"{name}_north"] = row.pop(name)
        row["faults"] = " ".join(self.faults)
        row["gnss"] = self.gnss or ""
        return row

    def run(self, text: str, limits: dict[str, float]) -> dict[str, Any]:
        """Return the verdict with its reasons, the report's figures and the trajectory's hash."""
        from quarterdeck.physics.sensing import Sensing
        from quarterdeck.physics.simulate import simulate

        with _ONE:
            report = simulate(
                _mission(text),
                seed=self.seed,
                current=self.current,
                wind=self.wind,
                gusts=self.gusts,
                faults=self.faults,
                sensing=Sensing(gnss=self.gnss, lidar=self.lidar, amcl=self.amcl),
                limits=limits,
            ).report
        return {
            "passed": report.passed,
            "reasons": BETWEEN.join(report.reasons),
            **report.figures,
            "trace_hash": report.trace_hash,
        }

    def replay(self, source: str, limits: Mapping[str, float]) -> str:
        """Return the command that runs the case again, exactly."""
        words = ["quarterdeck simulate", shlex.quote(source), f"--seed {self.seed}"]
        motions = {"current": self.current, "wind": self.wind}
        words += [f"--{name}={east!r},{north!r}" for name, (east, north) in motions.items() if east or north]
        if self.gusts:
            words.append(f"--gusts {self.gusts!r}")
        words += [f"--fail {shlex.quote(text)}" for text in self.faults]
        words += [f"--gnss {self.gnss}"] * (self.gnss is not None)
        words += ["--lidar"] * self.lidar + ["--amcl"] * self.amcl
        words += [f"--limit {name}={float(value)!r}" for name, value in limits.items()]
        return " ".join(words)


@lru_cache(maxsize=2)
def _mission(text: str) -> Mission:
    """Return the mission in a plan's text, read once a process."""
    from quarterdeck.geo.geojson import Document, parse
    from quarterdeck.mission.planfile import read_plan

    data = text.encode("utf-8")
    return read_plan(Document("plan.geojson", data, parse(data)))


def _case(number: int, seed: int, conditions: Mapping[str, Any], levels: Mapping[str, Any]) -> PlanCase:
    c = conditions
    return PlanCase(
        number=number,
        seed=seed,
        current=_vector(c.get("current_speed", 0.0), c.get("current_towards", 0.0)),
        wind=_vector(c.get("wind_speed", 0.0), c.get("wind_from", 0.0) + 180.0),
        gusts=c.get("gusts", 0.0),
        faults=c.get("faults", ()),
        gnss=c.get("gnss"),
        lidar=c.get("lidar", False),
        amcl=c.get("amcl", False),
        levels=levels,
    )


def _vector(speed: float, towards: float) -> tuple[float, float]:
    """Return east and north of a speed and a compass direction in degrees."""
    angle = math.radians(towards)
    return round(speed * math.sin(angle), 9) + 0.0, round(speed * math.cos(angle), 9) + 0.0


def _value(name: str, value: Any) -> Any:
    if name in NUMBERS:
        if not is_number(value) or (value < 0 and not name.endswith(("towards", "from"))):
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


PLAN = Kind(
    table="conditions",
    names=(*NUMBERS, "faults", "gnss", *FLAGS),
    numbers=NUMBERS,
    lists=("faults",),
    value=_value,
    case=_case,
    figures=FIGURES,
)
