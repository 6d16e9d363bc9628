"""Tours past all guards so that the last robot is home soon: min-max, closed, over given distances, by annealing."""

from collections.abc import Sequence

import numpy as np
from numba import njit

from quarterdeck.geo.deadline import time_is_up

POWER = 12.0  # of the norm that stands for the maximum while searching
STEPS = 120_000  # proposals, and as many more for each guard:
STEPS_A_GUARD = 15_000


def improve_tours(
    lengths: np.ndarray,
    tours: Sequence[Sequence[int]],
    speeds: np.ndarray,
    *,
    ranks: np.ndarray | None = None,
    effort: float = 1.0,
    seed: int = 0,
) -> list[list[int]]:
    """Return tours of a makespan not above that of `tours`, found from them by simulated annealing.

    `lengths` (m + 2 k, m + 2 k) metres between the m guards, the k robots' starts, then their ends; every guard is on one
    of the k tours; `speeds` (k,) m/s. With `ranks` (m,), no robot visits a guard before one of a higher rank, and higher
    ranks are done as soon as can be, whatever that costs the makespan. `effort` scales the number of steps.
    """
    k = len(tours)
    m = len(lengths) - 2 * k
    rank = np.zeros(m, dtype=np.int64) if ranks is None else np.asarray(ranks)
    levels = np.unique(rank)[::-1]
    places, ends = np.arange(m, m + k), np.arange(m + k, m + 2 * k)
    spent = np.zeros(k)  # seconds until a robot has done the higher ranks
    orders: list[list[int]] = [[] for _ in range(k)]
    for level in levels:
        mine = np.flatnonzero(rank == level)
        number = {int(g): i for i, g in enumerate(mine)}
        used = np.concatenate([mine, places, ends])
        part = np.where(np.isfinite(lengths), lengths, 1e12)[np.ix_(used, used)]
        if level != levels[-1]:  # not home yet: what counts is when the last of this rank is seen
            part[:, -k:] = part[-k:, :] = 0.0
        begin = [[number[g] for g in tour if rank[g] == level] for tour in tours]
        for robot, order in enumerate(_improved(part, begin, np.asarray(speeds, dtype=float), spent, effort, seed)):
            walk = [places[robot], *mine[order]]
            spent[robot] += lengths[walk[:-1], walk[1:]].sum() / speeds[robot]
            orders[robot] += mine[order].tolist()
            places[robot] = walk[-1]
    return orders


def _improved(
    lengths: np.ndarray, tours: Sequence[Sequence[int]], speeds: np.ndarray, spent: np.ndarray, effort: float, seed: int
) -> list[list[int]]:
    """Return shorter tours of one rank, for robots that have spent (k,) seconds already."""
    k, m = len(tours), len(lengths) - 2 * len(tours)
    if m < 2:
        return [list(t) for t in tours]
    rows, sizes = np.full((k, m), -1, dtype=np.int64), np.array([len(t) for t in tours], dtype=np.int64)
    for robot, tour in enumerate(tours):
        rows[robot, : len(tour)] = tour
    away = lengths[:m, :m] + np.diag(np.full(m, np.inf))
    near = np.argsort(away, axis=1, kind="stable")[:, : min(12, m - 1)]
    steps = 0 if time_is_up("the search for shorter tours") else int(effort * (STEPS + STEPS_A_GUARD * m))
    best, best_sizes = _anneal(lengths, rows, sizes, speeds, spent, near, steps, seed)
    return [best[robot, : best_sizes[robot]].tolist() for robot in range(k)]


def tour_times(lengths: np.ndarray, tours: Sequence[Sequence[int]], speeds: np.ndarray) -> np.ndarray:
    """Return the (k,) seconds that tours take, laid out as in `improve_tours`."""
    k = len(tours)
    m = len(lengths) - 2 * k
    walks = [[m + r, *tour, m + k + r] for r, tour in enumerate(tours)]
    return np.array([lengths[w[:-1], w[1:]].sum() for w in walks]) / speeds


