"""Aerial vehicles: a quadrotor with rotors that lag, drag in the wind, and the cascade position - velocity - attitude
- rate.

Rigid body with quaternion attitude (Beard & McLain 2012, chapter 3); rotor drag linear in the airspeed (Martin & Salaun
2010); attitude error on SO(3) (Lee, Leok & McClamroch 2010).
"""

from typing import Any

import numpy as np
from numba import njit

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.models import VehicleModel
from quarterdeck.physics.figures import number, numbers

P, V, Q, W, F, Z, ENERGY = (
    0,
    3,
    6,
    10,
    13,
    17,
    20,
)  # first columns of: position, velocity, quaternion (w, x, y, z), rates, rotors
COLUMNS = 21  # Z: integral of the position error; ENERGY in Wh
PHYSICAL = 17
SUBSTEP = 0.01  # s
GRAVITY = 9.80665  # m/s2
CEILING = 0.78  # radians: the greatest tilt asked for

PARAMETERS = np.dtype(
    [(n, float) for n in ("mass", "jx", "jy", "jz", "dx", "dy", "torque", "most", "lag", "drag", "drag2", "bandwidth")]
    + [(n, float) for n in ("max_speed", "idle", "watts", "cruise", "exponent")]
)


def multirotor_parameters(model: VehicleModel) -> np.ndarray:
    """Return the () record of PARAMETERS of an aerial model. Raises InputError if [dynamics] lacks a figure."""
    if model.domain != "aerial":
        raise InputError(f"vehicle model {model.name!r} is {model.domain}, not aerial")
    p = np.zeros((), PARAMETERS)
    p["mass"] = number(model, "mass", least=1e-4)
    p["jx"], p["jy"], p["jz"] = numbers(model, "inertia", 3, least=1e-9)
    p["dx"], p["dy"] = numbers(model, "arms", 2, least=1e-3)
    p["torque"], p["most"] = number(model, "torque", least=1e-5), number(model, "thrust", least=1e-6)
    p["lag"], p["bandwidth"] = number(model, "lag", least=0.005), number(model, "bandwidth", least=1.0)
    p["drag"], p["drag2"] = numbers(model, "drag", 2, least=0.0)
    p["max_speed"], p["cruise"], p["exponent"] = model.max_speed, model.speed, model.power_exponent
    # Power goes with thrust to the power 3/2, and with speed so that level cruise takes the cruise figure.
    drag = (p["drag"] + p["drag2"] * model.speed) * model.speed
    load = np.hypot(1.0, drag / (p["mass"] * GRAVITY))
    p["idle"], p["watts"] = model.power_idle, model.power_cruise / load**1.5 - model.power_idle
    if 4 * p["most"] < 1.2 * p["mass"] * GRAVITY:
        raise InputError(
            f"vehicle model {model.name!r}: [dynamics] four times thrust {p['most']} N is under 1.2 times the weight"
        )
    return p


@njit(cache=True)
def drive_multirotors(
    state: np.ndarray,
    parameters: np.ndarray,
    active: np.ndarray,
    reference: np.ndarray,
    wind: np.ndarray,
    scale: np.ndarray,
    step: float,
) -> None:
    """Advance all multirotors by `step` seconds, in place, each substep with fresh control.

    `state` (k, COLUMNS), `parameters` (k,) records; those not `active` (k,) stay as they are; `reference` (k, 7)
    position, velocity, heading, carried on at its velocity within the step; `wind` (k, 3) m/s; `scale` (k, 4) of each
    rotor's thrust.
    """
    count = max(1, int(np.ceil(step / SUBSTEP - 1e-9)))
    dt = step / count
    work = np.empty((5, PHYSICAL))
    q = np.empty(11)
    target = np.empty(7)
    for i in range(len(state)):
        if not active[i]:
            continue
        s, p = state[i], parameters[i]
        if s[P + 2] <= 0.0 and reference[i, 2] <= 0.02 and reference[i, 5] <= 0.0:  # stands on the ground, motors off
            s[P + 2] = 0.0
            s[V : V + 3] = 0.0
            s[W:ENERGY] = 0.0
            continue
        q[4:7] = wind[i]
        q[7:11] = scale[i]
        for j in range(count):
            for c in range(3):
                target[c] = reference[i, c] - (step - j * dt) * reference[i, 3 + c]
                target[3 + c] = reference[i, 3 + c]
            target[6] = reference[i, 6]
            _control(s, p, target, dt, q)
            _rk4(s, p, q, dt, work)
            norm = np.sqrt(s[6] ** 2 + s[7] ** 2 + s[8] ** 2 + s[9] ** 2)
            s[Q : Q + 4] /= norm
            if s[P + 2] < 0.0:  # the ground
                s[P + 2], s[V + 2] = 0.0, max(s[V + 2], 0.0)
            load = (s[F] + s[F + 1] + s[F + 2] + s[F + 3]) / (p.mass * GRAVITY)
            pace = np.sqrt(s[V] ** 2 + s[V + 1] ** 2 + s[V + 2] ** 2) / p.cruise
            s[ENERGY] += (p.idle + p.watts * pace**p.exponent) * max(load, 0.0) ** 1.5 * dt / 3600.0


