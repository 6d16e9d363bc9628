"""The priority TSP: the shortest path through every place of the first class, then of the second, and so on.

Weaver et al. 2025, Alg. 1: the list is split by priority, each part is solved on its own from where the part before it
ended, and the parts are joined; the path is open (the medic does not come back). Exact per class by Held & Karp 1962 up to
`EXACT` places (the paper's brute force gives the same and is kept as the yardstick); beyond, an iterated local search
(2-opt, or-opt) with a lower bound by Lagrangian relaxation of the degrees (Held & Karp 1970), so that the gap is known.
"""

from dataclasses import dataclass
from itertools import permutations

import numba
import numpy as np

EXACT = 15
_KICKS = 40
_ASCENTS = 150


@dataclass(frozen=True, slots=True)
class Order:
    """An order of places: indices into the places given; `length` and the lower `bound` of it in metres.

    The bound holds class by class: each class from where the one before it ended.
    """

    order: tuple[int, ...]
    length: float
    bound: float

    @property
    def gap(self) -> float:
        """How much shorter the order could be at most, as a part of its length; 0 where it is exact."""
        return (self.length - self.bound) / self.length if self.length > self.bound else 0.0


def priority_order(distance: np.ndarray, ranks: np.ndarray, *, exact_to: int = EXACT) -> Order:
    """Return the shortest open path from the start through all places, the lower `ranks` first.

    `distance` is (n + 1, n + 1) symmetric metres, row and column 0 the start; `ranks` (n,) integers, served in increasing
    order. A class of up to `exact_to` (at most 20) places is solved exactly. Ties go to the lower index.
    """
    ranks = np.ascontiguousarray(ranks, dtype=np.int64)
    if len(ranks) == 0:
        return Order((), 0.0, 0.0)
    order, length, bound = _by_class(np.ascontiguousarray(distance, dtype=np.float64), ranks, min(exact_to, 20))
    return Order(tuple(order.tolist()), length, bound)


def brute_force(distance: np.ndarray, ranks: np.ndarray) -> Order:
    """Return what `priority_order` returns by trying every order of each class: the paper's way, for up to 9 a class."""
    order: list[int] = []
    at, total = 0, 0.0
    for rank in sorted(set(np.asarray(ranks).tolist())):
        members = [i + 1 for i, r in enumerate(ranks) if r == rank]
        length, best = min((_path_length(distance, at, p), p) for p in permutations(members))
        order += best
        total += length
        at = best[-1]
    return Order(tuple(i - 1 for i in order), total, total)


def _path_length(distance: np.ndarray, start: int, path: tuple[int, ...]) -> float:
    return float(sum(distance[a, b] for a, b in zip((start, *path), path, strict=False)))


@numba.njit(cache=True)
def _by_class(distance: np.ndarray, ranks: np.ndarray, exact_to: int) -> tuple[np.ndarray, float, float]:
    order = np.empty(len(ranks), np.int64)
    done, at, total, bounds = 0, 0, 0.0, 0.0
    for rank in np.unique(ranks):
        members = np.flatnonzero(ranks == rank) + 1
        n = len(members)
        if n <= exact_to:
            path, length = _held_karp(distance, at, members)
            bound = length
        else:
            path, length = _local_search(distance, at, members)
            bound = min(length, _lower_bound(distance, at, members, length))
        order[done : done + n] = path - 1
        done += n
        at = path[-1]
        total += length
        bounds += bound
    return order, total, bounds


@numba.njit  # of several signatures: no cache of its own (see .ci/signatures)
def _held_karp(distance: np.ndarray, start: int, members: np.ndarray) -> tuple[np.ndarray, float]:
    n = len(members)
    if n == 1:
        return members.copy(), distance[start, members[0]]
    full = (1 << n) - 1
    # cost[s, j]: the shortest way from member j through all of s (j not in s) to wherever it ends; read forwards below
    cost = np.full((1 << n, n), np.inf)
    cost[0, :] = 0.0
    for s in range(1, full):
        for j in range(n):
            if s >> j & 1:
                continue
            best = np.inf
            for k in range(n):
                if s >> k & 1:
                    c = distance[members[j], members[k]] + cost[s & ~(1 << k), k]
                    best = min(best, c)
            cost[s, j] = best
    path = np.empty(n, np.int64)
    left, at, length = full, start, 0.0
    for i in range(n):
        best, chosen = np.inf, -1
        for k in range(n):
            if left >> k & 1:
                c = distance[at, members[k]] + cost[left & ~(1 << k), k]
                if c < best - 1e-12:
                    best, chosen = c, k
        left &= ~(1 << chosen)
        length += distance[at, members[chosen]]
        at = members[chosen]
        path[i] = at
    return path, length


