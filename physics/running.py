"""A run under way: all vehicles together, step by step."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from quarterdeck.geo.angles import wrap
from quarterdeck.geo.scenario import Obstacle, Site
from quarterdeck.geo.terrain import Terrain
from quarterdeck.mission.director import Command, Director, Event, State, wake_time
from quarterdeck.mission.mission import Mission, Waypoint
from quarterdeck.physics.faults import Fault, active, next_change
from quarterdeck.physics.fleet import Fleet, Rovers
from quarterdeck.physics.navigation import REACH
from quarterdeck.physics.rerouting import Rerouting
from quarterdeck.physics.sensing import Legs, Senses, Sensing
from quarterdeck.physics.sightings import look_out
from quarterdeck.physics.terrain import Footing
from quarterdeck.physics.trace import TraceBuilder
from quarterdeck.physics.watch import WARY, Watch
from quarterdeck.physics.wind import MEMORY, step_gusts
from quarterdeck.physics.world import INCONSISTENT, World

DECIDE = 1.0  # s between calls of the director
HARBOUR = 4.0  # lengths: so near its start or end a vehicle is being launched or recovered
CRASH, SKID = 4.0, 0.5  # m/s down, and over the ground: a multirotor that meets it faster is out of the mission
UP = np.array([0.0, 0.0, 1.0])
STUCK = 60.0  # s in contact, or down from the air, without a pause: the vehicle is given up


@dataclass
class Running:
    """A run under way: what changes from step to step, all vehicles together."""

    mission: Mission
    director: Director
    world: World
    seed: int
    current: np.ndarray
    wind: np.ndarray
    gusts: float
    faults: tuple[Fault, ...]
    sensing: Sensing
    known: Site
    terrain: Terrain | None = None
    turns: Sequence[tuple[float, Sequence[Obstacle], Sequence[Obstacle]]] = ()  # when what is gone, and what appears
    time: float = 0.0
    memory: Any = None
    served: dict[str, float] = field(default_factory=dict)
    servers: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        vehicles = self.mission.vehicles
        self.count = len(vehicles)
        routes = {route.vehicle: route.waypoints for route in self.mission.routes}
        self.position, self.heading = _starts(self.mission, routes)
        self.fleet = Fleet(vehicles, self.position, self.heading, self.seed)
        self.home = np.array([v.home for v in vehicles], float).reshape(-1, 2)
        self.start = self.position[:, :2].copy()
        self.harbour = np.array([HARBOUR * v.model.length for v in vehicles])
        self.length = np.array([v.model.length for v in vehicles])
        self.battery = np.array([v.battery for v in vehicles])
        self.random = np.random.default_rng(self.seed)
        self.gust = np.zeros((self.count, MEMORY))
        self.velocity, self.rate = np.zeros((self.count, 3)), np.zeros(self.count)
        self.underway, self.moored, self.aground = (np.zeros(self.count, bool) for _ in range(3))
        self.contact = np.zeros(self.count, bool)
        self.stuck, self.down = np.zeros(self.count), np.zeros(self.count)  # s in contact; s on the ground, meant to fly
        self.commands: dict[str, tuple[Waypoint, ...]] = {}
        self.told = np.zeros(self.count, int)
        self.done = False
        self.watch = Watch(vehicles, self.mission.site)
        self.ids = [v.id for v in vehicles]
        self.change, self.suffering = -1.0, active((), self.ids, 0.0)
        self.aerial = np.array([v.domain == "aerial" for v in vehicles])
        self.lost, self.given_up = np.zeros(self.count, bool), np.zeros(self.count, bool)  # given_up: the director knows
        self.gone = np.full(self.count, np.inf)  # s: when it was lost, or ended otherwise
        self.events: list[Event] = []  # not yet told to the director
        self.heard: dict[str, State] = {}
        self.undelivered: dict[str, Command] = {}
        self.stalled = np.zeros(self.count, bool)
        self.senses: Senses | None = None
        if self.sensing != Sensing() or any(f.kind == "gnss" for f in self.faults):
            pose = np.column_stack([self.position[:, :2], self.heading])
            random = np.random.default_rng([self.seed, 0x5E])
            self.senses = Senses(self.sensing, self.known, self.mission.site, vehicles, pose, random)
        self.router = self.senses.router if self.senses is not None else None
        passing = {o.id for _, old, _ in self.turns for o in old}
        blocking = [o for o in self.mission.site.obstacles if o.id not in passing and self._blocks(o)]
        self.footing = Footing(vehicles)
        self.trouble: list[str] = []  # with the terrain
        if self.terrain is not None:
            self.footing.lay(self.terrain, self.mission, self.fleet, self.world, self.position)
            self._rise(self.terrain, self.position, self.heading)
        self.lookout = look_out(self.mission, self.terrain)
        if self.lookout is not None and self.router is None:  # people and robots find ways around who stands in theirs
            self.router = Rerouting(self.known, vehicles, np.flatnonzero(~self.aerial))
        self.world.add_obstacles(blocking, self.terrain)
        stand = [o for o in self.mission.site.obstacles if o.id in passing]
        self.bodies = {o.id: self.world.add_obstacles([o] if self._blocks(o) else [], self.terrain) for o in stand}
        self.ahead = list(self.turns)
        up = np.column_stack([np.zeros((self.count, 2)), self.footing.lift])
        self.world.add_vehicles(vehicles, self.position + up, self.heading)

    @property
    def finished(self) -> np.ndarray:
        """(k,) bool: has done all it was told and was neither given up nor lost, nor is without a way."""
        stuck = np.isin(np.arange(self.count), list(self.router.stuck) if self.router else [])
        return self.fleet.gather("idle") & ~self.aground & ~self.lost & ~stuck

    def advance(self) -> None:
        """One step of the world."""
        step = self.world.step
        if self.time >= self.change:
            self._befall()
        if self.watch.wary and round(self.time / step) % max(1, round(WARY / step)) == 0:
            self._keep_clear()
        wind = self._wind(step)
        for squad in self.fleet.squads:
            squad.guide(self.time, step)
            squad.drive(step, self.current, wind[squad.index])
        position, heading = self.fleet.poses()
        velocity = (position - self.position) / step
        rate = wrap(heading - self.heading) / step
        rise = self._rise(self.terrain, position, heading) / step if self.terrain is not None else np.zeros(self.count)
        touched = self.world.advance(velocity + rise[:, None] * UP, rate)
        self.contact[:] = False
        for i in touched:
            body, psi, v, r = self.world.state(i)
            self.contact[i] = True
            body, v = body - self.footing.lift[i] * UP, v - rise[i] * UP
            if np.abs(body - position[i]).max() > INCONSISTENT or abs(np.sin(psi - heading[i])) > INCONSISTENT:
                if self.mission.vehicles[i].domain != "aerial":
                    body[2] = 0.0
                self.world.place(i, body + self.footing.lift[i] * UP, psi)
                squad, place = self.fleet.of(i)
                squad.adopt(place, body, psi, v, r, self.current)
                position[i], heading[i], velocity[i] = body, psi, (body - self.position[i]) / step
        falling = (self.velocity[:, 2] < -CRASH) | (np.hypot(*self.velocity[:, :2].T) > SKID) | self.lost
        self.aground |= self.aerial & falling & (position[:, 2] <= 0.0)
        self.position, self.heading, self.velocity, self.rate = position, heading, velocity, rate
        self.stuck = np.where(self.contact, self.stuck + step, 0.0)
        if self.senses is not None:
            self._sense(self.senses)
        if self.lookout is not None:
            self.events += self.lookout.step(self.position[:, :2], ~self.aground & ~self.lost)
            self._keep_clear()  # among people and at close quarters a second is too long

    def _blocks(self, obstacle: Obstacle) -> bool:
        return any(v.domain in obstacle.blocks for v in self.mission.vehicles)

    def _turn(self) -> None:
        """Let obstacles go and appear whose time it is."""
        while self.ahead and self.ahead[0][0] <= self.time:
            _, gone, new = self.ahead.pop(0)
            self.world.remove_obstacles([body for o in gone for body in self.bodies.pop(o.id, [])])
            self.bodies |= {o.id: self.world.add_obstacles([o] if self._blocks(o) else [], self.terrain) for o in new}

    def decide(self) -> None:
        """Call the director, see to mooring, launching and keeping clear; once a second."""
        if self.time >= self.change:
            self._befall()
        self._run_flat()
        self._turn()
        reached = self._reached()
        self.events += self._serve(reached)
        self.events += self._held()
        self.events += [Event("lost", self.ids[i]) for i in np.flatnonzero(self.aground & ~self.given_up & ~self.lost)]
        self.given_up |= self.aground
        self.gone[(self.aground | self.lost) & np.isinf(self.gone)] = self.time
        mute = dict(zip(self.ids, self.suffering["comms"].tolist(), strict=True))
        if self.lookout is not None:  # each decides for itself: what passes between them is the director's business
            mute = dict.fromkeys(self.ids, False)
        # What a mute vehicle has to tell waits; that it is mute is known.
        events = tuple(e for e in self.events if not mute[e.vehicle] or e.kind == "lost")
        self.events = [e for e in self.events if e not in events]
        commands, self.memory = self.director(self.time, self._states(reached, mute), events, self.memory)
        self.undelivered |= commands
        fresh: set[int] = set()
        for i, id in enumerate(self.ids):  # noqa: A001
            if id in self.undelivered and not mute[id]:
                command = self.undelivered.pop(id)
                if not self.aground[i] and not self.lost[i]:
                    squad, place = self.fleet.of(i)
                    squad.command(place, command.waypoints)
                    self.commands[id], self.told[i] = command.waypoints, 0
                    fresh.add(i)
        self._moor()
        if self.senses is not None:
            self.senses.note()
        if self.router is not None:
            self._reroute(self.router, fresh)
        over = bool((self.fleet.gather("idle") & ~self.lost | self.aground | self.lost & ~self.aerial).all())
        told = all(mute[e.vehicle] for e in self.events) and not (self.aground & ~self.given_up).any()
        self.done = over and told and wake_time(self.memory) == np.inf and not self._heard_again(mute)

    def _heard_again(self, mute: Mapping[str, bool]) -> bool:
        """Return whether one that works is silent now and will be heard again: it can tell and be told."""
        silent = {f.vehicle for f in self.faults if f.kind == "comms" and f.start <= self.time < f.end < np.inf}
        return any(mute[i] and i in silent for i in np.array(self.ids)[~self.aground & ~self.lost])

    def standing(self) -> tuple[dict[str, State], dict[str, tuple[Waypoint, ...]]]:
        """Return how everybody stands, and what of his command is left to do."""
        reached = self._reached()
        states = self._states(reached, dict.fromkeys(self.ids, False))
        return states, {id: self.commands.get(id, ())[n:] for id, n in zip(self.ids, reached.tolist(), strict=True)}  # noqa: A001

    def record(self, builder: TraceBuilder) -> None:
        """Add a sample to the trace."""
        tracks = self.fleet.gather("tracks")
        builder.add(
            self.time,
            x=self.position[:, 0],
            y=self.position[:, 1],
            z=self.position[:, 2],
            heading=self.heading,
            speed=np.hypot(self.velocity[:, 0], self.velocity[:, 1]),
            energy=self.fleet.gather("energy"),
            cross=tracks["cross"] if self.senses is None else self._true_cross(tracks["cross"]),
            leg=tracks["leg"] - tracks["first"],
            kind=self.fleet.gather("kind"),
            turning=tracks["turning"],
            underway=self.underway,
            contact=self.contact,
            ground=self.footing.ground,
            pitch=self.footing.pitch,
        )

    def _rise(self, terrain: Terrain, position: np.ndarray, heading: np.ndarray) -> np.ndarray:
        """Tilt the bodies to the ground at where the vehicles come to, and return how far it rises, (k,).

        One on ground that is steeper than it climbs, or not known, is given up.
        """
        footing = self.footing
        before = footing.lift
        for i, why in footing.settle(terrain, position[:, :2], heading).items():
            if not self.aground[i]:
                x, y, _ = position[i]
                self.trouble.append(f"{self.ids[i]}: given up at {self.time:.0f} s, x {x:.1f} m, y {y:.1f} m: {why}")
                self.aground[i] = True
        for i in np.flatnonzero(footing.rolling).tolist() if self.world.bodies else ():
            at = self.position[i] + before[i] * UP
            self.world.place(i, at, float(self.heading[i]), float(footing.pitch[i]), float(footing.roll[i]))
        for squad in self.fleet.squads:
            if isinstance(squad, Rovers):
                squad.pitch = footing.pitch[squad.index]
                squad.active[:] &= ~self.aground[squad.index]
        return footing.lift - before

    def _true_cross(self, believed: np.ndarray) -> np.ndarray:
        """Return (k,) cross-track errors in metres of where the vehicles are, not of where they believe to be."""
        start, end = self.fleet.gather("ends").transpose(1, 0, 2)
        span, off = end - start, self.position - start
        product = np.cross(span, off) / np.maximum(np.linalg.norm(span, axis=1), 1e-9)[:, None]
        return np.where(believed != 0, np.where(self.aerial, np.linalg.norm(product, axis=1), product[:, 2]), 0.0)

    def _states(self, reached: np.ndarray, mute: Mapping[str, bool]) -> dict[str, State]:
        """Return what is known of each vehicle: of a mute or lost one what was last heard, and that it is not heard."""
        idle, energy = self.fleet.gather("idle"), self.fleet.gather("energy")
        alive = ~self.aground & ~self.lost
        for i, id in enumerate(self.ids):  # noqa: A001
            if (mute[id] or not alive[i]) and id in self.heard:
                self.heard[id] = replace(self.heard[id], alive=False)
            else:
                x, y, z = self.position[i].tolist()
                psi, used = float(self.heading[i]), float(energy[i])
                self.heard[id] = State(x, y, z, psi, bool(alive[i]), int(reached[i]), bool(idle[i]), used)
        return dict(self.heard)

    def _befall(self) -> None:
        """Let faults begin and end."""
        before, self.suffering = self.suffering, active(self.faults, self.ids, self.time)
        self.change = next_change(self.faults, self.time)
        for i, id in enumerate(self.ids):  # noqa: A001
            squad, place = self.fleet.of(i)
            if self.suffering["lost"][i] and not self.lost[i]:
                self._stop(i)
            elif self.suffering["thruster"][i] != before["thruster"][i] and not self.lost[i]:
                squad.scale[place, 0] = 0.5 if self.suffering["thruster"][i] else 1.0
            if self.suffering["comms"][i] != before["comms"][i] and not (self.lost[i] or self.aground[i]):
                kind = {"kind": "mute"}
                self.events.append(Event("lost", id, data=kind) if self.suffering["comms"][i] else Event("returned", id))

    def _run_flat(self) -> None:
        """Stop for ever who has used up its battery."""
        for i in np.flatnonzero((self.fleet.gather("energy") >= self.battery) & ~self.lost & ~self.aground):
            x, y, _ = self.position[i]
            self.trouble.append(f"{self.ids[i]}: battery empty at {self.time:.0f} s, x {x:.1f} m, y {y:.1f} m")
            self._stop(int(i))

    def _stop(self, i: int) -> None:
        squad, place = self.fleet.of(i)
        self.lost[i] = True
        squad.command(place, ())
        squad.scale[place] = 0.0
        squad.parameters["idle"][place] = 0.0
        self.events.append(Event("lost", self.ids[i], data={"kind": "stop"}))

    def _sense(self, senses: Senses) -> None:
        """See and localise after a step; tell the guidance and, of robots that get no further, the director."""
        pose = np.column_stack([self.position[:, :2], self.heading])
        step = self.world.step
        deaf, present = self.suffering["gnss"], ~self.moored & ~self.aground & ~self.lost
        senses.step(self.time + step, step, pose, deaf, present, self.moored, self._legs())
        for squad in self.fleet.squads:
            squad.error[:] = senses.error[squad.index]
            squad.tracks["slow"] = np.minimum(self.watch.slow, senses.slow)[squad.index]
            squad.tracks["bias"] = senses.bias[squad.index]
        for i in np.flatnonzero(senses.stalled & ~self.stalled):
            x, y, _ = senses.navigation.believed[i].tolist()
            self.events.append(Event("blocked", self.ids[i], data={"x": x, "y": y}))
        self.stalled = senses.stalled.copy()

    def _reroute(self, router: Rerouting, fresh: set[int]) -> None:
        """Have robots with lidar put on their maps what they see, and all drive around what bars their way."""
        there = ~self.moored & ~self.aground
        present, believed = there & ~self.lost, np.column_stack([self.position[:, :2], self.heading])
        router.begin(fresh)
        if self.senses is not None and len(self.senses.lidars):
            believed, sure = self.senses.navigation.believed, self.senses.navigation.sure | self.sensing.mapping
            angles, ranges, mute = self.senses.angles, self.senses.ranges, self.suffering["comms"]
            router.findings.look(believed, sure, angles, ranges, REACH, mute, present)
        commands = [self.commands.get(id, ()) for id in self.ids]  # noqa: A001
        self.events += router.drive_around(self.time, self.fleet, believed, commands, fresh, self.stalled, present, there)

    def _reached(self) -> np.ndarray:
        """Return (k,) how many waypoints of its last command each has reached."""
        actual = self.fleet.gather("reached")
        return actual if self.router is None else self.router.reached(actual)

    def _legs(self) -> Legs:
        """Return the legs under way."""
        start, end = self.fleet.gather("ends")[..., :2].transpose(1, 0, 2)
        tracks, pace = self.fleet.gather("tracks"), np.hypot(*self.velocity[:, :2].T)
        speed, aside = self.fleet.gather("pace"), self.fleet.gather("aside")
        return Legs(start, end, speed, self.watch.slow, aside, pace, self.length, tracks["leg"], tracks["mode"])

    def _moor(self) -> None:
        near = np.minimum(np.hypot(*(self.position[:, :2] - self.start).T), np.hypot(*(self.position[:, :2] - self.home).T))
        idle = self.fleet.gather("idle")
        self.aground |= self.stuck > STUCK
        flying = self.aerial & (self.position[:, 2] > 1.0)
        self.moored = idle & ~flying & (near < self.harbour)
        underway = ~self.moored & ~self.aground & (near > self.harbour)
        self.down = np.where(self.aerial & underway & ~idle & (self.position[:, 2] <= 0.0), self.down + DECIDE, 0.0)
        self.aground |= self.down > STUCK
        for i in np.flatnonzero(underway != self.underway):
            self.world.set_underway(int(i), bool(underway[i]))
        self.underway = underway
        self._keep_clear()
        for squad in self.fleet.squads:
            squad.active[:] = ~(self.moored | self.aground)[squad.index]

    def _keep_clear(self) -> None:
        present = ~self.moored & ~self.aground
        self.watch.keep_clear(self.time, self.fleet, self.position, self.heading, self.velocity, self.rate, present)

    def _serve(self, reached: np.ndarray) -> tuple[Event, ...]:
        """Return an event for each task served since the last call."""
        events = []
        for i, vehicle in enumerate(self.mission.vehicles):
            for waypoint in self.commands.get(vehicle.id, ())[self.told[i] : reached[i]]:
                if waypoint.task is not None:
                    self.served[waypoint.task], self.servers[waypoint.task] = self.time, vehicle.id
                    events.append(Event("served", vehicle.id, waypoint.task))
            self.told[i] = reached[i]
        return tuple(events)

    def _held(self) -> list[Event]:
        """Return who stands before one that is dead or silent, and where that one is."""
        if self.lookout is not None:
            return []
        still = (self.lost | self.aground | self.suffering["comms"]) & ~self.moored
        pairs = [(self.ids[i], self.ids[j], self.position[j]) for i, j in self.watch.held(self.time, self.position, still)]
        return [Event("held", who, by, {"x": float(x), "y": float(y)}) for who, by, (x, y, _) in pairs]

    def _wind(self, step: float) -> np.ndarray:
        """(k, 3) wind at each vehicle."""
        if self.gusts == 0:
            return np.broadcast_to(self.wind, (self.count, 3))
        airspeed = np.linalg.norm(self.velocity - self.wind, axis=1)
        noise = self.random.standard_normal((self.count, 3))
        gust = step_gusts(self.gust, noise, airspeed, self.position[:, 2], self.gusts, step)
        return self.wind + gust


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