@njit(cache=True)
def coast_multirotors(
    state: np.ndarray, parameters: np.ndarray, rotors: np.ndarray, wind: np.ndarray, step: float, count: int
) -> None:
    """Advance by `count` RK4 steps of `step` seconds, in place, with rotor commands (k, 4) N held: no control, no
    ground.
    """
    work = np.empty((5, PHYSICAL))
    q = np.ones(11)
    for i in range(len(state)):
        q[0:4] = rotors[i]
        q[4:7] = wind[i]
        for _ in range(count):
            _rk4(state[i], parameters[i], q, step, work)


@njit(cache=True)
def _control(s: np.ndarray, p: Any, target: np.ndarray, dt: float, q: np.ndarray) -> None:
    """Set the rotor commands q[0:4] in newtons for the target position, velocity and heading."""
    kv = p.bandwidth / 3
    kp = kv / 2.2
    ki = kp * kv / 5
    ax = _axis(s, p, target, 0, kp, kv, ki, dt)
    ay = _axis(s, p, target, 1, kp, kv, ki, dt)
    az = min(max(_axis(s, p, target, 2, kp, kv, ki, dt), -0.5 * GRAVITY), 0.8 * GRAVITY) + GRAVITY
    level = np.hypot(ax, ay)
    steep = np.tan(CEILING) * az
    if level > steep:  # what it cannot have is taken from along the path first, so that it falls behind and not off
        cos, sin = np.cos(target[6]), np.sin(target[6])
        across = min(max(-sin * ax + cos * ay, -steep), steep)
        rest = np.sqrt(steep * steep - across * across)
        along = min(max(cos * ax + sin * ay, -rest), rest)
        ax, ay = cos * along - sin * across, sin * along + cos * across
    size = np.sqrt(ax * ax + ay * ay + az * az)
    zx, zy, zz = ax / size, ay / size, az / size
    # The wanted body axes: z along the thrust, x as near to the heading as that allows.
    cx, cy = np.cos(target[6]), np.sin(target[6])
    yx, yy, yz = -zz * cy, zz * cx, zx * cy - zy * cx
    norm = np.sqrt(yx * yx + yy * yy + yz * yz)
    yx, yy, yz = yx / norm, yy / norm, yz / norm
    xx, xy, xz = yy * zz - yz * zy, yz * zx - yx * zz, yx * zy - yy * zx
    w, a, b, c = s[6], s[7], s[8], s[9]
    r00, r01, r02 = 1 - 2 * (b * b + c * c), 2 * (a * b - w * c), 2 * (a * c + w * b)
    r10, r11, r12 = 2 * (a * b + w * c), 1 - 2 * (a * a + c * c), 2 * (b * c - w * a)
    r20, r21, r22 = 2 * (a * c - w * b), 2 * (b * c + w * a), 1 - 2 * (a * a + b * b)
    # Tilt and heading apart: with the heading off by half a turn, a whole-attitude error asks for the reversed tilt.
    ex = -(r01 * zx + r11 * zy + r21 * zz)
    ey = r00 * zx + r10 * zy + r20 * zz
    ez = np.arctan2(r01 * xx + r11 * xy + r21 * xz, r00 * xx + r10 * xy + r20 * xz)
    kr, kw = p.bandwidth, 2.0 * p.bandwidth
    wx, wy, wz = s[W], s[W + 1], s[W + 2]
    tx = p.jx * kw * (kr * ex - wx) + (p.jz - p.jy) * wy * wz
    ty = p.jy * kw * (kr * ey - wy) + (p.jx - p.jz) * wz * wx
    tz = 0.3 * p.jz * kw * (min(max(0.4 * kr * ez, -2.0), 2.0) - wz)
    thrust = min(max(p.mass * (ax * r02 + ay * r12 + az * r22), 0.1 * p.mass * GRAVITY), 3.6 * p.most)
    yaw = min(max(tz / (4 * p.torque), -0.15 * p.most), 0.15 * p.most)
    roll, pitch = tx / (4 * p.dy), ty / (4 * p.dx)
    base = thrust / 4
    q[0] = base - roll - pitch - yaw  # ahead, starboard; turns counter-clockwise
    q[1] = base + roll + pitch - yaw  # astern, port; counter-clockwise
    q[2] = base + roll - pitch + yaw  # ahead, port; clockwise
    q[3] = base - roll + pitch + yaw  # astern, starboard; clockwise
    for j in range(4):
        q[j] = min(max(q[j], 0.0), p.most)


