"""What necks allow: a bound from the chambers behind them.

Cells at least some distance from a root fall into components, the chambers. Whoever comes into a chamber from outside owns
one of its cells nearest to the root, its entries: no more vehicles than entries can come, and each spends cells on the way.
With those that start inside they must hold the chamber: sum of (load x share) inside, plus the largest (load x share -
cells on the way) from outside, is at least its cells. In a maze every branch is a chamber, whatever the corridor's width.
"""

import numba
import numpy as np

from quarterdeck.coverage.bound import Bound

ROOTS = 16
"""The starts together are one root; the others are cells far from those before."""

CHAMBERS = 32
"""How many chambers of each root, the most crowded ones, are looked at closely."""

MOST_CELLS = 30_000_000
"""How many cells the close looks may take in all."""


def chamber_bound(reachable: np.ndarray, starts: np.ndarray, shares: np.ndarray) -> Bound:
    """Return the best bound that a chamber of `reachable` (R, C) bool proves for `starts` (k, 2) and `shares` (k,)."""
    padded = np.pad(reachable, 1)
    width = padded.shape[1]
    free = padded.ravel()
    cells = (starts[:, 0] + 1) * width + starts[:, 1] + 1
    vehicle = np.full(len(free), -1, dtype=np.int32)
    vehicle[cells] = np.arange(len(cells))
    strongest = np.append(0.0, np.cumsum(np.sort(shares)[::-1]))
    best, proof = 0.0, "no chamber"
    roots = cells
    nearest = np.full(len(free), 2**30)
    looks = min(CHAMBERS, MOST_CELLS // (ROOTS * int(reachable.sum()) + 1))
    for number in range(ROOTS):
        distance, order = _distances(free, roots, width)
        crowd, seeds = _crowded(distance, order, vehicle, shares, strongest, width, number == 0)
        for at in np.argsort(-crowd, kind="stable")[:looks]:
            if crowd[at] <= best and at > looks // 2:
                continue
            load, held, entries, inside = _load(free, distance, seeds[at], vehicle, shares, width)
            if load > best:
                best = load
                proof = f"{held} cells lie behind {entries} entry cells, with {inside} of {len(cells)} starts inside"
        nearest = np.minimum(nearest, np.where(distance < 0, -1, distance))
        roots = np.array([int(nearest.argmax())])
    return Bound(best, proof)


@numba.njit(cache=True)
def _distances(free, roots, width):  # type: ignore[no-untyped-def]
    """Return the steps from the roots (n,), -1 for cells apart, and the cells by distance."""
    distance = np.full(len(free), -1, dtype=np.int32)
    order = np.empty(len(free), dtype=np.int32)
    last = 0
    for root in roots:
        distance[root] = 0
        order[last] = root
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
    return distance, order[:last]


@numba.njit(cache=True)
def _crowded(distance, order, vehicle, shares, strongest, width, from_starts):  # type: ignore[no-untyped-def]
    """Return for each chamber a load that it proves at first sight, and its first entry cell.

    Cells join from far to near; when all at one distance have joined, each component is a chamber. With `from_starts`
    the root is the starts and the distance is spent on the way.
    """
    n = len(distance)
    k = len(shares)
    root = np.full(n, -1, dtype=np.int32)
    size = np.zeros(n, dtype=np.int32)
    inside = np.zeros(n)
    starts = np.zeros(n, dtype=np.int32)
    entries = np.zeros(n, dtype=np.int32)
    crowd = np.zeros(n)
    seeds = np.zeros(n, dtype=np.int32)
    count = 0
    at = len(order) - 1
    while at >= 0 and distance[order[at]] > 0:
        d = distance[order[at]]
        begin = at
        while at >= 0 and distance[order[at]] == d:
            cell = order[at]
            root[cell], size[cell] = cell, 1
            if vehicle[cell] >= 0:
                inside[cell] = shares[vehicle[cell]]
                starts[cell] = 1
            for step in (-1, 1, -width, width):
                if root[cell + step] >= 0:
                    a, b = _find(root, cell), _find(root, cell + step)
                    if a != b:
                        if size[a] < size[b]:
                            a, b = b, a
                        root[b] = a
                        size[a] += size[b]
                        inside[a] += inside[b]
                        starts[a] += starts[b]
            at -= 1
        for i in range(begin, at, -1):
            entries[_find(root, order[i])] = 0
        for i in range(begin, at, -1):
            entries[_find(root, order[i])] += vehicle[order[i]] < 0
        for i in range(begin, at, -1):
            top = _find(root, order[i])
            if entries[top] >= 0:
                w = min(entries[top], k - starts[top])
                power = inside[top] + strongest[w]
                crowd[count] = (size[top] + w * (d if from_starts else 1)) / power if power > 0 else 0.0
                seeds[count] = order[i]
                count += 1
                entries[top] = -1
    return crowd[:count], seeds[:count]


@numba.njit  # of several signatures: no cache of its own (see .ci/signatures)
def _find(root: np.ndarray, a: int) -> int:
    while root[a] != a:
        root[a] = root[root[a]]
        a = root[a]
    return a


@numba.njit(cache=True)
def _load(free, distance, seed, vehicle, shares, width):  # type: ignore[no-untyped-def]
    """Return the load that the chamber of entry cell `seed` proves, its cells, its entries, the starts inside.

    The way to the chamber leads past no other start: it would belong to that vehicle.
    """
    k = len(shares)
    d = distance[seed]
    away = np.full(len(free), -1, dtype=np.int32)
    queue = np.empty(len(free), dtype=np.int32)
    queue[0] = seed
    away[seed] = 0
    first, last, entries = 0, 1, 0
    power = 0.0
    inside = 0
    while first < last:
        cell = queue[first]
        first += 1
        if vehicle[cell] >= 0:
            power += shares[vehicle[cell]]
            inside += 1
        elif distance[cell] == d:
            entries += 1
        for step in (-1, 1, -width, width):
            if away[cell + step] < 0 and distance[cell + step] >= d:
                away[cell + step] = 0
                queue[last] = cell + step
                last += 1
    cells = last
    way = np.full(k, -1, dtype=np.int32)
    last = 0
    for at in range(cells):  # outwards from the entries that no start occupies
        if distance[queue[at]] == d and vehicle[queue[at]] < 0:
            queue[last] = queue[at]
            last += 1
    first = 0
    while first < last:
        cell = queue[first]
        first += 1
        if vehicle[cell] >= 0:
            way[vehicle[cell]] = away[cell]
            continue
        for step in (-1, 1, -width, width):
            if free[cell + step] and away[cell + step] < 0:
                away[cell + step] = away[cell] + 1
                queue[last] = cell + step
                last += 1

    low, high = 0.0, 4.0 * len(free) / shares.min()
    gains = np.zeros(k)
    for _ in range(60):
        load = (low + high) / 2
        for v in range(k):
            gains[v] = max(load * shares[v] - way[v], 0.0) if way[v] > 0 else 0.0
        helpers = np.sort(gains)[::-1][:entries].sum()
        if load * power + helpers >= cells:
            high = load
        else:
            low = load
    return low, cells, entries, inside
