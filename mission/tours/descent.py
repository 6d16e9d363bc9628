"""Local search: relocate, or-opt, swap, 2-opt, 2-opt* between tasks that are near each other, until nothing improves."""

import numpy as np
from numba import njit

from quarterdeck.mission.tours.moves import BETWEEN, ENDS, WITHIN, between, ends, within
from quarterdeck.mission.tours.problem import Problem
from quarterdeck.mission.tours.rng import shuffle
from quarterdeck.mission.tours.schedule import LATE, value
from quarterdeck.mission.tours.tables import judge, measure, refresh, tables

NEIGHBOURS = 10  # nearest tasks tried beside each task
LEAST = 1e-4  # part of the value that a move must gain: thousands of smaller ones would balance rows to the millimetre


@njit(cache=True)
def descend(p: Problem, seq: np.ndarray, length: np.ndarray, smooth: float, rng: np.ndarray) -> float:
    """Improve a complete, executable solution in place until no move does; return its value.

    First improvement over tasks in random order; a pair is tried again only if one of its rows has changed since.
    """
    k, n = p.out.shape
    t = tables(p, seq, length)
    start, done = np.empty(n), np.empty(k)
    cost, total = measure(p, t, seq, length, start, done)
    now = cost + smooth * total
    travel, out, home, idle, kind, endurance = p.travel, p.out, p.home, p.idle, p.kind, p.endurance
    begin, end, begins, ends_, weights, barred = t.begin, t.end, t.begins, t.ends, t.weights, t.barred
    duration, urgency, row, place, nearest = t.duration, t.urgency, t.row, t.place, p.near
    order, tried = np.arange(n), np.full(n, -1, np.int64)
    changes, changed = 0, np.zeros(k, np.int64)
    new_u, new_v = np.zeros((5, 4), np.int64), np.zeros((5, 4), np.int64)
    rows = np.empty((4, n), seq.dtype)
    near = min(NEIGHBOURS, n - 1)
    again = True
    while again:
        again = False
        shuffle(rng, order)
        for u in order:
            last, tried[u] = tried[u], changes
            for q in range(near + k):  # beside its neighbours, then at the ends of every row
                v = nearest[u, q] if q < near else -1
                rv = row[v] if q < near else q - near
                if last >= 0 and max(changed[row[u]], changed[rv]) <= last:
                    continue
                ru, i, j = row[u], place[u], place[v]
                few = LEAST * abs(now)
                others = 0.0
                for r in range(k):
                    if r not in (ru, rv):
                        others = max(others, duration[r])
                old = max(others, duration[ru], duration[rv]) + smooth * duration[ru] + urgency[ru]
                old += LATE * max(0.0, duration[ru] - endurance[ru])
                if ru != rv:
                    old += smooth * duration[rv] + urgency[rv] + LATE * max(0.0, duration[rv] - endurance[rv])
                for number in range((WITHIN if ru == rv else BETWEEN) if q < near else ENDS):
                    if q >= near:
                        count = ends(number, ru, i, length[ru] - 1, rv, length[rv] - 1, new_u, new_v)
                    elif ru == rv:
                        count = within(number, ru, i, j, length[ru] - 1, new_u)
                    else:
                        count = between(number, ru, i, length[ru] - 1, rv, j, length[rv] - 1, new_u, new_v)
                    if count == 0:
                        continue
                    if p.coupled:
                        worth = _attempt(p, seq, length, smooth, ru, rv, new_u, new_v, count, now - few, rows, start, done)
                    else:
                        d, weighted = judge(
                            travel, out, home, idle, kind, p.mixed, begin, end, begins, ends_, weights, barred,
                            seq, ru, new_u, count,
                        )  # fmt: skip
                        worth = smooth * d + weighted + LATE * max(0.0, d - endurance[ru])
                        longest = max(others, d)
                        if ru != rv and worth + longest < old - few:
                            d, weighted = judge(
                                travel, out, home, idle, kind, p.mixed, begin, end, begins, ends_, weights, barred,
                                seq, rv, new_v, count,
                            )  # fmt: skip
                            worth += smooth * d + weighted + LATE * max(0.0, d - endurance[rv])
                            longest = max(longest, d)
                        elif ru != rv:
                            continue
                        worth += now - old + longest
                    if worth < now - few:
                        if not p.coupled:
                            _lay(seq, length, ru, rv, new_u, new_v, count, rows)
                        now = worth
                        refresh(p, t, seq, length, ru)
                        refresh(p, t, seq, length, rv)
                        changes += 1
                        changed[ru] = changes
                        changed[rv] = changes
                        again = True
                        break
    return now


@njit(cache=True)
def _attempt(p, seq, length, smooth, ru, rv, new_u, new_v, count, limit, rows, start, done):  # type: ignore[no-untyped-def]
    """Lay the rows out anew and return the value of the whole schedule; undo that unless it is below `limit`."""
    size_u, size_v = length[ru], length[rv]
    rows[2, :size_u] = seq[ru, :size_u]
    rows[3, :size_v] = seq[rv, :size_v]
    _lay(seq, length, ru, rv, new_u, new_v, count, rows)
    worth = value(p, seq, length, smooth, start, done)
    if not worth < limit:
        seq[rv, :size_v] = rows[3, :size_v]
        length[rv] = size_v
        seq[ru, :size_u] = rows[2, :size_u]
        length[ru] = size_u
    return worth


@njit(cache=True)
def _lay(seq, length, ra, rb, new_a, new_b, count, rows):  # type: ignore[no-untyped-def]
    size = _fill(seq, new_a, count, rows[0])
    if rb != ra:
        other = _fill(seq, new_b, count, rows[1])
        length[rb] = other
        seq[rb, :other] = rows[1, :other]
    length[ra] = size
    seq[ra, :size] = rows[0, :size]


@njit(cache=True)
def _fill(seq, new, count, row):  # type: ignore[no-untyped-def]
    size = 0
    for q in range(count):
        r, first, last = new[q, 0], new[q, 1], new[q, 2]
        for i in range(last - first + 1):
            row[size] = seq[r, last - i] if new[q, 3] == 1 else seq[r, first + i]
            size += 1
    return size
