"""Metrics against figures worked out by hand and shapely's union."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import MultiPolygon, box

from quarterdeck.coverage.metrics import count_turns, measure, straight_pieces, swath, track_length, uncovered
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


tracks = st.lists(st.tuples(st.integers(-20, 20), st.integers(-20, 20)), min_size=2, max_size=30)


@settings(deadline=None, max_examples=60)
@given(tracks, st.floats(0, 6.28), st.floats(0.5, 8))
def test_swath_is_the_union_of_what_each_piece_sweeps(points, angle, spacing):
    """Whatever the crossings and reversals, the swath is shapely's union on a precision grid, at any angle."""
    track = np.array(points, dtype=float)
    turned = track @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    capsules = shapely.buffer(shapely.linestrings(np.stack([turned[:-1], turned[1:]], axis=1)), spacing / 2, quad_segs=16)
    assert swath([turned], spacing).area == pytest.approx(shapely.union_all(capsules, grid_size=1e-7).area, rel=2e-3)
    assert swath([turned], spacing).area == pytest.approx(swath([track], spacing).area, rel=2e-3)
    assert count_turns(turned) == count_turns(track)
    assert np.linalg.norm(np.diff(straight_pieces(track), axis=1), axis=2).sum() == pytest.approx(track_length(track))
