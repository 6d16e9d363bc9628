"""How each vehicle stands, in the terms of AIS's navigational status: under way, moored, aground, or not under command
(`lost`); and what makes it so: faults, an empty battery, a fall, contact that does not end, being at its berth.
"""

from collections.abc import Sequence

import numpy as np

from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.director import Event
from quarterdeck.physics.faults import Fault, active, next_change
from quarterdeck.physics.fleet import Fleet

HARBOUR = 4.0  # lengths: so near its start or end a vehicle is being launched or recovered
CRASH, SKID = 4.0, 0.5  # m/s down, and over the ground: a multirotor that meets it faster is out of the mission
STUCK = 60.0  # s in contact, or down from the air, without a pause: the vehicle is given up


class Status:
    """The status of all k vehicles of a run, which stand at `start` (k, 2) metres when it begins.

    (k,) bool each: `underway` and `moored`; `aground`, out of the mission where it is; `lost`, without power for good;
    `reported`, whom the director knows to be aground; `contact`, who touches something. `gone` (k,) is when each was lost
    or went aground, seconds; infinity: it did not. `suffering` says of each kind of fault who suffers from it, `trouble`
    what led to the loss of vehicles, a line each.
    """

    def __init__(self, vehicles: Sequence[Vehicle], start: np.ndarray, faults: Sequence[Fault]) -> None:
        count = len(vehicles)
        self.ids = [v.id for v in vehicles]
        self.aerial = np.array([v.domain == "aerial" for v in vehicles])
        self.battery = np.array([v.battery for v in vehicles])
        self.start, self.home = start, np.array([v.home for v in vehicles], float).reshape(-1, 2)
        self.harbour = np.array([HARBOUR * v.model.length for v in vehicles])
        self.underway, self.moored, self.aground = (np.zeros(count, bool) for _ in range(3))
        self.lost, self.reported, self.contact = (np.zeros(count, bool) for _ in range(3))
        self.gone = np.full(count, np.inf)
        self.stuck, self.down = np.zeros(count), np.zeros(count)  # s in contact; s on the ground, meant to fly
        self.faults, self.change, self.suffering = faults, -1.0, active((), self.ids, 0.0)
        self.trouble: list[str] = []

    @property
    def there(self) -> np.ndarray:
        """(k,) bool: neither moored nor aground."""
        return ~self.moored & ~self.aground

    @property
    def alive(self) -> np.ndarray:
        """(k,) bool: neither aground nor lost."""
        return ~self.aground & ~self.lost

    def befall(self, time: float, fleet: Fleet) -> list[Event]:
        """Let faults begin and end whose `time` it is, and return what there is to tell of that."""
        if time < self.change:
            return []
        before, self.suffering = self.suffering, active(self.faults, self.ids, time)
        self.change = next_change(self.faults, time)
        events = []
        for i, id in enumerate(self.ids):  # noqa: A001
            if self.suffering["lost"][i] and not self.lost[i]:
                events.append(self._stop(i, fleet))
            elif self.suffering["thruster"][i] != before["thruster"][i] and not self.lost[i]:
                squad, place = fleet.of(i)
                squad.scale[place, 0] = 0.5 if self.suffering["thruster"][i] else 1.0
            if self.suffering["comms"][i] != before["comms"][i] and self.alive[i]:
                mute = Event("lost", id, data={"kind": "mute"})
                events.append(mute if self.suffering["comms"][i] else Event("returned", id))
        return events

    def run_flat(self, time: float, fleet: Fleet, position: np.ndarray) -> list[Event]:
        """Stop for ever who has used up its battery, and return the events of that; `position` (k, 3) metres."""
        events = []
        for i in map(int, np.flatnonzero((fleet.gather("energy") >= self.battery) & self.alive)):
            x, y, _ = position[i]
            self.trouble.append(f"{self.ids[i]}: battery empty at {time:.0f} s, x {x:.1f} m, y {y:.1f} m")
            events.append(self._stop(i, fleet))
        return events

    def _stop(self, i: int, fleet: Fleet) -> Event:
        squad, place = fleet.of(i)
        self.lost[i] = True
        squad.command(place, ())
        squad.scale[place] = 0.0
        squad.parameters["idle"][place] = 0.0
        return Event("lost", self.ids[i], data={"kind": "stop"})

    def strand(self, i: int, time: float, position: np.ndarray, why: str) -> None:
        """Put vehicle `i` aground where it is, `position` (3,) metres, and say `why`."""
        if not self.aground[i]:
            x, y, _ = position
            self.trouble.append(f"{self.ids[i]}: given up at {time:.0f} s, x {x:.1f} m, y {y:.1f} m: {why}")
            self.aground[i] = True

    def step(self, step: float, position: np.ndarray, velocity: np.ndarray) -> None:
        """See after `step` seconds of the world who has fallen, and for how long each has been in contact.

        `position` (k, 3) is where they are now, `velocity` (k, 3) m/s that with which they came there.
        """
        falling = (velocity[:, 2] < -CRASH) | (np.hypot(*velocity[:, :2].T) > SKID) | self.lost
        self.aground |= self.aerial & falling & (position[:, 2] <= 0.0)
        self.stuck = np.where(self.contact, self.stuck + step, 0.0)

    def moor(self, beat: float, idle: np.ndarray, position: np.ndarray) -> None:
        """See who is at its berth and who under way, and give up who is stuck; called every `beat` seconds.

        `idle` (k,) are done with what they were told; `position` (k, 3) metres.
        """
        near = np.minimum(np.hypot(*(position[:, :2] - self.start).T), np.hypot(*(position[:, :2] - self.home).T))
        self.aground |= self.stuck > STUCK
        flying = self.aerial & (position[:, 2] > 1.0)
        self.moored = idle & ~flying & (near < self.harbour)
        self.underway = self.there & (near > self.harbour)
        self.down = np.where(self.aerial & self.underway & ~idle & (position[:, 2] <= 0.0), self.down + beat, 0.0)
        self.aground |= self.down > STUCK

    def report(self, time: float) -> list[Event]:
        """Return who has gone aground since the last call, for the director to know; what is new is of this `time`."""
        events = [Event("lost", self.ids[i]) for i in np.flatnonzero(self.aground & ~self.reported & ~self.lost)]
        self.reported |= self.aground
        self.gone[~self.alive & np.isinf(self.gone)] = time
        return events

    def heard_again(self, time: float, mute: np.ndarray) -> bool:
        """Return whether one that works is `mute` (k,) at `time`, and will be heard again: it can tell and be told."""
        silent = {f.vehicle for f in self.faults if f.kind == "comms" and f.start <= time < f.end < np.inf}
        return any(self.ids[i] in silent for i in np.flatnonzero(mute & self.alive))
