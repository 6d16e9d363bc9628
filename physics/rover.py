"""Ground vehicles: differential or skid steer, wheels that lag and slip, and a yaw loop closed over the gyro.

A skid-steered vehicle turns as if its wheels stood `slip` times as far apart (Mandow et al. 2007, the instantaneous
centres of rotation of its treads). The controller assumes the maker's `multiplier`; what is between the two, the yaw
loop takes out.
"""

from typing import Any

import numpy as np
from numba import njit

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.models import VehicleModel
from quarterdeck.physics.figures import number

X, Y, PSI, LEFT, RIGHT, ZW, ENERGY = range(7)  # columns of a rover's state; LEFT, RIGHT wheel speeds in m/s
COLUMNS = 7
SUBSTEP = 0.05  # s

PARAMETERS = np.dtype(
    [
        (n, float)
        for n in (
            "separation",
            "multiplier",
            "slip",
            "lag",
            "accel",
            "wheel_speed",
            "idle",
            "watts",
            "cruise",
            "exponent",
            "roughness",
        )
    ]
)


def rover_parameters(model: VehicleModel) -> np.ndarray:
    """Return the () record of PARAMETERS of a ground model. Raises InputError if [dynamics] lacks a figure."""
    if model.domain != "ground":
        raise InputError(f"vehicle model {model.name!r} is {model.domain}, not ground")
    p = np.zeros((), PARAMETERS)
    p["separation"], p["lag"] = number(model, "separation", least=1e-3), number(model, "lag", least=0.02)
    p["multiplier"], p["slip"] = number(model, "multiplier", least=1.0), number(model, "slip", least=1.0)
    p["accel"], p["wheel_speed"] = number(model, "wheel_acceleration", least=1e-3), number(model, "wheel_speed", least=1e-3)
    if p["wheel_speed"] < model.max_speed:
        raise InputError(f"vehicle model {model.name!r}: [dynamics] wheel_speed is below [limits] max_speed")
    p["roughness"] = number(model, "roughness", least=0.0)
    p["idle"], p["watts"] = model.power_idle, model.power_cruise - model.power_idle
    p["cruise"], p["exponent"] = model.speed, model.power_exponent
    return p


CLIMB = np.dtype([("mass", float), ("efficiency", float), ("gradeability", float)])
GRAVITY = 9.81  # m/s2


def climb_parameters(model: VehicleModel) -> np.ndarray:
    """Return the () record of CLIMB of a ground model, gradeability in radians.

    Raises InputError if [dynamics] lacks a figure.
    """
    c = np.zeros((), CLIMB)
    c["mass"], c["efficiency"] = number(model, "mass", least=1e-3), number(model, "efficiency", least=0.01)
    c["gradeability"] = np.radians(number(model, "gradeability", least=0.0))
    if c["efficiency"] > 1:
        raise InputError(f"vehicle model {model.name!r}: [dynamics] efficiency must be from 0.01 to 1")
    return c


def slowed(p: np.ndarray, c: np.ndarray, speed: np.ndarray, pitch: np.ndarray) -> np.ndarray:
    """Return (k,) m/s: `speed`, or less where the climb of `pitch` (k,) radians takes more than the motors give.

    They give what full wheel speed takes on flat ground. Climbing takes m g v sin(pitch) / efficiency beside.
    """
    full = p["watts"] * (p["wheel_speed"] / p["cruise"]) ** p["exponent"]
    weight = c["mass"] * GRAVITY * np.maximum(np.sin(pitch) * np.sign(speed), 0.0) / c["efficiency"]
    low, high = np.zeros(len(p)), np.abs(speed)
    fits = p["watts"] * (high / p["cruise"]) ** p["exponent"] + weight * high <= full
    for _ in range(40):  # what is taken grows with the speed
        middle = (low + high) / 2
        enough = p["watts"] * (middle / p["cruise"]) ** p["exponent"] + weight * middle <= full
        low, high = np.where(enough, middle, low), np.where(enough, high, middle)
    return np.where(fits | (weight == 0), speed, np.sign(speed) * low)


def climb(
    before: np.ndarray, state: np.ndarray, p: np.ndarray, c: np.ndarray, pitch: np.ndarray, active: np.ndarray, step: float
) -> None:
    """Put on the slope, in place, what `drive_rovers` did as on flat ground in `step` seconds from `before` (k, COLUMNS).

    The way is along the slope, so its plan is shorter. Climbing adds m g v sin(pitch) / efficiency to the power; going
    down takes as much of m g v sin(pitch) off it as the wheels need: nothing goes back to the battery.
    """
    state[:, :2] -= (state[:, :2] - before[:, :2]) * (1.0 - np.cos(pitch))[:, None]
    speed = (state[:, LEFT] + state[:, RIGHT] + before[:, LEFT] + before[:, RIGHT]) / 4
    power = c["mass"] * GRAVITY * speed * np.sin(pitch)
    wheels = np.maximum(state[:, ENERGY] - before[:, ENERGY] - p["idle"] * step / 3600.0, 0.0)
    more = np.where(power > 0, power / c["efficiency"], power) * step / 3600.0
    state[:, ENERGY] += np.where(active, np.maximum(more, -wheels), 0.0)


