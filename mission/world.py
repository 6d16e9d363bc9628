"""The fast world: points that move at constant speed between waypoints, from event to event, no time steps.

It asks a director as PyBullet does (see `director`), but sightings, meetings and arrivals are computed in closed form, so
thousands of missions a minute can be studied.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any, Literal

import numpy as np

from quarterdeck.geo.deadline import cause, time_is_up
from quarterdeck.mission.courses import crossing, sightings
from quarterdeck.mission.director import Command, Director, Event, State, wake_time
from quarterdeck.mission.mission import Waypoint
from quarterdeck.mission.motion import SAME, Motion

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
    world = _World(actors, targets, pairs, reach, faults)
    log: list[tuple[float, Event]] = []
    events: list[Event] = []
    now, memory, calls = 0.0, None, 0
    while True:
        states = world.states(now)
        for motion in world.motions:
            motion.told = motion.end <= now + SAME
        commands, memory = director(now, states, tuple(events), memory)
        world.obey(now, commands, states)
        then = min(world.next_moment(), max(wake_time(memory), now))
        if then == inf or then > until:
            reason = "" if then == inf else f"the mission was not over after {until:g} s"
            break
        if time_is_up("the mission"):
            reason, until = f"the run was stopped at {now:,.0f} s of the mission ({cause()})", now
            break
        calls = calls + 1 if then <= now + SAME else 0
        if calls > _MOST_CALLS:
            raise RuntimeError(f"the director does not let time pass at {now:.3f} s")
        now = max(then, now)
        events = [*world.befall(now), *world.serve(now), *world.see(now), *world.meet(now)]
        log += [(now, e) for e in events]
    last = until if until < inf else now
    left = {a.id: motion.left(last) for a, motion in zip(actors, world.motions, strict=True)}
    ways = world.ways(until if reason else inf)
    return Run(ways, tuple(log), until if reason else now, memory, reason, world.states(last), left)


class _World:
    """All actors of a run: their `motions`, what each has yet to see, who is in contact, and when that is to change."""

    def __init__(
        self,
        actors: Sequence[Actor],
        targets: Sequence[Target],
        pairs: Sequence[tuple[int, int]],
        reach: float,
        faults: Sequence[Fault],
    ) -> None:
        n = len(actors)
        self.actors, self.targets, self.pairs, self.reach = actors, targets, pairs, reach
        self.index = {a.id: i for i, a in enumerate(actors)}
        self.spots = np.array([(s.x, s.y) for s in targets], dtype=float).reshape(-1, 2)
        self.partners: list[list[tuple[int, int]]] = [[] for _ in actors]
        for k, (i, j) in enumerate(pairs):
            self.partners[i].append((k, j))
            self.partners[j].append((k, i))
        self.motions = [Motion(0.0, a.x, a.y, a.speed, a.power) for a in actors]
        self.tracks: list[list[np.ndarray]] = [[] for _ in actors]
        self.unseen = np.ones((n, len(targets)), dtype=bool)
        self.sight = np.full((n, len(targets)), inf)
        self.contact, self.switch = [False] * len(pairs), [inf] * len(pairs)
        self.alive, self.pace = [True] * n, [1.0] * n
        over = {"mute": "heard", "slow": "slow"}
        changes: list[tuple[float, str, str, float]] = [(f.time, f.actor, f.kind, f.pace) for f in faults]
        changes += [(f.until, f.actor, over[f.kind], 1.0 / f.pace) for f in faults if f.until < inf and f.kind in over]
        self.pending = sorted(changes)
        for i in range(n):
            self._look_ahead(i, 0.0)

    def _look_ahead(self, i: int, now: float) -> None:
        """Work out afresh what actor i will see and meet on its present course."""
        knots = self.motions[i].knots
        if self.actors[i].sees > 0 and self.alive[i] and len(self.targets):
            self.sight[i] = np.where(self.unseen[i], sightings(knots, self.spots, self.actors[i].sees, now), inf)
        else:
            self.sight[i] = inf
        for k, j in self.partners[i]:
            if self.alive[i] and self.alive[j]:
                self.switch[k] = self._crossing(k, i, j, now)
            else:
                self.switch[k] = inf

    def _crossing(self, k: int, i: int, j: int, now: float) -> float:
        """Return when the pair `k` of actors i and j next comes into contact, or loses it."""
        knots = self.motions[i].knots, self.motions[j].knots
        return crossing(*knots, self.reach + EDGE if self.contact[k] else self.reach, now, not self.contact[k])

    def states(self, now: float) -> dict[str, State]:
        """Return how everybody stands."""
        everybody = zip(self.actors, self.motions, self.alive, strict=True)
        return {a.id: motion.state(a.z, now, alive) for a, motion, alive in everybody}

    def obey(self, now: float, commands: Mapping[str, Command], states: Mapping[str, State]) -> None:
        """Let those who can do what they are told."""
        for name, command in commands.items():
            i = self.index[name]
            if self.alive[i]:
                self._turn(i, now, states[name], command.waypoints)
                self.motions[i].change_pace(now, self.pace[i])
        for name in commands:
            self._look_ahead(self.index[name], now)

    def _turn(self, i: int, now: float, here: State, waypoints: tuple[Waypoint, ...]) -> None:
        """Let actor i begin another course, from where it is."""
        actor = self.actors[i]
        self.tracks[i].append(self.motions[i].until(now))
        self.motions[i] = Motion(now, here.x, here.y, actor.speed, actor.power, waypoints, here.energy_used)

    def next_moment(self) -> float:
        """Return when something next happens by itself; infinity for never."""
        return min(
            min((m.next_stop() for m in self.motions), default=inf),
            float(self.sight.min()) if self.sight.size else inf,
            min(self.switch, default=inf),
            self.pending[0][0] if self.pending else inf,
        )

    def befall(self, now: float) -> list[Event]:
        """Let faults begin and end whose time it is, and return what is heard of that."""
        events = []
        while self.pending and self.pending[0][0] <= now + SAME:
            _, name, kind, times = self.pending.pop(0)
            i = self.index[name]
            if not self.alive[i]:
                continue
            if kind == "slow":
                self.pace[i] *= times
                self.motions[i].change_pace(now, times)
                self._look_ahead(i, now)
                continue
            if kind == "stop":
                self._turn(i, now, self.motions[i].state(0.0, now, True), ())
                self.motions[i].told = True
                self.alive[i] = False
                self._look_ahead(i, now)
            events.append(Event("returned", name) if kind == "heard" else Event("lost", name, data={"kind": kind}))
        return events

    def serve(self, now: float) -> list[Event]:
        """Return what is served now."""
        everybody = zip(self.actors, self.motions, strict=True)
        return [Event("served", a.id, task) for a, motion in everybody for task in motion.tasks_until(now)]

    def see(self, now: float) -> list[Event]:
        """Return who comes to see what."""
        events = []
        for i, k in zip(*np.nonzero(self.sight <= now + SAME), strict=True):
            self.unseen[i, k], self.sight[i, k] = False, inf
            target = self.targets[k]
            events.append(Event("seen", self.actors[i].id, target.id, {"x": target.x, "y": target.y, **target.data}))
        return events

    def meet(self, now: float) -> list[Event]:
        """Return who comes into contact; others lose it."""
        events = []
        for k, (i, j) in enumerate(self.pairs):
            if self.switch[k] <= now + SAME:
                self.contact[k] = not self.contact[k]
                if self.contact[k]:
                    events.append(Event("met", self.actors[i].id, self.actors[j].id))
                self.switch[k] = self._crossing(k, i, j, now)
        return events

    def ways(self, until: float) -> dict[str, np.ndarray]:
        """Return the tracks (n, 3) of all, to the end of their courses or `until` then."""
        for track, motion in zip(self.tracks, self.motions, strict=True):
            track.append(motion.knots if until == inf else motion.until(until))
        return {a.id: _joined(track) for a, track in zip(self.actors, self.tracks, strict=True)}


def _joined(pieces: list[np.ndarray]) -> np.ndarray:
    """Return one track of the pieces of many commands, without knots that repeat the one before."""
    knots = np.concatenate(pieces)
    keep = np.ones(len(knots), dtype=bool)
    keep[1:] = np.abs(np.diff(knots, axis=0)).max(axis=1) > SAME
    return knots[keep]