def makespan_bound(lengths: np.ndarray, speeds: np.ndarray) -> float:
    """Return seconds that no tours past all guards can beat, laid out as in `improve_tours`.

    The larger of the longest way out and home that the best placed robot has, and of the work together: all starts and
    ends drawn into one depot, a spanning tree of the guards and the depot under Lagrangian prices on the guards' degrees
    (Held and Karp 1970), and an edge more, over the sum of speeds.
    """
    k = len(speeds)
    m = len(lengths) - 2 * k
    if m == 0:
        return 0.0
    out, home = lengths[m : m + k, :m], lengths[m + k :, :m]
    alone = ((out + home) / np.asarray(speeds)[:, None]).min(axis=0).max()
    depot = np.minimum(out.min(axis=0), home.min(axis=0))
    work = np.zeros((m + 1, m + 1))
    work[:m, :m] = lengths[:m, :m]
    work[m, :m] = work[:m, m] = depot
    if not np.isfinite(work).all():  # robots apart from each other: the sum is no bound by this tree
        return float(alone)
    upper = float(np.sum(work[m, :m]) * 2)
    return float(max(alone, _held_karp(work, upper, 400 if m <= 300 else 60) / np.sum(speeds)))


@njit(cache=True)
def _held_karp(work: np.ndarray, upper: float, rounds: int) -> float:
    n = len(work)
    m = n - 1
    price = np.zeros(n)
    best, step = 0.0, 1.0
    key, parent, done = np.empty(n), np.empty(n, dtype=np.int64), np.empty(n, dtype=np.bool_)
    stalled = 0
    for _ in range(rounds):
        degree = np.zeros(n)
        key[:], parent[:], done[:] = np.inf, -1, False
        key[m] = 0.0
        total = 0.0
        for _ in range(n):
            v = -1
            for w in range(n):
                if not done[w] and (v < 0 or key[w] < key[v]):
                    v = w
            done[v] = True
            total += key[v]
            if parent[v] >= 0:
                degree[v] += 1
                degree[parent[v]] += 1
            for w in range(n):
                if not done[w] and work[v, w] + price[v] + price[w] < key[w]:
                    key[w], parent[w] = work[v, w] + price[v] + price[w], v
        extra, a, b = np.inf, 0, 0  # the tours have at least one edge more than a tree
        for v in range(n):
            for w in range(v + 1, n):
                cost = work[v, w] + price[v] + price[w]
                single = parent[v] != w and parent[w] != v
                if (single or v == m or w == m) and cost < extra:  # out and home by one edge is a tour too
                    extra, a, b = cost, v, w
        degree[a] += 1
        degree[b] += 1
        bound = total + extra - 2 * price[:m].sum()
        if bound > best * (1 + 1e-6):
            stalled = 0
        else:
            stalled += 1
        best = max(best, bound)
        if stalled > 20:
            step, stalled = step / 2, 0
        slope = ((degree[:m] - 2) ** 2).sum()
        if slope == 0:
            break
        price[:m] += step * max(1.05 * upper / 2 - bound, 0.05 * abs(bound)) / slope * (degree[:m] - 2)
    return best


@njit(cache=True)
def _length(d: np.ndarray, row: np.ndarray, size: int, robot: int, m: int, k: int) -> float:
    if size == 0:
        return d[m + robot, m + k + robot]
    total = d[m + robot, row[0]] + d[row[size - 1], m + k + robot]
    for i in range(size - 1):
        total += d[row[i], row[i + 1]]
    return total


