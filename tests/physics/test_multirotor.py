"""The multirotor model against what physics demands."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from quarterdeck.geo.models import load_model
from quarterdeck.physics.multirotor import (
    COLUMNS,
    GRAVITY,
    F,
    Q,
    V,
    W,
    coast_multirotors,
    drive_multirotors,
    multirotor_parameters,
)

MODELS = ["survey-quad", "crazyflie"]


def fresh(model, z=50.0):
    p = np.array([multirotor_parameters(load_model(model))])
    state = np.zeros((1, COLUMNS))
    state[0, 2], state[0, Q] = z, 1.0
    return state, p


def fly(state, p, reference, seconds, wind=(0.0, 0.0, 0.0)):
    for _ in range(round(seconds / 0.1)):
        drive_multirotors(state, p, np.ones(1, bool), np.array([reference], float), np.array([wind]), np.ones((1, 4)), 0.1)


@pytest.mark.parametrize("model", MODELS)
def test_hover_thrust_is_weight(model):
    """Left to settle, all four rotors together carry the weight, each a quarter of it."""
    state, p = fresh(model)
    fly(state, p, (0, 0, 50, 0, 0, 0, 0), 60.0)
    np.testing.assert_allclose(state[0, F : F + 4], load_model(model).dynamics["mass"] * GRAVITY / 4, rtol=1e-3)
    np.testing.assert_allclose(state[0, :3], (0, 0, 50), atol=1e-3)


@pytest.mark.parametrize("model", MODELS)
def test_terminal_speed_of_the_fall_is_where_drag_is_weight(model):
    """Rotors stopped, level: the speed at which linear and quadratic drag carry the weight."""
    state, p = fresh(model, 1e5)
    coast_multirotors(state, p, np.zeros((1, 4)), np.zeros((1, 3)), 0.01, 20_000)
    a, b = load_model(model).dynamics["drag"]
    weight = load_model(model).dynamics["mass"] * GRAVITY
    expected = weight / a if b == 0 else (-a + np.sqrt(a * a + 4 * b * weight)) / (2 * b)
    assert -state[0, V + 2] == pytest.approx(expected, rel=1e-3)


def test_free_rotation_keeps_angular_momentum_and_energy():
    """Rotors stopped, tumbling: the momentum in the world's axes and the energy of rotation stay to a millionth."""
    state, p = fresh("survey-quad")
    state[0, W : W + 3] = 3.0, -2.0, 4.0
    inertia = np.array(load_model("survey-quad").dynamics["inertia"])

    def momentum():
        q = state[0, Q : Q + 4] / np.linalg.norm(state[0, Q : Q + 4])
        return Rotation.from_quat(q[[1, 2, 3, 0]]).apply(inertia * state[0, W : W + 3])

    before, energy = momentum(), inertia @ state[0, W : W + 3] ** 2
    coast_multirotors(state, p, np.zeros((1, 4)), np.zeros((1, 3)), 0.01, 500)
    np.testing.assert_allclose(momentum(), before, rtol=1e-5)
    assert inertia @ state[0, W : W + 3] ** 2 == pytest.approx(energy, rel=1e-6)


def test_flight_is_that_of_solve_ivp_on_independent_equations():
    """Uneven rotors and wind, rotation by scipy's Rotation: position, velocity and attitude after a second within 1e-4."""
    state, p = fresh("survey-quad")
    d = load_model("survey-quad").dynamics
    rotors, wind = np.array([3.70, 3.69, 3.71, 3.68]), np.array([2.0, -1.0, 0.5])
    state[0, F : F + 4] = 3.6
    ax, ay = d["arms"]
    places = np.array([(ax, -ay, 0), (-ax, ay, 0), (ax, ay, 0), (-ax, -ay, 0)])
    spin = np.array([-1, -1, 1, 1]) * d["torque"]  # reaction on the body: rotors 1 and 2 turn counter-clockwise

    def rates(_, y):
        v, attitude, w, f = y[3:6], y[6:10], y[10:13], y[13:]
        air, j = v - wind, np.array(d["inertia"])
        drag = -(d["drag"][0] + d["drag"][1] * np.linalg.norm(air)) * air
        force = Rotation.from_quat(attitude).apply([0, 0, f.sum()]) + drag
        torque = np.cross(places, np.c_[np.zeros((4, 2)), f]).sum(axis=0)
        torque[2] += spin @ f
        turning = 0.5 * np.r_[attitude[3] * w + np.cross(attitude[:3], w), -attitude[:3] @ w]  # scalar last, as in scipy
        return np.r_[
            v, force / d["mass"] - [0, 0, GRAVITY], turning, (torque - np.cross(w, j * w)) / j, (rotors - f) / d["lag"]
        ]

    start = np.r_[0, 0, 50, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, [3.6] * 4]
    truth = solve_ivp(rates, (0, 1), start, rtol=1e-9, atol=1e-11).y[:, -1]
    coast_multirotors(state, p, rotors[None, :], wind[None, :], 0.01, 100)
    np.testing.assert_allclose(state[0, :6], truth[:6], atol=1e-4)
    np.testing.assert_allclose(np.abs(state[0, Q : Q + 4]), np.abs(truth[[9, 6, 7, 8]]), atol=1e-4)


def test_halving_the_step_converges_at_fourth_order():
    """Richardson on a tumble under thrust."""
    ends = []
    for step in (0.02, 0.01, 0.005, 0.0025):
        state, p = fresh("survey-quad")
        state[0, W : W + 3] = 1.0, 0.5, -0.5
        coast_multirotors(state, p, np.array([[4.0, 3.9, 4.1, 4.0]]), np.zeros((1, 3)), step, round(0.8 / step))
        ends.append(state[0, :13].copy())
    errors = [np.abs(a - b).max() for a, b in pairwise(ends)]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(np.abs(orders - 4) < 0.5), orders


@pytest.mark.parametrize("model", MODELS)
def test_planner_limits_are_what_the_craft_can_do(model):
    """It climbs at its climb rate and keeps its top speed level, the reference moving on."""
    kind = load_model(model)
    state, p = fresh(model)
    z, x = 50.0, 0.0
    for _ in range(100):
        z += kind.climb_rate * 0.1
        fly(state, p, (0, 0, z, 0, 0, kind.climb_rate, 0), 0.1)
    assert state[0, V + 2] == pytest.approx(kind.climb_rate, rel=0.02)
    for _ in range(300):
        x += kind.max_speed * 0.1
        fly(state, p, (x, 0, z, kind.max_speed, 0, 0, 0), 0.1)
    assert state[0, V] == pytest.approx(kind.max_speed, rel=0.02)
    assert abs(state[0, 2] - z) < 0.5


def test_stands_on_the_ground_without_using_energy():
    """Told to be at height 0 it stays there, motors off."""
    state, p = fresh("survey-quad", 0.0)
    fly(state, p, (0, 0, 0, 0, 0, 0, 0), 5.0, wind=(5.0, 0, 0))
    assert state[0, 2] == 0.0
    assert state[0, -1] == 0.0
