"""Ruin and recreate: strings of tasks near each other are taken out and put back where they cost least; annealed.

Christiaens & Vanden Berghe 2020, "Slack induction by string removals for vehicle routing problems", with insertion by the
min-max objective and the first string mostly from the row that binds.
"""

import numpy as np
from numba import njit

from quarterdeck.mission.tours.problem import Problem
from quarterdeck.mission.tours.rng import below, shuffle, uniform
from quarterdeck.mission.tours.schedule import LATE, value
from quarterdeck.mission.tours.tables import Tables, measure, refresh, tables

REMOVED = 10  # tasks taken out a round, on average
STRING = 10  # longest string
BLINK = 0.01  # chance that a place is not looked at


@njit(cache=True)
def ruin_recreate(
    p: Problem,
    seq: np.ndarray,
    length: np.ndarray,
    rounds: int,
    heat: tuple[float, float],
    smooth: tuple[float, float],
    rng: np.ndarray,
) -> tuple[float, float]:
    """Improve a complete, executable solution in place; return the objective with penalties and the total of the best.

    Over the `rounds` of annealing the temperature goes from the first of `heat` to the second, in units of the objective,
    and so does the part of the total tour time that counts, `smooth`: at first it guides rows that do not bind.
    """
    k, n = p.out.shape
    start = np.empty(n)
    done = np.empty(k)
    t = tables(p, seq, length)
    cost, total = measure(p, t, seq, length, start, done)
    best = (cost, total)
    best_seq, best_length = seq.copy(), length.copy()
    now_seq, now_length = seq.copy(), length.copy()
    absent = np.empty(n, np.int64)
    temperature, thin = heat[0], smooth[0]
    for _ in range(rounds):
        touched = np.zeros(k, np.bool_)
        count = _ruin(p, t, seq, length, absent, touched, rng)
        then, then_total = np.inf, np.inf
        if recreate(p, t, seq, length, absent, count, touched, thin, rng, start, done):
            then, then_total = measure(p, t, seq, length, start, done)
        if then + thin * then_total < cost + thin * total - temperature * np.log(1.0 - uniform(rng)):
            cost, total = then, then_total
            for r in range(k):
                if touched[r]:
                    now_length[r] = length[r]
                    now_seq[r, : length[r]] = seq[r, : length[r]]
            if better(cost, total, best[0], best[1]):
                best = (cost, total)
                best_length[:] = length
                best_seq[:] = seq
        else:
            for r in range(k):
                if touched[r]:
                    length[r] = now_length[r]
                    seq[r, : length[r]] = now_seq[r, : length[r]]
                    refresh(p, t, seq, length, r)
        temperature *= (heat[1] / heat[0]) ** (1.0 / rounds)
        thin *= (smooth[1] / smooth[0]) ** (1.0 / rounds)
    seq[:] = best_seq
    length[:] = best_length
    return best


@njit(cache=True)
def better(cost: float, total: float, other_cost: float, other_total: float) -> bool:
    """Whether the first is less in cost, or equal in cost and less in total."""
    few = 1e-9 * (1.0 + abs(other_cost)) if other_cost < np.inf else 0.0
    return cost < other_cost - few or (cost <= other_cost + few and total < other_total - 1e-9 * (1.0 + abs(other_total)))


@njit(cache=True)
def _ruin(p: Problem, t: Tables, seq, length, absent, touched, rng) -> int:  # type: ignore[no-untyped-def]
    """Take out strings around a random task, whole groups with them; return how many tasks `absent` now holds."""
    k, n = p.out.shape
    longest = min(float(STRING), n / max(np.sum(length > 0), 1))
    strings = int(1 + uniform(rng) * max(4.0 * REMOVED / (1.0 + longest) - 1.0, 1.0))
    seed = below(rng, n)
    if uniform(rng) < 0.5:
        binding = np.argmax(t.duration)
        if length[binding] > 0:
            seed = seq[binding, below(rng, length[binding])]
    count = 0
    gone = np.zeros(n, np.bool_)
    cut = np.zeros(k, np.bool_)
    for near in range(-1, n - 1):
        if strings == 0:
            break
        task = seed if near < 0 else p.near[seed, near]
        r = t.row[task]
        if gone[task] or cut[r]:
            continue
        cut[r] = True
        strings -= 1
        size = 1 + int(uniform(rng) * min(longest, float(length[r])))
        size = min(size, length[r])
        kept = 0  # split string: so many in the middle of the string stay
        if size > 1 and size < length[r] and uniform(rng) < 0.5:
            kept = 1
            while size + kept < length[r] and uniform(rng) > 0.01 and kept < size:
                kept += 1
                if uniform(rng) < 0.5:
                    break
        span = size + kept
        low = max(0, t.place[task] - span + 1)
        high = min(t.place[task], length[r] - span)
        first = low + below(rng, high - low + 1)
        stay = below(rng, size) if kept > 0 else 0
        for i in range(first, first + span):
            if kept > 0 and first + stay <= i < first + stay + kept:
                continue
            if not gone[seq[r, i]]:
                gone[seq[r, i]] = True
                absent[count] = seq[r, i]
                count += 1
    if p.coupled:
        for q in range(count):
            g = p.group[absent[q]]
            for task in range(n if g >= 0 else 0):
                if p.group[task] == g and not gone[task]:
                    gone[task] = True
                    absent[count] = task
                    count += 1
    for q in range(count):
        touched[t.row[absent[q]]] = True
    for r in range(k):
        if touched[r]:
            size = 0
            for i in range(length[r]):
                if not gone[seq[r, i]]:
                    seq[r, size] = seq[r, i]
                    size += 1
            length[r] = size
            refresh(p, t, seq, length, r)
    return count


