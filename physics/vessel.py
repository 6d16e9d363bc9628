"""Surface vessels: the 3-degree-of-freedom manoeuvring model with two fixed propellers, and its autopilot.

Fossen 2021, "Handbook of Marine Craft Hydrodynamics and Motion Control", sections 6.5 and 10.3: with velocity relative to
a constant, irrotational current, M v' + C(v) v + D(v) v = tau. Axes: x ahead, y to port, yaw counter-clockwise; the
equations keep Fossen's form under this change of handedness.
"""

from typing import Any

import numpy as np
from numba import njit

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.models import VehicleModel
from quarterdeck.physics.figures import number, numbers

X, Y, PSI, U, V, R, N1, N2, ZU, ZR, ENERGY = range(11)  # columns of a vessel's state; U, V through the water
COLUMNS = 11
SUBSTEP = 0.05  # s; half the propellers' time constant; RK4 is then 0.2 mm off after a minute of turning
STRIPS = 10

PARAMETERS = np.dtype(
    [(name, float) for name in ("m11", "m22", "m23", "m33", "mass", "xg", "ax", "ay")]
    + [(name, float) for name in ("xu", "yv", "nr", "xuu", "yvv", "nrr", "crossflow", "length")]
    + [(name, float) for name in ("ahead", "astern", "kahead", "kastern", "lever", "lag", "windx", "windy")]
    + [(name, float) for name in ("max_speed", "turn_rate", "idle", "watts")]
)


def vessel_parameters(model: VehicleModel) -> np.ndarray:
    """Return the () record of PARAMETERS of a surface model. Raises InputError if [dynamics] lacks a figure."""
    if model.domain != "surface":
        raise InputError(f"vehicle model {model.name!r} is {model.domain}, not surface")
    d = model.dynamics
    p = np.zeros((), PARAMETERS)
    mass, xg = number(model, "mass", least=1e-3), number(model, "xg")
    added, linear, quadratic = (numbers(model, key, 3, least=0.0) for key in ("added_mass", "linear", "quadratic"))
    p["mass"], p["xg"], p["ax"], p["ay"] = mass, xg, added[0], added[1]
    p["m11"], p["m22"], p["m23"] = mass + added[0], mass + added[1], mass * xg
    p["m33"] = number(model, "inertia", least=1e-6) + added[2]
    if p["m22"] * p["m33"] <= p["m23"] ** 2:
        raise InputError(
            f"vehicle model {model.name!r}: [dynamics] inertia is too small for xg: the mass matrix is singular"
        )
    p["xu"], p["yv"], p["nr"] = linear
    p["xuu"], p["yvv"], p["nrr"] = quadratic
    p["crossflow"], p["length"] = number(model, "crossflow", least=0.0), model.length
    ahead, astern = numbers(model, "thrust", 2)
    if not ahead > 0 >= astern:
        raise InputError(
            f"vehicle model {model.name!r}: [dynamics] thrust must be [ahead > 0, astern <= 0], not {d['thrust']}"
        )
    p["ahead"], p["astern"] = ahead, astern
    p["kahead"], p["kastern"] = numbers(model, "bollard", 2, least=1e-9)
    p["lever"], p["lag"] = number(model, "lever", least=1e-3), number(model, "lag", least=0.02)
    p["windx"], p["windy"] = numbers(model, "windage", 2, least=0.0)
    p["max_speed"], p["turn_rate"], p["idle"] = model.max_speed, model.turn_rate, model.power_idle
    # A propeller's power goes with thrust to the power 3/2; the cruise figure fixes the factor.
    thrust = (p["xu"] * model.speed + p["xuu"] * model.speed**2) / 2
    if thrust > ahead:
        raise InputError(
            f"vehicle model {model.name!r}: [limits] speed {model.speed} needs more thrust than [dynamics] has"
        )
    p["watts"] = max(0.0, model.power_cruise - model.power_idle) / (2 * thrust**1.5) if thrust > 0 else 0.0
    return p


@njit(cache=True)
def drive_vessels(
    state: np.ndarray,
    parameters: np.ndarray,
    active: np.ndarray,
    heading: np.ndarray,
    speed: np.ndarray,
    current: np.ndarray,
    wind: np.ndarray,
    scale: np.ndarray,
    step: float,
) -> None:
    """Advance all vessels by `step` seconds, in place, with propellers set by the autopilot each substep.

    `state` (k, COLUMNS); `parameters` (k,) records; those not `active` (k,) stay as they are; `heading` (k,) radians
    and `speed` (k,) m/s through the water are held (NaN heading: propellers stopped); `current` (2,), `wind` (k, 3)
    m/s over ground; `scale` (k, 2) of each propeller's thrust.
    """
    count = max(1, int(np.ceil(step / SUBSTEP - 1e-9)))
    dt = step / count
    q = np.empty(8)
    work = np.empty((5, 8))
    for i in range(len(state)):
        if not active[i]:
            continue
        s, p = state[i], parameters[i]
        q[2], q[3], q[4], q[5], q[6], q[7] = current[0], current[1], wind[i, 0], wind[i, 1], scale[i, 0], scale[i, 1]
        for _ in range(count):
            left, right = _autopilot(s, p, heading[i], speed[i], dt)
            q[0], q[1] = _shaft(left, p), _shaft(right, p)
            _rk4(s, p, q, dt, work)
            used = abs(_thrust(s[N1], p)) ** 1.5 * q[6] + abs(_thrust(s[N2], p)) ** 1.5 * q[7]
            s[ENERGY] += (p.idle + p.watts * used) * dt / 3600.0
        s[PSI] = (s[PSI] + np.pi) % (2 * np.pi) - np.pi


