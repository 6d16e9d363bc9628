"""The one evaluator: when every task starts, what the schedule costs, and whether anything is broken."""

import numpy as np
from numba import njit

from quarterdeck.mission.tours.problem import LINEAR, POWER, Problem

LATE = 1000.0  # seconds of cost a second of lateness or of missing endurance, so that no saving ever buys one


@njit(cache=True)
def value(p: Problem, seq: np.ndarray, length: np.ndarray, smooth: float, start: np.ndarray, done: np.ndarray) -> float:
    """Return what the searches minimise: objective + `smooth` x total tour time + penalties; inf if it cannot be executed.

    `seq` (k, n) int task indices of which the first `length[r]` of row r count; tasks may be missing. `start` (n,) and
    `done` (k,) receive the start of service of each task (-2: missing) and the time at which each robot is home.
    """
    objective, total, late = schedule(p, seq, length, start, done)
    return objective + smooth * total + LATE * late


@njit(cache=True)
def schedule(
    p: Problem, seq: np.ndarray, length: np.ndarray, start: np.ndarray, done: np.ndarray
) -> tuple[float, float, float]:
    """Return the objective, the total tour time and the seconds of lateness and missing endurance; see `value`.

    Every task starts as soon as its robot is there, its window is open and those before it are finished: the longest path
    over route arcs and precedence arcs. inf where the robots would wait for each other for ever, a robot may not do a task,
    a group is torn apart or a higher tier comes after a lower one.
    """
    k = length.shape[0]
    start[:] = -2.0
    todo = 0
    can, tier, service, opens, closes = p.can, p.tier, p.service, p.opens, p.closes  # out of the tuple once: it costs
    travel, out, before, coupled = p.travel, p.out, p.before, p.coupled
    for r in range(k):
        todo += length[r]
        for i in range(length[r]):
            task = seq[r, i]
            start[task] = -1.0
            if not can[r, task] or (i > 0 and tier[task] > tier[seq[r, i - 1]]):
                return np.inf, np.inf, np.inf
    if coupled and not _whole(p.group, seq, length):
        return np.inf, np.inf, np.inf
    if p.paper:
        return _paper(p, seq, length, start, done)
    place = np.zeros(k, np.int64)
    done[:] = 0.0
    late = 0.0
    moved = True
    while moved and todo > 0:
        moved = False
        for r in range(k):
            c = p.kind[r]
            while place[r] < length[r]:
                task = seq[r, place[r]]
                ready = _ready(before, service, task, start) if coupled else 0.0
                if ready < 0.0:
                    break
                leg = out[r, task] if place[r] == 0 else travel[c, seq[r, place[r] - 1], task]
                start[task] = max(done[r] + leg, opens[task], ready)
                late += max(0.0, start[task] - closes[task])
                done[r] = start[task] + service[task]
                place[r] += 1
                todo -= 1
                moved = True
    if todo > 0:
        return np.inf, np.inf, np.inf
    makespan = 0.0
    total = 0.0
    for r in range(k):
        done[r] += p.home[r, seq[r, length[r] - 1]] if length[r] > 0 else p.idle[r]
        late += max(0.0, done[r] - p.endurance[r])
        total += done[r]
        makespan = max(makespan, done[r])
    weight, linear = p.weight, p.shape == LINEAR
    for task in range(start.shape[0]):
        if start[task] >= 0.0 and weight[task] > 0.0:
            makespan += weight[task] * (start[task] if linear else shaped(p, start[task]))
    return makespan, total, late


@njit(cache=True)
def shaped(p: Problem, t: float) -> float:
    """Return the priority function of a time in seconds, itself in seconds.

    linear t; power a (t / a)^b; logistic a / (1 + exp((a - t) / b)), which is half of a at t = a.
    """
    if p.shape == LINEAR:
        return t
    if p.shape == POWER:
        return p.shape_a * (t / p.shape_a) ** p.shape_b
    return p.shape_a / (1.0 + np.exp(min((p.shape_a - t) / p.shape_b, 700.0)))


@njit(cache=True)
def _whole(group: np.ndarray, seq: np.ndarray, length: np.ndarray) -> bool:
    rider = np.full(group.shape[0], -1, np.int64)
    for r in range(length.shape[0]):
        for i in range(length[r]):
            g = group[seq[r, i]]
            if g >= 0:
                if rider[g] >= 0 and rider[g] != r:
                    return False
                rider[g] = r
    return True


@njit(cache=True)
def _ready(before: np.ndarray, service: np.ndarray, task: int, start: np.ndarray) -> float:
    """Return when those before `task` are finished (the missing do not count), or -1 if one has not started."""
    ready = 0.0
    for q in range(before.shape[1]):
        first = before[task, q]
        if first < 0:
            break
        if start[first] != -2.0:
            if start[first] < 0.0:
                return -1.0
            ready = max(ready, start[first] + service[first])
    return ready


@njit(cache=True)
def _paper(
    p: Problem, seq: np.ndarray, length: np.ndarray, start: np.ndarray, done: np.ndarray
) -> tuple[float, float, float]:
    """The literal objective, eq. 2 and 4-6: the largest tour cost; `start` and `done` are costs, not seconds.

    A leg costs travel plus service at its end (6). With priority g > 0 it costs f(p) instead (5), where p is the leg plus
    the legs before it as they were revised (4): g p, p^g, or g times the logistic function of p.
    """
    worst = 0.0
    total = 0.0
    late = 0.0
    for r in range(length.shape[0]):
        cost = 0.0
        clock = 0.0
        for i in range(length[r]):
            task = seq[r, i]
            for first in range(start.shape[0]):
                if p.pred[task, first] and start[first] == -1.0:
                    return np.inf, np.inf, np.inf  # the same robot, so not yet visited means later
            leg = p.out[r, task] if i == 0 else p.travel[p.kind[r], seq[r, i - 1], task]
            clock += leg + p.service[task]
            leg += p.service[task]
            g = p.level[task]
            if g > 0.0:
                if p.shape == LINEAR:
                    leg = g * (cost + leg)
                elif p.shape == POWER:
                    leg = (cost + leg) ** g
                else:
                    leg = g * shaped(p, cost + leg)
            cost += leg
            start[task] = cost
        back = p.home[r, seq[r, length[r] - 1]] if length[r] > 0 else p.idle[r]
        late += max(0.0, clock + back - p.endurance[r])
        done[r] = cost + back
        total += done[r]
        worst = max(worst, done[r])
    return worst, total, late
