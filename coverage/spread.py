"""Lines whose distance follows what a pass sees where it is: wide where the water is deep, close where it is shoal."""

from dataclasses import dataclass

import numpy as np

HALVINGS = 10  # of the search for the least widths that need no more lines


@dataclass(frozen=True, slots=True)
class Spread:
    """The metres that a pass adds, `widths` (n,), at `places` (n, 2) all over what is surveyed."""

    places: np.ndarray
    widths: np.ndarray


def strips(across: np.ndarray, widths: np.ndarray, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """Return where strips between `low` and `high` begin, (k,), and their heights, (k,): none above any width in it.

    `across` (n,) are the places of the `widths` (n,) on the axis on which strips are stacked. There are as few as there can
    be, one after the other from `low`; what the last one needs less is taken off all, for more overlap.
    """
    order = np.argsort(across, kind="stable")
    across, widths = across[order], widths[order]
    whole = _stacked(across, widths, low, high)
    small, large = 0.0, 1.0
    for _ in range(HALVINGS):
        part = (small + large) / 2
        few = _stacked(across, part * widths, low, high, len(whole))
        small, large = (small, part) if len(few) <= len(whole) and few.sum() >= high - low - 1e-9 else (part, large)
    heights = _stacked(across, large * widths, low, high, len(whole))
    return low + np.append(0.0, np.cumsum(heights)[:-1]), heights


def _stacked(across: np.ndarray, widths: np.ndarray, low: float, high: float, most: int = 10**6) -> np.ndarray:
    """Heights (k,) of strips from `low`, each the greatest that is no more than the least width in it; `most` at most."""
    heights: list[float] = []
    widest = float(widths.max())
    while low < high - 1e-9 and len(heights) < most:
        first, last = np.searchsorted(across, (low, low + widest), side="left")
        here, least = across[first:last] - low, np.minimum.accumulate(widths[first:last])
        fits = int((here <= least).sum())  # the least only falls, so that those that fit come first
        if fits == 0:
            height = float(least[0]) if len(least) else widest
        else:
            beyond = float(here[fits]) if fits < len(here) else np.inf
            height = min(float(least[fits - 1]), beyond)
        height = min(height, high - low)
        heights.append(height)
        low += height
    return np.array(heights)
