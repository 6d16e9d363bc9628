"""What the director that recovers remembers of a run, and what can be read from it when that is over."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any

import numpy as np

from quarterdeck.mission.contact import Contact
from quarterdeck.mission.director import Director
from quarterdeck.mission.inspection import Memory as Inspected
from quarterdeck.mission.lateness import Course
from quarterdeck.mission.mission import Mission, Route, Waypoint
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.told import Telling


@dataclass(frozen=True, slots=True)
class Memory:
    """What is remembered: the plan followed and since when, what was done before it, who is missed and until when to wait.

    `following` is the route that each vehicle was last told and heard; `used` each vehicle's watt-hours at `since`;
    `tracks` and `served`, tasks and who did them, are what was done before that plan (of guards: since then); `given_up`
    who is held for lost; `wake` when the next silence has lasted too long. `barred` are vehicles and the tasks to which
    they found no way, `undone` what earlier plans told could not be done. `untried` have not been heard of since they were
    told of the plan: how far they say to have come is how far they had come by the one before it. `sent` are the waypoints
    that each was commanded last, `serving` the task that it is at by them, and since when. `wrecks` are the ids that those
    who were given up have as obstacles, by vehicle, `found` the ids of what robots have found. `tellings` are all routes
    told anew so far, `reliefs` how far those had come whose part was given to others. `courses` say how each gets on with
    what it was commanded last. `wishes` is how many of the late changes were heeded. `sighted` are the metres x and y
    at which others saw those who were given up.
    """

    mission: Mission
    director: Director
    following: Mapping[str, Route]
    since: float = 0.0
    inner: Any = None
    tracks: tuple[np.ndarray, ...] = ()
    served: Mapping[str, str] = field(default_factory=dict)
    used: Mapping[str, float] | None = None
    missed: Mapping[str, float] | None = None
    given_up: frozenset[str] = frozenset()
    wake: float = inf
    barred: frozenset[tuple[str, str]] = frozenset()
    undone: tuple[Reason, ...] = ()
    untried: frozenset[str] = frozenset()
    sent: Mapping[str, tuple[Waypoint, ...]] = field(default_factory=dict)
    serving: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    wrecks: Mapping[str, str] = field(default_factory=dict)
    found: frozenset[str] = frozenset()
    tellings: tuple[Telling, ...] = ()
    reliefs: Mapping[str, Telling] = field(default_factory=dict)
    wishes: int = 0
    sighted: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    courses: Mapping[str, Course] = field(default_factory=dict)


def tellings(memory: Any) -> tuple[Telling, ...]:
    """Return the new routes that the director with this `memory` has told vehicles in a run, in order."""
    memory = _unwrapped(memory)
    return memory.tellings if isinstance(memory, Memory) else ()


def relieved(memory: Any) -> dict[str, Telling]:
    """Return of each vehicle that was given up how far it had come when its part was given to others."""
    memory = _unwrapped(memory)
    return dict(memory.reliefs) if isinstance(memory, Memory) else {}


def left_out(memory: Any) -> tuple[Reason, ...]:
    """Return what the last plan told, by a director that replans, said of what can't be done any more."""
    memory = _unwrapped(memory)
    return memory.mission.reasons if isinstance(memory, Memory) and memory.tellings else ()


def followed(memory: Any) -> Mission | None:
    """Return the last plan that a director made in a run; None where it made none."""
    memory = _unwrapped(memory)
    return memory.mission if isinstance(memory, Memory) and memory.tellings else None


def undone(memory: Any) -> tuple[Reason, ...]:
    """Return what a director's `memory` says will not be done, and why."""
    memory = _unwrapped(memory)
    if isinstance(memory, Memory):
        return tuple(dict.fromkeys((*memory.undone, *undone(memory.inner))))
    if isinstance(memory, Inspected):
        told = [Reason(why, "undone", task) for task, why in memory.abandoned.items()]
        return (*told, *(Reason("found no way home", "end", vehicle) for vehicle in sorted(memory.stranded)))
    return ()


def _unwrapped(memory: Any) -> Any:
    """Return the memory of the director that decides, without what `contact` adds to it."""
    return memory.inner if isinstance(memory, Contact) else memory