@njit(cache=True)
def drive_rovers(
    state: np.ndarray,
    parameters: np.ndarray,
    active: np.ndarray,
    speed: np.ndarray,
    turn: np.ndarray,
    scale: np.ndarray,
    step: float,
) -> None:
    """Advance all rovers by `step` seconds, in place.

    `state` (k, COLUMNS), `parameters` (k,) records; those not `active` (k,) stay as they are; `speed` (k,) m/s and
    `turn` (k,) rad/s are held; `scale` (k, 2) is the part of its wheels' commanded speed that each side really turns at.
    """
    count = max(1, int(np.ceil(step / SUBSTEP - 1e-9)))
    dt = step / count
    for i in range(len(state)):
        if not active[i]:
            continue
        s, p = state[i], parameters[i]
        for _ in range(count):
            slip = turn[i] - yaw_rate(s, p)
            s[ZW] = 0.0 if turn[i] == 0.0 and speed[i] == 0.0 else min(max(s[ZW] + 4.0 * slip * dt, -1.0), 1.0)
            half = (turn[i] + s[ZW]) * p.separation * p.multiplier / 2
            half = min(max(half, -p.wheel_speed), p.wheel_speed)
            mean = min(max(speed[i], abs(half) - p.wheel_speed), p.wheel_speed - abs(half))  # steering has precedence
            _rk4(s, p, (mean - half) * scale[i, 0], (mean + half) * scale[i, 1], dt)
            wheels = (abs(s[LEFT]) + abs(s[RIGHT])) / 2
            s[ENERGY] += (p.idle + p.watts * (wheels / p.cruise) ** p.exponent) * dt / 3600.0
        s[PSI] = (s[PSI] + np.pi) % (2 * np.pi) - np.pi


@njit(cache=True)
def yaw_rate(s: np.ndarray, p: Any) -> float:
    """Return the rate of turn in rad/s that the wheels bring about."""
    return (s[RIGHT] - s[LEFT]) / (p.separation * p.slip)


@njit(cache=True)
def _rk4(s: np.ndarray, p: Any, left: float, right: float, dt: float) -> None:
    """One Runge-Kutta step: wheels by their lag and limit, the pose by the wheels."""
    l1, r1 = _wheel(s[LEFT], left, p), _wheel(s[RIGHT], right, p)
    l2, r2 = _wheel(s[LEFT] + dt / 2 * l1, left, p), _wheel(s[RIGHT] + dt / 2 * r1, right, p)
    l3, r3 = _wheel(s[LEFT] + dt / 2 * l2, left, p), _wheel(s[RIGHT] + dt / 2 * r2, right, p)
    l4, r4 = _wheel(s[LEFT] + dt * l3, left, p), _wheel(s[RIGHT] + dt * r3, right, p)
    x1, y1, w1 = _rates(s[PSI], s[LEFT], s[RIGHT], p)
    x2, y2, w2 = _rates(s[PSI] + dt / 2 * w1, s[LEFT] + dt / 2 * l1, s[RIGHT] + dt / 2 * r1, p)
    x3, y3, w3 = _rates(s[PSI] + dt / 2 * w2, s[LEFT] + dt / 2 * l2, s[RIGHT] + dt / 2 * r2, p)
    x4, y4, w4 = _rates(s[PSI] + dt * w3, s[LEFT] + dt * l3, s[RIGHT] + dt * r3, p)
    s[X] += dt / 6 * (x1 + 2 * x2 + 2 * x3 + x4)
    s[Y] += dt / 6 * (y1 + 2 * y2 + 2 * y3 + y4)
    s[PSI] += dt / 6 * (w1 + 2 * w2 + 2 * w3 + w4)
    s[LEFT] += dt / 6 * (l1 + 2 * l2 + 2 * l3 + l4)
    s[RIGHT] += dt / 6 * (r1 + 2 * r2 + 2 * r3 + r4)


@njit(cache=True)
def _wheel(speed: float, wanted: float, p: Any) -> float:
    return min(max((wanted - speed) / p.lag, -p.accel), p.accel)


@njit(cache=True)
def _rates(psi: float, left: float, right: float, p: Any) -> tuple[float, float, float]:
    v = (left + right) / 2
    return v * np.cos(psi), v * np.sin(psi), (right - left) / (p.separation * p.slip)
