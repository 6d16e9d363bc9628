# ruff: noqa: ARG002, D102 - the squads' methods are described once, in Squad; not every kind feels every influence
"""The fleet: all vehicles of a kind as one squad of arrays, with one way to guide, drive and read them whatever the
kind; and the squads together.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.mission import Waypoint
from quarterdeck.physics import multirotor, rover, vessel
from quarterdeck.physics.guidance import guide_multirotors, guide_rovers, guide_vessels, nearing_rovers
from quarterdeck.physics.paths import IDLE, ROTATE, SAIL, WAYPOINT, command_track, empty_tracks, vehicle_limits


class Squad(ABC):
    """The k vehicles of one kind. `index` (k,) are their places in the fleet; `state` is the kind's own.

    `active` (k,) are those that run, `scale` (k, actuators) what is left of each actuator, `error` (k, 3) how far x, y
    and heading as the vehicles believe them are from the truth.
    """

    columns: int
    actuators: int

    def __init__(
        self, vehicles: Sequence[Vehicle], index: np.ndarray, position: np.ndarray, heading: np.ndarray, seed: int = 0
    ) -> None:
        count = len(vehicles)
        self.vehicles, self.index, self.seed = vehicles, index, seed
        self.limits, self.tracks = vehicle_limits(vehicles), empty_tracks(count)
        self.table = np.zeros(0, WAYPOINT)
        self.state = np.zeros((count, self.columns))
        self.active = np.ones(count, bool)
        self.scale = np.ones((count, self.actuators))
        self.error = np.zeros((count, 3))
        self.parameters = np.array([self.figures(v) for v in vehicles])
        self.begin(position, heading)
        for i in range(count):
            self.command(i, ())

    def command(self, i: int, waypoints: Sequence[Waypoint]) -> None:
        """Tell the squad's vehicle `i` to follow `waypoints` from where it is."""
        position, _ = self.pose()
        self.table = command_track(self.tracks, self.table, i, position[i], waypoints, self.vehicles[i].speed)

    def stop_short(self, i: int) -> None:
        """Let the leg that the squad's vehicle `i` is on end where it is: somebody else is where it was to end."""
        position, _ = self.pose()
        track = self.tracks[i]
        for axis, value in zip("xyz", position[i].tolist(), strict=True):
            self.table[axis][track["leg"]] = value
        track["aside"] = track["want"] = 0.0

    @property
    def idle(self) -> np.ndarray:
        """(k,) bool: has done all it was told."""
        return self.tracks["mode"] == IDLE

    @property
    def reached(self) -> np.ndarray:
        """(k,) number of waypoints of the last command that were reached and served."""
        t = self.tracks
        return np.where(self.idle, t["last"] - t["first"], np.maximum(t["leg"] - t["first"] - 1, 0))

    @property
    def course(self) -> np.ndarray:
        """(k, 2) direction of the leg that each is on; zeros for one that waits, holds or is done."""
        start, end = self.ends[..., :2].transpose(1, 0, 2)
        way, mode = end - start, self.tracks["mode"]
        length = np.hypot(*way.T)
        return way / np.where((length > 0) & ((mode == SAIL) | (mode == ROTATE)), length, np.inf)[:, None]

    @property
    def ends(self) -> np.ndarray:
        """(k, 2, 3) metres: where the leg that each is on begins and ends."""
        t = self.tracks
        a, b = self.table[np.maximum(t["leg"] - 1, t["first"])], self.table[t["leg"]]
        return np.stack([np.column_stack([w["x"], w["y"], w["z"]]) for w in (a, b)], axis=1)

    @property
    def kind(self) -> np.ndarray:
        """(k,) int8: the kind of leg that each is on, its place in `paths.LEGS`."""
        return self.table["kind"][self.tracks["leg"]]

    @property
    def pace(self) -> np.ndarray:
        """(k,) m/s at which each is to go on its leg."""
        return self.table["speed"][self.tracks["leg"]]

    @property
    def rest(self) -> np.ndarray:
        """(k,) metres, on the plan, to the end of the leg that each is on."""
        end = self.table[self.tracks["leg"]]
        return np.hypot(*(self.pose()[0][:, :2] - np.column_stack([end["x"], end["y"]])).T)

    @property
    def nearing(self) -> np.ndarray:
        """(k,) m/s that each goes at most because it stops at the end of its leg; infinity where it may not."""
        return np.full(len(self.tracks), np.inf)

    @property
    def aside(self) -> np.ndarray:
        """(k,) metres that each is told to keep to starboard of its path, to be clear of others."""
        return self.tracks["aside"]

    @property
    def goal(self) -> np.ndarray:
        """(k, 3) metres: the place that the controllers hold; of those that steer by heading, where they are."""
        return self.pose()[0]

    @property
    def shifted(self) -> np.ndarray:
        """(k,) metres of `aside` that each has already moved: it follows what it is told with a lag."""
        return np.clip(-self.tracks["cross"], np.minimum(self.aside, 0.0), np.maximum(self.aside, 0.0))

    @abstractmethod
    def figures(self, vehicle: Vehicle) -> np.ndarray:
        """Return the record of the vehicle's parameters."""

    @abstractmethod
    def begin(self, position: np.ndarray, heading: np.ndarray) -> None:
        """Put the vehicles at rest at their starts: (k, 3) metres, (k,) radians."""

    @abstractmethod
    def guide(self, time: float, step: float) -> None:
        """Set what the controllers hold until the next call."""

    @abstractmethod
    def drive(self, step: float, current: np.ndarray, wind: np.ndarray) -> None:
        """Advance the active vehicles by `step` seconds in `current` (2,) and `wind` (k, 3) m/s."""

    @abstractmethod
    def pose(self) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (k, 3) and headings (k,)."""

    @abstractmethod
    def velocity(self, current: np.ndarray) -> np.ndarray:
        """Return (k, 3) m/s over ground."""

    @abstractmethod
    def adopt(
        self, i: int, position: np.ndarray, heading: float, velocity: np.ndarray, rate: float, current: np.ndarray
    ) -> None:
        """Take over what contact has made of vehicle `i`: (3,) metres, radians, (3,) m/s over ground, rad/s."""

    @property
    def energy(self) -> np.ndarray:
        """(k,) Wh used."""
        return self.state[:, -1]


class Vessels(Squad):
    """Surface vessels."""

    columns, actuators = vessel.COLUMNS, 2

    def figures(self, vehicle: Vehicle) -> np.ndarray:
        return vessel.vessel_parameters(vehicle.model)

    def begin(self, position: np.ndarray, heading: np.ndarray) -> None:
        self.state[:, :2], self.state[:, vessel.PSI] = position[:, :2], heading
        self.heading, self.speed = heading.copy(), np.zeros(len(heading))
        self.seen = np.zeros((len(heading), 4))

    def guide(self, time: float, step: float) -> None:
        self.seen[:, 2:] = self.state[:, [vessel.U, vessel.V]]
        pose = self.state[:, :3] + self.error
        rate = self.state[:, vessel.R].copy()
        guide_vessels(time, step, pose, self.seen, rate, self.limits, self.tracks, self.table, self.heading, self.speed)

    def drive(self, step: float, current: np.ndarray, wind: np.ndarray) -> None:
        before = self.state[:, :2].copy()
        vessel.drive_vessels(
            self.state, self.parameters, self.active, self.heading, self.speed, current, wind, self.scale, step
        )
        self.seen[:, :2] = (self.state[:, :2] - before) / step  # what a GNSS receiver tells of the motion

    def pose(self) -> tuple[np.ndarray, np.ndarray]:
        return np.column_stack([self.state[:, :2], np.zeros(len(self.state))]), self.state[:, vessel.PSI]

    def velocity(self, current: np.ndarray) -> np.ndarray:
        u, v, psi = self.state[:, vessel.U], self.state[:, vessel.V], self.state[:, vessel.PSI]
        cos, sin = np.cos(psi), np.sin(psi)
        over = np.column_stack([cos * u - sin * v + current[0], sin * u + cos * v + current[1], np.zeros(len(u))])
        return over * self.active[:, None]

    def adopt(
        self, i: int, position: np.ndarray, heading: float, velocity: np.ndarray, rate: float, current: np.ndarray
    ) -> None:
        s = self.state[i]
        vx, vy = velocity[:2] - current
        cos, sin = np.cos(heading), np.sin(heading)
        s[:3] = position[0], position[1], heading
        s[vessel.U], s[vessel.V], s[vessel.R] = cos * vx + sin * vy, -sin * vx + cos * vy, rate


class Rovers(Squad):
    """Ground vehicles."""

    columns, actuators = rover.COLUMNS, 2

    def figures(self, vehicle: Vehicle) -> np.ndarray:
        return rover.rover_parameters(vehicle.model)

    def begin(self, position: np.ndarray, heading: np.ndarray) -> None:
        self.state[:, :2], self.state[:, rover.PSI] = position[:, :2], heading
        self.ground = np.random.default_rng(self.seed)
        self.speed, self.turn = np.zeros(len(heading)), np.zeros(len(heading))
        self.pitch = np.zeros(len(heading))
        self.climb: np.ndarray | None = None  # what slopes need to be known; None on flat ground

    def guide(self, time: float, step: float) -> None:
        speed = self.state[:, [rover.LEFT, rover.RIGHT]].mean(axis=1)
        guide_rovers(
            time, step, self.state[:, :3] + self.error, speed, self.limits, self.tracks, self.table, self.speed, self.turn
        )

    def drive(self, step: float, current: np.ndarray, wind: np.ndarray) -> None:
        rough = self.parameters["roughness"][:, None] * self.ground.standard_normal((len(self.state), 2))
        scale = self.scale * (1.0 + rough)
        if self.climb is None:
            rover.drive_rovers(self.state, self.parameters, self.active, self.speed, self.turn, scale, step)
            return
        before = self.state.copy()
        speed = rover.slowed(self.parameters, self.climb, self.speed, self.pitch)
        rover.drive_rovers(self.state, self.parameters, self.active, speed, self.turn, scale, step)
        rover.climb(before, self.state, self.parameters, self.climb, self.pitch, self.active, step)

    def pose(self) -> tuple[np.ndarray, np.ndarray]:
        return np.column_stack([self.state[:, :2], np.zeros(len(self.state))]), self.state[:, rover.PSI]

    @property
    def nearing(self) -> np.ndarray:
        return nearing_rovers(self.limits, self.tracks, self.table, self.rest)

    def velocity(self, current: np.ndarray) -> np.ndarray:
        speed, psi = self.state[:, [rover.LEFT, rover.RIGHT]].mean(axis=1) * self.active, self.state[:, rover.PSI]
        return np.column_stack([speed * np.cos(psi), speed * np.sin(psi), np.zeros(len(psi))])

    def adopt(
        self, i: int, position: np.ndarray, heading: float, velocity: np.ndarray, rate: float, current: np.ndarray
    ) -> None:
        s, p = self.state[i], self.parameters[i]
        ahead = velocity[0] * np.cos(heading) + velocity[1] * np.sin(heading)
        half = rate * p["separation"] * p["slip"] / 2
        s[:3] = position[0], position[1], heading
        s[rover.LEFT], s[rover.RIGHT] = ahead - half, ahead + half


class Multirotors(Squad):
    """Aerial vehicles."""

    columns, actuators = multirotor.COLUMNS, 4

    def figures(self, vehicle: Vehicle) -> np.ndarray:
        return multirotor.multirotor_parameters(vehicle.model)

    def begin(self, position: np.ndarray, heading: np.ndarray) -> None:
        self.state[:, :3] = position
        self._turn_to(slice(None), heading)
        hover = self.parameters["mass"] * multirotor.GRAVITY / 4 * (position[:, 2] > 0)
        self.state[:, multirotor.F : multirotor.F + 4] = hover[:, None]
        self.reference = np.column_stack([position, np.zeros((len(position), 3)), heading])

    def guide(self, time: float, step: float) -> None:
        believed = self.state[:, :3].copy()
        believed[:, :2] += self.error[:, :2]
        guide_multirotors(time, step, believed, self.limits, self.tracks, self.table, self.reference)

    def drive(self, step: float, current: np.ndarray, wind: np.ndarray) -> None:
        wanted = self.reference.copy()
        wanted[:, :2] -= self.error[:, :2]  # a vehicle that believes itself east of where it is stays west of its path
        multirotor.drive_multirotors(self.state, self.parameters, self.active, wanted, wind, self.scale, step)

    def pose(self) -> tuple[np.ndarray, np.ndarray]:
        w, a, b, c = self.state[:, multirotor.Q : multirotor.Q + 4].T
        return self.state[:, :3].copy(), np.arctan2(2 * (w * c + a * b), 1 - 2 * (b * b + c * c))

    @property
    def goal(self) -> np.ndarray:
        return self.reference[:, :3]

    @property
    def shifted(self) -> np.ndarray:
        return self.aside  # their `cross` has no side

    def velocity(self, current: np.ndarray) -> np.ndarray:
        return self.state[:, 3:6] * self.active[:, None]

    def adopt(
        self, i: int, position: np.ndarray, heading: float, velocity: np.ndarray, rate: float, current: np.ndarray
    ) -> None:
        s = self.state[i]
        s[:3], s[3:6] = position, velocity
        self._turn_to(i, np.array(heading))  # a body holds its yaw only: after contact the craft is level
        s[multirotor.W : multirotor.W + 3] = 0.0, 0.0, rate

    def _turn_to(self, i: int | slice, heading: np.ndarray) -> None:
        self.state[i, multirotor.Q : multirotor.Q + 4] = 0.0
        self.state[i, multirotor.Q], self.state[i, multirotor.Q + 3] = np.cos(heading / 2), np.sin(heading / 2)


KINDS: dict[str, type[Squad]] = {"surface": Vessels, "ground": Rovers, "aerial": Multirotors}


class Fleet:
    """All k vehicles: a squad for each domain that has some, and what they are together, in the order of `vehicles`.

    Raises InputError if a model's [dynamics] are wrong.
    """

    def __init__(self, vehicles: Sequence[Vehicle], position: np.ndarray, heading: np.ndarray, seed: int = 0) -> None:
        self.count = len(vehicles)
        self.squads: list[Squad] = []
        for domain, kind in KINDS.items():
            index = np.array([i for i, v in enumerate(vehicles) if v.domain == domain], dtype=int)
            if len(index):
                self.squads.append(kind([vehicles[i] for i in index], index, position[index], heading[index], seed))

    def poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (k, 3) and headings (k,)."""
        position, heading = np.empty((self.count, 3)), np.empty(self.count)
        for squad in self.squads:
            position[squad.index], heading[squad.index] = squad.pose()
        return position, heading

    def gather(self, name: str) -> np.ndarray:
        """Return a squad's property, (k, ...), over the whole fleet."""
        parts = [getattr(squad, name) for squad in self.squads]
        out = np.empty((self.count, *parts[0].shape[1:]), parts[0].dtype)
        for squad, part in zip(self.squads, parts, strict=True):
            out[squad.index] = part
        return out

    def of(self, i: int) -> tuple[Squad, int]:
        """Return the squad of vehicle `i`, and its place there."""
        for squad in self.squads:
            place = int(np.searchsorted(squad.index, i))
            if place < len(squad.index) and squad.index[place] == i:
                return squad, place
        raise KeyError(i)
