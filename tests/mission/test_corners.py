"""Corners that a vehicle can drive."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, MultiPolygon, Point, box

from quarterdeck.mission.corners import driven, with_turns

SEA = MultiPolygon([box(-1000, -1000, 1000, 1000)])


def curvature(points):
    """Return the tightest radius of a polyline, from the mean chord and the bend at each point."""
    step = np.diff(points, axis=0)
    size = np.hypot(*step.T)
    heading = np.arctan2(step[:, 1], step[:, 0])
    bend = np.abs((np.diff(heading) + math.pi) % math.tau - math.pi)
    return float((0.5 * (size[:-1] + size[1:]) / np.maximum(2 * np.sin(bend / 2), 1e-12)).min(initial=math.inf))


def test_wide_corners_stay():
    """Where arcs fit nothing is added, and the driven line keeps the radius and cuts the corner by what geometry says."""
    line = np.array([[0, 0], [100, 0], [100, 100], [0, 100.0]])
    path = with_turns(line, ["start", "survey", "survey", "survey"], 10.0, SEA)
    assert np.array_equal(path.points, line)
    assert not path.stops.any()
    track = driven(line, 10.0)
    assert curvature(track) > 9.9
    assert math.isclose(LineString(track).distance(Point(100, 0)), 10 * (math.sqrt(2) - 1), rel_tol=1e-2)


@settings(max_examples=60, deadline=None)
@given(st.floats(1, 60), st.floats(5, 40))
def test_narrow_u_turns_become_curves(gap, radius):
    """A U-turn narrower than the vehicle's becomes a curve of its radius that ends on the next line in its direction."""
    line = np.array([[0, 0], [300, 0], [300, gap], [0, gap]])
    path = with_turns(line, ["start", "survey", "survey", "survey"], radius, SEA)
    points, legs = path.points, path.legs
    assert not path.stops.any()
    assert len(points) == len(legs) == len(path.pace)
    assert curvature(points) > 0.9 * radius or "turn" not in legs
    assert curvature(driven(points, radius)) > 0.9 * radius or "turn" in legs
    assert np.allclose(points[0], line[0])
    ends = points[-2:]  # it ends on the next line, in its direction
    assert np.allclose(ends[1], line[-1])
    assert math.isclose(abs(math.atan2(*(ends[1] - ends[0])[::-1])), math.pi, abs_tol=1e-6)
    track = LineString(driven(points, radius))
    assert track.distance(Point(150, 0)) < 1e-6
    assert track.distance(Point(150, gap)) < 1e-6
    assert ("turn" in legs) == (2 * radius > gap + 1e-9)


def test_no_room_is_told():
    """In a channel too narrow to turn, the corner is returned as stuck and stays."""
    channel = MultiPolygon([box(-1, -1, 101, 10.5)])
    line = np.array([[0, 0], [100, 0], [100, 10], [0, 10.0]])
    path = with_turns(line, ["start", "survey", "survey", "survey"], 80.0, channel)
    assert path.stops.tolist() == [False, True, True, False]
    assert np.array_equal(path.points, line)
    assert path.legs == ["start", "survey", "survey", "survey"]
