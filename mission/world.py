"""The fast world: points that move at constant speed between waypoints, from event to event, no time steps.

It asks a director as PyBullet does (see `director`), but sightings, meetings and arrivals are computed in closed form, so
thousands of missions a minute can be studied.
"""

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any, Literal

import numpy as np

from quarterdeck.geo.deadline import cause, time_is_up
from quarterdeck.mission.courses import at, crossing, sightings
from quarterdeck.mission.director import Command, Director, Event, State, wake_time
from quarterdeck.mission.mission import Waypoint

SAME = 1e-9  # s: events this close are one moment
EDGE = 1e-6  # m: contact is lost this far beyond the range, so that a range just reached is not lost by rounding
MOST_TIME = 7 * 86400.0  # s
_MOST_CALLS = 10_000  # at one moment: a director that commands for ever without time passing is wrong


@dataclass(frozen=True, slots=True)
class Actor:
    """Somebody who moves: `speed` m/s where a waypoint gives none; sees targets within `sees` metres, on the plan.

    `power` gives the watts drawn at (n,) speeds; without it no energy is reckoned.
    """

    id: str
    x: float
    y: float
    z: float = 0.0
    speed: float = 1.0
    sees: float = 0.0
    power: Callable[[np.ndarray], np.ndarray] | None = None


@dataclass(frozen=True, slots=True)
class Target:
    """Something that stands still and can be seen; `data` goes with the event."""

    id: str
    x: float
    y: float
    data: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Fault:
    """At `time` seconds an actor stops for ever (`stop`), or goes on, `until` then, its radio silent (`mute`) or, without a
    word of it, at `pace` times its speed (`slow`).

    Who is silent still moves past others: it is for the director to let nothing pass between them.
    """

    actor: str
    time: float
    kind: Literal["stop", "mute", "slow"] = "stop"
    until: float = inf
    pace: float = 1.0


@dataclass(frozen=True, slots=True)
class Run:
    """What happened. `tracks` (n, 3) seconds, x, y by actor, straight in between; `events` (time, event) in order.

    `end` is the time of the last event, or when the run was cut short: `reason` says why, if it was. `memory` is what the
    director had in mind then, `states` how everybody stood at `until`, `left` what of the commands was left then.
    """

    tracks: Mapping[str, np.ndarray]
    events: tuple[tuple[float, Event], ...]
    end: float
    memory: Any
    reason: str = ""
    states: Mapping[str, State] = field(default_factory=dict)
    left: Mapping[str, tuple[Waypoint, ...]] = field(default_factory=dict)

    def length(self, actor: str) -> float:
        """Return the metres that an actor moved."""
        return float(np.hypot(*np.diff(self.tracks[actor][:, 1:], axis=0).T).sum())


