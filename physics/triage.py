"""A triage mission after its run in PyBullet: what became of the casualties, beside what the fast world expected."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission import world
from quarterdeck.mission.mission import Mission, Route, Waypoint
from quarterdeck.mission.triage.figures import figures
from quarterdeck.mission.triage.outcome import Fate, Outcome, judge
from quarterdeck.mission.triage.plan import scenario_of, settings_of, team_of
from quarterdeck.physics.faults import Fault
from quarterdeck.physics.trace import Trace

TIMES = ("found", "reported", "delivered", "reached", "treated")


@dataclass(frozen=True, slots=True)
class Compared:
    """A mission as it was `driven` and as the `fast` world has it; `expected` has the fast tracks as routes."""

    driven: Outcome
    fast: Outcome
    expected: Mission

    def document(self) -> dict[str, Any]:
        """Return both side by side for the report: figures by name, then each casualty; [fast, driven] throughout."""
        one, other = figures(self.fast), figures(self.driven)
        return {
            "method": self.driven.method,
            "figures": {name: [_number(one[name]), _number(other[name])] for name in one},
            "casualties": [_row(a, b) for a, b in zip(self.fast.fates, self.driven.fates, strict=True)],
        }


def of_devices(faults: Sequence[Fault], mission: Mission) -> tuple[Fault, ...]:
    """Return the faults of a triage mission: what fails of a medic is his device, not the person."""
    medics = mission.parameters["medics"]
    return tuple(replace(f, kind="comms") if f.kind == "lost" and f.vehicle in medics else f for f in faults)


def compare(mission: Mission, memory: Any, trace: Trace, reason: str, fast: Outcome) -> Compared:
    """Return what became of the casualties in a run that left `trace` and the director's `memory`, beside the `fast` world.

    `reason` says why the run was cut short, if it was.
    """
    tracks = {v: np.column_stack([trace.time, trace.x[:, i], trace.y[:, i]]) for i, v in enumerate(trace.vehicles)}
    run = world.Run(tracks, (), float(trace.time[-1]), memory, reason)
    scenario, team, settings = scenario_of(mission), team_of(mission), settings_of(mission)
    driven = judge(scenario, team, mission.parameters["method"], settings, run, seed=mission.seed)
    driven = replace(driven, faults=fast.faults)
    routes = tuple(_as_route(v, fast.run.tracks[v.id]) for v in mission.vehicles)
    return Compared(driven, fast, replace(mission, routes=routes))


def _as_route(vehicle: Vehicle, track: np.ndarray) -> Route:
    """Return an (n, 3) track of seconds, x, y as a route; standing is holding."""
    waypoints = [Waypoint(float(track[0, 1]), float(track[0, 2]), leg="start")]
    energy = 0.0
    for (t0, x0, y0), (t1, x, y) in zip(track[:-1].tolist(), track[1:].tolist(), strict=True):
        seconds, metres = t1 - t0, float(np.hypot(x - x0, y - y0))
        energy += vehicle.model.power(metres / seconds if seconds > 0 else 0.0) * seconds
        if metres < 1e-6:
            waypoints[-1] = replace(waypoints[-1], hold=waypoints[-1].hold + seconds)
        else:
            waypoints.append(Waypoint(x, y, vehicle.altitude, speed=metres / max(seconds, 1e-9), time=t1))
    return Route(vehicle.id, tuple(waypoints), energy / 3600.0)


def _row(fast: Fate, driven: Fate) -> dict[str, Any]:
    times = {name: [_number(getattr(f, name)) for f in (fast, driven)] for name in TIMES}
    return {"id": fast.id, "colour": fast.colour, "state": [fast.state, driven.state], **times}


def _number(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else round(float(value), 3)
