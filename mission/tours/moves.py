"""The moves of the local search, numbered: each says of which pieces of the old rows the new rows are made.

A piece is (row, first, last, backwards), see `tables.judge`; u is task i of row ru, v task j of row rv. Numbers run over
the ways to bring u beside v (`WITHIN` a row, `BETWEEN` rows), or to the ends of a row (`ENDS`).
"""

import numpy as np
from numba import njit

WITHIN = 14  # 2-opt, or-opt of 1 to 3 tasks, swap
BETWEEN = 44  # relocate and swap 1 to 3 tasks against 0 to 2, 2-opt*
ENDS = 7


@njit(cache=True)
def within(number: int, row: int, i: int, j: int, end: int, new: np.ndarray) -> int:
    """Lay out a move in a row whose last position is `end`; return its number of pieces, 0 if there is no such move."""
    low, high = min(i, j), max(i, j)
    if high - low < 2:
        return 0
    if number < 2:  # 2-opt: low+1..high or low..high-1 turn around
        _piece(new, 0, row, 0, low - number, 0)
        _piece(new, 1, row, low + 1 - number, high - number, 1)
        _piece(new, 2, row, high + 1 - number, end, 0)
        return 3
    if number < 12:  # or-opt: u, alone or with those behind or before it, to either side of v
        first, last, after, back = _segment(number - 2, i)
        if first < 0 or last > end or first <= j <= last:
            return 0
        gap = j if after else j - 1  # it goes between gap and gap + 1
        if gap > last:
            _piece(new, 0, row, 0, first - 1, 0)
            _piece(new, 1, row, last + 1, gap, 0)
            _piece(new, 2, row, first, last, back)
            _piece(new, 3, row, gap + 1, end, 0)
            return 4
        if gap < first - 1:
            _piece(new, 0, row, 0, gap, 0)
            _piece(new, 1, row, first, last, back)
            _piece(new, 2, row, gap + 1, first - 1, 0)
            _piece(new, 3, row, last + 1, end, 0)
            return 4
        return 0
    other = j + 1 if number == 12 else j - 1  # swap u with the task after or before v
    if other < 0 or other > end or abs(other - i) < 2:
        return 0
    low, high = min(i, other), max(i, other)
    _piece(new, 0, row, 0, low - 1, 0)
    _piece(new, 1, row, high, high, 0)
    _piece(new, 2, row, low + 1, high - 1, 0)
    _piece(new, 3, row, low, low, 0)
    _piece(new, 4, row, high + 1, end, 0)
    return 5


@njit(cache=True)
def between(
    number: int, ru: int, i: int, end_u: int, rv: int, j: int, end_v: int, new_u: np.ndarray, new_v: np.ndarray
) -> int:
    """Lay out a move between two rows; return the number of pieces of either, 0 if there is no such move."""
    if number < 40:
        first, last, after, back = _segment(number // 4, i)
        taken = min(number % 4, 2)  # so many beyond v come back in exchange
        low, high = (j + 1, j + taken) if after else (j - taken, j - 1)
        if first < 0 or last > end_u or low < 0 or high > end_v:
            return 0
        _piece(new_u, 0, ru, 0, first - 1, 0)
        _piece(new_u, 1, rv, low, high, number % 4 // 3)
        _piece(new_u, 2, ru, last + 1, end_u, 0)
        _piece(new_v, 0, rv, 0, low - 1, 0)
        _piece(new_v, 1, ru, first, last, back)
        _piece(new_v, 2, rv, high + 1, end_v, 0)
        return 3
    if number == 40:  # 2-opt*: .. u v ..
        _piece(new_u, 0, ru, 0, i, 0)
        _piece(new_u, 1, rv, j, end_v, 0)
        _piece(new_v, 0, rv, 0, j - 1, 0)
        _piece(new_v, 1, ru, i + 1, end_u, 0)
    elif number == 41:  # .. v u ..
        _piece(new_u, 0, ru, 0, i - 1, 0)
        _piece(new_u, 1, rv, j + 1, end_v, 0)
        _piece(new_v, 0, rv, 0, j, 0)
        _piece(new_v, 1, ru, i, end_u, 0)
    elif number == 42:  # .. u v .. backwards
        _piece(new_u, 0, ru, 0, i, 0)
        _piece(new_u, 1, rv, 0, j, 1)
        _piece(new_v, 0, ru, i + 1, end_u, 1)
        _piece(new_v, 1, rv, j + 1, end_v, 0)
    else:  # backwards .. v u ..
        _piece(new_u, 0, ru, 0, i - 1, 0)
        _piece(new_u, 1, rv, 0, j - 1, 1)
        _piece(new_v, 0, rv, j, end_v, 1)
        _piece(new_v, 1, ru, i, end_u, 0)
    return 2


@njit(cache=True)
def ends(number: int, ru: int, i: int, end_u: int, r: int, end_r: int, new_u: np.ndarray, new_r: np.ndarray) -> int:
    """Lay out a move of u to the start or the end of row r; return the number of pieces, 0 if there is no such move."""
    if ru == r:
        if number > 3 or (number % 2 == 0 and i == 0) or (number % 2 == 1 and i == end_u):
            return 0
        turn = number // 2  # else u moves alone
        if number % 2 == 0:
            _piece(new_u, 0, r, i, i, 0)
            _piece(new_u, 1, r, 0, i - 1, turn)
            _piece(new_u, 2, r, i + 1, end_u, 0)
        else:
            _piece(new_u, 0, r, 0, i - 1, 0)
            _piece(new_u, 1, r, i + 1, end_u, turn)
            _piece(new_u, 2, r, i, i, 0)
        return 3
    if number == 6:  # the tail that begins with u
        _piece(new_u, 0, ru, 0, i - 1, 0)
        _piece(new_u, 1, ru, 0, -1, 0)
        _piece(new_r, 0, r, 0, end_r, 0)
        _piece(new_r, 1, ru, i, end_u, 0)
        return 2
    size = 1 + number // 2
    first = i if number % 2 == 0 else i - size + 1
    last = first + size - 1
    if first < 0 or last > end_u:
        return 0
    _piece(new_u, 0, ru, 0, first - 1, 0)
    _piece(new_u, 1, ru, last + 1, end_u, 0)
    _piece(new_r, number % 2, ru, first, last, 0)
    _piece(new_r, 1 - number % 2, r, 0, end_r, 0)
    return 2


@njit(cache=True)
def _segment(number: int, i: int) -> tuple[int, int, bool, int]:
    """Return first, last, whether it goes after v, and whether it turns, so that u is the one that touches v."""
    if number < 2:
        return i, i, number == 1, 0
    size, lead, after = 2 + (number - 2) // 4, (number - 2) // 2 % 2 == 0, number % 2 == 1
    first = i if lead else i - size + 1
    return first, first + size - 1, after, int(lead != after)


@njit  # of several signatures: no cache of its own (see .ci/signatures)
def _piece(new: np.ndarray, q: int, row: int, first: int, last: int, back: int) -> None:
    new[q, 0] = row
    new[q, 1] = first
    new[q, 2] = last
    new[q, 3] = back
