"""Where the vehicles of a run believe themselves to be, and by what they know it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from quarterdeck.geo.angles import wrap
from quarterdeck.geo.scenario import Vehicle
from quarterdeck.physics.amcl import (
    ALARM,
    Belief,
    FilterParams,
    believe_at,
    estimate,
    lostness,
    move,
    recover,
    resample,
    weakest,
    weigh_fix,
    weigh_heading,
    weigh_scan,
)
from quarterdeck.physics.lidar import EdgeGrid
from quarterdeck.physics.likelihood import DistanceField
from quarterdeck.physics.positioning import (
    COMPASS,
    GNSS,
    ODOMETRY,
    GnssModel,
    add_motion,
    body_motion,
    correct,
    draw_faults,
    fixes,
    lasting_deviation,
    measure_motion,
    predict,
    step_slow,
)

KNOWN, LIDAR, BY_GNSS, DEAD = range(4)
MODES = ("known", "lidar", "gnss", "dead reckoning")
PERIOD = 0.5  # s between updates of the particle filters
REST = 5.0  # s from one recovery to the next: the filter needs some scans to tell the places apart
BRIDGE = 5.0  # s that odometry bridges before GNSS takes over where the lidar sees too little
SHARP = 0.1  # m: a receiver this good is good enough to draw a map by
LAUNCHED = (0.1, 0.1, 0.05)  # m, m, radians: how well a robot knows where it was put down


@dataclass(frozen=True, slots=True)
class Map:
    """What robots with lidar know of the site: its edges and its likelihood field."""

    grid: EdgeGrid
    field: DistanceField


class Navigation:
    """The whole fleet's. `believed` (k, 3) x, y, heading; `mode` (k,) the place in MODES of what it rests on.

    A vehicle that has neither lidar nor GNSS modelled knows where it is, until its GNSS fails: then it reckons on from
    there.
    """

    def __init__(
        self,
        vehicles: Sequence[Vehicle],
        pose: np.ndarray,
        random: np.random.Generator,
        *,
        gnss: GnssModel | None = None,
        map: Map | None = None,  # noqa: A002 - the map of the robots
        params: FilterParams | None = None,
    ) -> None:
        count = len(vehicles)
        self.random, self.gnss, self.map, self.params = random, gnss, map, params or FilterParams()
        self.receiver = gnss or GNSS["single"]
        self.truth, self.believed = pose.copy(), pose.copy()
        self.covariance = np.zeros((count, 3, 3))
        self.slow = self.receiver.slow * random.standard_normal((count, 2))
        self.mode = np.full(count, KNOWN)
        domains = [v.domain for v in vehicles]
        order = sorted(range(count), key=domains.__getitem__)
        self.groups = [(ODOMETRY[d], np.array(list(i))) for d, i in groupby(order, key=domains.__getitem__)]
        self.wrong = np.zeros((count, 3))
        for model, index in self.groups:
            self.wrong[index] = draw_faults(len(index), model, random)
        self.lidar = np.array([i for i in range(count) if map is not None and domains[i] == "ground"], dtype=int)
        self.beliefs = [believe_at(pose[i], LAUNCHED, self.params, random) for i in self.lidar]
        self.pending = np.zeros((len(self.lidar), 3))  # pose change since the last update, in the frame of the pose then
        self.weak = np.zeros(len(self.lidar))  # seconds for which the lidar has seen too little
        self.rest = np.zeros(len(self.lidar))  # seconds until a recovery may be tried again
        self.recoveries = np.zeros(count, int)
        self.mode[self.lidar] = LIDAR
        self.by_fixes = np.setdiff1d(np.arange(count), self.lidar)
        if gnss is not None:
            self.mode[self.by_fixes] = BY_GNSS
            self.covariance[self.by_fixes] = np.diag([gnss.slow**2, gnss.slow**2, COMPASS**2])
            self.believed[self.by_fixes, :2] += self.slow[self.by_fixes]

    def step(
        self, time: float, step: float, pose: np.ndarray, deaf: np.ndarray, angles: np.ndarray, ranges: np.ndarray | None
    ) -> None:
        """Follow the vehicles to `pose` (k, 3), `step` seconds on. `deaf` (k,): no GNSS; `ranges` (lidars, b) of each
        lidar.
        """
        told = np.empty_like(pose)
        motion = body_motion(self.truth, pose)
        for model, index in self.groups:
            told[index] = measure_motion(motion[index], step, model, self.wrong[index], self.random)
        self.truth = pose.copy()
        self.slow = step_slow(self.slow, step, self.receiver, self.random)
        fix = round(time / step) % max(round(self.receiver.interval / step), 1) == 0
        self._reckon(step, told, deaf, fix)
        if len(self.lidar):
            self.believed[self.lidar] = add_motion(self.believed[self.lidar], told[self.lidar])
            self.pending = add_motion(self.pending, told[self.lidar])
            if ranges is not None and round(time / step) % round(PERIOD / step) == 0:
                self._localise(deaf, fix, angles, ranges)

    @property
    def error(self) -> np.ndarray:
        """(k, 3) believed less true x, y and heading."""
        off = self.believed - self.truth
        off[:, 2] = wrap(off[:, 2])
        return off

    @property
    def sure(self) -> np.ndarray:
        """(k,) bool: knows its place well enough to put on a map what it sees."""
        out = (self.mode == KNOWN) | (self.mode == BY_GNSS) & (math.hypot(self.receiver.white, self.receiver.slow) < SHARP)
        out[self.lidar] = self.weak == 0
        return out

    def _reckon(self, step: float, told: np.ndarray, deaf: np.ndarray, fix: bool) -> None:
        """Carry on the Kalman filters of the vehicles that live by fixes."""
        self.mode[self.by_fixes] = np.where(deaf, DEAD, KNOWN if self.gnss is None else BY_GNSS)[self.by_fixes]
        known = self.mode == KNOWN
        self.believed[known], self.covariance[known] = self.truth[known], 0.0
        for model, members in self.groups:
            index = members[(self.mode[members] == BY_GNSS) | (self.mode[members] == DEAD)]
            index = np.intersect1d(index, self.by_fixes)
            if not len(index):
                continue
            pose, covariance = predict(self.believed[index], self.covariance[index], told[index], step, model)
            if fix:
                truth, heard = self.truth[index], ~deaf[index]
                compass = truth[:, 2:] + COMPASS * self.random.standard_normal((len(index), 1))
                place = fixes(truth, self.slow[index], self.receiver, self.random)
                measured = np.hstack([place, compass])
                white = max(self.receiver.white, 0.01)
                pose, covariance = correct(pose, covariance, measured, np.array([white, white, np.inf]), heard)
                compassed = np.array([np.inf, np.inf, COMPASS])
                pose, covariance = correct(pose, covariance, measured, compassed, np.ones(len(index), bool))
            self.believed[index], self.covariance[index] = pose, covariance

    def _localise(self, deaf: np.ndarray, fix: bool, angles: np.ndarray, ranges: np.ndarray) -> None:
        """Update the particle filters."""
        p = self.params
        places = fixes(self.truth[self.lidar], self.slow[self.lidar], self.receiver, self.random)
        for n, i in enumerate(self.lidar):
            way = math.hypot(*self.pending[n, :2])
            if way < 0.05 and abs(self.pending[n, 2]) < 0.05 and self.weak[n] == 0:
                continue  # standing still, the same scan would be believed again and again
            belief = self.beliefs[n]
            motion = body_motion(np.zeros((1, 3)), self.pending[n : n + 1])[0]
            belief = move(belief, motion, PERIOD, p, self.random)
            self.pending[n] = 0.0
            self.beliefs[n] = resample(
                self._told(n, i, belief, angles, ranges[n], places[n], fix, not deaf[i]), p, self.random
            )
            self.believed[i] = estimate(self.beliefs[n]).pose

    def _told(
        self,
        n: int,
        i: int,
        belief: Belief,
        angles: np.ndarray,
        ranges: np.ndarray,
        place: np.ndarray,
        fix: bool,
        hears: bool,
    ) -> Belief:
        """Return what robot `i` believes after a scan and, where that does not hold it, a position and a heading fix.

        It lives by its lidar as long as the belief stays sharp, whatever a single scan tells. When it has not for BRIDGE
        seconds, GNSS and compass bound what odometry and what little is seen leave open, until the belief is sharp and
        a scan alone would keep it so.
        """
        assert self.map is not None
        p, site, doubt = self.params, self.map, max(6 * math.hypot(self.receiver.white, self.receiver.slow), 2.0)
        belief = weigh_scan(belief, site.field, angles, ranges, p)
        astray = hears and math.hypot(*(self.believed[i, :2] - place)) > doubt
        part = 0.9 if astray else lostness(belief)
        self.rest[n] = max(self.rest[n] - PERIOD, 0.0)
        if part > ALARM and self.rest[n] == 0:
            self.recoveries[i] += 1
            self.rest[n] = REST
            near = (place, doubt) if hears else None
            belief = recover(belief, part, site.field, site.grid, angles, ranges, REACH, p, self.random, near)
        spread = _spread(belief)
        if spread > p.weak or (self.mode[i] != LIDAR and weakest(self.believed[i], site.field, angles, ranges, p) > p.weak):
            self.weak[n] += PERIOD
        else:
            self.weak[n] = 0.0
        holds = self.weak[n] <= BRIDGE
        if not holds and fix:
            if hears:  # far off or wide, it takes over a fix; finer, it learns only what fixes tell in the long run
                coarse = astray or spread > 2 * self.receiver.slow
                once = math.hypot(self.receiver.white, self.receiver.slow)
                belief = weigh_fix(belief, place, once if coarse else lasting_deviation(self.receiver))
            belief = weigh_heading(belief, self.truth[i, 2] + COMPASS * self.random.standard_normal(), COMPASS)
        self.mode[i] = LIDAR if holds else BY_GNSS if hears else DEAD
        return belief


def _spread(belief: Belief) -> float:
    """Return metres: the deviation of the belief's position in its least certain direction."""
    return math.sqrt(max(float(np.linalg.eigvalsh(estimate(belief).covariance[:2, :2])[-1]), 0.0))


REACH = 30.0  # m: of the lidars
