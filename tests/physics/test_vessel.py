"""The vessel model against equations written independently, and against what physics demands."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.special import roots_legendre

from quarterdeck.geo.models import load_model
from quarterdeck.physics.vessel import (
    COLUMNS,
    N1,
    PSI,
    SUBSTEP,
    R,
    U,
    V,
    X,
    Y,
    coast_vessels,
    drive_vessels,
    vessel_parameters,
)

STILL = np.zeros(2)
MODELS = ["otter", "wam-v"]
speeds = st.floats(-2.0, 2.0)


def record(model):
    return np.array([vessel_parameters(load_model(model))])


def shaft(model, thrust):
    """Shaft speed for a thrust in newtons, by the bollard figures."""
    ahead, astern = load_model(model).dynamics["bollard"]
    return np.sign(thrust) * np.sqrt(abs(thrust) / (ahead if thrust > 0 else astern))


def coast(model, state, shafts, seconds, *, step=SUBSTEP, current=STILL, wind=STILL):
    state = np.array(state, float)[None, :].copy()
    coast_vessels(state, record(model), np.array([shafts], float), current, np.array([wind]), step, round(seconds / step))
    return state[0]


def started(model, speed):
    """A vessel under way at `speed` with its shafts at the balance of thrust and drag."""
    d = load_model(model).dynamics
    n = shaft(model, (d["linear"][0] * speed + d["quadratic"][0] * speed**2) / 2)
    state = np.zeros(COLUMNS)
    state[U], state[N1], state[N1 + 1] = speed, n, n
    return state, n


# The same vessel from Fossen 2021 in his own axes (y to starboard, yaw clockwise) and his matrix form, its parameters
# read from the model's file and not from the code under test.
def fossen(model):
    d = load_model(model).dynamics
    m, xg = d["mass"], d["xg"]
    rigid = np.array([[m, 0, 0], [0, m, m * xg], [0, m * xg, d["inertia"]]])
    added = np.diag(d["added_mass"])
    nodes, weights = roots_legendre(40)
    half = load_model(model).length / 2

    def force(n):
        k = d["bollard"][0] if n > 0 else d["bollard"][1]
        return float(np.clip(k * n * abs(n), d["thrust"][1], d["thrust"][0]))

    def coriolis(mass, nu):
        """Equation 3.46 for three degrees of freedom: C from the rows of M."""
        a, b = mass[0] @ nu, mass[1] @ nu
        return np.array([[0, 0, -b], [0, 0, a], [b, -a, 0]])

    def rates(_, y, port, starboard):
        psi, nu, n = y[2], y[3:6], y[6:8]
        sway = nu[1] + half * nodes * nu[2]
        drag = -d["crossflow"] * half * weights * np.abs(sway) * sway
        cross = np.array([0, drag.sum(), (half * nodes * drag).sum()])
        damping = -(np.array(d["linear"]) + np.array(d["quadratic"]) * np.abs(nu)) * nu
        f = force(n[0]), force(n[1])
        tau = np.array([sum(f), 0, d["lever"] * (f[0] - f[1])])
        total = tau + damping + cross - coriolis(rigid, nu) @ nu - coriolis(added, nu) @ nu
        turn = np.array([[np.cos(psi), -np.sin(psi), 0], [np.sin(psi), np.cos(psi), 0], [0, 0, 1]])
        return np.r_[
            turn @ nu, np.linalg.solve(rigid + added, total), (port - n[0]) / d["lag"], (starboard - n[1]) / d["lag"]
        ]

    return rates


def circle(x, y, psi):
    """Advance, transfer and tactical diameter of a turn, heading 0 and place 0 at its start (IMO MSC.137(76))."""
    quarter = np.interp(np.pi / 2, psi, np.arange(len(psi)))
    half = np.interp(np.pi, psi, np.arange(len(psi)))
    at = np.arange(len(psi))
    return np.array([np.interp(quarter, at, x), np.interp(quarter, at, y), np.interp(half, at, y)])


@pytest.mark.parametrize("model", MODELS)
def test_turning_circle_is_that_of_solve_ivp_on_fossens_equations(model):
    """Advance, transfer and tactical diameter within 2 % (they are within 0.1 %)."""
    cruise = load_model(model).speed
    state, n = started(model, cruise)
    outer, inner = shaft(model, load_model(model).dynamics["thrust"][0]), 0.2 * n
    path = [state]
    for _ in range(800):
        path.append(coast(model, path[-1], (inner, outer), SUBSTEP))
    ours = circle(*np.array(path)[:, [X, Y, PSI]].T)
    times = np.arange(801) * SUBSTEP
    start = np.r_[0, 0, 0, cruise, 0, 0, n, n]
    truth = solve_ivp(fossen(model), (0, 40), start, args=(inner, outer), t_eval=times, rtol=1e-8, atol=1e-10).y
    theirs = circle(truth[0], -truth[1], -truth[2])
    np.testing.assert_allclose(ours, theirs, rtol=0.02)
    assert np.all(theirs > 0)


@pytest.mark.parametrize("model", MODELS)
def test_zig_zag_is_that_of_solve_ivp_on_fossens_equations(model):
    """The 20/20 zig-zag: the first three reversals' times within 2 %, both overshoots within 2 % (and 0.1 degree)."""
    cruise = load_model(model).speed
    state, n = started(model, cruise)
    slow, fast = 0.6 * n, shaft(model, load_model(model).dynamics["thrust"][0])
    limit, step = np.radians(20), 0.01

    def ours():
        s, side, times, peaks, peak, t = state, 1, [], [], 0.0, 0.0
        while len(times) < 3:
            s = coast(model, s, (slow, fast) if side > 0 else (fast, slow), step, step=step)
            t += step
            peak = max(peak, -side * s[PSI])
            if side * s[PSI] >= limit:
                times.append(t)
                peaks.append(peak)
                side, peak = -side, 0.0
        return np.array(times), np.array(peaks[1:]) - limit

    def theirs():
        y, side, times, peaks, t = np.r_[0, 0, 0, cruise, 0, 0, n, n], 1, [], [], 0.0
        while len(times) < 3:

            def crossed(_, y, *__, side=side):
                return -side * y[2] - limit

            crossed.terminal, crossed.direction = True, 1
            shafts = (slow, fast) if side > 0 else (fast, slow)
            leg = solve_ivp(
                fossen(model), (t, t + 100), y, args=shafts, events=crossed, rtol=1e-8, atol=1e-10, max_step=0.05
            )
            t, y = leg.t[-1], leg.y[:, -1]
            times.append(t)
            peaks.append((side * leg.y[2]).max())
            side = -side
        return np.array(times), np.array(peaks[1:]) - limit

    (times, overshoots), (true_times, true_overshoots) = ours(), theirs()
    np.testing.assert_allclose(times, true_times, rtol=0.02)
    np.testing.assert_allclose(overshoots, true_overshoots, rtol=0.02, atol=np.radians(0.1))


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("part", [0.3, 0.7, 1.0])
def test_terminal_speed_is_where_thrust_and_drag_balance(model, part):
    """Within 0.1 %, by the positive root of the water's drag and that of the still air."""
    d = load_model(model).dynamics
    thrust = part * d["thrust"][0]
    n = shaft(model, thrust)
    a, b = d["quadratic"][0] + d["windage"][0], d["linear"][0]
    expected = (-b + np.sqrt(b * b + 8 * a * thrust)) / (2 * a)
    assert coast(model, np.zeros(COLUMNS), (n, n), 60.0)[U] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("model", MODELS)
