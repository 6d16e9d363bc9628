"""The director's desk for one call: records taken out of memory, changed, commanded, logged, put back."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from math import hypot, inf
from typing import Any

from shapely import Point
from shapely.ops import nearest_points

from quarterdeck.mission.director import Command, State
from quarterdeck.mission.mission import Waypoint
from quarterdeck.mission.triage.chase import LEGS, Ways, expanding_square, straight
from quarterdeck.mission.triage.machines import Row, step
from quarterdeck.mission.triage.records import XY, Entry, Medic, Memory, Record, Section, Uav, Ugv
from quarterdeck.mission.triage.settings import Policy, Settings
from quarterdeck.mission.triage.team import Robot, Team

_EDGE = 2e-6  # m: what the world calls a meeting is in range here, whatever the rounding
_KIND: dict[type, str] = {Ugv: "ugv", Uav: "uav", Medic: "medic"}


class Desk:
    """One call of the director: `agents` are the records as they stand, `replanned` the medics with a new plan.

    `looked` is what each UGV that is done knew of the sections when it last looked, in this call, if it is needed.
    """

    __slots__ = (
        "agents",
        "commands",
        "log",
        "look",
        "looked",
        "mute",
        "out",
        "policy",
        "replanned",
        "settings",
        "states",
        "tags",
        "team",
        "time",
    )

    def __init__(
        self,
        team: Team,
        policy: Policy,
        settings: Settings,
        time: float,
        states: Mapping[str, State],
        memory: Memory | None,
    ) -> None:
        self.team, self.policy, self.settings, self.time, self.states = team, policy, settings, time, states
        self.agents: dict[str, Any] = dict(memory.agents) if memory else {}
        self.looked: dict[str, Mapping[str, Section]] = {}
        self.out, self.tags = (memory.out, memory.tags) if memory else (frozenset(), frozenset())
        self.mute = memory.mute if memory else frozenset()
        self.log: list[Entry] = list(memory.log) if memory else []
        self.look: Mapping[str, float] = memory.look if memory else {}
        self.commands: dict[str, Command] = {}
        self.replanned: set[str] = set()

    def memory(self) -> Memory:
        """Return what is to be kept until the next call."""
        at_work = any(record.moving for name, record in self.agents.items() if name not in self.out)
        wake = min((t for name, t in self.look.items() if name not in self.out), default=inf) if at_work else inf
        return Memory(self.agents, self.out, self.mute, self.tags, tuple(self.log), self.look, wake)

    @property
    def robots(self) -> dict[str, Robot]:
        """The UGVs and UAVs by id."""
        return {**self.team.ugvs, **self.team.uavs}

    def change(self, name: str, **changes: Any) -> None:
        """Put a changed record in the place of a member's record."""
        self.agents[name] = replace(self.agents[name], **changes)

    def fire(self, name: str, event: str) -> Row | None:
        """Let a member's machine make the step of an event; its action is for the caller to do."""
        record: Record = self.agents[name]
        row = step(_KIND[type(record)], record.state, event)
        if row is not None:
            if row.next != record.state:
                self.change(name, state=row.next)
            if event != "casualty seen":  # that is logged as found
                self.note(name, "state", row.next, whom=event)
        return row

    def note(self, name: str, what: str, about: str = "", whom: str = "") -> None:
        """Write a line of the log."""
        here = self.states[name]
        self.log.append(Entry(self.time, name, what, about, here.x, here.y, whom))

    def here(self, name: str) -> XY:
        """Return where a member is."""
        state = self.states[name]
        return state.x, state.y

    def distance(self, a: str, b: str) -> float:
        """Return the metres between two members, on the plan."""
        one, other = self.states[a], self.states[b]
        return hypot(one.x - other.x, one.y - other.y)

    @property
    def reach(self) -> float:
        """How far two members hear each other, in metres."""
        return inf if self.policy.everywhere else self.settings.talk + _EDGE

    def send(self, name: str, waypoints: Iterable[Waypoint]) -> None:
        """Command a member to do these waypoints from now on; none: stay."""
        command = Command(tuple(waypoints))
        self.commands[name] = command
        self.change(name, moving=bool(command.waypoints))

    def drive(self, name: str, corners: Iterable[XY], speed: float, hold: float = 0.0, halt: float = 0.0) -> None:
        """Command a member through corners at a speed, to halt `halt` seconds at each and wait `hold` at the last."""
        points = list(corners) or [self.here(name)]
        z = self.team.uavs[name].z if name in self.team.uavs else 0.0
        last = len(points) - 1
        self.send(
            name, [Waypoint(x, y, z, speed=speed, hold=hold if i == last else halt) for i, (x, y) in enumerate(points)]
        )

    def search_field(self, name: str, speed: float) -> None:
        """Command a member to search all the field for a medic, from where it is outwards."""
        here = self.here(name)
        area = self.team.air if isinstance(self.agents[name], Uav) else self.team.ground
        self.drive(name, expanding_square(here, area, LEGS * self.settings.talk, self.ways(name)), speed)

    def lose(self, name: str, kind: str) -> None:
        """A member stops for ever or, if only its device fails, hears and tells nothing until it is heard again."""
        if name in self.out:
            return
        self.note(name, "lost", kind)
        if kind == "mute":
            self.mute |= {name}
        else:
            self.out |= {name}

    def heard(self, name: str) -> None:
        """A member's device works again."""
        if name in self.mute - self.out:
            self.note(name, "heard again")
            self.mute -= {name}

    def stand(self, name: str, place: XY) -> XY:
        """Return the place, or the nearest at which somebody on the ground may be, which a UAV keeps above."""
        if self.ways(name) is straight and name not in self.team.uavs:
            return place
        near = nearest_points(self.team.ground if name in self.team.ugvs else self.team.foot, Point(place))[0]
        return float(near.x), float(near.y)

    def middle(self, rendezvous: XY) -> XY:
        """Return the middle of the robots that wait at a rendezvous."""
        return rendezvous[0] + self.team.beside[0], rendezvous[1] + self.team.beside[1]

    def berth(self, name: str, rendezvous: XY, far: float = 1.0) -> XY:
        """Return a robot's place at a rendezvous, or what is `far` times as far from the middle."""
        (x, y), (dx, dy) = self.middle(rendezvous), self.robots[name].berth
        place = x + far * dx, y + far * dy
        return place if place == rendezvous else self.stand(name, place)

    def ways(self, name: str) -> Ways:
        """Return the shortest paths of a member."""
        record = self.agents[name]
        team = self.team
        return team.on_ground if isinstance(record, Ugv) else team.in_air if isinstance(record, Uav) else team.on_foot
