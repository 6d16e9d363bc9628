"""Balancing regions: cells flow from regions with a surplus to those with a deficit until each has its target.

The flow between neighbouring regions solves the Laplace equation of the regions' graph (diffusive load balancing, Hu
& Blake 1999); it is carried out by cells on the borders whose leaving keeps their region 4-connected. Where none may
go, a cell goes with all that hangs on it. A border that lets few cells pass conducts less from then on, so that the
flow finds other ways. The last units travel along chains of regions.
"""

import numba
import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import spsolve

from quarterdeck.coverage.cuts import SIMPLE, hanging, move_hanging
from quarterdeck.coverage.transfer import transfer, transfer_by_depth
from quarterdeck.geo.deadline import time_is_up

ROUNDS = 400
PATIENCE = 25
"""Rounds without progress after which the search ends."""

KICKS, KICK_CELLS = 200, 2_000_000
"""How often hard ground is shaken, and how many cells in all."""

FAIRER = "the search for a fairer division"

STUCK = 10
"""A border is stuck when less than this part of what it should let pass did."""


def balance(
    labels: np.ndarray,
    starts: np.ndarray,
    targets: np.ndarray,
    width: int,
    lane: int,
    rng: np.random.Generator,
    patience: int = PATIENCE,
) -> np.ndarray:
    """Return the labels of the best balance found; regions stay 4-connected and keep their starts.

    `labels` is (n,) int32, padded and flattened rows of length `width`; `starts` (k,) are cells, `targets` (k,) real
    numbers of cells: a region is balanced when it is less than a cell off. `lane` is the step along which whole runs of
    cells change hands: 1 rows, `width` columns, 0 no preference. Ends after ROUNDS rounds, or `patience` rounds without
    progress.
    """
    k = len(starts)
    is_start = np.zeros(len(labels), dtype=np.bool_)
    is_start[starts] = True
    labels = labels.copy()
    best, best_cost = labels.copy(), _cost(labels, targets)
    ease = np.ones((k, k))  # how willingly each border lets cells pass, by what it did
    stale = 0
    for _ in range(ROUNDS):
        sizes, border = _census(labels, k, width)
        surplus = sizes - targets
        if np.abs(surplus).max() < 1 - 1e-9:
            return labels
        if stale > patience or time_is_up(FAIRER):
            break
        want = _flow(surplus, np.sqrt(border) * ease, targets) if np.abs(surplus).max() > 2 else border[:0]
        if want.any():
            moved = transfer(labels, is_start, want, width, lane, SIMPLE)
            rest = want - moved
            if 4 * rest.sum() > want.sum():
                moved += transfer_by_depth(labels, starts, is_start, rest, width)
            ease = np.minimum(2 * ease, 1)
            stuck = moved * STUCK < want
            ease[stuck | stuck.T] /= 8
            if 2 * moved.sum() < want.sum():
                _move_blocks(labels, starts, targets, width, rng, 1.0)
        elif not _chains(labels, starts, targets, width, rng):
            _move_blocks(labels, starts, targets, width, rng, 1.3)
        cost = _cost(labels, targets)
        if cost < best_cost:
            best, best_cost, stale = labels.copy(), cost, 0
        else:
            stale += 1
    return best


def _cost(labels: np.ndarray, targets: np.ndarray) -> tuple[float, float]:
    """Return the largest excess over a target in cells, at least 1, and the sum of squares of all differences."""
    difference = np.bincount(labels[labels >= 0], minlength=len(targets)) - targets
    return max(float(difference.max()), 1.0), float((difference**2).sum())


