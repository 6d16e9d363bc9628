"""Straightening the borders: two neighbours are united and divided anew by a strip, again and again.

Sizes stay what they were. A strip is taken if it needs fewer lanes, or a few more while the annealing is hot. (Uniting two
districts to divide them anew is the recombination of DeFord, Duchin & Solomon 2021, there by random trees.)
"""

import numba
import numpy as np

from quarterdeck.coverage.peel import cheapest_lanes, peel, sweep_of

WAYS = 16
"""A strip for either vehicle, rows or columns, from either side, from either end."""

HOT, COLD = 1.0, 0.05
"""Temperatures of the annealing, in lanes."""

TRIAL = 300
"""What a trial takes besides the cells of its window, in cells."""


@numba.njit(cache=True)
def recombine(labels, starts, width, rng, budget):  # type: ignore[no-untyped-def]
    """Return labels (n,) with the fewest lanes in all that were met before the budget was used.

    `labels` is (n,) int32, padded and flattened rows of length `width`; `starts` (k,) cells; `budget` is how many cells may
    be looked at: those of a pair's window for each strip tried.
    """
    k = len(starts)
    labels = labels.copy()
    best = labels.copy()
    boxes = np.empty((k, 4), dtype=np.int64)
    near = np.zeros((k, k), dtype=np.bool_)
    _survey(labels, width, boxes, near)
    if not near.any():
        return best
    total = best_total = 0.0
    left = budget
    while left > 0:
        left -= k + TRIAL
        i = rng.integers(0, k)
        beside = np.flatnonzero(near[i])
        if len(beside) == 0:
            continue
        j = beside[rng.integers(0, len(beside))]
        heat = HOT * (COLD / HOT) ** (1 - left / budget)
        slack = -heat * np.log(1 - rng.random())
        gain, looked = _divide_pair(labels, starts, i, j, width, boxes, near, rng.integers(0, WAYS), slack)
        left -= looked
        total -= gain
        if total < best_total - 1e-9:
            best_total = total
            best[:] = labels
    return best


@numba.njit(cache=True)
def _survey(labels, width, boxes, near):  # type: ignore[no-untyped-def]
    """Fill in each region's bounding box (top, bottom, left, right) and which regions touch."""
    boxes[:, 0] = boxes[:, 2] = len(labels)
    boxes[:, 1] = boxes[:, 3] = 0
    for cell in range(width, len(labels) - width):
        i = labels[cell]
        if i >= 0:
            _enclose(boxes, i, cell // width, cell % width)
            for there in (cell + 1, cell + width):
                j = labels[there]
                if j >= 0 and i != j:
                    near[i, j] = near[j, i] = True


@numba.njit(cache=True)
def _enclose(boxes: np.ndarray, i: int, row: int, col: int) -> None:
    boxes[i, 0], boxes[i, 1] = min(boxes[i, 0], row), max(boxes[i, 1], row)
    boxes[i, 2], boxes[i, 3] = min(boxes[i, 2], col), max(boxes[i, 3], col)


@numba.njit(cache=True)
def _divide_pair(labels, starts, i, j, width, boxes, near, way, slack):  # type: ignore[no-untyped-def]
    """Divide i and j anew by strip `way` of WAYS if that needs less than `slack` more lanes.

    Return how many lanes that saves (0 if nothing changed) and how many cells were looked at.
    """
    top, bottom = min(boxes[i, 0], boxes[j, 0]), max(boxes[i, 1], boxes[j, 1])
    left, right = min(boxes[i, 2], boxes[j, 2]), max(boxes[i, 3], boxes[j, 3])
    wide, high = right - left + 3, bottom - top + 3
    base = (top - 1) * width + left - 1
    own_i = np.zeros(wide * high, dtype=np.bool_)
    own_j = np.zeros(wide * high, dtype=np.bool_)
    size_i = size_j = 0
    for row in range(1, high - 1):
        for col in range(1, wide - 1):
            label = labels[base + row * width + col]
            if label == i:
                own_i[row * wide + col] = True
                size_i += 1
            elif label == j:
                own_j[row * wide + col] = True
                size_j += 1
    start_i = (starts[i] // width - top + 1) * wide + starts[i] % width - left + 1
    start_j = (starts[j] // width - top + 1) * wide + starts[j] % width - left + 1
    both = own_i | own_j

    now = cheapest_lanes(own_i, wide, high) + cheapest_lanes(own_j, wide, high)
    limit = now + slack
    sweep = sweep_of(wide, high, way & 4 != 0, way & 2 != 0, way & 1 != 0)
    if way < 8:
        new_i, _, price = peel(both, start_i, start_j, size_i, sweep, wide, limit)
    else:
        _, new_i, price = peel(both, start_j, start_i, size_j, sweep, wide, limit)
    if price >= limit:
        return 0.0, wide * high

    for region in (i, j):
        boxes[region, 0] = boxes[region, 2] = len(labels)
        boxes[region, 1] = boxes[region, 3] = 0
        near[region] = near[:, region] = False
    for row in range(1, high - 1):
        for col in range(1, wide - 1):
            if both[row * wide + col]:
                labels[base + row * width + col] = i if new_i[row * wide + col] else j
    for row in range(1, high - 1):
        for col in range(1, wide - 1):
            if both[row * wide + col]:
                cell = base + row * width + col
                own = labels[cell]
                _enclose(boxes, own, top + row - 1, left + col - 1)
                for there in (cell - 1, cell + 1, cell - width, cell + width):
                    beside = labels[there]
                    if beside >= 0 and beside != own:
                        near[own, beside] = near[beside, own] = True
    return now - price, wide * high
