"""The paper's genetic algorithm as printed, for reproduction: population and generations, tournament of two, order
crossover of a segment, repair, swap mutation; with elitism, which the paper's "preserved" may mean and without which it
forgets.

Under precedence the initial plans obey it (Algorithm 1, each task placed once), no crossover segment overlaps a task that
has one, and nothing mutates, as the paper says.
"""

from collections.abc import Callable

import numpy as np
from numba import njit

from quarterdeck.geo.deadline import cause, running_time, time_is_up
from quarterdeck.mission.tours.genetic import measure_alone
from quarterdeck.mission.tours.problem import Problem
from quarterdeck.mission.tours.rng import below, shuffle, stream, uniform
from quarterdeck.mission.tours.search import Solution, solution

POPULATION = 100  # the authors' settings (configs/example.yaml of their repository)
GENERATIONS = 100
MUTATION = 0.1


def paper_search(
    p: Problem,
    *,
    generations: int = GENERATIONS,
    time_limit: float | None = None,
    seed: int = 0,
    clock: Callable[[], float] = running_time,
    progress: Callable[[int, float, float], None] | None = None,
) -> Solution:
    """Return the best plan of the paper's algorithm; arguments as `search.search`."""
    begun, done, stopped = clock(), 0, "iterations"
    rng = stream(seed)
    plans = np.array([_random_plan(p, rng) for _ in range(POPULATION)])
    fitness = np.array([_fitness(p, plan) for plan in plans])
    try:
        while done < generations:
            plans, fitness = _generation(p, plans, fitness, rng)
            done += 1
            if progress is not None:
                progress(done, float(fitness.min()), 0.0)
            if time_limit is not None and clock() - begun >= time_limit:
                stopped = "time limit"
                break
            if time_is_up("the search for shorter tours"):
                stopped = cause()
                break
    except KeyboardInterrupt:
        stopped = "interrupted"
    seq, length = _rows(plans[int(np.argmin(fitness))])
    return solution(p, seq, length, 0.0, done, stopped)


@njit(cache=True)
def _random_plan(p: Problem, rng: np.ndarray) -> np.ndarray:
    """Algorithm 1: random rows; a task with predecessors is added to one robot after all of them."""
    k, n = p.out.shape
    plan, filled = np.full((k, n), -1, np.int64), np.zeros(k, np.int64)
    placed = np.zeros(n, np.bool_)
    order = np.arange(n)
    shuffle(rng, order)
    for task in order:
        if placed[task]:
            continue
        members = np.zeros(n, np.bool_)
        members[task] = True
        if p.group[task] >= 0:
            members[:] = p.group == p.group[task]
        able = np.flatnonzero(p.can[:, task])
        r = able[below(rng, able.shape[0])]
        left = int(np.sum(members))
        while left > 0:  # those first whose predecessors are placed
            for other in order:
                if members[other] and not placed[other] and not np.any(p.pred[other] & members & ~placed):
                    plan[r, filled[r]] = other
                    filled[r] += 1
                    placed[other] = True
                    left -= 1
    return plan


@njit(cache=True)
def _rows(plan: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    k, n = plan.shape
    seq, length = np.zeros((k, n), np.int64), np.zeros(k, np.int64)
    for r in range(k):
        for i in range(n):
            if plan[r, i] >= 0:
                seq[r, length[r]] = plan[r, i]
                length[r] += 1
    return seq, length


@njit(cache=True)
def _fitness(p: Problem, plan: np.ndarray) -> float:
    seq, length = _rows(plan)
    return measure_alone(p, seq, length)[0]


@njit(cache=True)
def _generation(p: Problem, plans: np.ndarray, fitness: np.ndarray, rng: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    count = plans.shape[0]
    children, worth = plans.copy(), fitness.copy()
    best = np.argmin(fitness)
    children[0], worth[0] = plans[best], fitness[best]
    ordered = p.pred.any()
    for i in range(1, count):
        mother, father = _winner(fitness, rng), _winner(fitness, rng)
        child = _crossover(p, plans[mother], plans[father], rng)
        if not ordered and uniform(rng) < MUTATION:
            _swap(child, rng)
        worth[i] = _fitness(p, child)
        if worth[i] == np.inf:  # what the repair cannot mend is replaced by its mother
            child, worth[i] = plans[mother].copy(), fitness[mother]
        children[i] = child
    return children, worth


@njit(cache=True)
def _winner(fitness: np.ndarray, rng: np.ndarray) -> int:
    a, b = below(rng, fitness.shape[0]), below(rng, fitness.shape[0])
    return a if fitness[a] <= fitness[b] else b


@njit(cache=True)
def _crossover(p: Problem, mother: np.ndarray, father: np.ndarray, rng: np.ndarray) -> np.ndarray:
    """Give the mother the father's slots of a random segment; repair what is then double or missing."""
    k, n = mother.shape
    child = mother.copy()
    low = below(rng, k * n)
    high = min(k * n, low + 1 + below(rng, k * n))
    for slot in range(low, high):  # no segment overlaps a task that has a precedence
        for task in (mother[slot // n, slot % n], father[slot // n, slot % n]):
            if task >= 0 and (p.pred[task].any() or p.pred[:, task].any()):
                return child
    seen = np.zeros(n, np.bool_)
    for slot in range(low, high):
        task = father[slot // n, slot % n]
        child[slot // n, slot % n] = task
        if task >= 0:
            seen[task] = True
    for slot in range(k * n):
        task = child[slot // n, slot % n]
        if (slot < low or slot >= high) and task >= 0:
            if seen[task]:
                child[slot // n, slot % n] = -1
            seen[task] = True
    for task in range(n):  # repair: a missing task goes to a random empty slot of a robot that may do it
        while not seen[task]:
            slot = below(rng, k * n)
            if child[slot // n, slot % n] < 0 and p.can[slot // n, task]:
                child[slot // n, slot % n] = task
                seen[task] = True
    return child


@njit(cache=True)
def _swap(plan: np.ndarray, rng: np.ndarray) -> None:
    """Swap two tasks of one robot's path."""
    r = below(rng, plan.shape[0])
    held = np.flatnonzero(plan[r] >= 0)
    if held.shape[0] > 1:
        a, b = held[below(rng, held.shape[0])], held[below(rng, held.shape[0])]
        plan[r, a], plan[r, b] = plan[r, b], plan[r, a]
