"""Moving cells over the borders, as many as asked from region to region, while all regions stay 4-connected."""

import numba
import numpy as np

from quarterdeck.coverage.cuts import is_simple


@numba.njit(cache=True)
def transfer(labels, is_start, want, width, lane, table):  # type: ignore[no-untyped-def]
    """Move border cells from region to region as `want` (k, k) asks, and return how many moved (k, k).

    Fronts advance cell by cell, all borders in turn; along a `lane` a front runs as far as it can before it steps aside.
    """
    n = len(labels)
    moved = np.zeros_like(want)
    left = want.copy()
    queue = np.empty(4 * n, dtype=np.int32)
    target = np.empty(4 * n, dtype=np.int32)
    last = 0
    for first_pass in (True, False):
        for cell in range(width, n - width):
            i = labels[cell]
            if i < 0 or is_start[cell]:
                continue
            for step in (
                lane if lane else 1,
                -lane if lane else -1,
                width if lane != width else 1,
                -width if lane != width else -1,
            ):
                j = labels[cell + step]
                if j >= 0 and j != i and left[i, j] > 0 and (abs(step) == lane) == first_pass:
                    queue[last], target[last] = cell, j
                    last += 1
    stack = np.empty(n, dtype=np.int32)
    first = 0
    while first < last:
        j = target[first]
        stack[0] = queue[first]
        first += 1
        top = 1
        i = labels[stack[0]]
        while top > 0:
            top -= 1
            cell = stack[top]
            if (
                labels[cell] != i
                or i == j
                or left[i, j] <= 0
                or is_start[cell]
                or not is_simple(labels, cell, width, table)
            ):
                continue
            if labels[cell - 1] != j and labels[cell + 1] != j and labels[cell - width] != j and labels[cell + width] != j:
                continue
            labels[cell] = j
            left[i, j] -= 1
            moved[i, j] += 1
            for step in (-1, 1, -width, width):
                there = cell + step
                if labels[there] == i and not is_start[there]:
                    if abs(step) == lane:
                        if top < n:
                            stack[top] = there
                            top += 1
                    elif last < 4 * n:
                        queue[last], target[last] = there, j
                        last += 1
    return moved


@numba.njit(cache=True)
def transfer_by_depth(labels, starts, is_start, want, width):  # type: ignore[no-untyped-def]
    """Move border cells as `transfer` does where the neighbours alone cannot tell; return how many moved (k, k).

    Every cell but a start keeps a neighbour of its region that is nearer to the start, so regions stay 4-connected; a cell
    may leave when each farther neighbour has another nearer one.
    """
    n = len(labels)
    depth = _depths(labels, starts, width)
    moved = np.zeros_like(want)
    left = want.copy()
    queue = np.empty(4 * n, dtype=np.int32)
    target = np.empty(4 * n, dtype=np.int32)
    last = 0
    for cell in range(width, n - width):
        i = labels[cell]
        if i >= 0 and not is_start[cell]:
            for step in (-1, 1, -width, width):
                j = labels[cell + step]
                if j >= 0 and j != i and left[i, j] > 0:
                    queue[last], target[last] = cell, j
                    last += 1
    first = 0
    while first < last:
        cell, j = queue[first], target[first]
        first += 1
        i = labels[cell]
        if i == j or left[i, j] <= 0 or not _may_leave(labels, depth, cell, width):
            continue
        nearest = 2**30
        for step in (-1, 1, -width, width):
            if labels[cell + step] == j:
                nearest = min(nearest, depth[cell + step])
        if nearest == 2**30:
            continue
        labels[cell] = j
        depth[cell] = nearest + 1
        left[i, j] -= 1
        moved[i, j] += 1
        for step in (-1, 1, -width, width):
            there = cell + step
            if labels[there] == i and not is_start[there] and last < 4 * n:
                queue[last], target[last] = there, j
                last += 1
    return moved


@numba.njit(cache=True)
def _may_leave(labels: np.ndarray, depth: np.ndarray, cell: int, width: int) -> bool:
    own = labels[cell]
    for step in (-1, 1, -width, width):
        child = cell + step
        if labels[child] == own and depth[child] > depth[cell]:
            other = False
            for turn in (-1, 1, -width, width):
                parent = child + turn
                if parent != cell and labels[parent] == own and depth[parent] < depth[child]:
                    other = True
            if not other:
                return False
    return True


@numba.njit(cache=True)
def _depths(labels: np.ndarray, starts: np.ndarray, width: int) -> np.ndarray:
    """Return how many steps within its region each cell is from the start (breadth first)."""
    depth = np.full(len(labels), -1, dtype=np.int32)
    queue = np.empty(len(labels), dtype=np.int32)
    last = 0
    for start in starts:
        depth[start] = 0
        queue[last] = start
        last += 1
    first = 0
    while first < last:
        cell = queue[first]
        first += 1
        for step in (-1, 1, -width, width):
            there = cell + step
            if labels[there] == labels[cell] and depth[there] < 0:
                depth[there] = depth[cell] + 1
                queue[last] = there
                last += 1
    return depth
