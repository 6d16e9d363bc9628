"""Largest matching in a bipartite graph (Hopcroft & Karp 1973).

scipy's `maximum_bipartite_matching` takes 16 s for the brick cover of 100 x 100 cells with obstacles; this one takes
milliseconds, because a greedy start leaves little to augment and each phase is linear.
"""

import numba
import numpy as np


@numba.njit(cache=True)
def largest_matching(indptr: np.ndarray, indices: np.ndarray, n_right: int) -> tuple[np.ndarray, np.ndarray]:
    """Return each left vertex's mate and each right vertex's mate, -1 for none; the graph is CSR, left to right."""
    n_left = len(indptr) - 1
    mate = np.full(n_left, -1, dtype=np.int32)
    back = np.full(n_right, -1, dtype=np.int32)
    for u in range(n_left):
        for at in range(indptr[u], indptr[u + 1]):
            if back[indices[at]] < 0:
                mate[u], back[indices[at]] = indices[at], u
                break

    depth = np.empty(n_left, dtype=np.int32)
    queue = np.empty(n_left, dtype=np.int32)
    cursor = np.empty(n_left, dtype=np.int32)
    while True:
        last = 0
        for u in range(n_left):
            cursor[u] = indptr[u]
            depth[u] = -1
            if mate[u] < 0:
                depth[u] = 0
                queue[last] = u
                last += 1
        first, found = 0, False
        while first < last:
            u = queue[first]
            first += 1
            for at in range(indptr[u], indptr[u + 1]):
                w = back[indices[at]]
                if w < 0:
                    found = True
                elif depth[w] < 0:
                    depth[w] = depth[u] + 1
                    queue[last] = w
                    last += 1
        if not found:
            return mate, back
        for u in range(n_left):
            if mate[u] < 0:
                _augment(u, indptr, indices, mate, back, depth, cursor, queue)


@numba.njit(cache=True)
def _augment(root, indptr, indices, mate, back, depth, cursor, stack) -> None:  # type: ignore[no-untyped-def]
    """Search depth first, one layer a step, for an augmenting path from `root`, and flip it."""
    stack[0] = root
    top = 0
    while top >= 0:
        u = stack[top]
        if cursor[u] == indptr[u + 1]:
            depth[u] = -1
            top -= 1
            if top >= 0:
                cursor[stack[top]] += 1
            continue
        w = back[indices[cursor[u]]]
        if w < 0:
            for level in range(top, -1, -1):
                left = stack[level]
                right = indices[cursor[left]]
                mate[left], back[right] = right, left
            return
        if depth[w] == depth[u] + 1:
            top += 1
            stack[top] = w
        else:
            cursor[u] += 1