@njit(cache=True)
def _anneal(
    d: np.ndarray,
    rows: np.ndarray,
    sizes: np.ndarray,
    speeds: np.ndarray,
    spent: np.ndarray,
    near: np.ndarray,
    steps: int,
    seed: int,
) -> tuple[np.ndarray, np.ndarray]:
    np.random.seed(seed)  # noqa: NPY002 - numba's own
    k, width = rows.shape
    m = len(near)
    rows, sizes = rows.copy(), sizes.copy()
    of, at = np.empty(m, dtype=np.int64), np.empty(m, dtype=np.int64)
    for r in range(k):
        for i in range(sizes[r]):
            of[rows[r, i]], at[rows[r, i]] = r, i
    time = np.array([_length(d, rows[r], sizes[r], r, m, k) / speeds[r] + spent[r] for r in range(k)])
    best_rows, best_sizes, best, best_sum = rows.copy(), sizes.copy(), time.max(), time.sum()
    new = np.empty((2, width), dtype=np.int64)
    scale = max(time.max(), 1e-9)
    energy = ((time / scale) ** POWER).sum() ** (1 / POWER) + 0.02 * time.mean() / scale
    for step in range(steps):
        heat = 0.03 * (1e-3) ** (step / steps)
        a = np.random.randint(m)  # noqa: NPY002
        b = near[a, np.random.randint(near.shape[1])]  # noqa: NPY002
        r, s = of[a], of[b]
        move = np.random.randint(4)  # noqa: NPY002
        i, j = at[a], at[b]
        size_r, size_s = sizes[r], sizes[s]
        if np.random.random() < 0.05:  # noqa: NPY002 - to anywhere, an empty tour too
            s = np.random.randint(k)  # noqa: NPY002
            if s == r:
                continue
            size_s = sizes[s]
            j = np.random.randint(size_s + 1) - 1  # noqa: NPY002
            move = 0
        if r == s:
            if move <= 1:  # turn the stretch between them
                low, high = min(i, j), max(i, j)
                if j > i:
                    low, high = i + 1, j
                else:
                    low, high = j, i - 1
                if high <= low:
                    continue
                new[0, :size_r] = rows[r, :size_r]
                for t in range(high - low + 1):
                    new[0, low + t] = rows[r, high - t]
            else:  # move a stretch that begins at a beside b
                count = min(1 + np.random.randint(3), size_r - i)  # noqa: NPY002
                if i <= j < i + count:
                    continue
                n = 0
                back = np.random.random() < 0.5  # noqa: NPY002
                for t in range(-1, size_r):
                    if t >= 0 and not i <= t < i + count:
                        new[0, n] = rows[r, t]
                        n += 1
                    if t == j:
                        for q in range(count):
                            new[0, n] = rows[r, i + count - 1 - q] if back else rows[r, i + q]
                            n += 1
            other_r, other_s = _length(d, new[0], size_r, r, m, k) / speeds[r] + spent[r], time[s]
            new_r, new_s = size_r, size_s
        else:
            if move <= 1:  # move a stretch behind b
                count = min(1 + np.random.randint(3), size_r - i)  # noqa: NPY002
                back = np.random.random() < 0.5  # noqa: NPY002
                new_r, new_s = size_r - count, size_s + count
                new[0, :i] = rows[r, :i]
                new[0, i:new_r] = rows[r, i + count : size_r]
                new[1, : j + 1] = rows[s, : j + 1]
                for q in range(count):
                    new[1, j + 1 + q] = rows[r, i + count - 1 - q] if back else rows[r, i + q]
                new[1, j + 1 + count : new_s] = rows[s, j + 1 : size_s]
            elif move == 2:  # swap what follows
                new_r, new_s = i + 1 + size_s - j - 1, j + 1 + size_r - i - 1
                new[0, : i + 1] = rows[r, : i + 1]
                new[0, i + 1 : new_r] = rows[s, j + 1 : size_s]
                new[1, : j + 1] = rows[s, : j + 1]
                new[1, j + 1 : new_s] = rows[r, i + 1 : size_r]
            else:  # swap two
                new_r, new_s = size_r, size_s
                new[0, :size_r], new[1, :size_s] = rows[r, :size_r], rows[s, :size_s]
                new[0, i], new[1, j] = b, a
            other_r = _length(d, new[0], new_r, r, m, k) / speeds[r] + spent[r]
            other_s = _length(d, new[1], new_s, s, m, k) / speeds[s] + spent[s]
        old_r, old_s = time[r], time[s]
        time[r] = other_r
        if r != s:
            time[s] = other_s
        after = ((time / scale) ** POWER).sum() ** (1 / POWER) + 0.02 * time.mean() / scale
        if after > energy and np.random.random() >= np.exp((energy - after) / heat):  # noqa: NPY002
            time[r], time[s] = old_r, old_s
            continue
        energy = after
        sizes[r] = new_r
        for t in range(new_r):
            rows[r, t] = new[0, t]
            of[new[0, t]], at[new[0, t]] = r, t
        if r != s:
            sizes[s] = new_s
            for t in range(new_s):
                rows[s, t] = new[1, t]
                of[new[1, t]], at[new[1, t]] = s, t
        most = time.max()
        if most < best * (1 - 1e-12) or (most <= best and time.sum() < best_sum * (1 - 1e-12)):
            best, best_sum = most, time.sum()
            best_rows, best_sizes = rows.copy(), sizes.copy()
    return best_rows, best_sizes
