"""Dubins curves: they arrive, they keep the radius, they are the shortest of their kind."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from quarterdeck.geo.dubins import dubins_paths

pose = st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(-math.pi, math.pi)).map(
    lambda p: tuple(round(v, 6) for v in p)
)


def length(points):
    """Return metres along a polyline."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


@settings(max_examples=300, deadline=None)
@given(pose, pose, st.floats(0.5, 8))
def test_every_word_arrives(start, goal, radius):
    """Every word's path ends at the goal, without a jump, in its heading, and never turns tighter than the radius."""
    for path in dubins_paths(start, goal, radius):
        step = np.diff(path, axis=0)
        size = np.hypot(*step.T)
        step, size = step[size > 1e-6], size[size > 1e-6]
        if not len(step):
            continue
        heading = np.arctan2(step[:, 1], step[:, 0])
        bend = np.abs((np.diff(heading) + math.pi) % math.tau - math.pi)
        assert abs((heading[-1] - goal[2] + math.pi) % math.tau - math.pi) < 0.1
        assert abs((heading[0] - start[2] + math.pi) % math.tau - math.pi) < 0.1
        assert (bend < math.radians(10.1)).all()
        assert np.hypot(*(path[-1] - goal[:2])) < 1e-9


def test_known_lengths():
    """Straight ahead is a line; a U-turn to the side two radii away is half a circle."""
    assert math.isclose(length(dubins_paths((0, 0, 0), (10, 0, 0), 2.0)[0]), 10.0)
    assert math.isclose(length(dubins_paths((0, 0, 0), (0, 4, math.pi), 2.0)[0]), 2 * math.pi, rel_tol=2e-3)


@settings(max_examples=100, deadline=None)
@given(pose, pose, st.floats(0.5, 8))
def test_reversal_symmetry(start, goal, radius):
    """The way back, turned round, is as long: an independent check of all words at once."""
    there = length(dubins_paths(start, goal, radius)[0])
    back = length(dubins_paths((*goal[:2], goal[2] + math.pi), (*start[:2], start[2] + math.pi), radius)[0])
    assert math.isclose(there, back, rel_tol=1e-2, abs_tol=1e-2 * radius)


@settings(max_examples=100, deadline=None)
@given(pose, st.floats(1, 20), st.sampled_from([0.0, math.pi / 2]), st.floats(0.5, 8))
def test_no_point_is_repeated(start, distance, turn, radius):
    """Straight on, and after a quarter turn, words have segments of no length: they leave no point twice."""
    x, y, heading = start
    goal = (x + distance * math.cos(heading), y + distance * math.sin(heading), heading + turn)
    for path in dubins_paths(start, goal, radius):
        assert (np.hypot(*np.diff(path, axis=0).T) > 0).all()
