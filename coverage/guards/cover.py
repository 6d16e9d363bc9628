"""Small set covers by row weighting local search (Gao, Weise and Li 2015), for thousands of sets."""

import numpy as np
from numba import njit
from scipy.sparse import csr_array


def small_cover(covers: csr_array, chosen: np.ndarray, steps: int, *, seed: int = 0) -> np.ndarray:
    """Return indices of few columns of `covers` (rows, columns; what is stored counts) that together cover every row.

    The search begins at the columns `chosen`, completed greedily, and takes `steps` exchanges; the result is never larger.
    Rows that no column covers are left out.
    """
    rows = csr_array(covers)
    columns = csr_array(rows.T)
    taken = np.zeros(covers.shape[1], dtype=np.bool_)
    taken[chosen] = True
    arrays = (rows.indptr, rows.indices, columns.indptr, columns.indices)
    best = _search(*(a.astype(np.int64) for a in arrays), taken, steps, seed)
    return np.flatnonzero(best)


@njit(cache=True)
def _search(
    row_starts: np.ndarray,
    row_columns: np.ndarray,
    column_starts: np.ndarray,
    column_rows: np.ndarray,
    taken: np.ndarray,
    steps: int,
    seed: int,
) -> np.ndarray:
    np.random.seed(seed)  # noqa: NPY002 - numba's own
    m, n = len(row_starts) - 1, len(column_starts) - 1
    weight = np.ones(m, dtype=np.int64)
    count = np.zeros(m, dtype=np.int64)  # how many chosen columns cover a row
    score = np.zeros(n, dtype=np.int64)  # weight gained by adding a column, or lost by removing it
    stamp = np.zeros(n, dtype=np.int64)
    may_add = np.ones(n, dtype=np.bool_)
    open_rows, place = np.empty(m, dtype=np.int64), np.full(m, -1)
    opened = 0
    members, member_at = np.empty(n, dtype=np.int64), np.full(n, -1)
    size = 0
    for r in range(m):
        if row_starts[r + 1] > row_starts[r]:
            open_rows[opened], place[r] = r, opened
            opened += 1
            for e in range(row_starts[r], row_starts[r + 1]):
                score[row_columns[e]] += 1
    first = np.flatnonzero(taken)
    taken = np.zeros(n, dtype=np.bool_)
    best = taken.copy()
    best_size = n + 1
    tabu = -1
    begin, step = 0, 0
    while step < steps or best_size > n:
        add, drop, exchange = -1, -1, False
        if begin < len(first):
            add = first[begin]
            begin += 1
        elif best_size > n and opened:  # greedily to a first cover
            add = int(np.argmax(np.where(taken, -1, score)))
        elif opened == 0:
            if size < best_size:
                best[:] = taken
                best_size = size
            if size == 0:
                break
            for i in range(size):
                c = members[i]
                if drop < 0 or score[c] < score[drop] or (score[c] == score[drop] and stamp[c] < stamp[drop]):
                    drop = c
        else:
            step += 1
            exchange = True
            for i in range(size):
                c = members[i]
                if c == tabu:
                    continue
                if drop < 0 or score[c] < score[drop] or (score[c] == score[drop] and stamp[c] < stamp[drop]):
                    drop = c
        for turn in range(2):
            if turn == 0:
                if drop < 0:
                    continue
                c = drop
                taken[c] = False
                stamp[c] = step
                may_add[c] = False
                size -= 1
                last = members[size]
                members[member_at[c]], member_at[last] = last, member_at[c]
                score[c] = 0
                for e in range(column_starts[c], column_starts[c + 1]):
                    r = column_rows[e]
                    count[r] -= 1
                    if count[r] == 0:
                        open_rows[opened], place[r] = r, opened
                        opened += 1
                        for f in range(row_starts[r], row_starts[r + 1]):
                            score[row_columns[f]] += weight[r]
                            may_add[row_columns[f]] |= row_columns[f] != c
                    else:
                        for f in range(row_starts[r], row_starts[r + 1]):
                            other = row_columns[f]
                            if count[r] == 1 and taken[other]:
                                score[other] += weight[r]
                            if other != c:
                                may_add[other] = True
            else:
                if exchange and opened:
                    r = open_rows[np.random.randint(opened)]  # noqa: NPY002
                    for f in range(row_starts[r], row_starts[r + 1]):
                        c = row_columns[f]
                        if not may_add[c]:
                            continue
                        if add < 0 or score[c] > score[add] or (score[c] == score[add] and stamp[c] < stamp[add]):
                            add = c
                if add < 0 or taken[add]:
                    continue
                c = add
                taken[c] = True
                stamp[c] = step
                tabu = c
                members[size], member_at[c] = c, size
                size += 1
                score[c] = 0
                for e in range(column_starts[c], column_starts[c + 1]):
                    r = column_rows[e]
                    count[r] += 1
                    if count[r] == 1:
                        opened -= 1
                        moved = open_rows[opened]
                        open_rows[place[r]], place[moved] = moved, place[r]
                        place[r] = -1
                        score[c] += weight[r]
                        for f in range(row_starts[r], row_starts[r + 1]):
                            other = row_columns[f]
                            if other != c:
                                score[other] -= weight[r]
                                may_add[other] = True
                    else:
                        for f in range(row_starts[r], row_starts[r + 1]):
                            other = row_columns[f]
                            if count[r] == 2 and taken[other] and other != c:
                                score[other] -= weight[r]
                            may_add[other] = True
                if exchange:
                    for i in range(opened):
                        r = open_rows[i]
                        weight[r] += 1
                        for f in range(row_starts[r], row_starts[r + 1]):
                            score[row_columns[f]] += 1
    return best
