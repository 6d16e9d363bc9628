"""Obstacles that come and go in a run: when, which of them stand in the world, and what was there in all."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from quarterdeck.geo.scenario import Obstacle, Site, Vehicle
from quarterdeck.geo.terrain import Terrain
from quarterdeck.mission.changes import Changes, changed_site
from quarterdeck.physics.world import World


@dataclass(frozen=True, slots=True)
class Turn:
    """What obstacles are gone from `time` on, seconds of the run, and which appear."""

    time: float
    gone: tuple[Obstacle, ...]
    new: tuple[Obstacle, ...]


def turns_of(site: Site, changes: Sequence[tuple[float, Changes]]) -> tuple[Turn, ...]:
    """Return the turns that `changes`, each with its second, bring to the obstacles of a site, in order of time."""
    turns = []
    for when, change in sorted(changes, key=lambda c: c[0]):
        after = changed_site(site, change)
        old, new = ({o.id: o for o in s.obstacles} for s in (site, after))
        gone = tuple(o for i, o in old.items() if i not in new)
        turns.append(Turn(when, gone, tuple(o for i, o in new.items() if i not in old)))
        site = after
    return tuple(turn for turn in turns if turn.gone or turn.new)


def spans(turns: Sequence[Turn]) -> dict[str, tuple[float, float]]:
    """Return from when until when, seconds of the run, each obstacle is there that comes or goes, by id."""
    during = {o.id: (0.0, turn.time) for turn in turns for o in turn.gone}
    return during | {o.id: (turn.time, during.get(o.id, (0.0, np.inf))[1]) for turn in turns for o in turn.new}


def standing(obstacles: Sequence[Obstacle], during: Mapping[str, tuple[float, float]], time: float) -> tuple[Obstacle, ...]:
    """Return the obstacles that stand at `time`, of those that ever did; `during` is of those that come or go."""
    spans = [(o, *during.get(o.id, (0.0, np.inf))) for o in obstacles]
    return tuple(o for o, start, end in spans if start <= time < end)


class Obstacles:
    """The obstacles of a run's world: those of the `site` from the start, on the terrain if there is one, then by `turns`.

    Only such as bar one of the `vehicles` have bodies.
    """

    def __init__(
        self, world: World, site: Site, terrain: Terrain | None, vehicles: Sequence[Vehicle], turns: Sequence[Turn]
    ) -> None:
        self.world, self.terrain, self.ahead = world, terrain, list(turns)
        self.domains = {v.domain for v in vehicles}
        passing = {o.id for turn in turns for o in turn.gone}
        self._add([o for o in site.obstacles if o.id not in passing])
        self.bodies = {o.id: self._add([o]) for o in site.obstacles if o.id in passing}

    def _add(self, obstacles: Sequence[Obstacle]) -> list[int]:
        return self.world.add_obstacles([o for o in obstacles if o.blocks & self.domains], self.terrain)

    def proceed(self, time: float) -> None:
        """Let obstacles go and appear whose `time` it is."""
        while self.ahead and self.ahead[0].time <= time:
            turn = self.ahead.pop(0)
            self.world.remove_obstacles([body for o in turn.gone for body in self.bodies.pop(o.id, [])])
            self.bodies |= {o.id: self._add([o]) for o in turn.new}
