"""How somebody moves in the fast world: at constant speed between the waypoints of its last command."""

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import replace
from math import inf

import numpy as np

from quarterdeck.mission.courses import at
from quarterdeck.mission.director import State
from quarterdeck.mission.mission import Waypoint

SAME = 1e-9  # s: events this close are one moment


class Motion:
    """The course along `waypoints` from x, y at `time`: `knots` (m, 3) seconds, x, y; `served` the times its waypoints are
    over. `speed` m/s is where a waypoint gives none, `power` as an `Actor` has it, `used` the watt-hours before.
    """

    __slots__ = ("end", "knots", "power", "served", "tasks", "told", "used", "waypoints")

    def __init__(
        self,
        time: float,
        x: float,
        y: float,
        speed: float,
        power: Callable[[np.ndarray], np.ndarray] | None,
        waypoints: tuple[Waypoint, ...] = (),
        used: float = 0.0,
    ) -> None:
        self.waypoints, self.power, self.used = waypoints, power, used
        knots, self.served, self.tasks = [(time, x, y)], [], []
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

    def state(self, z: float, now: float, alive: bool) -> State:
        """Return how it stands, at the height `z` metres."""
        x, y, heading = at(self.knots, now)
        reached = len(self.served) if self.end <= now + SAME else bisect_right(self.served, now + SAME)
        return State(x, y, z, heading, alive, reached, reached == len(self.served), self.energy(now))

    def until(self, now: float) -> np.ndarray:
        """Return the knots before `now`, and where it is then."""
        x, y, _ = at(self.knots, now)
        return np.vstack([self.knots[self.knots[:, 0] < now], (now, x, y)])
