"""Adaptive Monte Carlo localisation: a particle filter on a likelihood field (Thrun, Burgard & Fox 2005, chapters 4 and 8).

Three choices of our own, each for a reason: variances of the motion grow with the way travelled, so that they do not depend
on how often the filter runs (table 5.6 makes deviations grow with it); particles carry weights and are drawn anew only when
half of them count for nothing, low-variance; and recovery draws not from anywhere but from where the scan fits
(`relocate`).
"""

import math
from dataclasses import dataclass

import numpy as np

from quarterdeck.geo.angles import wrap
from quarterdeck.physics.lidar import EdgeGrid
from quarterdeck.physics.likelihood import DistanceField, log_likelihoods, scan_information, spread_beams
from quarterdeck.physics.relocate import anywhere, relocate

BIN = (0.5, math.radians(10.0))  # m and radians: the KLD bins
ALARM = 0.25  # lostness above which a filter had better be helped
SEEN = 0.15  # of the beams must have an echo for the fit to count
CLUSTER = (1.0, 0.5)  # m and radians: so far around the best place particles belong to it


@dataclass(frozen=True, slots=True)
class FilterParams:
    """What the filter assumes. `hit` metres: deviation of a beam's end; `random_part` of the beams end anywhere; `beams`
    used of a scan. Motion: `along`, `across` m of deviation after a metre, `drift` radians after a metre, `turn` after a
    radian turned, `gyro` after a second. Particles: from `least` to `most` by KLD sampling with error `error` at normal
    quantile `quantile`. `slow` and `fast` are the rates of the averages whose ratio tells that the filter is lost; `weak`
    metres is the deviation of the least certain direction above which a scan, or a belief, is worth too little.
    """

    hit: float = 0.1
    random_part: float = 0.05
    beams: int = 60
    along: float = 0.05
    across: float = 0.02
    drift: float = 0.02
    turn: float = 0.05
    gyro: float = 0.001
    least: int = 400
    most: int = 4000
    error: float = 0.05
    quantile: float = 2.326
    slow: float = 0.02
    fast: float = 0.3
    weak: float = 0.2


@dataclass(frozen=True, slots=True)
class Belief:
    """Where a robot may be: `particles` (n, 3) x, y, heading, `weights` (n,) that sum to 1; `slow` and `fast`, running
    means of how well the scans fit (0: no scan yet).
    """

    particles: np.ndarray
    weights: np.ndarray
    slow: float = 0.0
    fast: float = 0.0


@dataclass(frozen=True, slots=True)
class Estimate:
    """The best place: `pose` (3,), `covariance` (3, 3), and the part of all weight that stands there."""

    pose: np.ndarray
    covariance: np.ndarray
    share: float


def believe_at(
    pose: np.ndarray, deviation: tuple[float, float, float], params: FilterParams, random: np.random.Generator
) -> Belief:
    """Return the belief of a robot that knows its pose (3,) up to normal `deviation` in x, y and heading."""
    particles = np.asarray(pose, dtype=float) + random.standard_normal((params.least, 3)) * np.asarray(deviation)
    return Belief(particles, np.full(params.least, 1 / params.least))


