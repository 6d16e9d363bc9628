"""What the vehicles of a run see, and what it does to them: lidar, localisation, and the potential field over their
paths.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from quarterdeck.geo.angles import wrap
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Obstacle, Site, Vehicle
from quarterdeck.physics.lidar import beam_angles, cast, edge_grid, noisy
from quarterdeck.physics.likelihood import distance_field
from quarterdeck.physics.navigation import BY_GNSS, DEAD, LIDAR, REACH, Map, Navigation
from quarterdeck.physics.paths import SAIL
from quarterdeck.physics.positioning import GNSS
from quarterdeck.physics.potential_field import PAPER, SCALED, field_velocity, hull_reach, safe_speed, watch_progress
from quarterdeck.physics.rerouting import Rerouting

BEAMS = 180
NOISE, DROPOUT = 0.03, 0.01  # m of deviation; part of the beams without echo
MARGIN = 0.1  # m added to the hull
CARROT = 4.0  # m: so far along its leg a robot looks
CORRIDOR = 0.2  # m beside the hull: what stands so near to the leg is in the way


@dataclass(frozen=True, slots=True)
class Sensing:
    """What is sensed, instead of known. `gnss`: one of positioning.GNSS, or None for perfect fixes; `lidar`: ground robots
    see and steer clear; `amcl`: and localise by it. `unmapped` obstacles are there, but neither in the plan nor on the
    robots' map; `world`, if given, is what is there in place of the plan's obstacles. `mapping`: robots draw a map, at the
    places where they believe themselves to be, however sure they are.
    """

    gnss: str | None = None
    lidar: bool = False
    amcl: bool = False
    unmapped: tuple[Obstacle, ...] = ()
    world: tuple[Obstacle, ...] | None = None
    mapping: bool = False
    field: Literal["scaled", "paper"] = "scaled"

    def __post_init__(self) -> None:
        if self.mapping and not (self.lidar or self.amcl):
            raise InputError("a map is drawn of what robots see; let them have lidar or amcl")
        if self.gnss is not None and self.gnss not in GNSS:
            raise InputError(f"unknown GNSS {self.gnss!r}; known: {', '.join(GNSS)}")


class Senses:
    """The senses of a run's fleet. `error` (k, 3) is what the vehicles believe less the truth; `bias` and `slow` (k,) what
    the field adds to their courses, radians, and leaves of their speeds, m/s; `stalled` (k,) those that get no further;
    `ranges` (lidars, b) the last scans. The fleet knows of `site` and is on the `real` one.
    """

    def __init__(
        self,
        sensing: Sensing,
        site: Site,
        real: Site,
        vehicles: Sequence[Vehicle],
        pose: np.ndarray,
        random: np.random.Generator,
    ) -> None:
        count = len(vehicles)
        self.field = {"scaled": SCALED, "paper": PAPER}[sensing.field]
        ground = np.array([v.domain == "ground" for v in vehicles])
        self.vehicles, self.random = vehicles, random
        self.bias, self.slow = np.zeros(count), np.full(count, np.inf)
        self.stalled = np.zeros(count, bool)
        self.best, self.since, self.leg = np.full(count, np.inf), np.zeros(count), np.full(count, -1)
        self.lidars = np.flatnonzero(ground) if sensing.lidar or sensing.amcl else np.empty(0, int)
        self.angles = beam_angles(BEAMS)
        self.router = Rerouting(site, vehicles, self.lidars) if len(self.lidars) else None
        self.errors: list[np.ndarray] = []
        self.modes: list[np.ndarray] = []
        known = None
        if len(self.lidars):
            solid = [o.polygon for o in site.obstacles if "ground" in o.blocks]
            self.grid = edge_grid([o.polygon for o in real.obstacles if "ground" in o.blocks])
            self.ranges = np.full((len(self.lidars), BEAMS), np.inf)
            # Ahead as far as a corner reaches: where it stops it can turn.
            sizes = [(np.hypot(*_size(vehicles[i])), _size(vehicles[i])[1]) for i in self.lidars.tolist()]
            self.hull = np.array([hull_reach(self.angles, *size, MARGIN) for size in sizes])
            self.disc = np.array([diagonal / 2 + MARGIN for diagonal, _ in sizes])
            self.half = np.array([vehicles[i].model.width / 2 + CORRIDOR for i in self.lidars.tolist()])
            # Beside its planned path, which keeps the clearance, a robot feels nothing.
            room = [vehicles[i].clearance - vehicles[i].model.width / 2 - MARGIN for i in self.lidars.tolist()]
            self.beside = np.maximum(np.array(room), 0.05)
            if sensing.amcl:
                known = Map(edge_grid(solid), distance_field(solid, site.operating.bounds))
        gnss = GNSS[sensing.gnss] if sensing.gnss else None
        self.navigation = Navigation(vehicles, pose, random, gnss=gnss, map=known)

    @property
    def error(self) -> np.ndarray:
        """(k, 3) believed less true x, y and heading."""
        return self.navigation.error

    def step(
        self,
        time: float,
        step: float,
        pose: np.ndarray,
        deaf: np.ndarray,
        present: np.ndarray,
        moored: np.ndarray,
        legs: "Legs",
    ) -> None:
        """See, localise and steer after a step to `pose` (k, 3). `deaf` (k,): without GNSS; `present` (k,): at work;
        `moored` (k,): at home, where nobody sees it.
        """
        ranges = None
        if len(self.lidars):
            radius = np.array([min(v.model.length, v.model.width) / 2 for v in self.vehicles])
            ground = np.array([v.domain == "ground" for v in self.vehicles]) & ~moored
            discs = np.column_stack([pose[ground, :2], radius[ground]])
            clean = cast(self.grid, pose[self.lidars], self.angles, REACH, discs)
            ranges = self.ranges = noisy(clean, self.random, deviation=NOISE, dropout=DROPOUT, reach=REACH)
        told = ranges
        if ranges is not None and self.router is not None:
            told = self.router.findings.mapped(self.navigation.believed, self.angles, ranges)
        self.navigation.step(time, step, pose, deaf, self.angles, told)
        if ranges is not None:
            self._steer(step, pose, present, ranges, legs)

    def note(self) -> None:
        """Keep a sample of errors and modes for the report."""
        self.errors.append(np.hypot(*self.navigation.error[:, :2].T))
        self.modes.append(self.navigation.mode.copy())

    def report(self) -> list[dict[str, Any]]:
        """Return for each vehicle its localisation error in metres (`mean`, `p95`, `max`), the parts of the time that it
        lived by `lidar`, `gnss` and `dead` reckoning, and how many `recoveries` its filter tried; of samples taken by
        `note`.
        """
        errors, modes = np.array(self.errors), np.array(self.modes)
        return [
            {
                "mean": float(errors[:, i].mean()),
                "p95": float(np.percentile(errors[:, i], 95)),
                "max": float(errors[:, i].max()),
                "lidar": float((modes[:, i] == LIDAR).mean()),
                "gnss": float((modes[:, i] == BY_GNSS).mean()),
                "dead": float((modes[:, i] == DEAD).mean()),
                "recoveries": int(self.navigation.recoveries[i]),
            }
            for i in range(len(self.vehicles))
        ]

    def _steer(self, step: float, pose: np.ndarray, present: np.ndarray, ranges: np.ndarray, legs: "Legs") -> None:
        """Set bias, speed and stall of the robots with lidar from the potential field over their legs."""
        n = self.lidars
        self.bias[n], self.slow[n] = 0.0, np.inf
        believed = self.navigation.believed[n]
        span = legs.end[n] - legs.start[n]
        length = np.maximum(np.hypot(*span.T), 1e-9)
        along = span / length[:, None]
        off = believed[:, :2] - legs.start[n]
        s, cross = np.einsum("ki,ki->k", off, along), along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0]
        goal = legs.start[n] + along * np.minimum(s + CARROT, length)[:, None]
        # What the beams meet, along the leg and off it, as the robots believe.
        bearing = believed[:, 2:] + self.angles
        reach = np.where(np.isfinite(ranges), ranges, 1e9)
        x, y = np.cos(bearing) * reach, np.sin(bearing) * reach
        ahead = x * along[:, :1] + y * along[:, 1:]
        aside = np.abs(cross[:, None] - x * along[:, 1:] + y * along[:, :1])
        corridor = (aside < self.half[:, None]) & (ahead < CARROT) & (s[:, None] + ahead < length[:, None])
        gap = ranges - self.hull
        felt = corridor | (gap < self.beside[:, None] * 0.5)
        near = (felt & (gap < self.field.influence)).any(axis=1)
        disc = np.broadcast_to(self.disc[:, None], ranges.shape)  # or forces would change as it turns on the spot
        moving = (legs.mode[n] == SAIL) & present[n]
        seen = np.where(felt, ranges, np.inf)
        truth = pose[n]
        speed = legs.speed[n]
        wanted = field_velocity(
            truth, goal - self.navigation.error[n, :2], speed, self.angles, seen, disc, NOBODY, self.field
        )
        pace = np.hypot(*wanted.T)
        look = np.maximum(0.5 * legs.length[n], 0.8 * legs.pace[n])
        wide = cross + legs.aside[n]
        pursued = np.arctan2(  # as guide_rovers does
            along[:, 1] * look - along[:, 0] * wide, along[:, 0] * look + along[:, 1] * wide
        )
        turn = np.where(pace > 0.02, np.arctan2(wanted[:, 1], wanted[:, 0]) - pursued, 0.0)
        act = near & moving
        self.bias[n[act]] = wrap(turn)[act]
        self.slow[n[act]] = pace[act]
        self.slow[n[moving]] = np.minimum(self.slow[n], safe_speed(self.angles, ranges, self.hull))[moving]
        fresh = self.leg[n] != legs.number[n]
        self.leg[n] = legs.number[n]
        best, since = self.best[n], self.since[n]
        best[fresh], since[fresh] = np.inf, 0.0
        self.stalled[n] = watch_progress(best, since, length - s, moving & (legs.allowed[n] > 0.1), step)
        self.best[n], self.since[n] = best, since


NOBODY = np.empty((0, 2))  # other robots are left to `separation.give_way`


@dataclass(frozen=True, slots=True)
class Legs:
    """The legs under way: `start`, `end` (k, 2) metres; `speed` planned, `allowed` by separation, m/s; `aside` metres to
    starboard by separation; `pace` at present, m/s; `length` of the hulls; `number` and `mode` of the tracks, all (k,).
    """

    start: np.ndarray
    end: np.ndarray
    speed: np.ndarray
    allowed: np.ndarray
    aside: np.ndarray
    pace: np.ndarray
    length: np.ndarray
    number: np.ndarray
    mode: np.ndarray


def _size(vehicle: Vehicle) -> tuple[float, float]:
    return vehicle.model.length, vehicle.model.width
