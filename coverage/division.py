"""Dividing the free hypervertices among the vehicles: connected, proportional, and always ending.

The idea of DARP (Kapoutsis et al. 2017), a region for every vehicle around its own start, with another method:
regions grow from the starts, then cells flow along the regions' graph until every region has its target. What is possible
is computed first, so an impossible share becomes the nearest possible one and says why.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import KDTree

from quarterdeck.coverage.balance import FAIRER, PATIENCE, balance, rebalance
from quarterdeck.coverage.bound import cells_at_least, fair_targets, pocket_bound
from quarterdeck.coverage.bricks import straight_trees, tree_turns
from quarterdeck.coverage.chambers import chamber_bound
from quarterdeck.coverage.growth import grow
from quarterdeck.coverage.recombine import recombine
from quarterdeck.geo.deadline import time_is_up
from quarterdeck.geo.errors import InputError

STRETCH = 8
"""How much dearer a step across the lanes is than one along them when regions grow along rows or columns."""

BRIEF = 6
"""Rounds without progress that further divisions get when one is balanced."""

LOOKS = 800
"""How many cells the straightening of borders may look at for each cell of the area; 90 million take about a second."""

LEAST_LOOKS, MOST_LOOKS = 1_500_000, 200_000_000
"""But no fewer and no more in all."""


@dataclass(frozen=True, slots=True)
class Division:
    """Who covers which hypervertex.

    `labels` (R, C) int32 holds the vehicle's index, -1 for nobody; `sizes`, `targets` (k,) int64 are cells had and aimed
    at. `bound` (k,) int64: in any division some vehicle i has at least bound[i] cells, `proof` says why; `ratio` is the
    largest sizes[i] / bound[i], so 1.0 is optimal. `reasons` tells what could not be as asked.
    """

    labels: np.ndarray
    sizes: np.ndarray
    targets: np.ndarray
    bound: np.ndarray
    proof: str
    ratio: float
    reasons: tuple[str, ...]

    @property
    def bound_moves(self) -> int:
        """The moves between path cells, 4 a hypervertex, that the longest closed tour has at least."""
        return 4 * int(self.bound.max())


def divide(
    free: np.ndarray,
    starts: np.ndarray,
    shares: np.ndarray | None = None,
    *,
    seed: int = 0,
    turn_cost: float | np.ndarray = 1.0,
    names: Sequence[object] | None = None,
) -> Division:
    """Divide the free hypervertices (R, C) bool among vehicles at `starts` (k, 2), distinct free rows and columns.

    `shares` (k,) are positive and sum to 1 within 1e-9; None means equal. `turn_cost` is what a turn costs in moves between
    path cells, one number or (k,): of the fairest divisions tried the one whose slowest vehicle is soonest done wins.
    Every region is 4-connected and has its vehicle's start; sizes are within one cell of the share where the geometry
    allows. Cells that no start reaches are nobody's. `names` (k,) are what the reasons call the vehicles, else by number.
    Deterministic for a seed.
    Raises InputError for starts that are not distinct free cells, and for shares that do not fit.
    """
    free = np.ascontiguousarray(free, dtype=np.bool_)
    starts = np.asarray(starts, dtype=np.int64).reshape(-1, 2)
    shares = _checked(free, starts, shares)
    k = len(starts)
    padded = np.pad(free, 1)
    width = padded.shape[1]
    cells = (starts[:, 0] + 1) * width + starts[:, 1] + 1

    lanes = ((1, 1, 0), (1, STRETCH, 1), (STRETCH, 1, width))
    grown = [grow(padded.ravel(), cells, width, across, along)[0] for across, along, _ in lanes]
    reachable = (grown[0] >= 0).reshape(padded.shape)[1:-1, 1:-1]
    targets, loads = fair_targets(reachable, starts, shares)
    wanted = loads * shares
    bound = pocket_bound(reachable, starts, loads, shares)
    floor = cells_at_least(bound, shares)

    rng = np.random.default_rng(seed)
    tried: list[np.ndarray] = []
    for labels, (_, _, lane) in zip(grown, lanes, strict=True):
        if tried and time_is_up(FAIRER):
            break
        done = any(_worst(other, floor) <= 1 for other in tried)
        tried.append(balance(labels, cells, wanted, width, lane, rng, patience=BRIEF if done else PATIENCE))
    worst = np.array([_worst(labels, floor) for labels in tried])
    if worst.min() > 1 and not time_is_up(FAIRER):
        bound = max(bound, chamber_bound(reachable, starts, shares), key=lambda b: b.load)
        floor = cells_at_least(bound, shares)
        worst = np.array([_worst(labels, floor) for labels in tried])
    if worst.min() > 1 and not time_is_up(FAIRER):
        tried.append(rebalance(tried[worst.argmin()], cells, wanted, floor, width, rng))
        worst = np.append(worst, _worst(tried[-1], floor))
    good = [labels for labels, load in zip(tried, worst, strict=True) if load <= worst.min() + 1e-9]

    def time(labels: np.ndarray) -> float:
        return _time(np.ascontiguousarray(labels.reshape(padded.shape)[1:-1, 1:-1]), shares, turn_cost)

    budget = min(max(LOOKS * int(reachable.sum()), LEAST_LOOKS), MOST_LOOKS)
    if time_is_up("the search for straighter borders of regions"):
        straight = min(good, key=time)
    else:
        straight = min((recombine(labels, cells, width, rng, budget // 8) for labels in good), key=time)
        straight = min((straight, recombine(straight, cells, width, rng, budget // 2)), key=time)
    labels = np.ascontiguousarray(straight.reshape(padded.shape)[1:-1, 1:-1])
    sizes = np.bincount(labels[labels >= 0], minlength=k)
    ratio = _worst(labels, floor)
    return Division(
        labels, sizes, targets, floor, bound.proof, ratio, _reasons(free, reachable, shares, sizes, targets, names)
    )


def _checked(free: np.ndarray, starts: np.ndarray, shares: np.ndarray | None) -> np.ndarray:
    """Return the shares, equal if None, after checking them and the starts."""
    k = len(starts)
    if k == 0:
        raise InputError("no vehicle to divide the area among; give at least one start")
    if len(np.unique(starts, axis=0)) < k:
        raise InputError("two vehicles share a start cell; let distinct_entries give each its own")
    inside = _in_free(free, starts)
    if not inside.all():
        row, col = starts[np.argmin(inside)]
        raise InputError(f"start (row {row}, column {col}) is not a free cell; let distinct_entries find one")
    if shares is None:
        return np.full(k, 1.0 / k)
    shares = np.asarray(shares, dtype=np.float64)
    if shares.shape != (k,) or not (shares > 0).all():
        raise InputError(f"expected {k} positive shares, got {np.array2string(shares, threshold=8)}")
    if abs(shares.sum() - 1.0) > 1e-9:
        raise InputError(f"the shares sum to {shares.sum():.12g}; they must sum to 1")
    return shares


def _in_free(free: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return (k,) bool: which of the (k, 2) cells are free ones of the grid."""
    inside = np.asarray(((cells >= 0) & (cells < free.shape)).all(axis=1))
    inside[inside] = free[cells[inside, 0], cells[inside, 1]]
    return inside


