"""Divisions: connected, disjoint, around their starts, proportional, and always ending."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from scipy.ndimage import label

from quarterdeck.coverage.division import Division, distinct_entries, divide
from quarterdeck.geo.errors import InputError


@st.composite
def instances(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw a grid with obstacles, distinct starts on it and shares."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    shape = draw(st.tuples(st.integers(1, 24), st.integers(1, 24)))
    free = rng.random(shape) >= draw(st.sampled_from([0.0, 0.1, 0.3]))
    free.flat[0] = True
    cells = np.argwhere(free)
    k = draw(st.integers(1, min(12, len(cells))))
    weights = rng.random(k) + 0.1 if draw(st.booleans()) else np.ones(k)
    return free, cells[rng.choice(len(cells), k, replace=False)], weights / weights.sum()


@settings(deadline=None, max_examples=60)
@given(instances())
def test_regions_are_connected_hold_their_starts_and_cover_what_is_reachable(instance: tuple) -> None:
    """Whatever the grid, starts and shares."""
    free, starts, shares = instance
    check(free, starts, divide(free, starts, shares))


def check(free: np.ndarray, starts: np.ndarray, division: Division) -> None:
    """Hold a division to what every one promises."""
    parts, _ = label(free)
    reachable = np.isin(parts, parts[starts[:, 0], starts[:, 1]]) & free
    assert ((division.labels >= 0) == reachable).all()
    for vehicle, (row, col) in enumerate(starts):
        region = division.labels == vehicle
        assert region[row, col]
        assert label(region)[1] == 1
        assert region.sum() == division.sizes[vehicle]
    assert division.targets.sum() == reachable.sum()
    assert division.ratio >= 1.0


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_open_ground_gives_any_share_to_within_a_cell(seed: int) -> None:
    """On a 30 x 30 area without obstacles, starts apart from each other."""
    rng = np.random.default_rng(seed)
    starts = np.argwhere(np.ones((10, 10)))[rng.choice(100, 6, replace=False)] * 3 + 1
    shares = rng.dirichlet(np.full(6, 4.0))
    division = divide(np.ones((30, 30), dtype=bool), starts, shares)
    assert (np.abs(division.sizes - shares * 900) <= 1 + 1e-9).all(), division.reasons


def test_sealed_starts_get_the_nearest_possible_and_the_reason() -> None:
    """Ten vehicles side by side in a corner: four have no free neighbour, the six others share the rest."""
    starts = np.argwhere(np.ones((5, 2)))
    division = divide(np.ones((40, 50), dtype=bool), starts)
    assert division.sizes.max() == division.bound.max() == 333
    assert len(division.reasons) == 10
    assert "allow 1 at the fairest" in division.reasons[0]


def test_cells_that_no_start_reaches_are_nobodys_and_told() -> None:
    """A wall parts the grid and both vehicles stand on the left."""
    free = np.ones((6, 9), dtype=bool)
    free[:, 5] = False
    division = divide(free, np.array([[0, 0], [5, 4]]))
    assert (division.labels[:, 6:] == -1).all()
    assert division.reasons == ("18 of 48 cells are nobody's: no vehicle's start leads there",)


def test_the_same_seed_gives_the_same_labels() -> None:
    """Byte for byte."""
    free = np.random.default_rng(1).random((40, 40)) > 0.1
    starts = distinct_entries(free, np.random.default_rng(2).random((9, 2)) * 40)
    assert divide(free, starts, seed=3).labels.tobytes() == divide(free, starts, seed=3).labels.tobytes()


@pytest.mark.parametrize(
    ("starts", "shares", "message"),
    [
        ([[0, 0], [0, 0]], None, "share a start cell"),
        ([[0, 0], [9, 9]], None, "not a free cell"),
        ([[0, 0], [1, 1]], [0.5, 0.6], "sum to 1.1"),
        ([[0, 0], [1, 1]], [1.5, -0.5], "positive shares"),
    ],
)
def test_wrong_input_is_refused_in_one_line(starts: list, shares: list | None, message: str) -> None:
    """Each error names what is wrong."""
    with pytest.raises(InputError, match=message):
        divide(np.ones((4, 4), dtype=bool), np.array(starts), None if shares is None else np.array(shares))


def test_entries_stay_where_vehicles_stand_alone() -> None:
    """Only vehicles that share a cell or stand outside are given another."""
    free = np.ones((10, 10), dtype=bool)
    entries = distinct_entries(free, np.array([[2.5, 2.5], [7.2, 7.9], [-3.0, 4.5], [11.0, 4.5]]))
    assert entries.tolist() == [[2, 2], [7, 7], [0, 4], [9, 4]]


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_entries_are_distinct_and_free(seed: int, k: int) -> None:
    """Also when all vehicles stand on one point."""
    rng = np.random.default_rng(seed)
    free = rng.random((9, 9)) > 0.4
    rc = np.tile(rng.random(2) * 13 - 2, (k, 1))
    entries = distinct_entries(free, rc)
    assert free[entries[:, 0], entries[:, 1]].all()
    assert len(np.unique(entries, axis=0)) == k
