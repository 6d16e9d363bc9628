"""A run under way: all vehicles together, step by step."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from quarterdeck.geo.angles import wrap
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Site
from quarterdeck.geo.terrain import Terrain
from quarterdeck.mission.director import Director, Event, State, wake_time
from quarterdeck.mission.mission import Mission, Waypoint
from quarterdeck.physics.faults import Fault
from quarterdeck.physics.fleet import Fleet, Rovers
from quarterdeck.physics.link import Link
from quarterdeck.physics.navigation import REACH
from quarterdeck.physics.obstacles import Obstacles, Turn
from quarterdeck.physics.paths import starts
from quarterdeck.physics.rerouting import Rerouting
from quarterdeck.physics.sensing import Legs, Senses, Sensing
from quarterdeck.physics.sightings import look_out
from quarterdeck.physics.status import Status
from quarterdeck.physics.terrain import Footing
from quarterdeck.physics.trace import TraceBuilder
from quarterdeck.physics.watch import WARY, Watch
from quarterdeck.physics.wind import Wind
from quarterdeck.physics.world import INCONSISTENT, World

DECIDE = 1.0  # s between calls of the director
WILD = 1000.0  # m/s: so fast is no vehicle
UP = np.array([0.0, 0.0, 1.0])


@dataclass
class Running:
    """A run under way: what changes from step to step, all vehicles together."""

    mission: Mission
    director: Director
    world: World
    seed: int
    current: np.ndarray
    wind: Wind
    faults: tuple[Fault, ...]
    sensing: Sensing
    known: Site
    terrain: Terrain | None = None
    turns: Sequence[Turn] = ()
    time: float = 0.0
    memory: Any = None

    def __post_init__(self) -> None:
        vehicles = self.mission.vehicles
        self.count, self.ids = len(vehicles), [v.id for v in vehicles]
        self.aerial = np.array([v.domain == "aerial" for v in vehicles])
        self.length = np.array([v.model.length for v in vehicles])
        self.position, self.heading = starts(self.mission)
        self.velocity, self.rate = np.zeros((self.count, 3)), np.zeros(self.count)
        self.fleet = Fleet(vehicles, self.position, self.heading, self.seed)
        self.status = Status(vehicles, self.position[:, :2].copy(), self.faults)
        self.link = Link(self.ids)
        self.watch = Watch(vehicles, self.mission.site)
        self.done = False
        self.stalled = np.zeros(self.count, bool)
        self.senses: Senses | None = None
        if self.sensing != Sensing() or any(f.kind == "gnss" for f in self.faults):
            pose = np.column_stack([self.position[:, :2], self.heading])
            random = np.random.default_rng([self.seed, 0x5E])
            self.senses = Senses(self.sensing, self.known, self.mission.site, vehicles, pose, random)
        self.router = self.senses.router if self.senses is not None else None
        self.footing = Footing(vehicles)
        if self.terrain is not None:
            self.footing.lay(self.terrain, self.mission, self.fleet, self.world, self.position)
            self._rise(self.terrain, self.position, self.heading)
        self.lookout = look_out(self.mission, self.terrain)
        if self.lookout is not None and self.router is None:  # people and robots find ways around who stands in theirs
            self.router = Rerouting(self.known, vehicles, np.flatnonzero(~self.aerial))
        self.obstacles = Obstacles(self.world, self.mission.site, self.terrain, vehicles, self.turns)
        up = np.column_stack([np.zeros((self.count, 2)), self.footing.lift])
        self.world.add_vehicles(vehicles, self.position + up, self.heading)

    @property
    def finished(self) -> np.ndarray:
        """(k,) bool: has done all it was told and was neither given up nor lost, nor is without a way."""
        stuck = np.isin(np.arange(self.count), list(self.router.stuck) if self.router else [])
        return self.fleet.gather("idle") & self.status.alive & ~stuck

    def advance(self) -> None:
        """One step of the world. Raises InputError where the weather throws a model out of all bounds."""
        step = self.world.step
        self.link.events += self.status.befall(self.time, self.fleet)
        if self.watch.wary and round(self.time / step) % max(1, round(WARY / step)) == 0:
            self._keep_clear()
        wind = self.wind.step(step, self.velocity, self.position[:, 2])
        for squad in self.fleet.squads:
            squad.guide(self.time, step)
            squad.drive(step, self.current, wind[squad.index])
        position, heading = self.fleet.poses()
        velocity = (position - self.position) / step
        wild = ~(np.abs(velocity) < WILD).all(axis=1)
        if wild.any():
            name = self.ids[int(np.argmax(wild))]
            raise InputError(f"{name}: its model does not hold in such weather; give less current, wind or gusts")
        rate = wrap(heading - self.heading) / step
        rise = self._rise(self.terrain, position, heading) / step if self.terrain is not None else np.zeros(self.count)
        self._touch(position, heading, velocity, rate, rise)
        self.status.step(step, position, self.velocity)
        self.position, self.heading, self.velocity, self.rate = position, heading, velocity, rate
        if self.senses is not None:
            self._sense(self.senses)
        if self.lookout is not None:
            self.link.events += self.lookout.step(self.position[:, :2], self.status.alive)
            self._keep_clear()  # among people and at close quarters a second is too long

    def _touch(
        self, position: np.ndarray, heading: np.ndarray, velocity: np.ndarray, rate: np.ndarray, rise: np.ndarray
    ) -> None:
        """Let the world move the bodies, and take over what contact makes of who touches something: the arrays change."""
        step = self.world.step
        touched = self.world.advance(velocity + rise[:, None] * UP, rate)
        self.status.contact[:] = False
        for i in touched:
            body, psi, v, r = self.world.state(i)
            self.status.contact[i] = True
            body, v = body - self.footing.lift[i] * UP, v - rise[i] * UP
            if np.abs(body - position[i]).max() > INCONSISTENT or abs(np.sin(psi - heading[i])) > INCONSISTENT:
                if not self.aerial[i]:
                    body[2] = 0.0
                self.world.place(i, body + self.footing.lift[i] * UP, psi)
                squad, place = self.fleet.of(i)
                squad.adopt(place, body, psi, v, r, self.current)
                position[i], heading[i], velocity[i] = body, psi, (body - self.position[i]) / step

    def decide(self) -> None:
        """Call the director, see to mooring, launching and keeping clear; once a second."""
        status, link, fleet = self.status, self.link, self.fleet
        link.events += status.befall(self.time, fleet)
        link.events += status.run_flat(self.time, fleet, self.position)
        self.obstacles.proceed(self.time)
        reached = self._reached()
        link.serve(self.time, reached)
        link.events += self._held()
        link.events += status.report(self.time)
        # Of a triage team each decides for itself: what passes between them is the director's business.
        mute = status.suffering["comms"] if self.lookout is None else np.zeros(self.count, bool)
        events = link.receive(mute)
        states = link.states(fleet, self.position, self.heading, status.alive, reached, mute)
        commands, self.memory = self.director(self.time, states, events, self.memory)
        fresh = link.send(commands, fleet, status.alive, mute)
        self._moor()
        if self.senses is not None:
            self.senses.note()
        if self.router is not None:
            self._reroute(self.router, fresh)
        self.done = self._over(mute)

    def _over(self, mute: np.ndarray) -> bool:
        """Return whether nothing will happen any more; `mute` (k,) are not heard."""
        s = self.status
        still = bool((self.fleet.gather("idle") & ~s.lost | s.aground | s.lost & ~self.aerial).all())
        told = not self.link.untold(mute) and not (s.aground & ~s.reported).any()
        return still and told and wake_time(self.memory) == np.inf and not s.heard_again(self.time, mute)

    def standing(self) -> tuple[dict[str, State], dict[str, tuple[Waypoint, ...]]]:
        """Return how everybody stands, and what of his command is left to do."""
        reached, heard = self._reached(), np.zeros(self.count, bool)
        states = self.link.states(self.fleet, self.position, self.heading, self.status.alive, reached, heard)
        commands = self.link.commands
        return states, {id: commands.get(id, ())[n:] for id, n in zip(self.ids, reached.tolist(), strict=True)}  # noqa: A001

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
            underway=self.status.underway,
            contact=self.status.contact,
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
            self.status.strand(i, self.time, position[i], why)
        for i in np.flatnonzero(footing.rolling).tolist() if self.world.bodies else ():
            at = self.position[i] + before[i] * UP
            self.world.place(i, at, float(self.heading[i]), float(footing.pitch[i]), float(footing.roll[i]))
        for squad in self.fleet.squads:
            if isinstance(squad, Rovers):
                squad.pitch = footing.pitch[squad.index]
                squad.active[:] &= ~self.status.aground[squad.index]
        return footing.lift - before

    def _true_cross(self, believed: np.ndarray) -> np.ndarray:
        """Return (k,) cross-track errors in metres of where the vehicles are, not of where they believe to be."""
        start, end = self.fleet.gather("ends").transpose(1, 0, 2)
        span, off = end - start, self.position - start
        product = np.cross(span, off) / np.maximum(np.linalg.norm(span, axis=1), 1e-9)[:, None]
        return np.where(believed != 0, np.where(self.aerial, np.linalg.norm(product, axis=1), product[:, 2]), 0.0)

    def _sense(self, senses: Senses) -> None:
        """See and localise after a step; tell the guidance and, of robots that get no further, the director."""
        pose = np.column_stack([self.position[:, :2], self.heading])
        step = self.world.step
        deaf, present = self.status.suffering["gnss"], self.status.there & ~self.status.lost
        senses.step(self.time + step, step, pose, deaf, present, self.status.moored, self._legs())
        for squad in self.fleet.squads:
            squad.error[:] = senses.error[squad.index]
            squad.tracks["slow"] = np.minimum(self.watch.slow, senses.slow)[squad.index]
            squad.tracks["bias"] = senses.bias[squad.index]
        for i in np.flatnonzero(senses.stalled & ~self.stalled):
            x, y, _ = senses.navigation.believed[i].tolist()
            self.link.events.append(Event("blocked", self.ids[i], data={"x": x, "y": y}))
        self.stalled = senses.stalled.copy()

    def _reroute(self, router: Rerouting, fresh: set[int]) -> None:
        """Have robots with lidar put on their maps what they see, and all drive around what bars their way."""
        there = self.status.there
        present, believed = there & ~self.status.lost, np.column_stack([self.position[:, :2], self.heading])
        router.begin(fresh)
        if self.senses is not None and len(self.senses.lidars):
            believed, sure = self.senses.navigation.believed, self.senses.navigation.sure | self.sensing.mapping
            angles, ranges, mute = self.senses.angles, self.senses.ranges, self.status.suffering["comms"]
            router.findings.look(believed, sure, angles, ranges, REACH, mute, present)
        commands = [self.link.commands.get(id, ()) for id in self.ids]  # noqa: A001
        self.link.events += router.drive_around(
            self.time, self.fleet, believed, commands, fresh, self.stalled, present, there
        )

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
        """See to mooring and launching: bodies of those under way collide, and only who is out there runs."""
        before = self.status.underway
        self.status.moor(DECIDE, self.fleet.gather("idle"), self.position)
        for i in np.flatnonzero(self.status.underway != before):
            self.world.set_underway(int(i), bool(self.status.underway[i]))
        self._keep_clear()
        for squad in self.fleet.squads:
            squad.active[:] = self.status.there[squad.index]

    def _keep_clear(self) -> None:
        pose = self.position, self.heading, self.velocity, self.rate
        self.watch.keep_clear(self.time, self.fleet, *pose, self.status.there)

    def _held(self) -> list[Event]:
        """Return who stands before one that is dead or silent, and where that one is."""
        if self.lookout is not None:
            return []
        still = (~self.status.alive | self.status.suffering["comms"]) & ~self.status.moored
        pairs = [(self.ids[i], self.ids[j], self.position[j]) for i, j in self.watch.held(self.time, self.position, still)]
        return [Event("held", who, by, {"x": float(x), "y": float(y)}) for who, by, (x, y, _) in pairs]
