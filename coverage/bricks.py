"""Spanning trees that run straight: few bricks, joined where a joint costs no turn.

A brick is a straight run of hypervertices. The walk around a tree turns 2 times at a leaf, a corner and a T, 4 times
at a crossing or a lone cell and never along a straight, so a tree of few, long bricks joined at their ends turns least.
The fewest bricks follow from a bipartite matching: a horizontal and a vertical link at the same cell exclude each
other, and the links of a largest set without such pairs make the bricks (the idea of TMSTC*, Lu et al. 2023).
"""

import numba
import numpy as np
from scipy.sparse import csr_array

from quarterdeck.coverage.matching import largest_matching

MATCHING_CELLS = 100_000
"""Above this many cells the matching is left out and rows or columns alone are tried: it would take seconds."""


def straight_trees(labels: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the links (right, down), both (R, C) bool, of a spanning tree of each of the k regions in `labels` (R, C).

    `right[r, c]` links (r, c) with (r, c + 1), `down[r, c]` with (r + 1, c). Each region takes the best of three trees:
    rows first, columns first, fewest bricks. Ties go to the first.
    """
    across = np.zeros(labels.shape, dtype=np.bool_)
    across[:, :-1] = (labels[:, :-1] == labels[:, 1:]) & (labels[:, :-1] >= 0)
    along = np.zeros(labels.shape, dtype=np.bool_)
    along[:-1] = (labels[:-1] == labels[1:]) & (labels[:-1] >= 0)
    none = np.zeros(labels.shape, dtype=np.bool_)

    covers = [(across, none), (none, along)]
    if np.count_nonzero(labels >= 0) <= MATCHING_CELLS:
        covers.append(_fewest_bricks(across, along))
    trees = [_join(across, along, *cover) for cover in covers]
    turns = np.array([tree_turns(right, down, labels, k) for right, down in trees])
    best = np.append(turns.argmin(axis=0), 0)[labels]
    return np.choose(best, [right for right, _ in trees]), np.choose(best, [down for _, down in trees])


def _fewest_bricks(across: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a largest set of links in which no cell has both a horizontal and a vertical one (Konig's theorem).

    Vertices of the bipartite graph are the links; its edges are the cells' exclusions. What a minimum vertex cover leaves
    is a maximum independent set; the cover comes from alternating paths out of the unmatched horizontal links.
    """
    cells = np.arange(across.size).reshape(across.shape)
    number_v = np.cumsum(along.ravel()) - 1
    h_at, v_at = cells[across], cells[along]
    pairs = []
    for h_end in (0, 1):
        for v_end in (0, across.shape[1]):
            v = h_at + h_end - v_end  # the vertical link of which the horizontal link's end is the upper or the lower end
            ok = (v >= 0) & along.ravel()[np.maximum(v, 0)]
            pairs.append((np.flatnonzero(ok), number_v[v[ok]]))
    rows = np.concatenate([p[0] for p in pairs])
    columns = np.concatenate([p[1] for p in pairs])
    graph = csr_array((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(len(h_at), len(v_at)))
    if graph.nnz == 0:
        return across, along
    mates = largest_matching(graph.indptr, graph.indices, len(v_at))
    reached_h, reached_v = _alternating(graph.indptr, graph.indices, *mates)
    keep_h = np.zeros(across.size, dtype=np.bool_)
    keep_h[h_at[reached_h]] = True
    keep_v = np.zeros(across.size, dtype=np.bool_)
    keep_v[v_at[~reached_v]] = True
    return keep_h.reshape(across.shape), keep_v.reshape(across.shape)


@numba.njit(cache=True)
def _alternating(
    indptr: np.ndarray, indices: np.ndarray, of_h: np.ndarray, of_v: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return which horizontal and vertical vertices alternating paths reach from the unmatched horizontal ones."""
    seen_h = of_h < 0
    seen_v = np.zeros(len(of_v), dtype=np.bool_)
    stack = np.empty(len(of_h), dtype=np.int32)
    top = 0
    for h in range(len(of_h)):
        if seen_h[h]:
            stack[top] = h
            top += 1
    while top > 0:
        top -= 1
        h = stack[top]
        for at in range(indptr[h], indptr[h + 1]):
            v = indices[at]
            if not seen_v[v]:
                seen_v[v] = True
                mate = of_v[v]
                if mate >= 0 and not seen_h[mate]:
                    seen_h[mate] = True
                    stack[top] = mate
                    top += 1
    return seen_h, seen_v


@numba.njit(cache=True)
def _join(across: np.ndarray, along: np.ndarray, h: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Join the bricks given by the links `h` and `v` to spanning trees, the links of fewest turns first (Kruskal)."""
    n_rows, n_cols = across.shape
    right, down = h.copy(), v.copy()
    root = np.arange(n_rows * n_cols, dtype=np.int32)
    for r in range(n_rows):
        for c in range(n_cols):
            if h[r, c]:
                _unite(root, r * n_cols + c, r * n_cols + c + 1)
            if v[r, c]:
                _unite(root, r * n_cols + c, (r + 1) * n_cols + c)

    for price in range(-4, 5, 2):
        for r in range(n_rows):
            for c in range(n_cols):
                if along[r, c] and not down[r, c] and _price(right, down, r, c, 1) <= price:
                    down[r, c] = _unite(root, r * n_cols + c, (r + 1) * n_cols + c)
                if across[r, c] and not right[r, c] and _price(right, down, r, c, 0) <= price:
                    right[r, c] = _unite(root, r * n_cols + c, r * n_cols + c + 1)
    return right, down


@numba.njit  # of several signatures: no cache of its own (see .ci/signatures)
def _price(right: np.ndarray, down: np.ndarray, r: int, c: int, vertical: int) -> int:
    """Return how many turns the link from (r, c) down (`vertical` 1) or right (0) would add."""
    up_a, down_a, left_a, right_a = _links(right, down, r, c)
    up_b, down_b, left_b, right_b = _links(right, down, r + vertical, c + 1 - vertical)
    before = _turns_at(up_a, down_a, left_a, right_a) + _turns_at(up_b, down_b, left_b, right_b)
    if vertical:
        return _turns_at(up_a, 1, left_a, right_a) + _turns_at(1, down_b, left_b, right_b) - before
    return _turns_at(up_a, down_a, left_a, 1) + _turns_at(up_b, down_b, 1, right_b) - before


@numba.njit(cache=True)
def _links(right: np.ndarray, down: np.ndarray, r: int, c: int) -> tuple[int, int, int, int]:
    """Return 0 or 1 for the tree's links of (r, c): up, down, left, right."""
    up = 1 if r > 0 and down[r - 1, c] else 0
    left = 1 if c > 0 and right[r, c - 1] else 0
    return up, 1 if down[r, c] else 0, left, 1 if right[r, c] else 0


@numba.njit  # of several signatures: no cache of its own (see .ci/signatures)
def _turns_at(up: int, down: int, left: int, right: int) -> int:
    """Return how often the walk around the tree turns at a hypervertex with these links."""
    degree = up + down + left + right
    if degree == 0 or degree == 4:
        return 4
    if degree == 2 and up == down:
        return 0
    return 2


@numba.njit(cache=True)
def _unite(root: np.ndarray, a: int, b: int) -> bool:
    """Unite the trees of a and b; False if they are one already."""
    while root[a] != a:
        root[a] = root[root[a]]
        a = root[a]
    while root[b] != b:
        root[b] = root[root[b]]
        b = root[b]
    if a == b:
        return False
    root[max(a, b)] = min(a, b)
    return True


@numba.njit(cache=True)
def tree_turns(right: np.ndarray, down: np.ndarray, labels: np.ndarray, k: int) -> np.ndarray:
    """Return (k,) turns of the closed walk around each region's tree."""
    turns = np.zeros(k, dtype=np.int64)
    for r in range(labels.shape[0]):
        for c in range(labels.shape[1]):
            if labels[r, c] >= 0:
                up, below, left, after = _links(right, down, r, c)
                turns[labels[r, c]] += _turns_at(up, below, left, after)
    return turns
