"""The verdict: what a run comes to, beside what was planned and what is allowed."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from difflib import get_close_matches
from functools import cache
from importlib.resources import files
from typing import Any

from quarterdeck.geo.errors import InputError
from quarterdeck.physics.task_report import TaskReport

# What a run may come to and still pass; None is half of each vehicle's clearance.
LIMITS: dict[str, tuple[float | None, str]] = {
    "coverage_loss": (0.01, "covered by the plan and not by the driven tracks, as a fraction of the area"),
    "collisions": (0, "vehicles that touched or went through anything"),
    "unfinished": (0, "vehicles that did not finish their routes (one whose part was given to others is only told)"),
    "unserved": (0, "tasks of the plan not served"),
    "cross_track": (None, "95 % of cross-track errors on straight legs, m (default: half the vehicle's clearance)"),
    "outside": (None, "how far a vehicle left the operating area, m (default: half its clearance)"),
    "clearance": (0.0, "least distance of a hull to an obstacle, m"),
    "separation": (0.0, "least distance between the hulls of two vehicles, m"),
    "battery": (1.0, "energy used over the battery's"),
    "endurance": (1.0, "time under way over the endurance"),
    "delay": (1.5, "time driven over time planned"),
    "localisation": (None, "95 % of a vehicle's localisation errors, m (default: not judged)"),
}


@dataclass(frozen=True, slots=True)
class CrossTrack:
    """Absolute cross-track errors in metres over `samples` samples (0: none, figures 0)."""

    mean: float
    p95: float
    max: float
    samples: int


@dataclass(frozen=True, slots=True)
class Localisation:
    """How far a vehicle's belief was from the truth, metres; the parts of the time that it lived by `lidar`, `gnss` and
    `dead` reckoning (the rest it simply knew); how many `recoveries` its particle filter tried.
    """

    mean: float
    p95: float
    max: float
    lidar: float
    gnss: float
    dead: float
    recoveries: int


@dataclass(frozen=True, slots=True)
class VehicleReport:
    """One vehicle's run. Times s, energies Wh, distances m; `touched` counts separate contacts that PyBullet told of,
    `hits` names the obstacles that the hull went through by the swept-path check; None where there is nothing to be
    near to. `time_fast` and `energy_fast` are what it took in the fast world.
    """

    id: str
    domain: str
    finished: bool
    aground: bool
    legs: CrossTrack
    turns: CrossTrack
    touched: int
    hits: tuple[str, ...]
    outside: float
    clearance: float | None
    clearance_time: float
    clearance_obstacle: str
    separation: float | None
    separation_time: float
    separation_vehicle: str
    time_planned: float
    time: float
    energy_planned: float
    energy: float
    length_planned: float
    length: float
    lost: bool = False
    localisation: Localisation | None = None
    time_fast: float | None = None
    energy_fast: float | None = None


@dataclass(frozen=True, slots=True)
class Report:
    """A run's figures, the limits that they were held against, and why it failed (`reasons`; it passed when there are
    none). `command` has the `options` of the command line that it came of, and the SHA-256 of the `files` among them.
    `notes` say what of a log was left out or reckoned; of a simulated run, who was lost, and what nobody could do then.
    `state` is where its end leaves the mission (`mission.recorded.progress_state`), for `replan --state`.
    """

    mission: str
    version: str
    settings: Mapping[str, Any]
    limits: Mapping[str, float | None]
    figures: Mapping[str, float | int | None]
    vehicles: tuple[VehicleReport, ...]
    reasons: tuple[str, ...]
    trace_hash: str
    tasks: tuple[TaskReport, ...] = ()
    command: Mapping[str, Any] | None = None
    notes: tuple[str, ...] = ()
    triage: Mapping[str, Any] | None = None  # casualties and figures, the fast world's beside the run's
    state: Mapping[str, Any] | None = None

    @property
    def passed(self) -> bool:
        """Whether everything is within the limits."""
        return not self.reasons

    def to_json(self) -> str:
        """Return the report as JSON, by the schema that `report_schema` returns."""
        document = {"type": "quarterdeck-report", "passed": self.passed, **asdict(self)}
        return json.dumps(document, indent=2, allow_nan=False) + "\n"


@cache
def report_schema() -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of a report."""
    text = (files("quarterdeck.physics") / "report.schema.json").read_text(encoding="utf-8")
    schema: dict[str, Any] = json.loads(text)
    return schema


def check_limits(limits: Mapping[str, float]) -> dict[str, float | None]:
    """Return all LIMITS with `limits` in their place. Raises InputError for an unknown one or a value that is not a
    number.
    """
    for name, value in limits.items():
        if name not in LIMITS:
            near = get_close_matches(name, LIMITS, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(LIMITS)}"
            raise InputError(f"unknown limit {name!r}; {hint}")
        if not value >= 0:
            raise InputError(f"limit {name} = {value} must be a number from 0")
    return {name: default for name, (default, _) in LIMITS.items()} | dict(limits)
