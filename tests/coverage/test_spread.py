"""Strips of uneven heights: they tile, none is wider than it may be, and there are as few as there can be."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from quarterdeck.coverage.spread import strips


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.floats(20.0, 500.0))
def test_strips_tile_and_none_is_wider_than_its_least_width(seed, high):
    """From the low end to the high one without a gap; the least width of the samples in a strip is its height or more."""
    rng = np.random.default_rng(seed)
    across = np.append(rng.uniform(0.0, high, 3000), [0.0, high])
    widths = rng.uniform(3.0, 8.0) + rng.uniform(0.0, 20.0) * (1 + np.sin(across / rng.uniform(10.0, 200.0)))
    lows, heights = strips(across, widths, 0.0, high)
    assert lows[0] == 0.0
    assert np.allclose(lows[1:], (lows + heights)[:-1])
    assert abs((lows + heights)[-1] - high) < 1e-6
    for low, height in zip(lows, heights, strict=True):
        inside = (across >= low) & (across < low + height)
        assert height <= widths[inside].min(initial=np.inf) + 1e-9
    assert len(heights) == fewest(across, widths, high)


def fewest(across, widths, high):
    """Return how many strips it takes if each goes as far as it may: a part of a strip that may be is one too."""
    low, count = 0.0, 0
    while low < high - 1e-6:
        short, long = 0.0, high - low
        for _ in range(50):
            height = (short + long) / 2
            may = height <= widths[(across >= low) & (across < low + height)].min(initial=np.inf)
            short, long = (height, long) if may else (short, height)
        low, count = low + long, count + 1
    return count


def test_one_width_makes_equal_strips():
    """Over a flat bottom the strips are all alike, as lines at one spacing are."""
    _, heights = strips(np.linspace(0, 100, 500), np.full(500, 30.0), 0.0, 100.0)
    assert len(heights) == 4
    assert np.allclose(heights[:-1], heights[0])
    assert np.allclose(heights, 25.0, atol=0.3)