def run_world(
    director: Director,
    actors: Sequence[Actor],
    targets: Sequence[Target],
    pairs: Sequence[tuple[int, int]],
    reach: float,
    *,
    faults: Sequence[Fault] = (),
    until: float = MOST_TIME,
) -> Run:
    """Run until nothing more can happen, or the time `until` in seconds.

    `pairs` are the indices of actors who notice each other within `reach` metres: event `met`, once each time they come
    into range. Further events: `seen` (each target once by each actor, its `data` and position with it), `served` (a
    waypoint's task, after its hold), `lost` (data `kind`) and, of who was silent, `returned`. The director is called at
    each, whenever somebody has become idle, and when it wants to be.
    """
    ids = [a.id for a in actors]
    index = {name: i for i, name in enumerate(ids)}
    n = len(actors)
    spots = np.array([(s.x, s.y) for s in targets], dtype=float).reshape(-1, 2)
    partners: list[list[tuple[int, int]]] = [[] for _ in actors]
    for k, (i, j) in enumerate(pairs):
        partners[i].append((k, j))
        partners[j].append((k, i))
    plans = [_Plan(0.0, a.x, a.y, a, ()) for a in actors]
    tracks: list[list[np.ndarray]] = [[] for _ in actors]
    unseen = np.ones((n, len(targets)), dtype=bool)
    sight = np.full((n, len(targets)), inf)
    contact = [False] * len(pairs)
    switch = [inf] * len(pairs)
    alive = [True] * n
    pace = [1.0] * n
    over = {"mute": "heard", "slow": "slow"}
    changes: list[tuple[float, str, str, float]] = [(f.time, f.actor, f.kind, f.pace) for f in faults]
    changes += [(f.until, f.actor, over[f.kind], 1.0 / f.pace) for f in faults if f.until < inf and f.kind in over]
    pending = sorted(changes)
    log: list[tuple[float, Event]] = []

    def look_ahead(i: int, now: float) -> None:
        """Work out afresh what actor i will see and meet on its present course."""
        if actors[i].sees > 0 and alive[i] and len(targets):
            sight[i] = np.where(unseen[i], sightings(plans[i].knots, spots, actors[i].sees, now), inf)
        else:
            sight[i] = inf
        for k, j in partners[i]:
            if not (alive[i] and alive[j]):
                switch[k] = inf
            elif contact[k]:
                switch[k] = crossing(plans[i].knots, plans[j].knots, reach + EDGE, now, False)
            else:
                switch[k] = crossing(plans[i].knots, plans[j].knots, reach, now, True)

    for i in range(n):
        look_ahead(i, 0.0)
    events: list[Event] = []
    now, memory, calls = 0.0, None, 0
    while True:
        states = {ids[i]: _state(plans[i], actors[i].z, now, alive[i]) for i in range(n)}
        for plan in plans:
            plan.told = plan.end <= now + SAME
        commands, memory = director(now, states, tuple(events), memory)
        for name, command in commands.items():
            i = index[name]
            if alive[i]:
                here = states[name]
                tracks[i].append(_until(plans[i].knots, now))
                plans[i] = _Plan(now, here.x, here.y, actors[i], command, here.energy_used)
                plans[i].change_pace(now, pace[i])
        for name in commands:
            look_ahead(index[name], now)

        then = min(
            min((p.next_stop() for p in plans), default=inf),
            float(sight.min()) if sight.size else inf,
            min(switch, default=inf),
            pending[0][0] if pending else inf,
            max(wake_time(memory), now),
        )
        if then == inf or then > until:
            reason = "" if then == inf else f"the mission was not over after {until:g} s"
            break
        if time_is_up("the mission"):
            reason, until = f"the run was stopped at {now:,.0f} s of the mission ({cause()})", now
            break
        calls = calls + 1 if then <= now + SAME else 0
        if calls > _MOST_CALLS:
            raise RuntimeError(f"the director does not let time pass at {now:.3f} s")
        now, events = max(then, now), []
        while pending and pending[0][0] <= now + SAME:
            _, name, kind, times = pending.pop(0)
            i = index[name]
            if not alive[i]:
                continue
            if kind == "slow":
                pace[i] *= times
                plans[i].change_pace(now, times)
                look_ahead(i, now)
                continue
            if kind == "stop":
                here = _state(plans[i], 0.0, now, True)
                tracks[i].append(_until(plans[i].knots, now))
                plans[i] = _Plan(now, here.x, here.y, actors[i], (), here.energy_used)
                plans[i].told = True
                alive[i] = False
                look_ahead(i, now)
            events.append(Event("returned", name) if kind == "heard" else Event("lost", name, data={"kind": kind}))
        for i, plan in enumerate(plans):
            events += [Event("served", ids[i], task) for task in plan.tasks_until(now)]
        for i, k in zip(*np.nonzero(sight <= now + SAME), strict=True):
            unseen[i, k], sight[i, k] = False, inf
            target = targets[k]
            events.append(Event("seen", ids[i], target.id, {"x": target.x, "y": target.y, **target.data}))
        for k, (i, j) in enumerate(pairs):
            if switch[k] <= now + SAME:
                contact[k] = not contact[k]
                if contact[k]:
                    events.append(Event("met", ids[i], ids[j]))
                knots = plans[i].knots, plans[j].knots
                switch[k] = crossing(*knots, reach + EDGE if contact[k] else reach, now, not contact[k])
        log += [(now, e) for e in events]
    last = until if until < inf else now
    states = {ids[i]: _state(plans[i], actors[i].z, last, alive[i]) for i in range(n)}
    left = {ids[i]: plan.left(last) for i, plan in enumerate(plans)}
    for i, plan in enumerate(plans):
        tracks[i].append(plan.knots if reason == "" else _until(plan.knots, until))
    ways = {ids[i]: _joined(tracks[i]) for i in range(n)}
    return Run(ways, tuple(log), until if reason else now, memory, reason, states, left)