def test_without_thrust_it_drifts_with_the_current(model):
    """From rest over ground, it ends up moving as the water does, the air moving with it."""
    state = np.zeros(COLUMNS)
    state[U] = -0.4  # at rest over ground in a current of 0.4 m/s along the hull
    before = coast(model, state, (0, 0), 60.0, current=np.array([0.4, 0.0]), wind=(0.4, 0.0))
    after = coast(model, before, (0, 0), 1.0, current=np.array([0.4, 0.0]), wind=(0.4, 0.0))
    assert after[X] - before[X] == pytest.approx(0.4, abs=1e-6)
    assert np.hypot(after[U], after[V]) < 1e-6


@pytest.mark.parametrize("model", MODELS)
@settings(deadline=None, max_examples=40)
@given(u=speeds, v=speeds, r=st.floats(-1.0, 1.0))
def test_energy_never_appears_from_nowhere(model, u, v, r):
    """Without thrust the kinetic energy, added mass and all, falls with every step from any motion."""
    p = record(model)[0]
    mass = np.array([[p["m11"], 0, 0], [0, p["m22"], p["m23"]], [0, p["m23"], p["m33"]]])
    state = np.zeros(COLUMNS)
    state[[U, V, R]] = u, v, r
    energy = [0.5 * state[3:6] @ mass @ state[3:6]]
    for _ in range(20):
        state = coast(model, state, (0, 0), 0.05)
        energy.append(0.5 * state[3:6] @ mass @ state[3:6])
    assert np.all(np.diff(energy) <= 1e-12)


