"""Strips: a region peeled off one side of a piece of ground, lane by lane.

Long lanes make few turns. A strip takes whole lanes in sweep order until it has its size; a corridor links it to its
start, and other starts inside it keep a corridor to the rest. Corridors run along walls and borders, where they cut no
lane. Ground is (n,) bool, padded by a cell all around and flattened; a sweep is (first cell, step across lanes, number of
lanes, step along a lane, cells in a lane).
"""

import numba
import numpy as np

CUT = 24
"""What a corridor's step across a lane costs where it cuts the lane, in steps along."""


@numba.njit(cache=True)
def sweep_of(wide, high, column_lanes, from_end, flip):  # type: ignore[no-untyped-def]
    """Return a sweep over padded ground: rows or columns as lanes, from the first or last lane, along or against it."""
    across, along = (1, wide) if column_lanes else (wide, 1)
    lanes, length = (wide - 2, high - 2) if column_lanes else (high - 2, wide - 2)
    first = wide + 1
    if from_end:
        first += (lanes - 1) * across
        across = -across
    if flip:
        first += (length - 1) * along
        along = -along
    return first, across, lanes, along, length


@numba.njit  # of several signatures: no cache of its own (see .ci/signatures)
def peel(ground, start, other, size, sweep, wide, limit):  # type: ignore[no-untyped-def]
    """Return (taken, the rest, price): a strip of `size` cells around `start` that leaves a whole rest around `other`.

    The price is the lanes of both along the sweep; it is infinite or not below `limit`, and taken and rest mean nothing,
    where there is no such strip below it.
    """
    first, across, lanes, along, length = sweep
    n = len(ground)
    taken, rest = ground, ground
    outer = -1  # the first lane with a cell that may be taken
    while outer < 0:
        for lane in range(lanes):
            for at in range(length):
                cell = first + lane * across + at * along
                if outer < 0 and ground[cell] and cell != other:
                    outer = lane
            if outer >= 0:
                break
    goal = np.zeros(n, dtype=np.bool_)
    for at in range(length):
        goal[first + outer * across + at * along] = True
    kept = np.zeros(n, dtype=np.bool_)  # the strip's own corridor and what it would shut in
    barred = np.zeros(n, dtype=np.bool_)  # the other start, its corridor, and what the strip would leave behind
    barred[other] = True
    count = corridor(ground, barred, goal, start, across, along, kept)
    if count == 0:
        return taken, rest, np.inf
    for _ in range(8):
        if count > size:
            break
        taken = kept.copy()
        rest = ground.copy()
        missing = size - count
        for lane in range(outer, lanes):
            for at in range(length):
                cell = first + lane * across + at * along
                if ground[cell] and not barred[cell] and not kept[cell] and missing > 0:
                    taken[cell] = True
                    missing -= 1
                if taken[cell]:
                    rest[cell] = False
            if missing == 0 and lane < lanes - 1:
                for cell in range(n):
                    if taken[cell]:
                        rest[cell] = False
                break
        if missing > 0:
            break
        price = _lanes(taken, wide, abs(across), lanes, abs(along), length)
        if price < limit:
            price += _lanes(rest, wide, abs(across), lanes, abs(along), length)
        if price >= limit:
            break
        reached = flood(taken, start, across, along)
        whole = True
        for cell in range(n):
            if taken[cell] and not reached[cell]:
                whole = False
                if kept[cell]:
                    return taken, rest, np.inf
                barred[cell] = True
        if not whole:
            continue
        reached = flood(rest, other, across, along)
        shut = 0
        for cell in range(n):
            if rest[cell] and not reached[cell]:
                shut += 1
        if shut == 0:
            return taken, rest, price
        inside = 0
        for cell in range(n):
            inside += reached[cell]
        if inside >= shut:  # what is shut in goes to the strip
            for cell in range(n):
                if rest[cell] and not reached[cell]:
                    kept[cell] = True
                    count += 1
        else:  # the other start is: it gets a corridor to the rest
            for cell in range(n):
                goal[cell] = rest[cell] and not reached[cell]
            if corridor(ground, kept, goal, other, across, along, barred) == 0:
                break
    return taken, rest, np.inf