@numba.njit  # of several signatures: no cache of its own (see .ci/signatures)
def _local_search(distance: np.ndarray, start: int, members: np.ndarray) -> tuple[np.ndarray, float]:
    n = len(members)
    path = np.empty(n + 1, np.int64)  # path[0] is the start and stays
    path[0] = start
    left = members.copy()
    for i in range(n):  # nearest neighbour
        k = i + np.argmin(np.array([distance[path[i], left[j]] for j in range(i, n)]))
        left[i], left[k] = left[k], left[i]
        path[i + 1] = left[i]
    _improve(distance, path)
    best, length = path.copy(), _length(distance, path)
    np.random.seed(n)  # noqa: NPY002 - numba's own generator, seeded: the same places give the same order
    for _ in range(_KICKS):
        path[:] = best
        a, b, c = np.sort(np.random.randint(1, n + 1, 3))  # noqa: NPY002
        path[1:] = np.concatenate((best[1:a], best[b:c], best[a:b], best[c:]))  # double bridge
        _improve(distance, path)
        candidate = _length(distance, path)
        if candidate < length - 1e-9:
            length = candidate
            best[:] = path
    return best[1:].copy(), length


@numba.njit(cache=True)
def _length(distance: np.ndarray, path: np.ndarray) -> float:
    total = 0.0
    for i in range(len(path) - 1):
        total += distance[path[i], path[i + 1]]
    return total


@numba.njit(cache=True)
def _improve(distance: np.ndarray, path: np.ndarray) -> None:
    """2-opt and or-opt on an open path whose first place stays, until neither helps."""
    n = len(path)
    better = True
    while better:
        better = False
        for i in range(1, n - 1):  # reverse path[i..j]
            for j in range(i + 1, n):
                gain = distance[path[i - 1], path[i]] - distance[path[i - 1], path[j]]
                if j + 1 < n:
                    gain += distance[path[j], path[j + 1]] - distance[path[i], path[j + 1]]
                if gain > 1e-9:
                    path[i : j + 1] = path[i : j + 1][::-1].copy()
                    better = True
        for size in range(1, 4):  # move path[i..i+size) to between k and k+1
            for i in range(1, n - size + 1):
                e = i + size
                freed = distance[path[i - 1], path[i]]
                if e < n:
                    freed += distance[path[e - 1], path[e]] - distance[path[i - 1], path[e]]
                gain, where = 1e-9, -1
                for k in range(n):
                    if i - 1 <= k < e:
                        continue
                    added = distance[path[k], path[i]]
                    if k + 1 < n:
                        added += distance[path[e - 1], path[k + 1]] - distance[path[k], path[k + 1]]
                    if freed - added > gain:
                        gain, where = freed - added, k
                if where >= 0:
                    segment = path[i:e].copy()
                    if where < i:
                        path[:] = np.concatenate((path[: where + 1], segment, path[where + 1 : i], path[e:]))
                    else:
                        path[:] = np.concatenate((path[:i], path[e : where + 1], segment, path[where + 1 :]))
                    better = True


@numba.njit  # of several signatures: no cache of its own (see .ci/signatures)
def _lower_bound(distance: np.ndarray, start: int, members: np.ndarray, upper: float) -> float:
    """A path is a spanning tree of degree 1 at the start and the end, 2 within: price the degrees and ascend."""
    n = len(members) + 1
    nodes = np.empty(n, np.int64)
    nodes[0] = start
    nodes[1:] = members
    price = np.zeros(n)
    best, step = 0.0, 1.0
    for _ in range(_ASCENTS):
        tree, degree = _spanning_tree(distance, nodes, price)
        end = 1 + np.argmin(price[1:])
        value = tree - price[0] - 2.0 * price[1:].sum() + price[end]
        best = max(best, value)
        slope = degree - 2.0
        slope[0] += 1.0
        slope[end] += 1.0
        norm = (slope * slope).sum()
        if norm == 0.0:
            break
        price += step * max(upper - value, 1e-9) / norm * slope
        step *= 0.98
    return best


@numba.njit(cache=True)
def _spanning_tree(distance: np.ndarray, nodes: np.ndarray, price: np.ndarray) -> tuple[float, np.ndarray]:
    """Prim 1957 on distance + price of both ends: the tree's weight and every node's degree in it."""
    n = len(nodes)
    degree = np.zeros(n)
    near = np.zeros(n, np.int64)
    cost = np.full(n, np.inf)
    inside = np.zeros(n, np.bool_)
    inside[0] = True
    for j in range(1, n):
        cost[j] = distance[nodes[0], nodes[j]] + price[0] + price[j]
    total = 0.0
    for _ in range(n - 1):
        chosen = -1
        for j in range(n):
            if not inside[j] and (chosen < 0 or cost[j] < cost[chosen]):
                chosen = j
        inside[chosen] = True
        total += cost[chosen]
        degree[chosen] += 1.0
        degree[near[chosen]] += 1.0
        for j in range(n):
            c = distance[nodes[chosen], nodes[j]] + price[chosen] + price[j]
            if not inside[j] and c < cost[j]:
                cost[j] = c
                near[j] = chosen
    return total, degree
