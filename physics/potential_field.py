"""The artificial potential field: drawn by a goal, pushed off by what the lidar sees and by other robots.

A local layer over a path, not a planner: it has local minima, so progress is watched and a stall is told. Two forms:
`PAPER`, the inspection paper's (section IV-C, equations 7 and 8) with its published gains and the repulsion of Khatib 1986,
whose forms the paper leaves open; and `SCALED`, the default, whose repulsion is scaled by the distance of the goal (Ge &
Cui 2000), so that a goal beside an obstacle can be reached, with a swirl that leads around what stands square in the way.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

APPROACH = 1.5  # 1/s: how fast what is left of the distance to an obstacle may be used up
NEAREST = 0.02  # m: no distance is taken as smaller


@dataclass(frozen=True, slots=True)
class FieldParams:
    """The field's gains. `attraction` m/s; `obstacles` and `robots` in the form's own units; `influence` metres from where
    on obstacles and robots push; `swirl` of the push that is turned to run along the obstacle; `scaled` by the goal's
    distance.
    """

    attraction: float
    obstacles: float
    robots: float
    influence: float
    swirl: float
    scaled: bool


PAPER = FieldParams(attraction=0.3, obstacles=1.0, robots=1.0, influence=1.0, swirl=0.0, scaled=False)
SCALED = FieldParams(attraction=1.0, obstacles=0.5, robots=0.5, influence=1.5, swirl=1.0, scaled=True)


def field_velocity(
    pose: np.ndarray,
    goal: np.ndarray,
    speed: np.ndarray,
    angles: np.ndarray,
    ranges: np.ndarray,
    keep: np.ndarray,
    others: np.ndarray,
    params: FieldParams = SCALED,
) -> np.ndarray:
    """Return the (k, 2) velocities in m/s that the field asks of robots at `pose` (k, 3).

    `goal` (k, 2), `speed` (k,) the most allowed; `ranges` (k, b) along `angles` (b,) from the heading, infinite where
    nothing is seen; `keep` (k, b) metres of each beam that lie inside the hull and its margin; `others` (k, 2) positions
    of the robots (nan: not there), who push one another. Whatever the field asks, no velocity closes in on a thing seen
    faster than APPROACH times the distance left to its margin: the robot cannot touch what it sees (a control barrier
    function; Ames et al. 2019, section III).
    """
    p = params
    return _velocities(
        pose, goal, speed, angles, ranges, np.ascontiguousarray(keep), np.ascontiguousarray(others),
        p.attraction, p.obstacles, p.robots, p.influence, p.swirl, p.scaled,
    )  # fmt: skip


def safe_speed(angles: np.ndarray, ranges: np.ndarray, keep: np.ndarray) -> np.ndarray:
    """Return (k,) m/s: how fast robots that move straight ahead may, by what they see. Arguments as `field_velocity`."""
    ahead = np.cos(angles)
    front = ahead > 0.05
    with np.errstate(invalid="ignore"):
        allowed = APPROACH * np.maximum(ranges - keep, 0.0)[:, front] / ahead[front]
    return allowed.min(axis=1, initial=np.inf)


def hull_reach(angles: np.ndarray, length: float, width: float, margin: float) -> np.ndarray:
    """Return (b,) metres from the middle of a hull to its edge, and `margin` more, along beams at `angles`."""
    with np.errstate(divide="ignore"):
        return np.minimum(length / 2 / np.abs(np.cos(angles)), width / 2 / np.abs(np.sin(angles))) + margin


def watch_progress(
    best: np.ndarray,
    since: np.ndarray,
    remaining: np.ndarray,
    trying: np.ndarray,
    step: float,
    *,
    progress: float = 0.25,
    patience: float = 10.0,
) -> np.ndarray:
    """Return (k,) bool: stalled. `best` (k,) metres and `since` (k,) seconds are kept up to date in place.

    `remaining` (k,) metres are still to go; a robot that is `trying` (k,) and has come no `progress` metres nearer than
    ever for `patience` seconds has stalled. Set `best` to infinity when the goal changes.
    """
    nearer = ~trying | (remaining < best - progress)
    best[nearer] = remaining[nearer]
    since[:] = np.where(nearer, 0.0, since + step)
    return since >= patience


@njit(cache=True)
def _velocities(
    pose: np.ndarray,
    goal: np.ndarray,
    speed: np.ndarray,
    angles: np.ndarray,
    ranges: np.ndarray,
    keep: np.ndarray,
    others: np.ndarray,
    attraction: float,
    obstacles: float,
    robots: float,
    influence: float,
    swirl: float,
    scaled: bool,
) -> np.ndarray:
    out = np.zeros((len(pose), 2))
    width = 2 * np.pi / len(angles)
    for k in range(len(pose)):
        gx, gy = goal[k, 0] - pose[k, 0], goal[k, 1] - pose[k, 1]
        away = np.hypot(gx, gy)
        if away < 1e-9:
            continue
        gx, gy = gx / away, gy / away
        pull = attraction * min(1.0, away) * (speed[k] if scaled else 1.0)
        vx, vy = pull * gx, pull * gy
        near, least, lean = -1, np.inf, 0.0
        for b in range(len(angles)):  # on which side most of what is in the way stands: all of it is passed on the other
            d = ranges[k, b] - keep[k, b]
            if scaled and d < influence:
                ux, uy = np.cos(pose[k, 2] + angles[b]), np.sin(pose[k, 2] + angles[b])
                if ux * gx + uy * gy > 0:
                    lean += np.sign(uy * gx - ux * gy) * (1 / max(d, NEAREST) - 1 / influence)
        side = 1.0 if lean < 0 else -1.0
        for b in range(len(angles)):
            d = ranges[k, b] - keep[k, b]
            if d < least:
                near, least = b, d
            if scaled and d < influence:
                ux, uy = np.cos(pose[k, 2] + angles[b]), np.sin(pose[k, 2] + angles[b])
                fx, fy = _push(ux, uy, d, gx, gy, away, influence, swirl * side, True)
                vx, vy = vx + obstacles * width * fx, vy + obstacles * width * fy
        if not scaled and least < influence:
            ux, uy = np.cos(pose[k, 2] + angles[near]), np.sin(pose[k, 2] + angles[near])
            fx, fy = _push(ux, uy, least, gx, gy, away, influence, 0.0, False)
            vx, vy = vx + obstacles * fx, vy + obstacles * fy
        for j in range(len(others)):
            if j == k or not np.isfinite(others[j, 0]):
                continue
            dx, dy = others[j, 0] - pose[k, 0], others[j, 1] - pose[k, 1]
            d = np.hypot(dx, dy)
            if 1e-9 < d < influence + keep[k, 0]:
                turned = swirl if dx * gy - dy * gx > 0 else -swirl
                fx, fy = _push(dx / d, dy / d, d - keep[k, 0], gx, gy, away, influence, turned, scaled)
                vx, vy = vx + robots * fx, vy + robots * fy
        size = np.hypot(vx, vy)
        if size > speed[k]:
            vx, vy = vx * speed[k] / size, vy * speed[k] / size
        out[k, 0], out[k, 1] = _barred(pose[k, 2], angles, ranges[k], keep[k], vx, vy)
    return out


@njit  # of several signatures: no cache of its own (see .ci/signatures)
def _push(
    ux: float, uy: float, d: float, gx: float, gy: float, away: float, influence: float, swirl: float, scaled: bool
) -> tuple[float, float]:
    """Return the push of a thing at distance `d` along the unit vector u, the goal `away` along the unit vector g.

    Plain: the gradient of (1/d - 1/influence)^2 / 2. Scaled: of the same times min(away, 1)^2, whose second term draws to
    the goal; where the thing is in the way, a part `swirl` of the push runs along it, to port if positive.
    """
    d = max(d, NEAREST)
    gap = 1 / d - 1 / influence
    if gap <= 0:
        return 0.0, 0.0
    if not scaled:
        force = gap / d**2
        return -force * ux, -force * uy
    near = min(away, 1.0)
    force = min(gap * near**2 / d, 20.0)
    fx, fy = -force * ux, -force * uy
    if away < 1.0:
        drawn = min(gap**2 * near, 20.0)
        fx, fy = fx + drawn * gx, fy + drawn * gy
    facing = ux * gx + uy * gy
    if facing > 0:
        fx, fy = fx - swirl * facing * force * uy, fy + swirl * facing * force * ux
    return fx, fy


@njit  # of several signatures: no cache of its own (see .ci/signatures)
def _barred(
    heading: float, angles: np.ndarray, ranges: np.ndarray, keep: np.ndarray, vx: float, vy: float
) -> tuple[float, float]:
    """Take out of a velocity what closes in on anything too fast; stop where that cannot be done."""
    for _ in range(4):
        clean = True
        for b in range(len(angles)):
            if ranges[b] - keep[b] > 2.0:
                continue
            ux, uy = np.cos(heading + angles[b]), np.sin(heading + angles[b])
            excess = vx * ux + vy * uy - APPROACH * (ranges[b] - keep[b])
            if excess > 1e-9:
                vx, vy = vx - excess * ux, vy - excess * uy
                clean = False
        if clean:
            return vx, vy
    worst = 0.0
    for b in range(len(angles)):
        ux, uy = np.cos(heading + angles[b]), np.sin(heading + angles[b])
        worst = max(worst, vx * ux + vy * uy - APPROACH * max(ranges[b] - keep[b], 0.0))
    return (0.0, 0.0) if worst > 1e-3 else (vx, vy)
