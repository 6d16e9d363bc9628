"""Prefix sums over the rows of a solution: any new row made of pieces of old ones is judged in a few operations.

Vidal et al. 2014, "A unified solution framework for multi-attribute vehicle routing problems", sec. 4.2, with starts of
service weighted for priority, kept for each class of robot, since a piece may move to a robot of another speed.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from quarterdeck.mission.tours.problem import Problem
from quarterdeck.mission.tours.schedule import LATE, schedule


class Tables(NamedTuple):
    """For position i of row r as a robot of class c would do it, clocks counted from the start of service at position 0.

    `begin` (c, k, n) the start of service at i, `end` its end; `begins` and `ends` the sums up to i of weight x these,
    `weights` (k, n) of weights; `barred` (k, k, n) how many tasks up to i the first index may not do. `row`, `place` (n,)
    where a task is; `length` (k,), `duration` (k,), `urgency` (k,) the weighted starts of a row.
    """

    begin: np.ndarray
    end: np.ndarray
    begins: np.ndarray
    ends: np.ndarray
    weights: np.ndarray
    barred: np.ndarray
    row: np.ndarray
    place: np.ndarray
    duration: np.ndarray
    urgency: np.ndarray


@njit(cache=True)
def tables(p: Problem, seq: np.ndarray, length: np.ndarray) -> Tables:
    """Return the tables of a solution; memory for k x n positions."""
    c = p.travel.shape[0]
    k, n = p.out.shape
    t = Tables(
        np.zeros((c, k, n)),
        np.zeros((c, k, n)),
        np.zeros((c, k, n)),
        np.zeros((c, k, n)),
        np.zeros((k, n)),
        np.zeros((k if p.mixed else 1, k, n), np.int64),
        np.full(n, -1, np.int64),
        np.zeros(n, np.int64),
        np.zeros(k),
        np.zeros(k),
    )
    for r in range(k):
        refresh(p, t, seq, length, r)
    return t


@njit(cache=True)
def refresh(p: Problem, t: Tables, seq: np.ndarray, length: np.ndarray, r: int) -> None:
    """Recompute row r."""
    for i in range(length[r]):
        task = seq[r, i]
        t.row[task] = r
        t.place[task] = i
        t.weights[r, i] = p.weight[task] + (t.weights[r, i - 1] if i > 0 else 0.0)
        if p.mixed:
            for robot in range(p.can.shape[0]):
                t.barred[robot, r, i] = (not p.can[robot, task]) + (t.barred[robot, r, i - 1] if i > 0 else 0)
    for c in range(p.travel.shape[0]):
        clock = 0.0
        begins = 0.0
        ends = 0.0
        for i in range(length[r]):
            task = seq[r, i]
            if i > 0:
                clock += p.travel[c, seq[r, i - 1], task]
            t.begin[c, r, i] = clock
            begins += p.weight[task] * clock
            clock += p.service[task]
            t.end[c, r, i] = clock
            ends += p.weight[task] * clock
            t.begins[c, r, i] = begins
            t.ends[c, r, i] = ends
    c = p.kind[r]
    last = length[r] - 1
    if last < 0:
        t.duration[r] = p.idle[r]
        t.urgency[r] = 0.0
    else:
        out = p.out[r, seq[r, 0]]
        t.duration[r] = out + t.end[c, r, last] + p.home[r, seq[r, last]]
        t.urgency[r] = t.begins[c, r, last] + out * t.weights[r, last]


@njit(cache=True)
def judge(  # type: ignore[no-untyped-def]  # arrays one by one: taking them out of the tuples costs more than the sums
    travel, out, home, idle, kind, mixed, begin, end, begins, ends, weights, barred, seq, robot, pieces, count
):
    """Return duration and weighted starts of the row that `robot` would have; inf if it may not do one of the tasks.

    `pieces` (5, 4) int: of which `count` rows count: the row a piece is cut from, its first and last position, and whether
    it is run backwards. Empty pieces, last < first, are left out. The other arrays are those of `Problem` and `Tables`.
    """
    c = kind[robot]
    clock = 0.0
    urgency = 0.0
    before = -1
    for q in range(count):
        r, a, b = pieces[q, 0], pieces[q, 1], pieces[q, 2]
        if b < a:
            continue
        if mixed and barred[robot, r, b] > (barred[robot, r, a - 1] if a > 0 else 0):
            return np.inf, np.inf
        back = pieces[q, 3] == 1
        first = seq[r, b] if back else seq[r, a]
        clock += out[robot, first] if before < 0 else travel[c, before, first]
        weight = weights[r, b] - (weights[r, a - 1] if a > 0 else 0.0)
        if weight > 0.0:
            if back:
                ended = ends[c, r, b] - (ends[c, r, a - 1] if a > 0 else 0.0)
                urgency += weight * (clock + end[c, r, b]) - ended
            else:
                begun = begins[c, r, b] - (begins[c, r, a - 1] if a > 0 else 0.0)
                urgency += begun + weight * (clock - begin[c, r, a])
        clock += end[c, r, b] - begin[c, r, a]
        before = seq[r, a] if back else seq[r, b]
    return clock + (home[robot, before] if before >= 0 else idle[robot]), urgency


@njit(cache=True)
def measure(
    p: Problem, t: Tables, seq: np.ndarray, length: np.ndarray, start: np.ndarray, done: np.ndarray
) -> tuple[float, float]:
    """Return the objective with penalties and the total tour time, from the tables where they suffice."""
    if p.coupled:
        objective, total, late = schedule(p, seq, length, start, done)
        return objective + LATE * late, total
    longest = 0.0
    rest = 0.0
    total = 0.0
    for r in range(t.duration.shape[0]):
        longest = max(longest, t.duration[r])
        rest += t.urgency[r] + LATE * max(0.0, t.duration[r] - p.endurance[r])
        total += t.duration[r]
    return longest + rest, total
