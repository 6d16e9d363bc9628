"""The ground model against closed forms."""

import numpy as np
import pytest

from quarterdeck.geo.models import load_model
from quarterdeck.physics.rover import COLUMNS, LEFT, PSI, RIGHT, X, Y, drive_rovers, rover_parameters, yaw_rate

MODELS = ["husky", "jackal"]


def drive(state, p, speed, turn, seconds):
    drive_rovers(state, p, np.ones(1, bool), np.array([speed]), np.array([turn]), np.ones((1, 2)), seconds)


@pytest.mark.parametrize("model", MODELS)
def test_closed_loop_yaw_reaches_what_is_asked_for(model):
    """On the spot and under way within 1 %, though the wheels slip otherwise than the controller thinks."""
    kind = load_model(model)
    p = np.array([rover_parameters(kind)])
    assert kind.dynamics["slip"] != kind.dynamics["multiplier"]
    for speed in (0.0, 0.5 * kind.speed):
        state = np.zeros((1, COLUMNS))
        drive(state, p, speed, 0.8 * kind.turn_rate, 10.0)
        assert yaw_rate(state[0], p[0]) == pytest.approx(0.8 * kind.turn_rate, rel=0.01)
        assert (state[0, LEFT] + state[0, RIGHT]) / 2 == pytest.approx(speed, abs=0.01)


@pytest.mark.parametrize("model", MODELS)
def test_circle_has_the_radius_of_speed_over_rate(model):
    """Once steady, the track curves at v / w."""
    kind = load_model(model)
    p, state = np.array([rover_parameters(kind)]), np.zeros((1, COLUMNS))
    drive(state, p, 0.6, 0.5, 20.0)
    points = []
    for _ in range(30):
        drive(state, p, 0.6, 0.5, 0.1)
        points.append(state[0, [X, Y]].copy())
    a, b, c = points[0], points[14], points[29]
    sides = [np.linalg.norm(a - b), np.linalg.norm(b - c), np.linalg.norm(c - a)]
    area = abs((b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]) / 2
    assert np.prod(sides) / (4 * area) == pytest.approx(0.6 / 0.5, rel=0.01)


@pytest.mark.parametrize("model", MODELS)
def test_stopping_distance_is_that_of_the_wheels_limit_and_lag(model):
    """From cruise at the wheels' deceleration until their lag takes over: v0^2 / 2a and what the lag adds, within 1 %."""
    kind = load_model(model)
    a, lag, v = kind.dynamics["wheel_acceleration"], kind.dynamics["lag"], kind.speed
    p, state = np.array([rover_parameters(kind)]), np.zeros((1, COLUMNS))
    state[0, [LEFT, RIGHT]] = v
    drive(state, p, 0.0, 0.0, 20.0)
    knee = a * lag  # below this speed the lag decelerates less than the limit
    assert state[0, X] == pytest.approx((v**2 - knee**2) / (2 * a) + knee * lag, rel=0.01)
    assert abs(state[0, PSI]) < 1e-9