@njit  # of several signatures: no cache of its own (see .ci/signatures)
def recreate(p: Problem, t: Tables, seq, length, absent, count, touched, smooth, rng, start, done) -> bool:  # type: ignore[no-untyped-def]
    """Put `count` absent tasks back, each where it costs least at that moment; False if one has no place."""
    shuffle(rng, absent[:count])
    rule = below(rng, 8)
    if rule >= 4:  # else random order
        key = np.empty(count)
        for q in range(count):
            far = np.min(p.out[:, absent[q]])
            key[q] = -far if rule < 6 else far if rule == 6 else -(p.weight[absent[q]] * 1e6 + p.service[absent[q]])
        order = np.argsort(key, kind="mergesort")
        absent[:count] = absent[:count][order]
    for q in range(count):
        task = absent[q]
        row, gap = (
            _place_coupled(p, seq, length, task, smooth, rng, start, done)
            if p.coupled
            else _place(p, t, seq, length, task, smooth, rng)
        )
        if row < 0:
            return False
        for i in range(length[row], gap, -1):
            seq[row, i] = seq[row, i - 1]
        seq[row, gap] = task
        length[row] += 1
        touched[row] = True
        refresh(p, t, seq, length, row)
    return True


@njit(cache=True)
def _place(p: Problem, t: Tables, seq, length, task, smooth, rng) -> tuple[int, int]:  # type: ignore[no-untyped-def]
    k = length.shape[0]
    travel, out, home, can, duration = p.travel, p.out, p.home, p.can, t.duration  # out of the tuples once, not in the loop
    end, weights, endurance = t.end, t.weights, p.endurance
    first, second, binding = 0.0, 0.0, -1
    for r in range(k):
        if duration[r] > first:
            second, first, binding = first, duration[r], r
        else:
            second = max(second, duration[r])
    best, row, gap = np.inf, -1, -1
    service, weight = p.service[task], p.weight[task]
    for r in range(k):
        if not can[r, task]:
            continue
        c = p.kind[r]
        size = length[r]
        others = second if r == binding else first
        for i in range(size + 1):
            if uniform(rng) < BLINK:
                continue
            before = out[r, task] if i == 0 else travel[c, seq[r, i - 1], task]
            after = home[r, task] if i == size else travel[c, task, seq[r, i]]
            if size == 0:
                old = p.idle[r]
            elif i == 0:
                old = out[r, seq[r, 0]]
            elif i == size:
                old = home[r, seq[r, i - 1]]
            else:
                old = travel[c, seq[r, i - 1], seq[r, i]]
            more = before + after + service - old
            longer = duration[r] + more
            worth = max(others, longer) + smooth * more
            if longer > endurance[r]:
                worth += LATE * (longer - max(endurance[r], duration[r]))
            if size > 0:
                behind = weights[r, size - 1] - (weights[r, i - 1] if i > 0 else 0.0)
                worth += behind * more
                if weight > 0.0 and i > 0:
                    before += out[r, seq[r, 0]] + end[c, r, i - 1]
            worth += weight * before
            if worth < best:
                best, row, gap = worth, r, i
    if row < 0:  # every place was blinked away
        for r in range(k):
            if p.can[r, task]:
                return r, length[r]
    return row, gap


@njit(cache=True)
def _place_coupled(p: Problem, seq, length, task, smooth, rng, start, done) -> tuple[int, int]:  # type: ignore[no-untyped-def]
    best, row, gap = np.inf, -1, -1
    for r in range(length.shape[0]):
        if not p.can[r, task]:
            continue
        size = length[r]
        length[r] = size + 1
        for i in range(size, -1, -1):  # from the end, so that one swap a step moves it on
            if i < size:
                seq[r, i + 1] = seq[r, i]
            seq[r, i] = task
            if best < np.inf and uniform(rng) < BLINK:
                continue
            worth = value(p, seq, length, smooth, start, done)
            if worth < best:
                best, row, gap = worth, r, i
        for i in range(size):
            seq[r, i] = seq[r, i + 1]
        length[r] = size
    return row, gap
