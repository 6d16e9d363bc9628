"""Every plan there is, one by one: the oracle for small problems."""

import numpy as np
from numba import njit

from quarterdeck.mission.tours.problem import Problem
from quarterdeck.mission.tours.schedule import LATE, schedule


@njit(cache=True)
def enumerate_plans(p: Problem) -> tuple[np.ndarray, np.ndarray, float, int]:
    """Return the rows and lengths of the best plan, its objective with penalties, and how many plans can be executed.

    All n! (n + k - 1)! / (n! (k - 1)!) orders and cuts are tried; ties are broken by total tour time, then by order.
    """
    k, n = p.out.shape
    order, cut = np.arange(n), np.zeros(k + 1, np.int64)
    seq, length = np.zeros((k, n), np.int64), np.zeros(k, np.int64)
    best_seq, best_length = seq.copy(), length.copy()
    start, done = np.empty(n), np.empty(k)
    best, best_total, count = np.inf, np.inf, 0
    while True:
        cut[:] = 0
        cut[k] = n
        while True:
            for r in range(k):
                length[r] = cut[r + 1] - cut[r]
                seq[r, : length[r]] = order[cut[r] : cut[r + 1]]
            objective, total, late = schedule(p, seq, length, start, done)
            if objective < np.inf:
                count += 1
                worth = objective + LATE * late
                if worth < best - 1e-9 or (worth <= best + 1e-9 and total < best_total - 1e-9):
                    best, best_total = worth, total
                    best_seq[:] = seq
                    best_length[:] = length
            r = k - 1  # the next way to cut: 0 <= cut[1] <= .. <= cut[k - 1] <= n
            while r > 0 and cut[r] == n:
                r -= 1
            if r == 0:
                break
            cut[r:k] = cut[r] + 1
        i = n - 2  # the next order
        while i >= 0 and order[i] > order[i + 1]:
            i -= 1
        if i < 0:
            return best_seq, best_length, best, count
        j = n - 1
        while order[j] < order[i]:
            j -= 1
        order[i], order[j] = order[j], order[i]
        order[i + 1 :] = order[i + 1 :][::-1].copy()
