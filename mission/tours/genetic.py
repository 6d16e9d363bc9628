"""The genetic algorithm: tournament, order crossover and swap mutation on giant tours, split into rows, one a
robot, then improved by local search and by ruin and recreate. One loop, stopped and continued at will.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from quarterdeck.mission.tours.descent import descend
from quarterdeck.mission.tours.problem import Problem
from quarterdeck.mission.tours.rng import below, shuffle, uniform
from quarterdeck.mission.tours.ruin import better, recreate, ruin_recreate
from quarterdeck.mission.tours.tables import measure, tables

FOUNDERS = 6  # individuals annealed from scratch before the first crossover
SIZE = 12  # individuals kept
MUTATION = 0.1  # chance that two tasks of a child's giant tour are swapped (the paper's rate)
HEAT = (0.03, 1e-4)  # annealing temperatures of founders, in units of their objective
WARM = (0.003, 1e-4)  # and of children
SMOOTH = (0.1, 3e-4)


class Population(NamedTuple):
    """`seq` (SIZE, k, n) and `length` (SIZE, k) the solutions, `cost` (SIZE, 2) objective and total tour time, best first;
    `tally` (2,) how many there are, and how many generations have passed; `rng` the random stream.
    """

    seq: np.ndarray
    length: np.ndarray
    cost: np.ndarray
    tally: np.ndarray
    rng: np.ndarray


def population(p: Problem, rng: np.ndarray) -> Population:
    """Return an empty population."""
    k, n = p.out.shape
    return Population(
        np.zeros((SIZE, k, n), np.int64),
        np.zeros((SIZE, k), np.int64),
        np.full((SIZE, 2), np.inf),
        np.zeros(2, np.int64),
        rng,
    )


@njit(cache=True)
def generation(p: Problem, pop: Population, rounds: int) -> None:
    """Breed one individual, with `rounds` of ruin and recreate, and let it replace the worst if it is better and new."""
    k, n = p.out.shape
    seq, length = np.zeros((k, n), np.int64), np.zeros(k, np.int64)
    founding = pop.tally[1] < FOUNDERS or pop.tally[0] == 0
    if founding:
        tour = np.arange(n)
        shuffle(pop.rng, tour)
    else:
        tour = _order_crossover(pop, _tournament(pop), _tournament(pop))
        if uniform(pop.rng) < MUTATION:
            a, b = below(pop.rng, n), below(pop.rng, n)
            tour[a], tour[b] = tour[b], tour[a]
    pop.tally[1] += 1
    if not _decode(p, tour, seq, length, pop.rng):
        return
    smooth = SMOOTH[0] * (0.3 + uniform(pop.rng))
    if not founding:
        descend(p, seq, length, 0.3 * smooth, pop.rng)
    scale = min(pop.cost[0, 0], 1e300) if pop.tally[0] > 0 else measure_alone(p, seq, length)[0]
    heat = (HEAT[0] * scale, HEAT[1] * scale) if founding else (WARM[0] * scale, WARM[1] * scale)
    cost, total = ruin_recreate(p, seq, length, rounds, heat, (smooth, SMOOTH[1]), pop.rng)
    _keep(pop, seq, length, cost, total)


@njit(cache=True)
def settle(p: Problem, pop: Population, seq: np.ndarray, length: np.ndarray, rounds: int) -> None:
    """Put the tasks that rows lack into them, improve them, and begin the population with them instead of founders."""
    k, n = p.out.shape
    absent, count = np.empty(n, np.int64), 0
    there = np.zeros(n, np.bool_)
    for r in range(k):
        there[seq[r, : length[r]]] = True
    for task in range(n):
        if not there[task]:
            absent[count] = task
            count += 1
    start, done = np.empty(n), np.empty(k)
    t = tables(p, seq, length)
    if count and not recreate(p, t, seq, length, absent, count, np.zeros(k, np.bool_), SMOOTH[1], pop.rng, start, done):
        return
    scale = measure_alone(p, seq, length)[0]
    if scale == np.inf:
        return
    heat = (WARM[0] * scale, WARM[1] * scale)
    cost, total = ruin_recreate(p, seq, length, rounds, heat, (0.5 * SMOOTH[0], SMOOTH[1]), pop.rng)
    _keep(pop, seq, length, cost, total)
    pop.tally[1] = FOUNDERS


@njit(cache=True)
def measure_alone(p: Problem, seq: np.ndarray, length: np.ndarray) -> tuple[float, float]:
    """Return the objective with penalties and the total tour time of one solution."""
    k, n = p.out.shape
    return measure(p, tables(p, seq, length), seq, length, np.empty(n), np.empty(k))


@njit(cache=True)
def _tournament(pop: Population) -> int:
    return min(below(pop.rng, pop.tally[0]), below(pop.rng, pop.tally[0]))  # they are sorted, best first


@njit(cache=True)
def _order_crossover(pop: Population, mother: int, father: int) -> np.ndarray:
    """Return a giant tour: a segment of the mother's, the other tasks in the father's order after it."""
    one, other = _giant(pop, mother), _giant(pop, father)
    n = one.shape[0]
    low, size = below(pop.rng, n), 1 + below(pop.rng, n)
    child, taken = np.empty(n, np.int64), np.zeros(n, np.bool_)
    for i in range(size):
        child[(low + i) % n] = one[(low + i) % n]
        taken[one[(low + i) % n]] = True
    at = low + size
    for i in range(n):
        task = other[(low + size + i) % n]
        if not taken[task]:
            child[at % n] = task
            at += 1
    return child


@njit(cache=True)
def _giant(pop: Population, parent: int) -> np.ndarray:
    tour = np.empty(pop.seq.shape[2], np.int64)
    at = 0
    for r in range(pop.length.shape[1]):
        size = pop.length[parent, r]
        tour[at : at + size] = pop.seq[parent, r, :size]
        at += size
    return tour


@njit(cache=True)
def _decode(p: Problem, tour: np.ndarray, seq: np.ndarray, length: np.ndarray, rng: np.ndarray) -> bool:
    """Split a giant tour into rows; tasks that then stand where they must not are taken out and put back."""
    k, n = p.out.shape
    split(p, tour, seq, length)
    start, done = np.empty(n), np.empty(k)
    t = tables(p, seq, length)
    if measure(p, t, seq, length, start, done)[0] < np.inf:
        return True
    absent = np.empty(n, np.int64)
    count = 0
    for r in range(k):
        size = 0
        for i in range(length[r]):
            task = seq[r, i]
            bound = p.group[task] >= 0 or p.pred[task].any() or p.pred[:, task].any() or p.tier.any()
            if bound or not p.can[r, task]:
                absent[count] = task
                count += 1
            else:
                seq[r, size] = task
                size += 1
        length[r] = size
    t = tables(p, seq, length)
    return recreate(p, t, seq, length, absent, count, np.zeros(k, np.bool_), SMOOTH[1], rng, start, done)


@njit(cache=True)
def split(p: Problem, tour: np.ndarray, seq: np.ndarray, length: np.ndarray) -> None:
    """Cut a giant tour into one stretch for each robot in turn, so that the objective is least (Prins 2004, min-max).

    Waiting is not seen; a stretch costs its tour time, penalties for what its robot may not do, and weighted starts.
    """
    k, n = p.out.shape
    longest = np.full((k + 1, n + 1), np.inf)  # of the best labels: the longest row and the rest of the objective
    rest = np.full((k + 1, n + 1), np.inf)
    cut = np.zeros((k + 1, n + 1), np.int64)
    longest[0, 0] = 0.0
    rest[0, 0] = 0.0
    for r in range(k):
        c = p.kind[r]
        for i in range(n + 1):
            if longest[r, i] == np.inf:
                continue
            clock = 0.0
            extra = 0.0
            for j in range(i, n + 1):
                if j > i:
                    task = tour[j - 1]
                    clock += p.out[r, task] if j == i + 1 else p.travel[c, tour[j - 2], task]
                    extra += p.weight[task] * clock + (0.0 if p.can[r, task] else 1e6)
                    clock += p.service[task]
                row = clock + (p.home[r, tour[j - 1]] if j > i else p.idle[r])
                high, low = max(longest[r, i], row), rest[r, i] + extra + 1e-3 * row
                if high + low < longest[r + 1, j] + rest[r + 1, j]:
                    longest[r + 1, j] = high
                    rest[r + 1, j] = low
                    cut[r + 1, j] = i
    end = n
    for r in range(k, 0, -1):
        first = cut[r, end]
        length[r - 1] = end - first
        seq[r - 1, : end - first] = tour[first:end]
        end = first


@njit(cache=True)
def _keep(pop: Population, seq: np.ndarray, length: np.ndarray, cost: float, total: float) -> None:
    """Insert a solution at its rank, unless one that is as good is there or the population is full of better ones."""
    count = pop.tally[0]
    rank = 0
    while rank < count and better(pop.cost[rank, 0], pop.cost[rank, 1], cost, total):
        rank += 1
    if rank == pop.seq.shape[0] or (rank < count and not better(cost, total, pop.cost[rank, 0], pop.cost[rank, 1])):
        return
    for i in range(min(count, pop.seq.shape[0] - 1), rank, -1):
        pop.seq[i] = pop.seq[i - 1]
        pop.length[i] = pop.length[i - 1]
        pop.cost[i] = pop.cost[i - 1]
    pop.seq[rank] = seq
    pop.length[rank] = length
    pop.cost[rank, 0] = cost
    pop.cost[rank, 1] = total
    pop.tally[0] = min(count + 1, pop.seq.shape[0])
