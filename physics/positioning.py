"""What a vehicle measures of its own motion and place (odometry, GNSS, compass), and the Kalman filter that joins them."""

import math
from dataclasses import dataclass

import numpy as np

from quarterdeck.geo.angles import wrap


@dataclass(frozen=True, slots=True)
class OdometryModel:
    """How wrong odometry is. Normal deviations that grow with the root of the way: `along`, `across` metres after a metre,
    `drift` radians after a metre, `turn` after a radian turned, `gyro` after a second. And what stays the same for a run,
    drawn for each vehicle: `scale` of the way told, `current` m/s told too much or too little, as the sea or the wind
    brings about.
    """

    along: float = 0.02
    across: float = 0.01
    drift: float = 0.005
    turn: float = 0.02
    gyro: float = 0.0005
    scale: float = 0.01
    current: float = 0.0


ODOMETRY = {
    "ground": OdometryModel(),
    "surface": OdometryModel(along=0.02, across=0.02, drift=0.001, turn=0.005, scale=0.01, current=0.1),  # speed log, gyro
    "aerial": OdometryModel(along=0.02, across=0.02, drift=0.002, turn=0.005, scale=0.01, current=0.1),  # optical flow
}


@dataclass(frozen=True, slots=True)
class GnssModel:
    """How wrong a receiver is: `white` metres anew with each fix and `slow` metres that change over `memory` seconds
    (ionosphere, orbits: a first-order Gauss-Markov process), per axis; a fix every `interval` seconds.
    """

    white: float
    slow: float
    memory: float = 300.0
    interval: float = 1.0


# Orders of magnitude from receivers' data sheets: fixed RTK, code-differential or SBAS, a single receiver.
GNSS = {
    "rtk": GnssModel(white=0.01, slow=0.01),
    "sbas": GnssModel(white=0.1, slow=0.4),
    "single": GnssModel(white=0.3, slow=1.2),
}
COMPASS = math.radians(1.0)  # deviation of a heading fix, white


