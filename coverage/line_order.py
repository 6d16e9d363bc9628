"""In which order lines are driven, and each in which direction."""

import numba as nb
import numpy as np


def short_order(ends: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the order (n,) of lines and whether each is driven forward: the nearest next, then reversals (2-opt).

    `ends` (n, 2, 2) are first and last points in metres, `start` (2,) is where the way to them begins.
    """
    order, forward = _short_order(np.ascontiguousarray(ends, dtype=float), np.asarray(start, dtype=float))
    return order, forward


def order_from(ends: np.ndarray, pieces: np.ndarray, entry: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the order and directions as `short_order` does, begun at the end nearest to `entry`.

    That is one of the ends of the (n, 2, 2) `pieces`, which are surveyed; `ends` has their runs too.
    """
    first, side = np.unravel_index(np.linalg.norm(pieces - entry, axis=2).argmin(), ends.shape[:2])
    rest = np.delete(np.arange(len(ends)), first)
    order, forward = short_order(ends[rest], ends[first, 1 - side])
    return np.append(first, rest[order]), np.append(side == 0, forward)


def alternate_order(ends: np.ndarray, row: np.ndarray, every: int, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the order and directions in which every `every`th line is driven, and the skipped ones on the way back.

    With `every` n that is n passes, there and back in turn. `row` (n,) says which line a piece is of; the pieces of a line
    are driven one after the other, from the end nearer to where the last line ended. The first is the outermost line
    with the end nearest to `start`.
    """
    rows = np.unique(row)
    outer = [np.linalg.norm(ends[row == r] - start, axis=2).min() for r in rows[[0, -1]]]
    rows = rows[::-1] if outer[1] < outer[0] else rows
    passes = [rows[n::every][:: 1 if n % 2 == 0 else -1] for n in range(min(every, len(rows)))]
    order, forward, here = [], [], start
    for r in np.concatenate(passes):
        pieces = np.flatnonzero(row == r)  # from first ends to last
        onward = np.linalg.norm(ends[pieces[0], 0] - here) <= np.linalg.norm(ends[pieces[-1], 1] - here)
        order += pieces[:: 1 if onward else -1].tolist()
        forward += [onward] * len(pieces)
        here = ends[order[-1], 1 if onward else 0]
    return np.array(order), np.array(forward)


@nb.njit(cache=True)
def _short_order(ends: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the order of lines and whether each is driven forward; `ends` (n, 2, 2) are first and last points."""
    n = len(ends)
    order, forward = np.empty(n, np.int64), np.empty(n, np.bool_)
    left = np.ones(n, np.bool_)
    x, y = start[0], start[1]
    for k in range(n):
        best, at, side = np.inf, -1, 0
        for i in range(n):
            if left[i]:
                for e in range(2):
                    d = np.hypot(ends[i, e, 0] - x, ends[i, e, 1] - y)
                    if d < best - 1e-9:
                        best, at, side = d, i, e
        order[k], forward[k], left[at] = at, side == 0, False
        x, y = ends[at, 1 - side, 0], ends[at, 1 - side, 1]
    for _ in range(50):
        improved = False
        for i in range(n - 1):
            for j in range(i + 1, n):
                # reverse i .. j: the links before i and after j change, the ends of those turn round
                a = ends[order[i], 0 if forward[i] else 1]
                b = ends[order[j], 1 if forward[j] else 0]
                px, py = start[0], start[1]
                if i > 0:
                    before = ends[order[i - 1], 1 if forward[i - 1] else 0]
                    px, py = before[0], before[1]
                gain = np.hypot(a[0] - px, a[1] - py) - np.hypot(b[0] - px, b[1] - py)
                if j + 1 < n:
                    after = ends[order[j + 1], 0 if forward[j + 1] else 1]
                    gain += np.hypot(b[0] - after[0], b[1] - after[1]) - np.hypot(a[0] - after[0], a[1] - after[1])
                if gain > 1e-6:
                    order[i : j + 1] = order[i : j + 1][::-1].copy()
                    forward[i : j + 1] = ~forward[i : j + 1][::-1].copy()
                    improved = True
        if not improved:
            break
    return order, forward
