"""The search as a whole: generations until a budget of iterations, a deadline, a proof or Ctrl-C ends it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from quarterdeck.geo.deadline import cause, running_time, time_is_up
from quarterdeck.mission.tours.bound import lower_bound
from quarterdeck.mission.tours.genetic import generation, population, settle
from quarterdeck.mission.tours.problem import Problem
from quarterdeck.mission.tours.rng import stream
from quarterdeck.mission.tours.schedule import schedule

ITERATIONS = 100
ROUNDS = 20  # of ruin and recreate in a generation, for each task; and at least
LEAST_ROUNDS = 200
COUPLED = 1_000_000  # rounds x tasks^2 at most where whole schedules are judged, unless that is less than the least
PATIENCE = 25  # generations without improvement after which a search without a time limit ends


@dataclass(frozen=True, slots=True)
class Solution:
    """Who does what when. `rows` holds each robot's task indices in order, `start` (n,) when service starts, `done` (k,)
    when a robot is home (under the paper's objective both are its costs); `late` the seconds of lateness and missing
    endurance.

    `objective` is exact, `bound` what nothing can beat; `stopped` says what ended the search: `iterations`, `patience`,
    `time limit`, `proved optimal` or `interrupted`.
    """

    rows: tuple[tuple[int, ...], ...]
    start: np.ndarray
    done: np.ndarray
    objective: float
    total: float
    late: float
    bound: float
    iterations: int
    stopped: str


def search(
    p: Problem,
    *,
    iterations: int | None = ITERATIONS,
    time_limit: float | None = None,
    first: Sequence[Sequence[int]] | None = None,
    seed: int = 0,
    clock: Callable[[], float] = running_time,
    progress: Callable[[int, float, float], None] | None = None,
) -> Solution:
    """Return the best solution found; the same for the same problem, seed and iterations, unless `time_limit` cuts it.

    `time_limit` is seconds of `clock`; `progress` is told iteration, best objective and bound after each. Ctrl-C ends the
    search with the best so far. Every task must have a robot that can do it. `first` are rows to begin with, where some are
    known, such as what is left of a plan: tasks that are in none are put in, and nothing is sought from scratch.
    """
    begun = clock()
    n = p.service.size
    bound = lower_bound(p)
    pop = population(p, stream(seed))
    rounds = max(LEAST_ROUNDS, min(ROUNDS * n, COUPLED // n**2) if p.coupled else ROUNDS * n)
    if first is not None and n:
        seq, length = np.zeros(p.out.shape, np.int64), np.array([len(row) for row in first], np.int64)
        for r, row in enumerate(first):
            seq[r, : len(row)] = row
        settle(p, pop, seq, length, rounds)
    done, stopped = 0, "iterations"
    best, since = np.inf, 0
    try:
        while pop.tally[0] == 0 or iterations is None or done < iterations:
            generation(p, pop, rounds)
            done += 1
            if progress is not None:
                progress(done, float(pop.cost[0, 0]), bound)
            if n < 2 or pop.cost[0, 0] <= bound * (1 + 1e-12):
                stopped = "proved optimal"
                break
            since = since + 1 if pop.cost[0, 0] >= best else 0
            best = float(pop.cost[0, 0])
            if time_limit is None and since == PATIENCE:
                stopped = "patience"
                break
            if time_limit is not None and clock() - begun >= time_limit:
                stopped = "time limit"
                break
            if time_is_up("the search for shorter tours"):
                stopped = cause()
                break
    except KeyboardInterrupt:
        if pop.tally[0] == 0:
            raise
        stopped = "interrupted"
    return solution(p, pop.seq[0], pop.length[0], bound, done, stopped)


def solution(p: Problem, seq: np.ndarray, length: np.ndarray, bound: float, iterations: int, stopped: str) -> Solution:
    """Return the solution that the rows of `seq` are."""
    k, n = p.out.shape
    start, done = np.empty(n), np.empty(k)
    objective, total, late = schedule(p, seq, length, start, done)
    rows = tuple(tuple(int(task) for task in seq[r, : length[r]]) for r in range(k))
    return Solution(rows, start, done, objective, total, late, bound, iterations, stopped)