def body_motion(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return (k, 3) what lies between poses (k, 3) as a vehicle feels it: metres ahead, to port, radians turned."""
    turned = wrap(after[:, 2] - before[:, 2])
    middle = before[:, 2] + turned / 2
    dx, dy = (after[:, :2] - before[:, :2]).T
    cos, sin = np.cos(middle), np.sin(middle)
    return np.column_stack([cos * dx + sin * dy, cos * dy - sin * dx, turned])


def add_motion(pose: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Return (k, 3) poses after (k, 3) motions as `body_motion` tells them."""
    middle = pose[:, 2] + motion[:, 2] / 2
    cos, sin = np.cos(middle), np.sin(middle)
    heading = wrap(pose[:, 2] + motion[:, 2])
    return np.column_stack(
        [
            pose[:, 0] + cos * motion[:, 0] - sin * motion[:, 1],
            pose[:, 1] + sin * motion[:, 0] + cos * motion[:, 1],
            heading,
        ]
    )


def motion_deviation(motion: np.ndarray, seconds: float, model: OdometryModel) -> np.ndarray:
    """Return the (k, 3) deviations of odometry over (k, 3) motions of `seconds`: what is random of it."""
    way = np.hypot(motion[:, 0], motion[:, 1])
    heading = model.drift**2 * way + model.turn**2 * np.abs(motion[:, 2]) + model.gyro**2 * seconds
    return np.column_stack([model.along * np.sqrt(way), model.across * np.sqrt(way), np.sqrt(heading)])


def measure_motion(
    motion: np.ndarray, seconds: float, model: OdometryModel, faults: np.ndarray, random: np.random.Generator
) -> np.ndarray:
    """Return (k, 3) motions as odometry tells them; `faults` (k, 3) from `draw_faults`."""
    told = motion + random.standard_normal(motion.shape) * motion_deviation(motion, seconds, model)
    told[:, :2] *= 1 + faults[:, :1]
    told[:, :2] += faults[:, 1:] * seconds
    return told


def draw_faults(count: int, model: OdometryModel, random: np.random.Generator) -> np.ndarray:
    """Return (count, 3) what is wrong with each vehicle's odometry for a run: scale, and m/s ahead and to port."""
    return random.standard_normal((count, 3)) * (model.scale, model.current, model.current)


def step_slow(slow: np.ndarray, seconds: float, model: GnssModel, random: np.random.Generator) -> np.ndarray:
    """Return the (k, 2) slow part of GNSS errors `seconds` later."""
    decay = math.exp(-seconds / model.memory)
    return decay * slow + math.sqrt(1 - decay**2) * model.slow * random.standard_normal(slow.shape)


def fixes(position: np.ndarray, slow: np.ndarray, model: GnssModel, random: np.random.Generator) -> np.ndarray:
    """Return (k, 2) positions as GNSS receivers tell them, metres."""
    return position[:, :2] + slow + model.white * random.standard_normal((len(position), 2))


def lasting_deviation(model: GnssModel) -> float:
    """Return metres: the normal deviation at which fixes, each taken as independent, tell as much as they really do.

    The slow part does not average out: it tells anew only every two memories (the information rate of a first-order
    Gauss-Markov process seen for long).
    """
    return math.hypot(model.white, model.slow * math.sqrt(2 * model.memory / model.interval))


def predict(
    pose: np.ndarray, covariance: np.ndarray, motion: np.ndarray, seconds: float, model: OdometryModel
) -> tuple[np.ndarray, np.ndarray]:
    """Return (k, 3) poses and (k, 3, 3) covariances after the odometry told of (k, 3) motions (extended Kalman filter)."""
    middle = pose[:, 2] + motion[:, 2] / 2
    cos, sin = np.cos(middle), np.sin(middle)
    moved = add_motion(pose, motion)
    transition, entry = np.zeros_like(covariance), np.zeros_like(covariance)
    transition[:, [0, 1, 2], [0, 1, 2]] = 1.0
    transition[:, 0, 2], transition[:, 1, 2] = (
        -sin * motion[:, 0] - cos * motion[:, 1],
        cos * motion[:, 0] - sin * motion[:, 1],
    )
    entry[:, 0, 0] = entry[:, 1, 1] = cos
    entry[:, 0, 1], entry[:, 1, 0] = -sin, sin
    entry[:, :2, 2] = transition[:, :2, 2] / 2
    entry[:, 2, 2] = 1.0
    variance = motion_deviation(motion, seconds, model) ** 2
    way = np.hypot(motion[:, 0], motion[:, 1])
    variance[:, :2] += ((model.scale * way) ** 2 + (model.current * seconds) ** 2)[:, None]
    noise = np.einsum("kij,kj,klj->kil", entry, variance, entry)
    return moved, transition @ covariance @ transition.transpose(0, 2, 1) + noise


def correct(
    pose: np.ndarray, covariance: np.ndarray, told: np.ndarray, deviation: np.ndarray, seen: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return poses and covariances after measurements `told` (k, 3) of x, y and heading with normal `deviation` (3,).

    Only vehicles in `seen` (k,) have measured; an infinite deviation means that this was not.
    """
    measured = np.isfinite(deviation)
    noise = np.diag(deviation[measured] ** 2)
    innovation = (told - pose)[:, measured]
    if measured[2]:
        innovation[:, -1] = wrap(innovation[:, -1])
    rows = covariance[:, measured]
    gain = np.linalg.solve(rows[:, :, measured] + noise, rows).transpose(0, 2, 1)
    better = pose + np.einsum("kij,kj->ki", gain, innovation)
    better[:, 2] = wrap(better[:, 2])
    surer = covariance - gain @ rows
    surer = (surer + surer.transpose(0, 2, 1)) / 2
    return np.where(seen[:, None], better, pose), np.where(seen[:, None, None], surer, covariance)
