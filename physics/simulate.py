"""Executing a mission in PyBullet: director, guidance, vehicles and world, step by step, to a trace and a verdict."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from quarterdeck.geo.errors import InputError
from quarterdeck.mission.director import Director, Event, State, fixed
from quarterdeck.mission.mission import Mission, Waypoint
from quarterdeck.physics.fleet import Squad, form_squads
from quarterdeck.physics.report import Report, measure
from quarterdeck.physics.separation import give_way
from quarterdeck.physics.trace import Trace, TraceBuilder
from quarterdeck.physics.wind import MEMORY, step_gusts
from quarterdeck.physics.world import INCONSISTENT, World, open_world

DECIDE = 1.0  # s between calls of the director
HARBOUR = 4.0  # lengths: so near its start or end a vehicle is being launched or recovered
KEEP = 3.0  # lengths kept from other vehicles
STUCK = 60.0  # s in contact without a pause: the vehicle is given up


@dataclass(frozen=True, slots=True)
class Run:
    """A mission executed: what happened, and what it comes to."""

    trace: Trace
    report: Report


def simulate(
    mission: Mission,
    *,
    director: Director | None = None,
    seed: int = 0,
    step: float = 0.1,
    sample: float | None = None,
    current: tuple[float, float] = (0.0, 0.0),
    wind: tuple[float, float] = (0.0, 0.0),
    gusts: float = 0.0,
    limits: Mapping[str, float] | None = None,
    duration: float | None = None,
    progress: Callable[[float, float], None] | None = None,
) -> Run:
    """Execute `mission` in PyBullet under `director` (default: fixed routes) and judge it.

    `step` seconds a PyBullet step (at most 0.1; the models integrate in smaller ones), `sample` seconds between
    samples of the trace (default: every step). `current` and `wind` are (east, north) m/s, `gusts` the standard
    deviation of Dryden gusts in m/s. `limits` change the verdict's (see report.LIMITS). The run ends when every
    vehicle is done, or after `duration` seconds (default: twice the planned time and ten minutes). `progress` is told
    seconds done and expected.

    Raises InputError for a vehicle model without its dynamics or a wrong option, UnavailableError where PyBullet is
    absent.
    """
    _check(mission, step, sample, current, wind, gusts)
    planned = max((max(r.duration, r.length / mission.vehicle(r.vehicle).speed) for r in mission.routes), default=0.0)
    until = 2.0 * planned + 600.0 if duration is None else duration
    with open_world(step) as world:
        run = _Running(mission, director or fixed(mission), world, seed, np.array(current), np.array([*wind, 0.0]), gusts)
        builder = TraceBuilder(tuple(v.id for v in mission.vehicles))
        every = max(1, round((sample or step) / step))
        run.decide()
        run.record(builder)
        count = 0
        while not run.done and run.time < until - step / 2:
            run.advance()
            count += 1
            run.time = count * step
            if count % round(DECIDE / step) == 0:
                run.decide()
                if progress is not None:
                    progress(run.time, min(max(planned, run.time), until))
            if count % every == 0 or run.done:
                run.record(builder)
    trace = builder.trace()
    settings = {"seed": seed, "step": step, "current": list(current), "wind": list(wind), "gusts": gusts}
    report = measure(
        mission,
        trace,
        finished=run.finished.tolist(),
        aground=run.aground.tolist(),
        served=run.served,
        limits=limits or {},
        settings=settings,
    )
    return Run(trace, report)


def _check(
    mission: Mission,
    step: float,
    sample: float | None,
    current: tuple[float, float],
    wind: tuple[float, float],
    gusts: float,
) -> None:
    if not 0.001 <= step <= 0.1 or abs(round(DECIDE / step) * step - DECIDE) > 1e-9:
        raise InputError(f"step {step} s must be from 0.001 to 0.1 and divide a second; try 0.1, 0.05 or 0.02")
    if sample is not None and not step <= sample <= 60:
        raise InputError(f"sample {sample} s must be from the step, {step}, to 60")
    if not np.all(np.isfinite([*current, *wind, gusts])) or gusts < 0:
        raise InputError(f"current {current}, wind {wind} and gusts {gusts} must be finite, gusts not negative")
    if not mission.vehicles:
        raise InputError("the plan has no vehicles; there is nothing to simulate")
    routed = [route.vehicle for route in mission.routes]
    for route in mission.routes:
        if route.vehicle not in {v.id for v in mission.vehicles}:
            raise InputError(f"the plan has a route for {route.vehicle!r}, which is not among its vehicles; plan it anew")
        if routed.count(route.vehicle) > 1:
            raise InputError(f"the plan has two routes for {route.vehicle!r}; plan it anew")
        if not np.isfinite(route.xyz).all():
            raise InputError(f"the route of {route.vehicle!r} has a position that is not finite; plan it anew")


@dataclass
class _Running:
    """A run under way: what changes from step to step, all vehicles together."""

    mission: Mission
    director: Director
    world: World
    seed: int
    current: np.ndarray
    wind: np.ndarray
    gusts: float
    time: float = 0.0
    memory: Any = None
    served: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        vehicles = self.mission.vehicles
        self.count = len(vehicles)
        routes = {route.vehicle: route.waypoints for route in self.mission.routes}
        self.position, self.heading = _starts(self.mission, routes)
        self.squads = form_squads(vehicles, self.position, self.heading, self.seed)
        self.home = np.array([v.home for v in vehicles], float).reshape(-1, 2)
        self.start = self.position[:, :2].copy()
        self.harbour = np.array([HARBOUR * v.model.length for v in vehicles])
        self.keep = np.array([KEEP * v.model.length for v in vehicles])
        self.random = np.random.default_rng(self.seed)
        self.gust = np.zeros((self.count, MEMORY))
        self.velocity = np.zeros((self.count, 3))
        self.underway, self.moored, self.aground = (np.zeros(self.count, bool) for _ in range(3))
        self.contact = np.zeros(self.count, bool)
        self.stuck = np.zeros(self.count)
        self.commands: dict[str, tuple[Waypoint, ...]] = {}
        self.told = np.zeros(self.count, int)
        self.done = False
        self.slow, self.bias = np.full(self.count, np.inf), np.zeros(self.count)
        blocking = [o for o in self.mission.site.obstacles if o.blocks & {v.domain for v in vehicles}]
        self.world.add_obstacles(blocking)
        self.world.add_vehicles(vehicles, self.position, self.heading)

    @property
    def finished(self) -> np.ndarray:
        """(k,) bool: has done all it was told and was not given up."""
        return self._gather("idle") & ~self.aground

    def advance(self) -> None:
        """One step of the world."""
        step = self.world.step
        wind = self._wind(step)
        for squad in self.squads:
            squad.guide(self.time, step)
            squad.drive(step, self.current, wind[squad.index])
        position, heading = self._poses()
        velocity = (position - self.position) / step
        rate = ((heading - self.heading + np.pi) % (2 * np.pi) - np.pi) / step
        touched = self.world.advance(velocity, rate)
        self.contact[:] = False
        for i in touched:
            body, psi, v, r = self.world.state(i)
            self.contact[i] = True
            if np.abs(body - position[i]).max() > INCONSISTENT or abs(np.sin(psi - heading[i])) > INCONSISTENT:
                if self.mission.vehicles[i].domain != "aerial":
                    body[2] = 0.0
                self.world.place(i, body, psi)
                squad, place = self._squad(i)
                squad.adopt(place, body, psi, v, r, self.current)
                position[i], heading[i], velocity[i] = body, psi, (body - self.position[i]) / step
        self.position, self.heading, self.velocity = position, heading, velocity
        self.stuck = np.where(self.contact, self.stuck + step, 0.0)

    def decide(self) -> None:
        """Call the director, see to mooring, launching and keeping clear; once a second."""
        reached, idle = self._gather("reached"), self._gather("idle")
        events = self._serve(reached)
        energy = self._gather("energy")
        states = {
            v.id: State(x, y, z, psi, alive, int(r), bool(rest), e)
            for v, (x, y, z), psi, alive, r, rest, e in zip(
                self.mission.vehicles,
                self.position.tolist(),
                self.heading.tolist(),
                (~self.aground).tolist(),
                reached,
                idle,
                energy.tolist(),
                strict=True,
            )
        }
        commands, self.memory = self.director(self.time, states, events, self.memory)
        for i, vehicle in enumerate(self.mission.vehicles):
            if vehicle.id in commands and not self.aground[i]:
                squad, place = self._squad(i)
                squad.command(place, commands[vehicle.id].waypoints)
                self.commands[vehicle.id], self.told[i] = commands[vehicle.id].waypoints, 0
        self._moor()
        self.done = bool((self._gather("idle") | self.aground).all())

    def record(self, builder: TraceBuilder) -> None:
        """Add a sample to the trace."""
        tracks = np.empty(self.count, self.squads[0].tracks.dtype)
        kind = np.empty(self.count, np.int8)
        for squad in self.squads:
            tracks[squad.index] = squad.tracks
            kind[squad.index] = squad.table["kind"][squad.tracks["leg"]]
        builder.add(
            self.time,
            x=self.position[:, 0],
            y=self.position[:, 1],
            z=self.position[:, 2],
            heading=self.heading,
            speed=np.hypot(self.velocity[:, 0], self.velocity[:, 1]),
            energy=self._gather("energy"),
            cross=tracks["cross"],
            leg=tracks["leg"] - tracks["first"],
            kind=kind,
            turning=tracks["turning"],
            underway=self.underway,
            contact=self.contact,
        )

    def _moor(self) -> None:
        near = np.minimum(np.hypot(*(self.position[:, :2] - self.start).T), np.hypot(*(self.position[:, :2] - self.home).T))
        idle = self._gather("idle")
        self.aground |= self.stuck > STUCK
        self.moored = idle & (np.hypot(*(self.position[:, :2] - self.home).T) < self.harbour)
        underway = ~self.moored & ~self.aground & (near > self.harbour)
        for i in np.flatnonzero(underway != self.underway):
            self.world.set_underway(int(i), bool(underway[i]))
        self.underway = underway
        give_way(self.position, self.velocity, self.keep, ~self.moored & ~self.aground, self.slow, self.bias)
        for squad in self.squads:
            squad.tracks["slow"], squad.tracks["bias"] = self.slow[squad.index], self.bias[squad.index]
            squad.active[:] = ~(self.moored | self.aground)[squad.index]

    def _serve(self, reached: np.ndarray) -> tuple[Event, ...]:
        """Return an event for each task served since the last call."""
        events = []
        for i, vehicle in enumerate(self.mission.vehicles):
            for waypoint in self.commands.get(vehicle.id, ())[self.told[i] : reached[i]]:
                if waypoint.task is not None:
                    self.served[waypoint.task] = self.time
                    events.append(Event("served", vehicle.id, waypoint.task))
            self.told[i] = reached[i]
        return tuple(events)

    def _wind(self, step: float) -> np.ndarray:
        """(k, 3) wind at each vehicle."""
        if self.gusts == 0:
            return np.broadcast_to(self.wind, (self.count, 3))
        airspeed = np.linalg.norm(self.velocity - self.wind, axis=1)
        noise = self.random.standard_normal((self.count, 3))
        gust = step_gusts(self.gust, noise, airspeed, self.position[:, 2], self.gusts, step)
        return self.wind + gust

    def _poses(self) -> tuple[np.ndarray, np.ndarray]:
        position, heading = np.empty((self.count, 3)), np.empty(self.count)
        for squad in self.squads:
            position[squad.index], heading[squad.index] = squad.pose()
        return position, heading

    def _gather(self, name: str) -> np.ndarray:
        """(k,) of a squad's property over the whole fleet."""
        parts = [getattr(squad, name) for squad in self.squads]
        out = np.empty(self.count, parts[0].dtype)
        for squad, part in zip(self.squads, parts, strict=True):
            out[squad.index] = part
        return out

    def _squad(self, i: int) -> tuple[Squad, int]:
        """Return the squad of fleet member `i`, and its place there."""
        for squad in self.squads:
            place = int(np.searchsorted(squad.index, i))
            if place < len(squad.index) and squad.index[place] == i:
                return squad, place
        raise KeyError(i)


def _starts(mission: Mission, routes: Mapping[str, tuple[Waypoint, ...]]) -> tuple[np.ndarray, np.ndarray]:
    """Return where the vehicles stand (k, 3) and head (k,): at their routes' first waypoint, towards the second."""
    position, heading = np.zeros((len(mission.vehicles), 3)), np.zeros(len(mission.vehicles))
    for i, vehicle in enumerate(mission.vehicles):
        waypoints = routes.get(vehicle.id, ())
        position[i, :2] = vehicle.start
        if waypoints:
            position[i] = waypoints[0].x, waypoints[0].y, waypoints[0].z if vehicle.domain == "aerial" else 0.0
        onward = next((w for w in waypoints if np.hypot(w.x - position[i, 0], w.y - position[i, 1]) > 0.01), None)
        if onward is not None:
            heading[i] = np.arctan2(onward.y - position[i, 1], onward.x - position[i, 0])
    return position, heading