def believe_anywhere(
    field: DistanceField,
    grid: EdgeGrid,
    angles: np.ndarray,
    ranges: np.ndarray,
    reach: float,
    params: FilterParams,
    random: np.random.Generator,
) -> Belief:
    """Return the belief of a robot that knows nothing but its first scan: where it fits, and anywhere."""
    poses, scores = relocate(field, grid, angles, ranges, reach, random)
    count = params.most
    fitting = _jittered(poses, scores, count // 2, random)
    particles = np.vstack([fitting, anywhere(field, count - len(fitting), random)])
    return Belief(particles, np.full(count, 1 / count))


def move(belief: Belief, motion: np.ndarray, seconds: float, params: FilterParams, random: np.random.Generator) -> Belief:
    """Return the belief after the odometry told of `motion` (3,): metres ahead, metres to port, radians turned."""
    ahead, port, turned = motion.tolist()
    way = math.hypot(ahead, port)
    deviation = np.array(
        [
            params.along * math.sqrt(way),
            params.across * math.sqrt(way),
            math.sqrt(params.drift**2 * way + params.turn**2 * abs(turned) + params.gyro**2 * seconds),
        ]
    )
    step = motion + random.standard_normal(belief.particles.shape) * deviation
    middle = belief.particles[:, 2] + step[:, 2] / 2
    cos, sin = np.cos(middle), np.sin(middle)
    moved = belief.particles + np.column_stack(
        [cos * step[:, 0] - sin * step[:, 1], sin * step[:, 0] + cos * step[:, 1], step[:, 2]]
    )
    return Belief(moved, belief.weights, belief.slow, belief.fast)


def weigh_scan(
    belief: Belief, field: DistanceField, angles: np.ndarray, ranges: np.ndarray, params: FilterParams
) -> Belief:
    """Return the belief after a scan of (b,) `ranges` at `angles`, infinite where there was no echo."""
    use = _spread_echoes(ranges, params.beams)
    told, fit = log_likelihoods(
        field.values,
        field.origin,
        field.spacing,
        belief.particles,
        angles[use],
        ranges[use],
        params.hit,
        params.random_part,
    )
    if np.count_nonzero(np.isfinite(ranges)) < SEEN * len(angles):  # too little to tell whether it is lost
        return Belief(belief.particles, _reweighed(belief.weights, told), belief.slow, belief.fast)
    mean = float(belief.weights @ fit)
    slow = belief.slow + params.slow * (mean - belief.slow) if belief.slow else mean
    fast = belief.fast + params.fast * (mean - belief.fast) if belief.fast else mean
    return Belief(belief.particles, _reweighed(belief.weights, told), slow, fast)


def weigh_fix(belief: Belief, fix: np.ndarray, deviation: float) -> Belief:
    """Return the belief after a position fix (2,) with normal `deviation` metres, as a GNSS receiver gives it.

    A fix that no particle explains (more than 5 deviations from all) shifts them all onto it: they were lost.
    """
    away = belief.particles[:, :2] - fix
    square = np.einsum("ni,ni->n", away, away) / deviation**2
    if square.min() > 25.0:
        particles = belief.particles.copy()
        particles[:, :2] -= belief.weights @ away
        return Belief(particles, belief.weights, belief.slow, belief.fast)
    return Belief(belief.particles, _reweighed(belief.weights, -square / 2), belief.slow, belief.fast)


def weigh_heading(belief: Belief, heading: float, deviation: float) -> Belief:
    """Return the belief after a heading fix with normal `deviation`, both radians, as a compass gives it."""
    off = wrap(belief.particles[:, 2] - heading)
    return Belief(belief.particles, _reweighed(belief.weights, -((off / deviation) ** 2) / 2), belief.slow, belief.fast)


def lostness(belief: Belief) -> float:
    """Return the part of particles that augmented MCL would replace: how much worse scans fit now than they used to."""
    return max(0.0, 1.0 - belief.fast / belief.slow) if belief.slow else 0.0


def resample(belief: Belief, params: FilterParams, random: np.random.Generator) -> Belief:
    """Return the belief with particles drawn by weight, as many as KLD sampling asks, where fewer than half still count."""
    count = len(belief.weights)
    if 1.0 / float(belief.weights @ belief.weights) > count / 2:
        return belief
    first = belief.particles[_systematic(belief.weights, count, random.random())]
    wanted = needed(_occupied(first), params)
    chosen = belief.particles[_systematic(belief.weights, wanted, random.random())]
    return Belief(chosen, np.full(wanted, 1 / wanted), belief.slow, belief.fast)


def recover(
    belief: Belief,
    part: float,
    field: DistanceField,
    grid: EdgeGrid,
    angles: np.ndarray,
    ranges: np.ndarray,
    reach: float,
    params: FilterParams,
    random: np.random.Generator,
    around: tuple[np.ndarray, float] | None = None,
) -> Belief:
    """Return the belief with a `part` of its weight moved to places where the scan fits.

    `around`, a place (2,) and a distance in metres, says where to look, as a GNSS receiver can; else everywhere.
    """
    poses, scores = relocate(field, grid, angles, ranges, reach, random, around=around)
    if not len(poses):
        return belief
    count = max(round(part * params.most), 50)
    found = _jittered(poses, scores, count, random)
    weights = np.concatenate([belief.weights * (1 - part), np.full(count, part / count)])
    fresh = Belief(np.vstack([belief.particles, found]), weights, belief.slow, belief.fast)
    if len(weights) <= 2 * params.most:
        return fresh
    kept = _systematic(weights, params.most, random.random())
    return Belief(fresh.particles[kept], np.full(params.most, 1 / params.most), belief.slow, belief.fast)


def estimate(belief: Belief) -> Estimate:
    """Return the mean and covariance of the particles around the heaviest KLD bin."""
    bins = _bins(belief.particles)
    names, of = np.unique(bins, return_inverse=True)
    heaviest = np.argmax(np.bincount(of, weights=belief.weights, minlength=len(names)))
    members = np.flatnonzero(of == heaviest)
    centre = _mean(belief.particles[members], belief.weights[members])
    near = (np.hypot(*(belief.particles[:, :2] - centre[:2]).T) < CLUSTER[0]) & (
        np.abs(wrap(belief.particles[:, 2] - centre[2])) < CLUSTER[1]
    )
    weights = belief.weights[near]
    share = float(weights.sum())
    pose = _mean(belief.particles[near], weights)
    spread = belief.particles[near] - pose
    spread[:, 2] = wrap(spread[:, 2])
    return Estimate(pose, (spread * (weights / share)[:, None]).T @ spread, share)


def weakest(pose: np.ndarray, field: DistanceField, angles: np.ndarray, ranges: np.ndarray, params: FilterParams) -> float:
    """Return metres: the deviation that one scan leaves in the least certain direction; infinite if it sees too little."""
    use = _spread_echoes(ranges, params.beams)
    told = scan_information(field.values, field.origin, field.spacing, pose, angles[use], ranges[use], params.hit)
    if told[2, 2] < 1e-6:
        return math.inf
    position = told[:2, :2] - np.outer(told[:2, 2], told[2, :2]) / told[2, 2]  # what is left when the heading is not known
    least = float(np.linalg.eigvalsh(position)[0])
    return 1 / math.sqrt(least) if least > 1e-12 else math.inf


def _reweighed(weights: np.ndarray, told: np.ndarray) -> np.ndarray:
    """Return weights times likelihoods, the log of which is `told` (n,).

    What would leave fewer than 40 particles, or a twentieth, is believed less, by the power that leaves as many
    (tempering): else a sharp scan, on particles that lie apart, picks one of them and claims to be certain of it.
    """
    told = told - told.max()
    power, floor = 1.0, min(len(weights) / 20, 40.0)
    new = weights * np.exp(told)
    while new.sum() ** 2 < floor * (new @ new) and power > 1e-3:
        power *= 0.7
        new = weights * np.exp(power * told)
    return new / new.sum()


def _spread_echoes(ranges: np.ndarray, beams: int) -> np.ndarray:
    """Return the indices of at most `beams` of the beams that have an echo, evenly spread: few may be all that is seen."""
    echoes = np.flatnonzero(np.isfinite(ranges))
    return echoes[spread_beams(len(echoes), beams)] if len(echoes) else echoes


def _jittered(poses: np.ndarray, scores: np.ndarray, count: int, random: np.random.Generator) -> np.ndarray:
    if not len(poses):
        return np.empty((0, 3))
    chances = scores**8  # a scan that fits a little better is much more likely to be the place
    chosen = poses[_systematic(chances / chances.sum(), count, random.random())]
    return chosen + random.standard_normal((count, 3)) * (0.05, 0.05, 0.01)


def _mean(particles: np.ndarray, weights: np.ndarray) -> np.ndarray:
    x, y = weights @ particles[:, :2] / weights.sum()
    return np.array([x, y, np.arctan2(weights @ np.sin(particles[:, 2]), weights @ np.cos(particles[:, 2]))])


def _bins(particles: np.ndarray) -> np.ndarray:
    """Return (n,) a number for the bin of each particle."""
    cells = np.floor(particles[:, :2] / BIN[0]).astype(np.int64)
    turns = np.floor(particles[:, 2] % (2 * np.pi) / BIN[1]).astype(np.int64)
    return ((cells[:, 0] + 2**24) * 2**25 + cells[:, 1] + 2**24) * 64 + turns


def _occupied(particles: np.ndarray) -> int:
    return len(np.unique(_bins(particles)))


def needed(bins: int, params: FilterParams) -> int:
    """Return how many particles keep the KL divergence below `error` (Fox 2003, equation 13)."""
    if bins < 2:
        return params.least
    a = 2 / (9 * (bins - 1))
    count = (bins - 1) / (2 * params.error) * (1 - a + math.sqrt(a) * params.quantile) ** 3
    return min(max(math.ceil(count), params.least), params.most)


def _systematic(weights: np.ndarray, count: int, offset: float) -> np.ndarray:
    """Return (count,) indices drawn by weight with one random number (low-variance sampling, table 4.4)."""
    return np.minimum(np.searchsorted(np.cumsum(weights), (np.arange(count) + offset) / count), len(weights) - 1)