def rebalance(
    labels: np.ndarray,
    starts: np.ndarray,
    targets: np.ndarray,
    floor: np.ndarray,
    width: int,
    rng: np.random.Generator,
) -> np.ndarray:
    """Return better labels for hard ground: blocks are moved at random, then all is balanced again (iterated local search).

    Arguments as for `balance`. Ends when no region has more than its `floor` (k,) cells, or after KICKS kicks, fewer on
    large ground (KICK_CELLS cells in all).
    """
    best, best_cost = labels, _cost(labels, targets)
    for _ in range(min(KICKS, KICK_CELLS // len(labels))):
        sizes = np.bincount(best[best >= 0], minlength=len(targets))
        if (sizes <= floor).all() or time_is_up(FAIRER):
            break
        loads = sizes / targets
        heavy = np.flatnonzero(loads > loads.max() * 0.98)
        kicked = best.copy()
        for _ in range(rng.integers(1, 4)):
            region = heavy[rng.integers(len(heavy))] if rng.random() < 0.5 else rng.integers(len(targets))
            _kick(kicked, starts, region, width, rng)
        kicked = balance(kicked, starts, targets, width, 0, rng, patience=4)
        cost = _cost(kicked, targets)
        if cost <= best_cost:
            best, best_cost = kicked, cost
    return best


@numba.njit(cache=True)
def _kick(labels, starts, region, width, rng):  # type: ignore[no-untyped-def]
    """Give a random border cell of the region, with all that hangs on it, to a neighbour."""
    number, order, size, low, parent, weight = hanging(labels, starts, width)
    chosen, to, seen = -1, -1, 0
    for cell in range(width, len(labels) - width):
        if labels[cell] == region and weight[cell] > 0:
            for step in (-1, 1, -width, width):
                j = labels[cell + step]
                if j >= 0 and j != region:
                    seen += 1
                    if rng.random() * seen < 1:
                        chosen, to = cell, j
    if chosen >= 0:
        move_hanging(labels, chosen, to, width, number, order, size, low, parent)


@numba.njit(cache=True)
def _census(labels: np.ndarray, k: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the regions' sizes (k,) and the lengths of their borders (k, k)."""
    sizes = np.zeros(k, dtype=np.int64)
    border = np.zeros((k, k), dtype=np.int64)
    for cell in range(width, len(labels) - width):
        i = labels[cell]
        if i >= 0:
            sizes[i] += 1
            for there in (cell + 1, cell + width):
                j = labels[there]
                if j >= 0 and j != i:
                    border[i, j] += 1
                    border[j, i] += 1
    return sizes, border


def _flow(surplus: np.ndarray, conductance: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Return (k, k) whole cells that each region should give to each neighbour, so that all surplus evens out.

    Parts of the graph without a border between them share their surplus in proportion to the targets.
    """
    laplacian = np.diag(conductance.sum(axis=0) + 1e-7 * np.maximum(targets, 1) / targets.mean()) - conductance
    potential = spsolve(csc_array(laplacian), surplus.astype(np.float64))  # numpy's solver spins up threads for this
    flow = conductance * (potential[:, None] - potential[None, :])
    return np.maximum(np.floor(flow + 0.5), 0).astype(np.int64)


@numba.njit(cache=True)
def _move_blocks(labels, starts, targets, width, rng, daring):  # type: ignore[no-untyped-def]
    """Give cells with all that hangs on them to a neighbour where that lessens the sum of squared differences.

    Each region takes part in one move, so that the search's results stay true; the largest gains go first. With `daring`
    above 1 a move may overshoot by that factor. Returns the number of moves.
    """
    k = len(starts)
    number, order, size, low, parent, weight = hanging(labels, starts, width)
    surplus = -targets.copy()
    for label in labels:
        if label >= 0:
            surplus[label] += 1
    best_gain = np.zeros((k, k))
    best_cell = np.full((k, k), -1, dtype=np.int32)
    for cell in range(width, len(labels) - width):
        i = labels[cell]
        if i < 0 or weight[cell] == 0:
            continue
        w = weight[cell]
        for step in (-1, 1, -width, width):
            j = labels[cell + step]
            if j >= 0 and j != i:
                gain = w * (daring * (surplus[i] - surplus[j]) - w) * (0.9 + 0.1 * rng.random())
                if gain > best_gain[i, j]:
                    best_gain[i, j] = gain
                    best_cell[i, j] = cell
    free = np.ones(k, dtype=np.bool_)
    moves = 0
    for at in np.argsort(-best_gain.ravel()):
        i, j = at // k, at % k
        if best_gain[i, j] <= 0:
            break
        if free[i] and free[j]:
            free[i] = free[j] = False
            move_hanging(labels, best_cell[i, j], j, width, number, order, size, low, parent)
            moves += 1
    return moves


@numba.njit(cache=True)
def _chains(labels, starts, targets, width, rng):  # type: ignore[no-untyped-def]
    """Send single cells along shortest chains of regions to one whose surplus is lower by more than a cell.

    Chains of one call share no region. Returns the number of cells moved.
    """
    k = len(starts)
    _, _, _, _, _, weight = hanging(labels, starts, width)
    surplus = -targets.copy()
    movable = np.full((k, k), -1, dtype=np.int32)  # the first entry of a list of cells for each pair of regions
    count = 0
    for cell in range(width, len(labels) - width):
        if labels[cell] >= 0:
            surplus[labels[cell]] += 1
            count += weight[cell] == 1 and _beside_another(labels, cell, width)
    entry = np.empty(4 * count, dtype=np.int32)
    after = np.empty(4 * count, dtype=np.int32)
    count = 0
    for cell in range(width, len(labels) - width):
        if weight[cell] == 1 and labels[cell] >= 0:
            i = labels[cell]
            for step in (-1, 1, -width, width):
                j = labels[cell + step]
                if j >= 0 and j != i:
                    entry[count], after[count] = cell, movable[i, j]
                    movable[i, j] = count
                    count += 1
    free = np.ones(k, dtype=np.bool_)
    moves = 0
    came = np.empty(k, dtype=np.int32)
    queue = np.empty(k, dtype=np.int32)
    shuffled = rng.permutation(k)
    for source in np.argsort(-surplus + rng.random(k) * 0.5):
        if surplus[source] <= 0.0 or not free[source]:
            continue
        came[:] = -1
        came[source] = source
        queue[0] = source
        first, last, end = 0, 1, -1
        while first < last and end < 0:
            i = queue[first]
            first += 1
            for j in shuffled:
                if came[j] < 0 and movable[i, j] >= 0 and free[j]:
                    came[j] = i
                    queue[last] = j
                    last += 1
                    if surplus[j] < surplus[source] - 1 - 1e-9 and (surplus[source] >= 1 - 1e-9 or surplus[j] <= 1e-9 - 1):
                        end = j
                        break
        j = end
        while j >= 0 and j != source:
            i = came[j]
            free[i] = free[j] = False
            if _move_one(labels, i, j, movable, entry, after, width):
                moves += 1
            else:
                break
            j = i
    return moves


@numba.njit(cache=True)
def _beside_another(labels: np.ndarray, cell: int, width: int) -> bool:
    up, down, left, right = labels[cell - width], labels[cell + width], labels[cell - 1], labels[cell + 1]
    own = labels[cell]
    vertical = (up >= 0 and up != own) or (down >= 0 and down != own)
    return vertical or (left >= 0 and left != own) or (right >= 0 and right != own)


@numba.njit(cache=True)
def _move_one(labels, i, j, movable, entry, after, width):  # type: ignore[no-untyped-def]
    """Move one of the listed cells from i to j, the one with most neighbours in j; i has lost nothing since the search.

    j may have lost one cell, so the neighbour in j must still be there.
    """
    best, best_score = -1, -9
    at = movable[i, j]
    while at >= 0:
        cell = entry[at]
        at = after[at]
        score, touches = 0, False
        for step in (-1, 1, -width, width):
            there = labels[cell + step]
            if there == j:
                touches = True
                score += 1
            elif there == i:
                score -= 1
        if touches and labels[cell] == i and score > best_score:
            best, best_score = cell, score
    if best >= 0:
        labels[best] = j
    return best >= 0