class _Plan:
    """One actor's course from its last command: `knots` (m, 3) seconds, x, y; `served` the times its waypoints are over.

    `used` watt-hours before it, of an actor whose energy is reckoned.
    """

    __slots__ = ("end", "knots", "power", "served", "tasks", "told", "used", "waypoints")

    def __init__(self, time: float, x: float, y: float, actor: Actor, command: Command | tuple, used: float = 0.0) -> None:
        speed, self.power, self.used = actor.speed, actor.power, used
        knots, self.served, self.tasks = [(time, x, y)], [], []
        self.waypoints = command.waypoints if isinstance(command, Command) else ()
        for w in self.waypoints:
            if w.time > time:
                time = w.time
                knots.append((time, x, y))
            time += ((w.x - x) ** 2 + (w.y - y) ** 2) ** 0.5 / (w.speed or speed)
            x, y = w.x, w.y
            knots.append((time, x, y))
            if w.hold > 0:
                time += w.hold
                knots.append((time, x, y))
            self.served.append(time)
            if w.task is not None:
                self.tasks.append((time, w.task))
        self.knots = np.array(knots)
        self.end = time
        self.told = not self.served  # the director knows that it is idle

    def change_pace(self, now: float, times: float) -> None:
        """Move from now on at so many times the speed; what is waited for takes as long as it does."""
        if times == 1.0:
            return
        before = self.knots[:, 0].copy()
        moves = np.abs(np.diff(self.knots[:, 1:], axis=0)).max(axis=1, initial=0.0) > 0
        ahead = np.clip(before[1:] - np.maximum(before[:-1], now), 0.0, None)
        self.knots[1:, 0] += np.cumsum(np.where(moves, ahead * (1.0 / times - 1.0), 0.0))
        self.served = np.interp(self.served, before, self.knots[:, 0]).tolist()
        self.tasks = [(float(np.interp(when, before, self.knots[:, 0])), task) for when, task in self.tasks]
        self.end = float(np.interp(self.end, before, self.knots[:, 0]))

    def next_stop(self) -> float:
        """Return when a task of it is over or, if the director does not know yet, all of it; infinity if never."""
        done = inf if self.told else self.end
        return min(done, self.tasks[0][0]) if self.tasks else done

    def energy(self, now: float) -> float:
        """Return the watt-hours used until now."""
        if self.power is None:
            return 0.0
        time, x, y = self.knots[: int(np.searchsorted(self.knots[:, 0], now)) + 1].T
        step = np.diff(time)
        speed = np.hypot(np.diff(x), np.diff(y)) / np.where(step > 0, step, 1.0)
        spent = np.diff(np.minimum(time, now)) @ self.power(speed)
        return self.used + float(spent + self.power(np.zeros(1))[0] * max(now - self.end, 0.0)) / 3600.0

    def left(self, now: float) -> tuple[Waypoint, ...]:
        """Return the waypoints that are not over, of the first the hold that is left."""
        reached = bisect_right(self.served, now + SAME)
        rest = self.waypoints[reached:]
        if rest and rest[0].hold > self.served[reached] - now:
            rest = (replace(rest[0], hold=self.served[reached] - now), *rest[1:])
        return rest

    def tasks_until(self, now: float) -> list[str]:
        """Take out and return the tasks that are over."""
        if not self.tasks or self.tasks[0][0] > now + SAME:
            return []
        over = [task for time, task in self.tasks if time <= now + SAME]
        self.tasks = self.tasks[len(over) :]
        return over


def _state(plan: _Plan, z: float, now: float, alive: bool) -> State:
    x, y, heading = at(plan.knots, now)
    served = plan.served
    reached = len(served) if plan.end <= now + SAME else bisect_right(served, now + SAME)
    return State(x, y, z, heading, alive, reached, reached == len(served), plan.energy(now))


def _until(knots: np.ndarray, now: float) -> np.ndarray:
    """Return the knots before `now`, and where the actor is then."""
    x, y, _ = at(knots, now)
    return np.vstack([knots[knots[:, 0] < now], (now, x, y)])


def _joined(pieces: list[np.ndarray]) -> np.ndarray:
    """Return one track of the pieces of many commands, without knots that repeat the one before."""
    knots = np.concatenate(pieces)
    keep = np.ones(len(knots), dtype=bool)
    keep[1:] = np.abs(np.diff(knots, axis=0)).max(axis=1) > SAME
    return knots[keep]