@numba.njit(cache=True)
def corridor(ground, barred, goal, start, across, along, kept):  # type: ignore[no-untyped-def]
    """Add to `kept` the cheapest way from `start` to a `goal` cell past `barred`; return its number of cells, 0 for none.

    A step across costs CUT where the lane goes on at both sides of the cell that it enters (Dial's buckets).
    """
    if goal[start]:
        kept[start] = True
        return 1
    n = len(ground)
    ring = CUT + 2
    cost = np.full(n, 2**30, dtype=np.int32)
    came = np.empty(n, dtype=np.int32)
    head = np.full(ring, -1, dtype=np.int32)
    after = np.empty(4 * n + 1, dtype=np.int32)
    entry = np.empty(4 * n + 1, dtype=np.int32)
    cost[start], came[start] = 0, -1
    entry[0], after[0], head[0] = start, -1, 0
    count, now, idle = 1, 0, 0
    while idle < ring:
        at = head[now % ring]
        if at < 0:
            now += 1
            idle += 1
            continue
        idle = 0
        head[now % ring] = after[at]
        cell = entry[at]
        if cost[cell] != now:
            continue
        if goal[cell]:
            cells = 0
            while cell >= 0:
                kept[cell] = True
                cells += 1
                cell = came[cell]
            return cells
        for step in (along, -along, across, -across):
            there = cell + step
            if not ground[there] or barred[there]:
                continue
            price = now + 1
            if abs(step) == abs(across) and ground[there - along] and ground[there + along]:
                price = now + CUT
            if price < cost[there]:
                cost[there] = price
                came[there] = cell
                entry[count], after[count] = there, head[price % ring]
                head[price % ring] = count
                count += 1
    return 0


@numba.njit(cache=True)
def flood(cells, start, across, along):  # type: ignore[no-untyped-def]
    """Return which cells (n,) bool are 4-connected with `start`."""
    reached = np.zeros(len(cells), dtype=np.bool_)
    stack = np.empty(len(cells), dtype=np.int32)
    reached[start] = True
    stack[0] = start
    top = 1
    while top > 0:
        top -= 1
        cell = stack[top]
        for step in (along, -along, across, -across):
            if cells[cell + step] and not reached[cell + step]:
                reached[cell + step] = True
                stack[top] = cell + step
                top += 1
    return reached


@numba.njit(cache=True)
def cheapest_lanes(cells: np.ndarray, wide: int, high: int) -> float:
    """Return the bricks of a region laid along rows or columns, whichever are fewer, and a half for each loose one."""
    return min(_lanes(cells, wide, wide, high - 2, 1, wide - 2), _lanes(cells, wide, 1, wide - 2, wide, high - 2))


@numba.njit  # of several signatures: no cache of its own (see .ci/signatures)
def _lanes(cells: np.ndarray, wide: int, across: int, lanes: int, along: int, length: int) -> float:
    """Return how many bricks the cells take along the lanes, plus a half for each that no aligned end joins to the last.

    A chain of single cells across lanes counts as one.
    """
    bricks = 0.0
    for lane in range(lanes):
        begin = wide + 1 + lane * across
        at = 0
        while at < length:
            cell = begin + at * along
            if not cells[cell]:
                at += 1
                continue
            last = cell
            touches = cells[cell - across]
            while cells[last + along]:
                last += along
                at += 1
                touches |= cells[last - across]
            if last > cell:
                bricks += 1
                aligned = (cells[cell - across] and not cells[cell - across - along]) or (
                    cells[last - across] and not cells[last - across + along]
                )
                if touches and not aligned:
                    bricks += 0.5
            elif not (cells[cell - across] and not cells[cell - across - along] and not cells[cell - across + along]):
                bricks += 1
            at += 1
    return bricks