@njit  # of several signatures: no cache of its own (see .ci/signatures)
def _axis(s: np.ndarray, p: Any, target: np.ndarray, c: int, kp: float, kv: float, ki: float, dt: float) -> float:
    """Return the acceleration wanted along one axis, and carry its integral on."""
    error = target[c] - s[P + c]
    if abs(error) < 2.0:
        s[Z + c] = min(max(s[Z + c] + error * dt, -4.0 / ki), 4.0 / ki)
    wanted = target[3 + c] + min(max(kp * error, -p.max_speed), p.max_speed)
    return kv * (wanted - s[V + c]) + ki * s[Z + c]


@njit(cache=True)
def _rk4(s: np.ndarray, p: Any, q: np.ndarray, dt: float, work: np.ndarray) -> None:
    """One classical Runge-Kutta step of the physical states, in place; `work` is (5, PHYSICAL) scratch."""
    k1, k2, k3, k4, t = work[0], work[1], work[2], work[3], work[4]
    _rates(k1, s, p, q)
    for j in range(PHYSICAL):
        t[j] = s[j] + dt / 2 * k1[j]
    _rates(k2, t, p, q)
    for j in range(PHYSICAL):
        t[j] = s[j] + dt / 2 * k2[j]
    _rates(k3, t, p, q)
    for j in range(PHYSICAL):
        t[j] = s[j] + dt * k3[j]
    _rates(k4, t, p, q)
    for j in range(PHYSICAL):
        s[j] += dt / 6 * (k1[j] + 2 * k2[j] + 2 * k3[j] + k4[j])


@njit(cache=True)
def _rates(out: np.ndarray, s: np.ndarray, p: Any, q: np.ndarray) -> None:
    """Time derivatives (PHYSICAL,) of the state; `q` is rotor commands (4), wind (3), thrust scale (4)."""
    w, a, b, c = s[6], s[7], s[8], s[9]
    wx, wy, wz = s[W], s[W + 1], s[W + 2]
    f0, f1, f2, f3 = s[F] * q[7], s[F + 1] * q[8], s[F + 2] * q[9], s[F + 3] * q[10]
    lift = (f0 + f1 + f2 + f3) / p.mass
    vx, vy, vz = s[V] - q[4], s[V + 1] - q[5], s[V + 2] - q[6]
    drag = (p.drag + p.drag2 * np.sqrt(vx * vx + vy * vy + vz * vz)) / p.mass
    out[0], out[1], out[2] = s[V], s[V + 1], s[V + 2]
    out[3] = 2 * (a * c + w * b) * lift - drag * vx
    out[4] = 2 * (b * c - w * a) * lift - drag * vy
    out[5] = (1 - 2 * (a * a + b * b)) * lift - drag * vz - GRAVITY
    out[6] = -0.5 * (a * wx + b * wy + c * wz)
    out[7] = 0.5 * (w * wx + b * wz - c * wy)
    out[8] = 0.5 * (w * wy + c * wx - a * wz)
    out[9] = 0.5 * (w * wz + a * wy - b * wx)
    out[10] = (p.dy * (f1 + f2 - f0 - f3) - (p.jz - p.jy) * wy * wz) / p.jx
    out[11] = (p.dx * (f1 + f3 - f0 - f2) - (p.jx - p.jz) * wz * wx) / p.jy
    out[12] = (p.torque * (f2 + f3 - f0 - f1) - (p.jy - p.jx) * wx * wy) / p.jz
    for j in range(4):
        out[F + j] = (q[j] - s[F + j]) / p.lag
