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
