"""The bound never exceeds the exact optimum, and on tiny grids the division reaches it."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from scipy.ndimage import label

from quarterdeck.coverage.bound import fair_targets, pocket_bound
from quarterdeck.coverage.chambers import chamber_bound
from quarterdeck.coverage.division import divide


def least_largest(free: np.ndarray, starts: np.ndarray, shares: np.ndarray) -> float:
    """Return the least possible largest load, cells over share, by trying every division: ten cells, three starts."""
    cells = [tuple(c) for c in np.argwhere(free)]
    number = {cell: i for i, cell in enumerate(cells)}
    beside = [0] * len(cells)
    for (row, col), i in number.items():
        for near in ((row, col + 1), (row + 1, col), (row, col - 1), (row - 1, col)):
            if near in number:
                beside[i] |= 1 << number[near]
    home = [number[tuple(s)] for s in starts]

    def whole(mask: int, start: int) -> bool:
        seen = 1 << start
        if not mask & seen:
            return False
        edge = seen
        while edge:
            grown = 0
            for i in range(len(cells)):
                if edge >> i & 1:
                    grown |= beside[i]
            edge = grown & mask & ~seen
            seen |= edge
        return seen == mask

    everything = (1 << len(cells)) - 1
    connected = [[m for m in range(1, everything + 1) if whole(m, h)] for h in home]
    if len(home) == 1:
        return len(cells) / shares[0]
    last = set(connected[-1])
    best = np.inf
    middle = connected[1] if len(home) == 3 else [0]
    for a in connected[0]:
        for b in middle:
            if a & b == 0 and (rest := everything & ~a & ~b) in last:
                masks = [a, b, rest] if len(home) == 3 else [a, rest]
                best = min(best, max(m.bit_count() / s for m, s in zip(masks, shares, strict=True)))
    return float(best)


@st.composite
def tiny(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw a connected grid of at most ten cells with two or three starts."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    shape = draw(st.sampled_from([(3, 4), (2, 6), (1, 9), (4, 3), (3, 5)]))
    free = rng.random(shape) > 0.25
    free[shape[0] // 2, 1] = True
    parts, _ = label(free)
    free = parts == parts[shape[0] // 2, 1]
    cells = np.argwhere(free)
    for row, col in cells[10:]:
        free[row, col] = False
    parts, _ = label(free)
    free = parts == np.bincount(parts[parts > 0]).argmax()
    cells = np.argwhere(free)
    k = min(draw(st.integers(2, 3)), len(cells))
    shares = rng.dirichlet(np.full(k, 5.0)) if draw(st.booleans()) else np.full(k, 1.0 / k)
    return free, cells[rng.choice(len(cells), k, replace=False)], shares


@settings(deadline=None, max_examples=150)
@given(tiny())
def test_no_division_beats_the_bounds(instance: tuple) -> None:
    """Both bounds against the exact optimum."""
    free, starts, shares = instance
    optimum = least_largest(free, starts, shares)
    _, loads = fair_targets(free, starts, shares)
    assert pocket_bound(free, starts, loads, shares).load <= optimum + 1e-6
    assert chamber_bound(free, starts, shares).load <= optimum + 1e-6


@settings(deadline=None, max_examples=30)
@given(tiny())
def test_equal_shares_on_tiny_grids_reach_the_optimum(instance: tuple) -> None:
    """The largest region is the smallest possible."""
    free, starts, _ = instance
    k = len(starts)
    division = divide(free, starts)
    assert division.sizes.max() == round(least_largest(free, starts, np.full(k, 1.0 / k)) / k)


def test_a_room_behind_a_neck_is_bounded_by_its_entries() -> None:
    """Two rooms with a neck two wide and all vehicles in one: two at most can work in the other."""
    free = np.ones((40, 50), dtype=bool)
    free[:19, 20:30] = free[21:, 20:30] = False
    starts = np.array([[5, 2], [15, 2], [25, 2], [35, 2]])
    bound = chamber_bound(free, starts, np.full(4, 0.25))
    assert bound.load / 4 >= 432
    assert "2 entry cells, with 0 of 4 starts inside" in bound.proof
    division = divide(free, starts)
    assert division.ratio <= 1.02
    assert len(division.reasons) == 4


@pytest.mark.parametrize("name", ["comb", "spiral", "corridor", "corner block"])
def test_adversarial_ground_ends_with_connected_regions(name: str) -> None:
    """Corridors one wide, where most exchanges are impossible, and starts that shut each other in."""
    free = np.ones((21, 21), dtype=bool)
    starts = np.array([[0, 0], [0, 2], [0, 10], [0, 20]])
    if name == "comb":
        free[1:, 1::2] = False
    elif name == "spiral":
        for ring in range(1, 10, 2):
            free[ring, ring - 1 : 21 - ring] = free[20 - ring, ring : 21 - ring] = False
            free[ring : 21 - ring, 20 - ring] = free[ring + 2 : 21 - ring, ring] = False
    elif name == "corridor":
        free[1:] = False
    else:
        starts = np.argwhere(np.ones((4, 3)))
    division = divide(free, starts)
    for vehicle, start in enumerate(starts):
        region = division.labels == vehicle
        assert region[tuple(start)]
        assert label(region)[1] == 1
    assert division.sizes.sum() == (label(free)[0] == label(free)[0][0, 0]).sum()


def test_a_corridor_gives_its_ends_to_the_outer_starts() -> None:
    """One wide, two starts: each has what lies on its side at least, and they meet in the middle where they can."""
    free = np.ones((1, 20), dtype=bool)
    assert divide(free, np.array([[0, 2], [0, 6]])).sizes.tolist() == [6, 14]
    assert divide(free, np.array([[0, 2], [0, 16]])).sizes.tolist() == [10, 10]