def test_halving_the_step_converges_at_fourth_order():
    """Richardson: each halving divides the error of a smooth turn by about sixteen."""
    state, n = started("wam-v", 1.0)  # the Otter's strips have a kink where sway changes its sign
    state[V], state[R] = 0.3, 0.2
    ends = [coast("wam-v", state, (1.2 * n, 1.4 * n), 3.2, step=step)[:6] for step in (0.2, 0.1, 0.05, 0.025)]
    errors = [np.abs(a - b).max() for a, b in pairwise(ends)]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(np.abs(orders - 4) < 0.5), orders


@pytest.mark.parametrize("model", MODELS)
def test_stopping_distance_by_drag_alone_is_the_closed_form(model):
    """Shafts stopped at cruise speed: the way run to a tenth of it, from m u du = -(a u + b u^2) dx."""
    d, cruise = load_model(model).dynamics, load_model(model).speed
    state = np.zeros(COLUMNS)
    state[U] = cruise
    while state[U] > cruise / 10:
        state = coast(model, state, (0, 0), 0.01, step=0.01)
    m, a, b = d["mass"] + d["added_mass"][0], d["linear"][0], d["quadratic"][0] + d["windage"][0]
    expected = m / b * np.log((a + b * cruise) / (a + b * cruise / 10))
    assert state[X] == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("model", MODELS)
def test_planner_limits_are_what_the_vessel_can_do(model):
    """Cruise within the turn radius, the top speed, the acceleration: with the autopilot, in calm water."""
    kind, p = load_model(model), record(model)
    state, _ = started(model, kind.speed)
    state, on, one = state[None, :], np.ones(1, bool), np.ones((1, 2))

    def drive(heading, speed, seconds):
        drive_vessels(state, p, on, np.array([heading]), np.array([speed]), STILL, np.zeros((1, 3)), one, seconds)

    for _ in range(300):
        drive(state[0, PSI] + 1.5, kind.speed, 0.1)  # always further round: the greatest rate of turn
    assert np.hypot(state[0, U], state[0, V]) / state[0, R] <= kind.turn_radius * 1.02
    state[:] = 0.0
    drive(0.0, kind.speed, kind.speed / kind.acceleration)
    assert state[0, U] >= 0.8 * kind.speed
    drive(0.0, kind.max_speed, 30.0)
    assert state[0, U] == pytest.approx(kind.max_speed, rel=0.01)


def test_wind_pushes_a_drifting_hull_downwind():
    """Broadside to a wind of 10 m/s, towards the north: it drifts north, slower than the wind."""
    state = coast("otter", np.zeros(COLUMNS), (0, 0), 60.0, wind=np.array([0.0, 10.0]))
    assert 1.0 < state[Y] < 100.0


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("pace", [0.5, 0.75, 1.0])
def test_power_at_a_slower_speed_is_what_planners_reckon(model, pace):
    """Watts drawn at a steady speed below cruise are the model file's power law, within five per cent."""
    kind, (p,) = load_model(model), record(model)
    speed = pace * kind.speed
    thrust = (kind.dynamics["linear"][0] * speed + kind.dynamics["quadratic"][0] * speed**2) / 2
    assert p["idle"] + p["watts"] * 2 * thrust**1.5 == pytest.approx(kind.power(speed), rel=0.05)
