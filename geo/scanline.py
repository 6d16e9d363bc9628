"""Counting a lattice by scanline: which path cells, moves and hypervertices are inside an area, in microseconds.

The area is given by its edges, (n, 4) x0, y0, x1, y1 in path cells and in the axes of the lattice; the centre of path cell
(i, j) is (j + 0.5, i + 0.5). Kernels that call each other stay in one file: numba's
cache does not see a change in another.
"""

import numba as nb
import numpy as np


@nb.njit(cache=True)
def crossings(edges: np.ndarray, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return where the lines y = i + 0.5 cross the edges: `first` (rows + 1,) and the sorted x of all, line after line."""
    first = np.zeros(rows + 1, np.int64)
    for e in range(len(edges)):
        low, high = min(edges[e, 1], edges[e, 3]), max(edges[e, 1], edges[e, 3])
        for i in range(max(0, int(np.ceil(low - 0.5))), min(rows, int(np.ceil(high - 0.5)))):
            first[i + 1] += 1
    for i in range(rows):
        first[i + 1] += first[i]
    x = np.empty(first[rows])
    filled = first[:-1].copy()
    for e in range(len(edges)):
        x0, y0, x1, y1 = edges[e]
        low, high = min(y0, y1), max(y0, y1)
        for i in range(max(0, int(np.ceil(low - 0.5))), min(rows, int(np.ceil(high - 0.5)))):
            value = x0 + (i + 0.5 - y0) * (x1 - x0) / (y1 - y0)
            at = filled[i]
            while at > first[i] and x[at - 1] > value:
                x[at] = x[at - 1]
                at -= 1
            x[at] = value
            filled[i] += 1
    return first, x


@nb.njit(cache=True)
def inside(edges: np.ndarray, rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """Return two (rows, columns) bool arrays: the cell's centre is inside, so is the move to the next column's."""
    first, x = crossings(edges, rows)
    cells = np.zeros((rows, columns), np.bool_)
    along = np.zeros((rows, columns), np.bool_)
    for i in range(rows):
        for at in range(first[i], first[i + 1] - 1, 2):
            start = int(np.ceil(x[at] - 0.5))
            stop = int(np.ceil(x[at + 1] - 0.5))
            cells[i, start:stop] = True
            along[i, start : max(start, stop - 1)] = True  # not to -1, which is the row's end
    return cells, along


@nb.njit(cache=True)
def held(edges, x, y, angle, by_centre):  # type: ignore[no-untyped-def]
    """Return what a lattice with a corner at (x, y) of its own axes, turned by `angle`, holds of an area.

    That is: the number of free hypervertices (less one for each adjacent pair that something parts), the width and height
    of the area in the lattice's axes, and by how much the margin right of the hypervertices' box exceeds that left of it,
    and the margin above it that below. The margins are NaN where there is no hypervertex. `by_centre` counts every
    hypervertex whose centre is inside instead of those whose four moves are.
    """
    cos, sin = np.cos(angle), np.sin(angle)
    turned = np.empty_like(edges)
    for e in range(len(edges)):
        turned[e, 0] = cos * edges[e, 0] + sin * edges[e, 1] - x
        turned[e, 1] = cos * edges[e, 1] - sin * edges[e, 0] - y
        turned[e, 2] = cos * edges[e, 2] + sin * edges[e, 3] - x
        turned[e, 3] = cos * edges[e, 3] - sin * edges[e, 2] - y
    left, right = turned[:, 0].min(), turned[:, 0].max()
    bottom, top = turned[:, 1].min(), turned[:, 1].max()
    column, row = np.floor(left / 2.0), np.floor(bottom / 2.0)
    for e in range(len(edges)):
        turned[e, 0] -= 2.0 * column
        turned[e, 1] -= 2.0 * row
        turned[e, 2] -= 2.0 * column
        turned[e, 3] -= 2.0 * row
    columns, rows = int(np.ceil(right / 2.0) - column), int(np.ceil(top / 2.0) - row)
    first, start, stop = _runs_by_centre(turned, rows) if by_centre else _runs_by_moves(turned, rows)
    begin = np.zeros(len(start) + 1, np.int64)
    begin[1:] = np.cumsum(stop - start)
    free = np.ones(begin[-1], np.uint8)
    conflicts = 0 if by_centre else _part(turned, first, start, stop, begin, free)
    count = int(free.sum()) - conflicts
    first_row, last_row, first_column, last_column = rows, -1, columns, -1
    for r in range(rows):
        for n in range(first[r], first[r + 1]):
            low, high = begin[n], begin[n + 1] - 1
            while low <= high and not free[low]:
                low += 1
            while low < high and not free[high]:
                high -= 1
            if low <= high:
                first_row, last_row = min(first_row, r), r
                first_column = min(first_column, start[n] + low - begin[n])
                last_column = max(last_column, start[n] + high - begin[n])
    if last_row < 0:
        return count, right - left, top - bottom, np.nan, np.nan
    margin_x = (right - 2.0 * (column + last_column + 1)) - (2.0 * (column + first_column) - left)
    margin_y = (top - 2.0 * (row + last_row + 1)) - (2.0 * (row + first_row) - bottom)
    return count, right - left, top - bottom, margin_x, margin_y


@nb.njit(cache=True)
def _runs_by_moves(edges, rows):  # type: ignore[no-untyped-def]
    """Return runs of hypervertices whose moves along the rows are inside, row after row: `first` (rows + 1,) of each row,
    and the columns from `start` to `stop`, excluded, of each. What is held is less than its box, of which thus no array is
    made.
    """
    cross, x = crossings(edges, 2 * rows)
    first, start, stop = np.zeros(rows + 1, np.int64), np.empty(len(x), np.int64), np.empty(len(x), np.int64)
    count = 0
    for r in range(rows):
        a, b = cross[2 * r], cross[2 * r + 1]
        while a + 1 < cross[2 * r + 1] and b + 1 < cross[2 * r + 2]:
            start[count] = int(np.ceil((max(x[a], x[b]) - 0.5) / 2.0))
            stop[count] = int(np.floor((min(x[a + 1], x[b + 1]) - 1.5) / 2.0)) + 1
            count += start[count] < stop[count]
            if x[a + 1] < x[b + 1]:
                a += 2
            else:
                b += 2
        first[r + 1] = count
    return first, start[:count], stop[:count]


@nb.njit(cache=True)
def _runs_by_centre(edges, rows):  # type: ignore[no-untyped-def]
    """Return runs, as `_runs_by_moves` does, of hypervertices whose centre is inside."""
    first, x = crossings(edges / 2.0, rows)
    start, stop = np.empty(len(x), np.int64), np.empty(len(x), np.int64)
    runs, count = np.zeros(rows + 1, np.int64), 0
    for r in range(rows):
        for at in range(first[r], first[r + 1] - 1, 2):
            start[count], stop[count] = int(np.ceil(x[at] - 0.5)), int(np.ceil(x[at + 1] - 0.5))
            count += start[count] < stop[count]
        runs[r + 1] = count
    return runs, start[:count], stop[:count]


@nb.njit(cache=True)
def _part(edges, first, start, stop, begin, free):  # type: ignore[no-untyped-def]
    """Take from the `free` of the runs, of which each has its own from `begin` on, those that an edge crosses; return how
    many adjacent pairs of what is left are parted.
    """
    seen = np.zeros(len(free), np.bool_)
    above = [(0, 0, 0) for _ in range(0)]  # a gap lies between the one there, in this row and column, and the next row's
    for e in range(len(edges)):
        x0, y0, x1, y1 = edges[e]
        if x0 == x1:
            continue
        slope = (y1 - y0) / (x1 - x0)
        for j in range(int(np.ceil(min(x0, x1) - 0.5)), int(np.floor(max(x0, x1) - 0.5)) + 1):
            line = int(np.floor(y0 + (j + 0.5 - x0) * slope - 0.5))  # the move up from this line is crossed
            at = _place(first, start, stop, begin, line // 2, j // 2) if line >= 0 else -1
            if at >= 0 and line % 2 == 0:
                free[at] = 0
            elif at >= 0 and not seen[at]:
                seen[at] = True
                above.append((at, line // 2, j // 2))
    parted = 0
    for at, row, column in above:
        other = _place(first, start, stop, begin, row + 1, column)
        parted += free[at] * free[other] if other >= 0 else 0
    for r in range(len(first) - 1):
        for n in range(first[r], first[r + 1] - 1):
            if stop[n] == start[n + 1]:
                parted += free[begin[n + 1] - 1] * free[begin[n + 1]]
    return parted


@nb.njit(cache=True)
def _place(first, start, stop, begin, row, column):  # type: ignore[no-untyped-def]
    """Return where a hypervertex stands among those of all runs; -1 if it is in none."""
    if row >= len(first) - 1:
        return -1
    low, high = first[row], first[row + 1]
    while low < high:  # the first run that stops beyond it
        middle = (low + high) // 2
        if stop[middle] <= column:
            low = middle + 1
        else:
            high = middle
    if low == first[row + 1] or start[low] > column:
        return -1
    return begin[low] + column - start[low]


@nb.njit(cache=True)
def best_shifts(edges, y, angle, most):  # type: ignore[no-untyped-def]
    """Return up to `most` shifts x at which a lattice at shift `y`, turned by `angle`, holds the most hypervertices.

    Counted exactly for all x at once: in every row of hypervertices each stretch inside loses one where x passes its end
    and gains one where x passes its beginning. (What pokes in between the row's two tracks is not seen.) Each x is the
    middle of a range in which the count does not change.
    """
    cos, sin = np.cos(angle), np.sin(angle)
    turned = np.empty_like(edges)
    for e in range(len(edges)):
        turned[e, 0] = cos * edges[e, 0] + sin * edges[e, 1]
        turned[e, 1] = cos * edges[e, 1] - sin * edges[e, 0] - y
        turned[e, 2] = cos * edges[e, 2] + sin * edges[e, 3]
        turned[e, 3] = cos * edges[e, 3] - sin * edges[e, 2] - y
    bottom = 2.0 * np.floor(min(turned[:, 1].min(), turned[:, 3].min()) / 2.0)
    turned[:, 1] -= bottom
    turned[:, 3] -= bottom
    rows = int(np.ceil(max(turned[:, 1].max(), turned[:, 3].max()) / 2.0))
    first, x = crossings(turned, 2 * rows)
    at, change = np.empty(2 * len(x)), np.empty(2 * len(x), np.int64)
    events, level = 0, 0
    for r in range(rows):
        a, b = first[2 * r], first[2 * r + 1]
        while a + 1 < first[2 * r + 1] and b + 1 < first[2 * r + 2]:
            begin, end = max(x[a], x[b]) - 0.5, min(x[a + 1], x[b + 1]) - 1.5
            if end >= begin:
                level += int(np.floor(end / 2.0) - np.ceil(begin / 2.0)) + 1
                at[events], change[events] = begin % 2.0, 1
                at[events + 1], change[events + 1] = end % 2.0, -1
                level -= 1 if begin % 2.0 == 0.0 else 0  # its gain at 0 comes as an event
                events += 2
            if x[a + 1] < x[b + 1]:
                a += 2
            else:
                b += 2
    order = np.argsort(at[:events], kind="mergesort")
    count, middle, size = np.empty(events + 1, np.int64), np.empty(events + 1), np.empty(events + 1)
    before = 0.0
    for n in range(events + 1):
        here = at[order[n]] if n < events else 2.0
        count[n], middle[n], size[n] = level, (before + here) / 2.0, here - before
        before = here
        if n < events:
            level += change[order[n]]
    best = np.empty(most)
    taken = 0
    while taken < most:
        winner = -1
        for n in range(events + 1):
            if size[n] > 1e-9 and (
                winner < 0 or count[n] > count[winner] or (count[n] == count[winner] and size[n] > size[winner])
            ):
                winner = n
        if winner < 0:
            break
        best[taken] = middle[winner]
        size[winner] = 0.0
        taken += 1
    return best[:taken]
