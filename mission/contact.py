"""Messages only within range: what a director knows of vehicles out of touch, and when it hears of their losses.

A vehicle with a `range` hears and is heard within so many metres of the place where any vehicle started or ends, where
people are, or of another vehicle that is in touch itself and reaches as far. Out of touch it goes on as it was told.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import inf
from typing import Any

import numpy as np
from scipy.sparse.csgraph import connected_components

from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.director import Command, Director, Event, State, wake_time
from quarterdeck.mission.mission import Mission, Waypoint
from quarterdeck.mission.timing import commanded_route

LOOK = 1.0  # s between looks at who is in range
PLACES = 50  # on each leg at which is asked whether a vehicle is in range again


@dataclass(frozen=True, slots=True)
class Contact:
    """Memory: the inner director's, what was `heard` of each vehicle last, what it was `told` last and got.

    `due` are the seconds at which those out of touch are to be heard again (infinity: told as lost already), `held` their
    events and `waiting` the commands for them. `wake` is when the inner director or a silence is due.
    """

    inner: Any = None
    heard: Mapping[str, State] = field(default_factory=dict)
    told: Mapping[str, tuple[Waypoint, ...]] = field(default_factory=dict)
    due: Mapping[str, float] = field(default_factory=dict)
    held: tuple[Event, ...] = ()
    waiting: Mapping[str, Command] = field(default_factory=dict)
    wake: float = inf


def within_range(director: Director, mission: Mission) -> Director:
    """Return the director that hears of vehicles, and is heard by them, only while they are in touch.

    Of a vehicle out of touch it has the state last heard, not alive. That is no loss before the time at which, by what it
    was told, it would be in range of a start or an end again: then, if it is not, an event `lost` says so; `returned` comes
    with what it has to tell whenever it is back in touch. Losses of vehicles in touch are told at once.
    """
    bases = np.array([place for v in mission.vehicles for place in (v.start, v.home)], dtype=float)

    def direct(
        time: float, states: Mapping[str, State], events: tuple[Event, ...], memory: Any
    ) -> tuple[dict[str, Command], Contact]:
        known: Contact = memory or Contact()
        touch = _in_touch(mission, states, bases)
        # Who is dead or silent for another reason stays what it was: in touch, so that it is told of, or out of it.
        out = {v for v, s in states.items() if v not in touch and (s.alive or v in known.due)}
        back = known.due.keys() - out
        heard = {v: replace(known.heard[v], alive=False) if v in out and v in known.heard else s for v, s in states.items()}
        due = {v: known.due[v] if v in known.due else time + _seconds_out(mission, v, heard[v], known, bases) for v in out}
        overdue = {v for v, when in due.items() if when <= time}
        held = (*known.held, *events)
        news = [e for e in held if e.vehicle not in out and not (e.vehicle in back and e.kind in ("lost", "returned"))]
        news += [Event("returned", v) for v in sorted(back)] + [Event("lost", v) for v in sorted(overdue)]
        commands, inner = director(time, heard, tuple(news), known.inner)
        waiting = {**known.waiting, **commands}
        sent = {v: c for v, c in waiting.items() if v not in out}
        due |= dict.fromkeys(overdue, inf)
        return sent, Contact(
            inner,
            heard,
            {**known.told, **{v: c.waypoints for v, c in sent.items()}},
            due,
            tuple(e for e in held if e.vehicle in out),
            {v: c for v, c in waiting.items() if v in out},
            min(
                [
                    wake_time(inner),
                    *due.values(),
                    *(time + LOOK for v, s in states.items() if s.alive and (v in sent or not s.idle)),
                ]
            ),
        )

    return direct


def _in_touch(mission: Mission, states: Mapping[str, State], bases: np.ndarray) -> set[str]:
    """Return who works and is linked, directly or over others, to a base."""
    here = [v for v in mission.vehicles if states[v.id].alive]
    if not here:
        return set()
    places = np.array([(states[v.id].x, states[v.id].y) for v in here])
    reach = np.array([inf if v.range is None else v.range for v in here])
    n = len(here)
    linked = np.zeros((n + 1, n + 1), dtype=bool)
    linked[:n, :n] = _apart(places, places) <= np.minimum(reach[:, None], reach)
    linked[:n, n] = _apart(places, bases).min(axis=1) <= reach
    labels = connected_components(linked, directed=False)[1]
    return {v.id for v, label in zip(here, labels, strict=False) if label == labels[n]}


def _apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return (n, m) metres between (n, 2) and (m, 2) places."""
    return np.hypot(*(one[:, None, :] - other[None, :, :]).transpose(2, 0, 1))


def _seconds_out(mission: Mission, id: str, last: State, known: Contact, bases: np.ndarray) -> float:  # noqa: A002
    """Return the seconds until a vehicle that goes on as it was told is in range of a base again, or has done it all."""
    vehicle: Vehicle = mission.vehicle(id)
    route = commanded_route(vehicle, (last.x, last.y, last.z), known.told.get(id, ())[last.reached :])
    away = False
    for a, b in pairwise(route.waypoints):
        part = np.linspace(0.0, 1.0, PLACES)
        places = np.column_stack([a.x + part * (b.x - a.x), a.y + part * (b.y - a.y)])
        near = _apart(places, bases).min(axis=1) <= (vehicle.range or inf)
        for fraction, inside in zip(part.tolist(), near.tolist(), strict=True):
            if inside and away:
                return a.time + a.hold + fraction * (b.time - a.time - a.hold)
            away |= not inside
    return route.duration
