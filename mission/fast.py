"""A mission in the fast world: points that move at the paces by which plans reckon, turns included, and pass each other.

It is what a run in PyBullet is held against: the same director, told and telling as much, in the same time, without
dynamics, wind or encounters.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import hypot, inf
from typing import Any

import numpy as np

from quarterdeck.mission.director import Command, Director, Event, State, wake_time
from quarterdeck.mission.lateness import done
from quarterdeck.mission.mission import Mission, Route, Waypoint
from quarterdeck.mission.progress import surveyed
from quarterdeck.mission.timing import commanded_route
from quarterdeck.mission.world import Actor, Fault, run_world


@dataclass(frozen=True, slots=True)
class FastRun:
    """What the fast world came to: seconds to the end of each vehicle's last move, and those at which tasks were served.

    `tracks` (n, 3) seconds, x, y by vehicle, straight in between; `surveyed` the (m, 2) lines of survey legs, metres;
    `energy` Wh by vehicle; `finished` who did all that it was told. `reason` says why the run was cut short, if it was.
    """

    times: Mapping[str, float]
    served: Mapping[str, float]
    tracks: Mapping[str, np.ndarray]
    surveyed: tuple[np.ndarray, ...]
    energy: Mapping[str, float]
    finished: frozenset[str]
    reason: str = ""

    @property
    def time(self) -> float:
        """Seconds until nobody moved any more."""
        return max(self.times.values(), default=0.0)


def run_fast(mission: Mission, director: Director, faults: Sequence[Fault] = (), *, until: float = inf) -> FastRun:
    """Run a mission under a director in the fast world, for `until` seconds at the most."""
    first = {r.vehicle: r.waypoints[0] for r in mission.routes if r.waypoints}
    actors = [
        Actor(v.id, *((w.x, w.y, w.z) if (w := first.get(v.id)) else (*v.start, 0.0)), speed=v.speed)
        for v in mission.vehicles
    ]
    run = run_world(_as_planned(director, mission), actors, (), (), 0.0, faults=faults, until=until)
    served = {e.subject: t for t, e in reversed(run.events) if e.kind == "served"}
    legs: _Legs = run.memory
    return FastRun(
        {v: _arrival(track) for v, track in run.tracks.items()},
        served,
        run.tracks,
        (*legs.surveyed, *(line for v in legs.routes for line in _lines(legs, v))),
        {v: s.energy_used for v, s in legs.states.items()},
        frozenset(v for v, s in legs.states.items() if s.alive and s.idle and _over(legs, v)),
        run.reason,
    )


def _over(legs: "_Legs", vehicle: str) -> bool:
    return vehicle not in legs.routes or legs.states[vehicle].reached + 1 >= len(legs.routes[vehicle].waypoints)


def _arrival(track: np.ndarray) -> float:
    """Return the second of the last move along an (n, 3) track of seconds, x, y."""
    moves = np.flatnonzero(np.abs(np.diff(track[:, 1:], axis=0)).max(axis=1, initial=0.0) > 0)
    return float(track[moves[-1] + 1, 0]) if len(moves) else 0.0


@dataclass(frozen=True, slots=True)
class _Legs:
    """Memory: the inner director's, the `routes` that vehicles are on, and the lines that they `surveyed` before those.

    `used` are their Wh before those, `states` the vehicles as they are, `heard` as they were heard last; `mute` who is not
    heard, `held` the events of theirs, `waiting` the commands for them.
    """

    inner: Any = None
    wake: float = inf
    routes: Mapping[str, Route] = field(default_factory=dict)
    surveyed: tuple[np.ndarray, ...] = ()
    used: Mapping[str, float] = field(default_factory=dict)
    states: Mapping[str, State] = field(default_factory=dict)
    heard: Mapping[str, State] = field(default_factory=dict)
    mute: frozenset[str] = frozenset()
    held: tuple[Event, ...] = ()
    waiting: Mapping[str, Command] = field(default_factory=dict)


def _as_planned(director: Director, mission: Mission) -> Director:
    """Return the director whose commands take as long as plans reckon, and which hears of nobody who is silent."""
    vehicles = {v.id: v for v in mission.vehicles}

    def direct(
        time: float, states: Mapping[str, State], events: tuple[Event, ...], memory: Any
    ) -> tuple[dict[str, Command], _Legs]:
        known: _Legs = memory or _Legs()
        states = {v: _flown(known, v, s) for v, s in states.items()}
        silent = {e.vehicle for e in events if e.kind == "lost" and e.data.get("kind") == "mute"}
        mute = (known.mute | silent) - {e.vehicle for e in events if e.kind == "returned"}
        heard = {v: replace(known.heard.get(v, s), alive=False) if v in mute else s for v, s in states.items()}
        held = (*known.held, *events)
        news = tuple(e for e in held if e.vehicle not in mute or e.kind == "lost")
        commands, inner = director(time, heard, news, known.inner)
        waiting = {**known.waiting, **commands}
        sent = {v: c for v, c in waiting.items() if v not in mute and states[v].alive}
        before = replace(known, states=states)
        timed = {
            v: commanded_route(vehicles[v], (states[v].x, states[v].y, states[v].z), c.waypoints) for v, c in sent.items()
        }
        return {v: _paced(route) for v, route in timed.items()}, _Legs(
            inner,
            wake_time(inner),
            {**known.routes, **timed},
            (*known.surveyed, *(line for v in sent.keys() & known.routes.keys() for line in _lines(before, v))),
            {**known.used, **{v: states[v].energy_used for v in sent}},
            states,
            heard,
            frozenset(mute),
            tuple(e for e in held if e not in news),
            {v: c for v, c in waiting.items() if v in mute},
        )

    return direct


def _flown(known: _Legs, vehicle: str, state: State) -> State:
    """Return a state with the height that the vehicle's route has there, and the energy that it has cost so far."""
    if vehicle not in known.routes:
        return state
    route = known.routes[vehicle]
    here = replace(state, z=route.waypoints[min(state.reached, len(route.waypoints) - 1)].z)
    part = done(route, here) / route.duration if route.duration else 1.0
    return replace(here, energy_used=known.used[vehicle] + part * route.energy)


def _paced(route: Route) -> Command:
    """Return the route as a command to points that turn at once: turns are driven slower, climbs are waits."""
    made: list[Waypoint] = []
    for last, w in zip(route.waypoints, route.waypoints[1:], strict=False):
        seconds, metres = w.time - last.time - last.hold, hypot(w.x - last.x, w.y - last.y)
        if metres > 0 and seconds > 0:
            made.append(replace(w, speed=metres / seconds, time=0.0))
        else:  # or so near that its time is lost beside the time so far
            made.append(replace(w, hold=w.hold + max(seconds, 0.0), time=0.0))
    return Command(tuple(made))


def _lines(legs: _Legs, vehicle: str) -> list[np.ndarray]:
    """Return the lines that a vehicle has surveyed on the route that it is on."""
    state, route = legs.states[vehicle], legs.routes[vehicle]
    return surveyed(route, min(state.reached + 1, len(route.waypoints)), (state.x, state.y, state.z))
