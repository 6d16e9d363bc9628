"""Metrics against figures worked out by hand and shapely's union."""

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely import MultiPolygon, box

from quarterdeck.coverage.metrics import count_turns, measure, straight_pieces, swath, track_length, uncovered
from quarterdeck.coverage.tour import tour
from quarterdeck.geo.grid import lay_grid

AREA = MultiPolygon([box(0, 0, 40, 20)])
LOOP = np.array([(5, 5), (15, 5), (25, 5), (35, 5), (35, 15), (25, 15), (15, 15), (5, 15), (5, 5)], dtype=float)


def test_figures_of_a_loop_by_hand():
    """One loop around two hypervertices: all but what the round swath misses in four corners."""
    figures = measure([LOOP], AREA, lay_grid(AREA, 10.0, 0.0, (0.0, 0.0)))
    corners = 4 * (25.0 - np.pi * 25.0 / 4)
    assert figures.poc == pytest.approx(1 - corners / 800.0, abs=3e-4)
    assert figures.cell_poc == pytest.approx(1.0)
    assert figures.turns == 4
    assert figures.length == pytest.approx(80.0)
    assert figures.turns_per_1000_m2 == pytest.approx(5.0)
    assert figures.length_per_1000_m2 == pytest.approx(100.0)
    assert figures.overlap == pytest.approx(800.0 / (800.0 - corners) - 1, abs=3e-4)


def test_turns():
    """A reversal is one turn, a repeated point none, and a closed track may turn where it begins."""
    assert count_turns(np.array([(0, 0), (5, 0), (0, 0)])) == 2
    assert count_turns(np.array([(0, 0), (5, 0), (5, 0), (9, 0)])) == 0
    assert count_turns(np.array([(0, 0), (5, 0), (5, 5)])) == 1
    assert count_turns(np.array([(2, 0), (5, 0), (5, 5), (0, 5), (0, 0), (2, 0)])) == 4
    assert count_turns(np.zeros((0, 2))) == 0
    assert count_turns(np.zeros((1, 2))) == 0


def test_nothing_and_a_point():
    """No track covers nothing, a single point a disc."""
    assert uncovered([], AREA, 10.0).area == pytest.approx(800.0)
    assert swath([np.array([(20.0, 10.0)])], 10.0).area == pytest.approx(np.pi * 25, rel=2e-3)


def agrees(tracks, spacing, rng):
    """Whether random points are in the swath just when they are within half the spacing of a track, 1 % of doubt apart."""
    shape, lines = swath(tracks, spacing), shapely.multilinestrings([t for t in tracks if len(t) > 1])
    points = rng.uniform(*np.array(lines.buffer(spacing).bounds).reshape(2, 2), (3000, 2))
    distance = shapely.distance(shapely.points(points), lines)
    sure = np.abs(distance - spacing / 2) > 0.01 * spacing
    return (shapely.contains_xy(shape, *points.T) == (distance < spacing / 2))[sure].all()


tracks = st.lists(st.tuples(st.integers(-20, 20), st.integers(-20, 20)), min_size=2, max_size=30)


@settings(deadline=None, max_examples=60)
@given(tracks, st.floats(0, 6.28), st.floats(0.5, 8))
def test_swath_is_what_is_near(points, angle, spacing):
    """Whatever the crossings and reversals, the swath is what is within half the spacing, at any angle."""
    track = np.array(points, dtype=float)
    assume((track != track[0]).any())
    turned = track @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    assert agrees([turned], spacing, np.random.default_rng(0))
    assert swath([turned], spacing).area == pytest.approx(swath([track], spacing).area, rel=2e-3)
    assert count_turns(turned) == count_turns(track)
    assert np.linalg.norm(np.diff(straight_pieces(track), axis=1), axis=2).sum() == pytest.approx(track_length(track))


@pytest.mark.parametrize(("seed", "shape"), [(328, (5, 10)), (355, (6, 4))])
def test_swath_of_a_lattice_tour_is_whole(seed, shape):
    """Tracks whose swaths touch along their whole length lose nothing in the union: without a precision grid these do."""
    rng = np.random.default_rng(seed)
    rng.integers(3, 11, 2)
    walk = tour(np.ones(shape, dtype=bool), np.array([0, 0]))
    angle = rng.uniform(0, 1.57)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    track = np.vstack([walk, walk[:1]])[:, ::-1] * 40.0 @ turn + rng.uniform(-1000, 1000, 2)
    assert agrees([track], 40.0, rng)
