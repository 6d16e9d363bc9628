"""What a division can reach at best: the fairest targets, and a bound that none can beat.

Loads are cells over share. Pockets are what the starts cut the free cells into: a region can't pass through another's
start, so a pocket's cells go to the vehicles beside it. Chambers are what lies farther than a distance from all starts:
only so many vehicles as it has entry cells can work there, and each has spent that distance on the way.
"""

import math
from dataclasses import dataclass

import numba
import numpy as np
from scipy.ndimage import label
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

FLOW_UNITS = 2**30
"""scipy's maximum flow counts in int32; capacities are scaled to this total."""


@dataclass(frozen=True, slots=True)
class Bound:
    """A load that no division beats: `load` in cells per unit of share (shares sum to 1), and why in one line."""

    load: float
    proof: str


def fair_targets(reachable: np.ndarray, starts: np.ndarray, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (k,) whole cells for each vehicle, and the (k,) real loads that they round.

    `reachable` (R, C) bool are the free cells that some start reaches; `starts` (k, 2); `shares` (k,) sum to 1. The loads
    are the fairest that sealed starts and separate parts allow: the largest is least, then the next, and so on (a
    lexicographically optimal base, by the decomposition of Fujishige 1980: a maximum flow, then both sides of its cut).
    """
    k = len(starts)
    pockets, n_pockets, beside = _pockets(reachable, starts)
    sizes = np.concatenate([np.bincount(pockets[pockets > 0] - 1, minlength=n_pockets), np.ones(k, dtype=np.int64)])
    links = np.zeros((n_pockets + k, k), dtype=np.bool_)
    links[beside[:, 0], beside[:, 1]] = True
    links[n_pockets + np.arange(k), np.arange(k)] = True

    loads = np.zeros(k)
    open_ = [(np.arange(n_pockets + k), np.arange(k))]
    while open_:
        some, vehicles = open_.pop()
        if len(vehicles) == 0:
            continue
        load = sizes[some].sum() / shares[vehicles].sum()
        over = _overfull(sizes[some], load * shares[vehicles], links[np.ix_(some, vehicles)])
        heavy = links[np.ix_(some[over], vehicles)].any(axis=0)
        if not over.any() or over.all() or heavy.all():
            loads[vehicles] = load
        else:
            open_ += [(some[over], vehicles[heavy]), (some[~over], vehicles[~heavy])]
    return _round(loads * shares, int(sizes.sum())), loads


def _pockets(reachable: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, int, np.ndarray]:
    """Return the pockets (R, C) from 1, their number, and (m, 2) pairs: pocket from 0, a vehicle beside it."""
    rest = reachable.copy()
    rest[starts[:, 0], starts[:, 1]] = False
    pockets, n = label(rest)
    padded = np.pad(pockets, 1)
    pairs = []
    for d_row, d_col in ((0, 1), (1, 0), (1, 2), (2, 1)):
        pocket = padded[starts[:, 0] + d_row, starts[:, 1] + d_col]
        vehicle = np.flatnonzero(pocket)
        pairs.append(np.column_stack((pocket[vehicle] - 1, vehicle)))
    return pockets, n, np.unique(np.concatenate(pairs), axis=0)


def _overfull(sizes: np.ndarray, capacity: np.ndarray, links: np.ndarray) -> np.ndarray:
    """Return which pockets lie on the source's side of the least cut when pockets flow into vehicles; none if all fit."""
    p, k = links.shape
    scale = FLOW_UNITS / sizes.sum()
    supply = np.floor(sizes * scale).astype(np.int32)
    room = np.ceil(capacity * scale + 1).astype(np.int32)
    at, vehicle = np.nonzero(links)
    rows = np.concatenate([np.zeros(p, dtype=int), 1 + at, 1 + p + np.arange(k)])
    columns = np.concatenate([1 + np.arange(p), 1 + p + vehicle, np.full(k, p + k + 1)])
    graph = csr_array((np.concatenate([supply, supply[at], room]), (rows, columns)), shape=(p + k + 2,) * 2, dtype=np.int32)
    result = maximum_flow(graph, 0, p + k + 1)
    over = np.zeros(p, dtype=np.bool_)
    if result.flow_value < int(supply.sum()):
        residual = csr_array(graph - result.flow)
        residual.eliminate_zeros()
        side = breadth_first_order(residual, 0, return_predecessors=False)
        over[side[(side > 0) & (side <= p)] - 1] = True
    return over


def _round(wanted: np.ndarray, total: int) -> np.ndarray:
    """Return whole numbers, at least 1, nearest to `wanted` that sum to `total` (largest remainder)."""
    whole = np.maximum(np.floor(wanted + 1e-6).astype(np.int64), 1)
    short = total - int(whole.sum())
    if short > 0:
        order = np.argsort(-(wanted - whole), kind="stable")
        whole += short // len(whole)
        whole[order[: short % len(whole)]] += 1
    for _ in range(-short):
        whole[np.argmax(whole - wanted + np.where(whole > 1, 0, -np.inf))] -= 1
    return whole


def lower_bound(reachable: np.ndarray, starts: np.ndarray, shares: np.ndarray, loads: np.ndarray) -> Bound:
    """Return the best bound known: all cells over all shares, the fairest loads of pockets, and the farthest chambers.

    Arguments as in `fair_targets`, which gives `loads`.
    """
    total = int(reachable.sum())
    bounds = [Bound(float(total), f"{total} cells shared by {len(starts)} vehicles")]
    heaviest = float(loads.max())
    if heaviest > total * (1 + 1e-9):
        few = np.flatnonzero(loads > heaviest * (1 - 1e-9))
        cells = round(heaviest * float(shares[few].sum()))
        bounds.append(Bound(heaviest, f"the other starts shut {cells} cells in with {len(few)} of {len(starts)} vehicles"))
    padded = np.pad(reachable, 1)
    width = padded.shape[1]
    flat = (starts[:, 0] + 1) * width + starts[:, 1] + 1
    strongest = np.cumsum(np.sort(shares)[::-1])
    load, cells, entries, away = _chambers(padded.ravel(), flat, width, strongest)
    far = f"{cells} cells lie beyond {entries} entry cells, {away} or more from every start"
    bounds.append(Bound(float(load), far))
    best = bounds[0]
    for other in bounds[1:]:
        if other.load > best.load * (1 + 1e-9):
            best = other
    return best


@numba.njit(cache=True)
def _chambers(free, starts, width, strongest):  # type: ignore[no-untyped-def]
    """Return the largest load that a chamber proves, and the chamber: its cells, entry cells, distance.

    Cells join from far to near; when all at one distance d have joined, each component is a chamber whose entries are its
    cells at d: w vehicles can enter, each with d cells on its way, so w loads less w d cells must hold the chamber.
    """
    n, k = len(free), len(strongest)
    distance = np.full(n, -1, dtype=np.int32)
    order = np.empty(n, dtype=np.int32)
    last = 0
    for start in starts:
        distance[start] = 0
        order[last] = start
        last += 1
    first = 0
    while first < last:
        cell = order[first]
        first += 1
        for step in (-1, 1, -width, width):
            if free[cell + step] and distance[cell + step] < 0:
                distance[cell + step] = distance[cell] + 1
                order[last] = cell + step
                last += 1

    root = np.full(n, -1, dtype=np.int32)
    size = np.zeros(n, dtype=np.int32)
    entries = np.zeros(n, dtype=np.int32)
    best, best_cells, best_entries, best_away = 0.0, 0, 0, 0
    at = last - 1
    while at >= 0 and distance[order[at]] > 0:
        d = distance[order[at]]
        begin = at
        while at >= 0 and distance[order[at]] == d:
            cell = order[at]
            root[cell], size[cell], entries[cell] = cell, 1, 0
            for step in (-1, 1, -width, width):
                if root[cell + step] >= 0:
                    a, b = _find(root, cell), _find(root, cell + step)
                    if a != b:
                        if size[a] < size[b]:
                            a, b = b, a
                        root[b] = a
                        size[a] += size[b]
            at -= 1
        for i in range(begin, at, -1):
            entries[_find(root, order[i])] = 0
        for i in range(begin, at, -1):
            entries[_find(root, order[i])] += 1
        for i in range(begin, at, -1):
            top = _find(root, order[i])
            w = min(entries[top], k)
            load = (size[top] + w * d) / strongest[w - 1]
            if load > best:
                best, best_cells, best_entries, best_away = load, size[top], entries[top], d
    return best, best_cells, best_entries, best_away


@numba.njit(cache=True)
def _find(root: np.ndarray, a: int) -> int:
    while root[a] != a:
        root[a] = root[root[a]]
        a = root[a]
    return a


def cells_at_least(bound: Bound, shares: np.ndarray) -> np.ndarray:
    """Return (k,) cells: some vehicle's region has at least its number of these."""
    return np.array([math.ceil(bound.load * share - 1e-6) for share in shares], dtype=np.int64)
