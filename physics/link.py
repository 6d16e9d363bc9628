"""The link between the vehicles and the director: what it hears of them, what it tells them, and what waits meanwhile."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from quarterdeck.mission.director import Command, Event, State
from quarterdeck.mission.mission import Waypoint
from quarterdeck.physics.fleet import Fleet


class Link:
    """The link to k vehicles `ids`; who is `mute` (k,) bool is neither heard nor told.

    `events` wait to be told to the director; `commands` are what each was told last. `served` is when each task was done,
    `servers` by whom.
    """

    def __init__(self, ids: Sequence[str]) -> None:
        self.ids = ids
        self.events: list[Event] = []
        self.commands: dict[str, tuple[Waypoint, ...]] = {}
        self.served: dict[str, float] = {}
        self.servers: dict[str, str] = {}
        self._told = np.zeros(len(ids), int)  # how many waypoints of its command each was seen to reach
        self._heard: dict[str, State] = {}
        self._undelivered: dict[str, Command] = {}

    def serve(self, time: float, reached: np.ndarray) -> None:
        """Note the tasks served since the last call; `reached` (k,) are waypoints of the commands."""
        for i, id in enumerate(self.ids):  # noqa: A001
            for waypoint in self.commands.get(id, ())[self._told[i] : reached[i]]:
                if waypoint.task is not None:
                    self.served[waypoint.task], self.servers[waypoint.task] = time, id
                    self.events.append(Event("served", id, waypoint.task))
            self._told[i] = reached[i]

    def receive(self, mute: np.ndarray) -> tuple[Event, ...]:
        """Return the events that are heard; what a mute vehicle has to tell waits, that it is mute is known."""
        silent = {self.ids[i] for i in np.flatnonzero(mute).tolist()}
        heard = tuple(e for e in self.events if e.vehicle not in silent or e.kind == "lost")
        self.events = [e for e in self.events if e not in heard]
        return heard

    def states(
        self,
        fleet: Fleet,
        position: np.ndarray,
        heading: np.ndarray,
        alive: np.ndarray,
        reached: np.ndarray,
        mute: np.ndarray,
    ) -> dict[str, State]:
        """Return what is known of each vehicle: of one that is mute or not `alive` (k,) what was last heard, and that it is
        not heard. `position` (k, 3) metres, `heading` (k,) radians, `reached` (k,) waypoints of the commands.
        """
        idle, energy = fleet.gather("idle"), fleet.gather("energy")
        for i, id in enumerate(self.ids):  # noqa: A001
            if (mute[i] or not alive[i]) and id in self._heard:
                self._heard[id] = replace(self._heard[id], alive=False)
            else:
                x, y, z = position[i].tolist()
                psi, used = float(heading[i]), float(energy[i])
                self._heard[id] = State(x, y, z, psi, bool(alive[i]), int(reached[i]), bool(idle[i]), used)
        return dict(self._heard)

    def untold(self, mute: np.ndarray) -> bool:
        """Return whether something that can be heard is yet to be told to the director."""
        return not {e.vehicle for e in self.events} <= {self.ids[i] for i in np.flatnonzero(mute).tolist()}

    def send(self, commands: Mapping[str, Command], fleet: Fleet, alive: np.ndarray, mute: np.ndarray) -> set[int]:
        """Tell `commands` to whom they reach now, and return who obeys; those for mute vehicles wait."""
        self._undelivered |= commands
        fresh: set[int] = set()
        for i, id in enumerate(self.ids):  # noqa: A001
            if id in self._undelivered and not mute[i]:
                command = self._undelivered.pop(id)
                if alive[i]:
                    squad, place = fleet.of(i)
                    squad.command(place, command.waypoints)
                    self.commands[id], self._told[i] = command.waypoints, 0
                    fresh.add(i)
        return fresh
