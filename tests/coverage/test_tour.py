"""Tours: closed walks that visit every path cell of their region once."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from scipy.ndimage import label

from quarterdeck.coverage.bricks import straight_trees, tree_turns
from quarterdeck.coverage.tour import count_turns, tour, tours
from quarterdeck.geo.errors import InputError


@settings(deadline=None, max_examples=100)
@given(st.integers(0, 2**32 - 1), st.integers(1, 15), st.integers(1, 15))
def test_a_tour_visits_each_path_cell_once_by_unit_moves(seed: int, rows: int, cols: int) -> None:
    """On the component of a random cell in a random grid; its turns are those of its tree."""
    rng = np.random.default_rng(seed)
    free = rng.random((rows, cols)) > 0.25
    start = np.array([rng.integers(rows), rng.integers(cols)])
    free[tuple(start)] = True
    parts, _ = label(free)
    region = parts == parts[tuple(start)]
    path = tour(region, start)
    assert tuple(path[0] // 2) == tuple(start)
    steps = np.abs(np.diff(path, axis=0, append=path[:1])).sum(axis=1)
    assert (steps == 1).all()
    visited = np.zeros((2 * rows, 2 * cols), dtype=int)
    np.add.at(visited, (path[:, 0], path[:, 1]), 1)
    assert (visited == np.kron(region, np.ones((2, 2), dtype=int))).all()
    labels = np.where(region, 0, -1).astype(np.int32)
    assert count_turns(path) == tree_turns(*straight_trees(labels, 1), labels, 1)[0]


@pytest.mark.parametrize(("rows", "cols", "turns"), [(1, 1, 4), (1, 9, 4), (2, 9, 8), (8, 50, 32), (20, 20, 80)])
def test_rectangles_take_four_turns_a_lane(rows: int, cols: int, turns: int) -> None:
    """The fewest possible: one brick for each row or column of the shorter side."""
    assert count_turns(tour(np.ones((rows, cols), dtype=bool), np.array([0, 0]))) == turns


def test_the_fewest_bricks_beat_rows_and_columns() -> None:
    """An L of two bars, one lying and one standing: neither direction alone suits both."""
    region = np.zeros((20, 20), dtype=bool)
    region[18:, :] = True
    region[:, :2] = True
    assert count_turns(tour(region, np.array([0, 0]))) <= 20


def test_a_torn_region_is_refused() -> None:
    """Its tour could not be closed."""
    region = np.array([[True, False, True]])
    with pytest.raises(InputError, match="not 4-connected"):
        tour(region, np.array([0, 0]))
    with pytest.raises(InputError, match="is not in the region"):
        tours(np.array([[0, -1]]), np.array([[0, 1]]))
