"""Spanning tree coverage: the closed walk around a region's tree (Gabriely & Rimon 2001).

A tree over the hypervertices (2 x 2 path cells each) is walked around clockwise, as drawn with rows downwards; the
walk visits every path cell once. Each path cell has one successor, known from the tree's edges at its hypervertex.
"""

import numba
import numpy as np

from quarterdeck.coverage.bricks import straight_trees
from quarterdeck.geo.errors import InputError


def tour(region: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return the (4 n, 2) path cells of the closed tour of the n hypervertices of `region`, in visiting order.

    `region` is (R, C) bool and 4-connected, `start` the (2,) row and column of one of its hypervertices. The tour begins at
    path cell (2 row, 2 col) of the start; the move from the last cell back to the first closes it.
    Raises InputError if the start is not in the region, or the region is not 4-connected.
    """
    labels = np.where(region, np.int32(0), np.int32(-1))
    return tours(labels, np.asarray(start).reshape(1, 2))[0]


def tours(labels: np.ndarray, starts: np.ndarray) -> list[np.ndarray]:
    """Return `tour` of every region: `labels` (R, C) int holds 0 .. k-1, or -1 for nobody's cells; `starts` is (k, 2)."""
    labels = np.ascontiguousarray(labels, dtype=np.int32)
    right, down = straight_trees(labels, len(starts))
    walks = []
    for vehicle, (row, col) in enumerate(np.asarray(starts, dtype=np.int64)):
        if labels[row, col] != vehicle:
            raise InputError(f"start (row {row}, column {col}) is not in the region of vehicle {vehicle}")
        walks.append((vehicle, _walk(right, down, row, col)))
    sizes = np.bincount(labels[labels >= 0], minlength=len(starts))
    for vehicle, walk in walks:
        if len(walk) != 4 * sizes[vehicle]:
            raise InputError(f"the region of vehicle {vehicle} is not 4-connected; divide the area again")
    return [walk for _, walk in walks]


@numba.njit(cache=True)
def _walk(right: np.ndarray, down: np.ndarray, row: int, col: int) -> np.ndarray:
    """Walk clockwise around the tree from path cell (2 row, 2 col) until back there.

    `right[r, c]` says that the tree links (r, c) with (r, c + 1), `down[r, c]` with (r + 1, c).
    """
    i, j = 2 * row, 2 * col
    n = 0
    path = np.empty((1024, 2), dtype=np.int32)
    while True:
        if n == len(path):
            longer = np.empty((2 * n, 2), dtype=np.int32)
            longer[:n] = path
            path = longer
        path[n, 0], path[n, 1] = i, j
        n += 1
        r, c = i >> 1, j >> 1
        if i & 1 == 0:
            if j & 1 == 0:  # the corner at the top left: along the tree's edge up, else to the right
                if r > 0 and down[r - 1, c]:
                    i -= 1
                else:
                    j += 1
            elif right[r, c]:
                j += 1
            else:
                i += 1
        elif j & 1 == 1:
            if down[r, c]:
                i += 1
            else:
                j -= 1
        elif c > 0 and right[r, c - 1]:
            j -= 1
        else:
            i -= 1
        if i == 2 * row and j == 2 * col:
            return path[:n].copy()


def count_turns(path: np.ndarray) -> int:
    """Return how many times the closed walk `path` (n, 2) changes direction, the closing moves included."""
    if len(path) < 3:
        return 0
    steps = np.diff(path, axis=0, append=path[:1])
    return int((steps != np.roll(steps, 1, axis=0)).any(axis=1).sum())
