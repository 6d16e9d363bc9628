"""Braking in time: ways to rest stay apart, whoever goes on."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from shapely import LineString

from quarterdeck.physics.braking import TOUCH, _apart, brake_in_time

NOBODY = np.zeros(2, bool)
NOWHERE = np.zeros((2, 3))


def _look(position, velocity, facing, *, passing=NOBODY, astern=NOWHERE):
    """Return the speeds allowed to two vehicles of 1 m/s, half a metre of half diagonal, 1 m/s2 of brakes."""
    brakes = np.array([(1.0, 0.3, 5.0)] * 2)
    slow = np.full(2, np.inf)
    brake_in_time(
        np.array(position, float), np.array(velocity, float), np.zeros(2), np.array(facing, float), np.ones(2),
        np.full(2, 0.5), brakes, np.ones(2, bool), np.arange(2), passing, astern, slow,
    )  # fmt: skip
    return slow


@pytest.mark.parametrize("axis", range(3))
def test_two_that_meet_stop_before_they_touch(axis):
    """Whichever way they come, up and down too: driven to rest by what is allowed them, they stay TOUCH apart."""
    along = np.eye(3)[axis]
    place, speed = np.array([-5.0, 5.0]), np.array([1.0, -1.0])
    least = np.inf
    for _ in range(100):
        slow = _look(place[:, None] * along, speed[:, None] * along, np.array([[1.0], [-1.0]]) * along)
        wanted = np.minimum(slow, 1.0) * [1.0, -1.0]
        for _ in range(2):  # a look is 0.2 s
            speed += np.clip(wanted - speed, -0.1, 0.1)
            place = place + 0.1 * speed
        least = min(least, place[1] - place[0])
    assert least > TOUCH
    assert np.abs(speed).max() < 0.1


def test_one_that_stands_too_near_only_gets_away():
    """From inside the distance kept one may set out away from the other, not past it."""
    position, still = [(0.0, 0.0, 0.0), (0.9, 0.0, 0.0)], np.zeros((2, 3))
    nowhere = (0.0, 0.0, 0.0)
    assert _look(position, still, [(-1.0, 0.0, 0.0), nowhere])[0] == np.inf
    assert _look(position, still, [(0.3, 0.95, 0.0), nowhere])[0] == 0.0
    assert _look(position, still, [(1.0, 0.0, 0.0), nowhere])[0] == 0.0


def test_one_that_backs_off_goes_astern():
    """Who faces another too near to go around goes astern, if told that there is room."""
    position, still = [(0.0, 0.0, 0.0), (0.9, 0.0, 0.0)], np.zeros((2, 3))
    facing = [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)]
    one, away = np.array([True, False]), np.array([(-1.0, 0.0, 0.0), (0.0, 0.0, 0.0)])
    assert _look(position, still, facing, passing=one, astern=away)[0] < 0.0
    assert _look(position, still, facing, passing=one, astern=-away)[0] == 0.0  # towards the other


coordinate = st.floats(-10.0, 10.0).map(lambda v: round(v, 3))
place = st.tuples(coordinate, coordinate)


@given(place, place, place, place)
@settings(deadline=None, max_examples=60)
def test_distance_of_pieces_is_that_of_shapely(a, b, c, d):
    """In the plane the distance of two pieces is GEOS's."""
    ours = _apart(*(np.array([*p, 0.0]) for p in (a, b, c, d)))
    assert_allclose(ours, LineString([a, b]).distance(LineString([c, d])), atol=1e-6)
