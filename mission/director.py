"""Directors: pure functions that decide what every vehicle does next.

A world, whether the fast event-driven one or PyBullet, calls its director with what it knows; the director answers with
commands. So waiting, faults, triage and recovery have one door, and are the same in both worlds.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any, Protocol

from quarterdeck.mission.mission import Mission, Waypoint


@dataclass(frozen=True, slots=True)
class State:
    """A vehicle as the world knows it: position in metres, `heading` radians counter-clockwise from east.

    `reached` is the number of waypoints of its last command that it has reached and served; it is `idle` when all are.
    """

    x: float
    y: float
    z: float = 0.0
    heading: float = 0.0
    alive: bool = True
    reached: int = 0
    idle: bool = True
    energy_used: float = 0.0  # Wh


@dataclass(frozen=True, slots=True)
class Event:
    """Something observed: `kind` such as `lost`, `returned`, `seen`, `served`, `met`, `blocked`; who, and about what.

    `held`: it has stood for long before the vehicle `subject`, which lies at `data`'s place, `x` and `y`, and is not heard.
    `unreachable`: there is no way any more to the task `subject` (empty: to where the last command ends); `data` has the
    place, `x` and `y`, and `found`, a MultiPolygon of all that the robot has found and the plan does not know. It stays
    there until it is told something else.
    """

    kind: str
    vehicle: str
    subject: str = ""
    data: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Command:
    """What a vehicle is to do from now on: these waypoints in order; none means stop and stay.

    A waypoint's `speed` and `hold` count, its `time` is the earliest departure from the waypoint before it.
    """

    waypoints: tuple[Waypoint, ...] = ()


class Director(Protocol):
    """(time, states by vehicle id, events since the last call, memory) -> (commands by vehicle id, memory).

    A vehicle without a command carries on with its last. `memory` is None at the first call. A memory with an attribute
    `wake`, seconds, asks to be called then though nothing happens; the run is not over before.
    """

    def __call__(
        self, time: float, states: Mapping[str, State], events: tuple[Event, ...], memory: Any
    ) -> tuple[dict[str, Command], Any]:
        """Decide."""


def wake_time(memory: Any) -> float:
    """Return the seconds at which a director asks to be called again; infinity where it does not."""
    return float(getattr(memory, "wake", inf))


def fixed(mission: Mission) -> Director:
    """Return the director that sends every vehicle along its planned route and changes nothing."""

    def direct(
        time: float,  # noqa: ARG001
        states: Mapping[str, State],  # noqa: ARG001
        events: tuple[Event, ...],  # noqa: ARG001
        memory: Any,
    ) -> tuple[dict[str, Command], Any]:
        if memory is not None:
            return {}, memory
        return {
            # A route's times are arrivals as planned; as a command's they would be departures to wait for.
            route.vehicle: Command(tuple(replace(w, time=0.0) for w in route.waypoints[1:]))
            for route in mission.routes
        }, True

    return direct
