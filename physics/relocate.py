"""Finding a robot that is lost: the places on the map where its scan fits, by search instead of by chance.

Particles thrown anywhere on a large map hardly ever fall near enough to the truth to survive. Drawing them from where the
measurement fits is the idea of sensor resetting (Lenser & Veloso 2000) and Mixture-MCL (Thrun, Fox, Burgard & Dellaert
2001).
"""

import numpy as np
from numba import njit

from quarterdeck.physics.lidar import EdgeGrid, cast
from quarterdeck.physics.likelihood import FAR, DistanceField, distance_at, log_likelihoods, spread_beams

HIT = 0.1  # m: deviation of a beam's end in the last, finest search


def relocate(
    field: DistanceField,
    grid: EdgeGrid,
    angles: np.ndarray,
    ranges: np.ndarray,
    reach: float,
    random: np.random.Generator,
    *,
    around: tuple[np.ndarray, float] | None = None,
    tries: int = 40_000,
    keep: int = 60,
) -> tuple[np.ndarray, np.ndarray]:
    """Return (n, 3) poses where a scan fits, and how well (n,): 1 is a beam's mean likelihood at best.

    `tries` poses anywhere, or `around` a place (2,) within a distance in metres, are compared with a few beams, the `keep`
    best are moved to where they fit better, and what they would see is cast and compared with what is seen: beams through
    a wall are found out, which the field alone does not do.
    """
    if np.count_nonzero(np.isfinite(ranges)) < 3:
        return np.empty((0, 3)), np.empty(0)
    poses = anywhere(field, tries, random)
    if around is not None:
        angle, away = random.uniform(0, 2 * np.pi, tries), around[1] * np.sqrt(random.random(tries))
        poses[:, :2] = around[0] + away[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    finite = np.flatnonzero(np.isfinite(ranges))
    few = finite[spread_beams(len(finite), 16)]
    told, _ = log_likelihoods(field.values, field.origin, field.spacing, poses, angles[few], ranges[few], 0.5, 0.1)
    best = poses[np.argsort(-told, kind="stable")[:keep]]
    use = spread_beams(len(angles), 60)
    for deviation in (0.5, 0.2, HIT):
        _climb(field.values, field.origin, field.spacing, best, angles[use], ranges[use], deviation)
    expected = cast(grid, best, angles[use], reach)
    both = np.isinf(expected) & np.isinf(ranges[use])
    error = np.where(both, 0.0, np.minimum(expected, reach) - np.minimum(ranges[use], reach))
    scores = np.exp(-0.5 * (error / (3 * HIT)) ** 2).mean(axis=1)
    fine = scores > 0.5 * scores.max()
    return best[fine], scores[fine]


def anywhere(field: DistanceField, count: int, random: np.random.Generator) -> np.ndarray:
    """Return (count, 3) poses anywhere outside the obstacles, FAR within the field's bounds."""
    return _draw_free(field.values, field.origin, field.spacing, random.random((4 * count, 3)), count)


@njit(cache=True)
def _draw_free(values: np.ndarray, origin: np.ndarray, spacing: float, random: np.ndarray, count: int) -> np.ndarray:
    out = np.empty((count, 3))
    rows, columns = values.shape
    n = 0
    for r in range(len(random)):
        x = origin[0] + FAR + random[r, 0] * ((columns - 1) * spacing - 2 * FAR)
        y = origin[1] + FAR + random[r, 1] * ((rows - 1) * spacing - 2 * FAR)
        if distance_at(values, origin, spacing, x, y) > 0.2 or len(random) - r <= count - n:
            out[n, 0], out[n, 1], out[n, 2] = x, y, (2 * random[r, 2] - 1) * np.pi
            n += 1
            if n == count:
                break
    return out


@njit(cache=True)
def _climb(
    values: np.ndarray,
    origin: np.ndarray,
    spacing: float,
    poses: np.ndarray,
    angles: np.ndarray,
    ranges: np.ndarray,
    deviation: float,
) -> None:
    """Move each pose, in place, to where the scan fits best nearby: a pattern search with halving steps."""
    around = np.zeros((6, 3))
    for n in range(len(poses)):
        step, turn = 2 * deviation, 0.1 * deviation
        here = log_likelihoods(values, origin, spacing, poses[n : n + 1], angles, ranges, deviation, 0.1)[0][0]
        for _ in range(24):
            for m in range(6):
                around[m] = poses[n]
                around[m, m // 2] += (step if m < 4 else turn) * (1 if m % 2 else -1)
            told = log_likelihoods(values, origin, spacing, around, angles, ranges, deviation, 0.1)[0]
            best = np.argmax(told)
            if told[best] > here:
                here = told[best]
                poses[n] = around[best]
            else:
                step, turn = step / 2, turn / 2
                if step < deviation / 16:
                    break
