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
    free, conflicts = _by_centre(turned, rows, columns) if by_centre else _by_moves(turned, rows, columns)
    count, first_row, last_row, first_column, last_column = -conflicts, rows, -1, columns, -1
    for r in range(rows):
        for c in range(columns):
            if free[r, c]:
                count += 1
                first_row, last_row = min(first_row, r), r
                first_column, last_column = min(first_column, c), max(last_column, c)
    if last_row < 0:
        return count, right - left, top - bottom, np.nan, np.nan
    margin_x = (right - 2.0 * (column + last_column + 1)) - (2.0 * (column + first_column) - left)
    margin_y = (top - 2.0 * (row + last_row + 1)) - (2.0 * (row + first_row) - bottom)
    return count, right - left, top - bottom, margin_x, margin_y


@nb.njit(cache=True)
def _by_moves(edges, rows, columns):  # type: ignore[no-untyped-def]
    """Return the (rows, columns) hypervertices with all four moves inside, and how many adjacent pairs are parted."""
    first, x = crossings(edges, 2 * rows)
    free = np.zeros((rows, columns), np.uint8)
    beside = np.zeros((rows, columns), np.uint8)  # a gap lies between this one and the next column's
    above = np.zeros((rows, columns), np.uint8)
    for r in range(rows):
        a, b, last = first[2 * r], first[2 * r + 1], -2
        while a + 1 < first[2 * r + 1] and b + 1 < first[2 * r + 2]:
            start = int(np.ceil((max(x[a], x[b]) - 0.5) / 2.0))
            stop = int(np.floor((min(x[a + 1], x[b + 1]) - 1.5) / 2.0)) + 1
            if start < stop:
                for c in range(start, stop):
                    free[r, c] = 1
                if start == last + 1:
                    beside[r, last] = 1
                last = stop - 1
            if x[a + 1] < x[b + 1]:
                a += 2
            else:
                b += 2
    for e in range(len(edges)):
        x0, y0, x1, y1 = edges[e]
        if x0 == x1:
            continue
        slope = (y1 - y0) / (x1 - x0)
        for j in range(int(np.ceil(min(x0, x1) - 0.5)), int(np.floor(max(x0, x1) - 0.5)) + 1):
            line = int(np.floor(y0 + (j + 0.5 - x0) * slope - 0.5))  # the move up from this line is crossed
            if line % 2 == 0:
                free[line // 2, j // 2] = 0
            elif line > 0:
                above[line // 2, j // 2] = 1
    conflicts = 0
    for r in range(rows):
        for c in range(columns):
            if free[r, c]:
                conflicts += beside[r, c] and free[r, c + 1]
                conflicts += above[r, c] and r + 1 < rows and free[r + 1, c]
    return free, conflicts


@nb.njit(cache=True)
def _by_centre(edges, rows, columns):  # type: ignore[no-untyped-def]
    """Return the (rows, columns) hypervertices whose centre is inside, and 0."""
    first, x = crossings(edges / 2.0, rows)
    free = np.zeros((rows, columns), np.uint8)
    for r in range(rows):
        for at in range(first[r], first[r + 1] - 1, 2):
            for c in range(int(np.ceil(x[at] - 0.5)), int(np.ceil(x[at + 1] - 0.5))):
                free[r, c] = 1
    return free, 0


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
