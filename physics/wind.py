"""Wind with gusts: the Dryden forms of MIL-F-8785C at low altitude, one independent gust for each vehicle."""

import numpy as np

MEMORY = 5  # columns of a gust's memory: along, across (2), up (2)


class Wind:
    """The wind at each of `count` vehicles: its `mean` (3,) m/s, and gusts of standard `deviation` m/s drawn by `seed`."""

    def __init__(self, mean: np.ndarray, deviation: float, count: int, seed: int) -> None:
        self.mean, self.deviation = mean, deviation
        self.random, self.memory = np.random.default_rng(seed), np.zeros((count, MEMORY))

    def step(self, step: float, velocity: np.ndarray, height: np.ndarray) -> np.ndarray:
        """Return the (k, 3) m/s of the next `step` seconds; `velocity` (k, 3) m/s over ground, `height` (k,) m above it."""
        if self.deviation == 0:
            return np.broadcast_to(self.mean, velocity.shape)
        airspeed = np.linalg.norm(velocity - self.mean, axis=1)
        noise = self.random.standard_normal(velocity.shape)
        return self.mean + step_gusts(self.memory, noise, airspeed, height, self.deviation, step)


def step_gusts(
    memory: np.ndarray, noise: np.ndarray, airspeed: np.ndarray, height: np.ndarray, deviation: float, step: float
) -> np.ndarray:
    """Return (k, 3) gusts in m/s: along, across and up. `memory` (k, MEMORY), begun as zeros, is carried on in place.

    `noise` (k, 3) standard normal; `airspeed` (k,) m/s; `height` (k,) metres above ground; `deviation` m/s of the gust
    along and across; up it is less near the ground. The filters are stepped exactly under noise held for a step, so
    the variance holds for steps up to a quarter of the time scale.
    """
    feet = np.clip(height, 3.0, 300.0) / 0.3048
    level = feet / (0.177 + 0.000823 * feet) ** 1.2 * 0.3048
    speed = np.maximum(airspeed, 1.0)
    upward = (0.177 + 0.000823 * feet) ** 0.4  # deviation up over deviation along
    out = np.empty_like(noise)
    decay = np.exp(-step * speed / level)
    memory[:, 0] = decay * memory[:, 0] + np.sqrt(1 - decay**2) * noise[:, 0]
    out[:, 0] = deviation * memory[:, 0]
    out[:, 1] = deviation * _second_order(memory[:, 1:3], noise[:, 1], decay)
    lift = np.exp(-step * speed / (feet * 0.3048))
    out[:, 2] = deviation * upward * _second_order(memory[:, 3:5], noise[:, 2], lift)
    return out


def _second_order(memory: np.ndarray, noise: np.ndarray, decay: np.ndarray) -> np.ndarray:
    """The form (1 + sqrt(3) T s) / (1 + T s)^2 with unit variance: two equal lags in a row."""
    memory[:, 0] = decay * memory[:, 0] + np.sqrt(1 - decay**2) * noise
    memory[:, 1] = decay * memory[:, 1] + (1 - decay) * memory[:, 0]
    # sqrt(3) of the first lag and (1 - sqrt(3)) of the second has this transfer function; the scale makes the variance 1.
    return (np.sqrt(3.0) * memory[:, 0] + (1 - np.sqrt(3.0)) * memory[:, 1]) / np.sqrt(2.0)