def _worst(labels: np.ndarray, floor: np.ndarray) -> float:
    return float((np.bincount(labels[labels >= 0], minlength=len(floor)) / floor).max())


def _time(labels: np.ndarray, shares: np.ndarray, turn_cost: float | np.ndarray) -> float:
    """Return the largest time per unit of share, in moves, turns included, plus the mean: the others count too."""
    k = len(shares)
    turns = tree_turns(*straight_trees(labels, k), labels, k)
    time = (4 * np.bincount(labels[labels >= 0], minlength=k) + turn_cost * turns) / shares
    return float(time.max() + time.mean() + 1e-6 * turns.sum())


def _reasons(
    free: np.ndarray,
    reachable: np.ndarray,
    shares: np.ndarray,
    sizes: np.ndarray,
    targets: np.ndarray,
    names: Sequence[object] | None,
) -> tuple[str, ...]:
    """Say in one line each which cells are nobody's and which vehicles are off their share by more than a cell."""
    reasons = []
    lost = int(free.sum() - reachable.sum())
    if lost:
        reasons.append(f"{lost} of {int(free.sum())} cells are nobody's: no vehicle's start leads there")
    asked = shares * reachable.sum()
    for vehicle, (size, target, ask) in enumerate(zip(sizes, targets, asked, strict=True)):
        if abs(target - ask) > 1 + 1e-6:
            why = f"starts and obstacles allow {target} at the fairest"
        elif abs(size - ask) > 1 + 1e-6:
            why = "no connected exchange came closer"
        else:
            continue
        reasons.append(f"vehicle {names[vehicle] if names else vehicle} has {size} cells, its share is {ask:.1f}: {why}")
    return tuple(reasons)


def distinct_entries(free: np.ndarray, rc: np.ndarray) -> np.ndarray:
    """Return (k, 2) rows and columns of distinct free hypervertices, one for each vehicle.

    `free` (R, C) bool; `rc` (k, 2) positions in cells: hypervertex (i, j) spans [i, i + 1) x [j, j + 1). A vehicle alone in
    a free hypervertex keeps it. The others get the entries of least total squared distance; those who share a point every
    second row and column of them, so that none shuts another in.
    Raises InputError if there are fewer free hypervertices than vehicles.
    """
    free = np.asarray(free, dtype=np.bool_)
    rc = np.asarray(rc, dtype=np.float64).reshape(-1, 2)
    k = len(rc)
    if np.count_nonzero(free) < k:
        raise InputError(f"{k} vehicles need {k} free cells, the grid has {np.count_nonzero(free)}; lessen the spacing")
    at = np.floor(rc).astype(np.int64)
    inside = _in_free(free, at)
    _, group, count = np.unique(at, axis=0, return_inverse=True, return_counts=True)
    keep = inside & (count[group.ravel()] == 1)
    entries = at.copy()
    open_ = free.copy()
    open_[at[keep, 0], at[keep, 1]] = False
    seekers = np.flatnonzero(~keep)
    if len(seekers):
        sparse = np.zeros_like(open_)
        sparse[::2, ::2] = open_[::2, ::2]
        shared = len(np.unique(group.ravel()[seekers])) < len(seekers)
        entries[seekers] = _nearest(sparse if shared and np.count_nonzero(sparse) >= len(seekers) else open_, rc[seekers])
    return entries


def _nearest(open_: np.ndarray, rc: np.ndarray) -> np.ndarray:
    """Return distinct open cells of least total squared distance: among each position's k nearest are enough."""
    cells = np.argwhere(open_)
    k = len(rc)
    _, near = KDTree(cells + 0.5).query(rc, k=np.arange(1, min(k, len(cells)) + 1))
    candidates = np.unique(near)
    cost = ((rc[:, None, :] - cells[candidates][None, :, :] - 0.5) ** 2).sum(axis=2)
    return cells[candidates[linear_sum_assignment(cost)[1]]]
