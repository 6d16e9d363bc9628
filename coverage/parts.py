"""Who covers how much of each connected part of a grid: a transport problem, so that shares stay exact."""

import numpy as np
from scipy.ndimage import label
from scipy.optimize import linprog
from scipy.sparse import eye_array, kron, vstack


def connected_parts(free: np.ndarray) -> tuple[np.ndarray, int]:
    """Return (R, C) numbers of the 4-connected parts of a (R, C) bool grid, from 0, -1 where not free; and how many."""
    numbers, count = label(free)
    return numbers - 1, int(count)


def whole_targets(total: int, shares: np.ndarray) -> np.ndarray:
    """Return (k,) whole numbers in proportion to `shares`, the sum `total`, by largest remainder."""
    exact = total * np.asarray(shares, dtype=float)
    targets = np.floor(exact).astype(np.int64)
    order = np.argsort(-(exact - targets), kind="stable")
    targets[order[: total - targets.sum()]] += 1
    return targets


def allot(sizes: np.ndarray, targets: np.ndarray, distances: np.ndarray) -> np.ndarray:
    """Return (k, p) how many of the (p,) `sizes` cells of each part each vehicle covers.

    Rows sum to `targets` (k,), columns to `sizes`; the sum over cells of (k, p) `distances` in metres is least. A vertex of
    this transport polytope is whole and has fewer than k + p pieces, so hardly a vehicle works in two parts.
    """
    k, p = distances.shape
    if p == 1:
        return targets.reshape(-1, 1).copy()
    rows = kron(eye_array(k), np.ones((1, p)))
    columns = kron(np.ones((1, k)), eye_array(p))
    finite = distances[np.isfinite(distances)]
    cost = np.where(np.isfinite(distances), distances, 1e3 * (1.0 + finite.max(initial=1.0)))
    result = linprog(
        cost.ravel(), A_eq=vstack([rows, columns]).tocsr(), b_eq=np.concatenate([targets, sizes]), method="highs-ds"
    )
    return np.rint(result.x).astype(np.int64).reshape(k, p)