@njit(cache=True)
def coast_vessels(
    state: np.ndarray,
    parameters: np.ndarray,
    shafts: np.ndarray,
    current: np.ndarray,
    wind: np.ndarray,
    step: float,
    count: int,
) -> None:
    """Advance vessels by `count` RK4 steps of `step` seconds, in place, with shaft speeds (k, 2) rad/s held: no
    autopilot.
    """
    q = np.ones(8)
    work = np.empty((5, 8))
    for i in range(len(state)):
        q[0], q[1], q[2], q[3], q[4], q[5] = shafts[i, 0], shafts[i, 1], current[0], current[1], wind[i, 0], wind[i, 1]
        for _ in range(count):
            _rk4(state[i], parameters[i], q, step, work)


@njit(cache=True)
def _autopilot(s: np.ndarray, p: Any, heading: float, speed: float, dt: float) -> tuple[float, float]:
    """Return the thrusts, left and right, that turn to `heading` and run at `speed` through the water."""
    if np.isnan(heading):
        return 0.0, 0.0
    error = (heading - s[PSI] + np.pi) % (2 * np.pi) - np.pi
    rate = min(max(0.6 * error, -p.turn_rate), p.turn_rate)
    slip = rate - s[R]
    moment = p.m33 * (2.5 * slip + s[ZR]) + (p.nr + p.nrr * abs(rate)) * rate
    surge = p.m11 * (0.5 * (speed - s[U]) + s[ZU]) + (p.xu + p.xuu * abs(speed)) * speed
    # Steering has precedence: what it leaves of the thrust drives.
    half = p.lever * (p.ahead - p.astern) / 2
    turning = min(max(moment / (2 * p.lever), -half / p.lever), half / p.lever)
    mean = min(max(surge / 2, p.astern + abs(turning)), p.ahead - abs(turning))
    if mean == surge / 2:  # else the integrals would wind up
        gain = 0.05 if (speed - s[U]) * s[ZU] >= 0.0 else 0.5  # what it had to push for is soon forgotten
        s[ZU] = min(max(s[ZU] + gain * (speed - s[U]) * dt, -0.5), 0.5)
    s[ZR] = min(max(s[ZR] + 0.5 * slip * dt, -0.3), 0.3)
    return mean - turning, mean + turning


@njit(cache=True)
def _shaft(thrust: float, p: Any) -> float:
    return np.sqrt(thrust / p.kahead) if thrust > 0 else -np.sqrt(-thrust / p.kastern)


@njit(cache=True)
def _thrust(n: float, p: Any) -> float:
    return min(p.kahead * n * n, p.ahead) if n > 0 else max(-p.kastern * n * n, p.astern)


@njit(cache=True)
def _rk4(s: np.ndarray, p: Any, q: np.ndarray, dt: float, work: np.ndarray) -> None:
    """One classical Runge-Kutta step of the eight physical states, in place; `work` is (5, 8) scratch."""
    k1, k2, k3, k4, t = work[0], work[1], work[2], work[3], work[4]
    _rates(k1, s, p, q)
    for j in range(8):
        t[j] = s[j] + dt / 2 * k1[j]
    _rates(k2, t, p, q)
    for j in range(8):
        t[j] = s[j] + dt / 2 * k2[j]
    _rates(k3, t, p, q)
    for j in range(8):
        t[j] = s[j] + dt * k3[j]
    _rates(k4, t, p, q)
    for j in range(8):
        s[j] += dt / 6 * (k1[j] + 2 * k2[j] + 2 * k3[j] + k4[j])


@njit(cache=True)
def _rates(out: np.ndarray, s: np.ndarray, p: Any, q: np.ndarray) -> None:
    """Time derivatives (8,) of the state; `q` is shaft commands (2), current (2), wind (2), thrust scale (2)."""
    u, v, r = s[U], s[V], s[R]
    cos, sin = np.cos(s[PSI]), np.sin(s[PSI])
    left, right = _thrust(s[N1], p) * q[6], _thrust(s[N2], p) * q[7]
    # Cross-flow drag by strips along the hull (Fossen 2021, eq. 6.92).
    sway, yaw = 0.0, 0.0
    if p.crossflow > 0:
        width = p.length / STRIPS
        for j in range(STRIPS):
            x = (j + 0.5) * width - p.length / 2
            force = p.crossflow * abs(v + x * r) * (v + x * r) * width
            sway += force
            yaw += x * force
    # The wind as the moving hull feels it.
    ax, ay = q[4] - q[2], q[5] - q[3]
    wu, wv = cos * ax + sin * ay - u, -sin * ax + cos * ay - v
    ww = np.sqrt(wu * wu + wv * wv)
    # Coriolis of the rigid body and of the added mass, times the velocity.
    cu = -p.mass * (p.xg * r + v) * r - p.ay * v * r
    cv = p.mass * u * r + p.ax * u * r
    cr = p.mass * p.xg * r * u + (p.ay - p.ax) * u * v
    fu = left + right - cu - (p.xu + p.xuu * abs(u)) * u + p.windx * ww * wu
    fv = -cv - (p.yv + p.yvv * abs(v)) * v - sway + p.windy * ww * wv
    fr = p.lever * (right - left) - cr - (p.nr + p.nrr * abs(r)) * r - yaw
    determinant = p.m22 * p.m33 - p.m23 * p.m23
    out[X] = cos * u - sin * v + q[2]
    out[Y] = sin * u + cos * v + q[3]
    out[PSI] = r
    out[U] = fu / p.m11
    out[V] = (p.m33 * fv - p.m23 * fr) / determinant
    out[R] = (p.m22 * fr - p.m23 * fv) / determinant
    out[N1] = (q[0] - s[N1]) / p.lag
    out[N2] = (q[1] - s[N2]) / p.lag
