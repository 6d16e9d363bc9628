"""What a division can reach at best: the fairest targets, and a bound that none can beat.

Loads are cells over share. Pockets are what the starts cut the free cells into: a region can't pass through another's
start, so a pocket's cells go to the vehicles beside it. What lies behind necks is bounded in chambers.py.
"""

import math
from dataclasses import dataclass

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


def pocket_bound(reachable: np.ndarray, starts: np.ndarray, loads: np.ndarray, shares: np.ndarray) -> Bound:
    """Return the better of two bounds: all cells over all shares, and the fairest load of the fullest pockets.

    Arguments as in `fair_targets`, which gives `loads`.
    """
    total = int(reachable.sum())
    heaviest = float(loads.max())
    if heaviest <= total * (1 + 1e-9):
        return Bound(float(total), f"{total} cells shared by {len(starts)} vehicles")
    few = loads > heaviest * (1 - 1e-9)
    cells = round(heaviest * float(shares[few].sum()))
    return Bound(heaviest, f"the other starts shut {cells} cells in with {few.sum()} of {len(starts)} vehicles")


def cells_at_least(bound: Bound, shares: np.ndarray) -> np.ndarray:
    """Return (k,) cells: some vehicle's region has at least its number of these."""
    return np.array([math.ceil(bound.load * share - 1e-6) for share in shares], dtype=np.int64)
