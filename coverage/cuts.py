"""What may leave a region: simple cells by their eight neighbours, and articulation cells with all that hangs on them.

Grids are padded by one cell of -1 and flattened; `width` is the padded row length.
"""

import numba
import numpy as np


def _simple_table() -> np.ndarray:
    """Return (256,) bool: which of the eight neighbours' patterns leave the neighbours 4-connected without the centre.

    Bits run clockwise from north: N 1, NE 2, E 4, SE 8, S 16, SW 32, W 64, NW 128.
    """
    table = np.zeros(256, dtype=np.bool_)
    for pattern in range(256):
        ring = [bool(pattern >> bit & 1) for bit in range(8)]
        sides = sum(ring[0::2])
        corners = sum(ring[bit] and ring[bit + 1] and ring[(bit + 2) % 8] for bit in (0, 2, 4, 6))
        table[pattern] = sides > 0 and (sides - corners == 1 or all(ring))
    return table


SIMPLE = _simple_table()


@numba.njit(cache=True)
def is_simple(labels: np.ndarray, cell: int, width: int, table: np.ndarray) -> bool:
    """Return whether the cell's region surely stays 4-connected without it, judged by its eight neighbours."""
    own = labels[cell]
    pattern = 0
    if labels[cell - width] == own:
        pattern |= 1
    if labels[cell - width + 1] == own:
        pattern |= 2
    if labels[cell + 1] == own:
        pattern |= 4
    if labels[cell + width + 1] == own:
        pattern |= 8
    if labels[cell + width] == own:
        pattern |= 16
    if labels[cell + width - 1] == own:
        pattern |= 32
    if labels[cell - 1] == own:
        pattern |= 64
    if labels[cell - width - 1] == own:
        pattern |= 128
    return bool(table[pattern])


@numba.njit(cache=True)
def hanging(labels: np.ndarray, starts: np.ndarray, width: int):  # type: ignore[no-untyped-def]
    """Search every region depth first from its start (Tarjan 1972).

    Return for each cell: its number in preorder (-1 if no start reaches it), the preorder itself, the size of its
    subtree, the lowest number that its subtree is linked to, its parent, and the weight: how many cells leave the region
    when it does, itself and what hangs on it away from the start (0 for the start itself, which may not leave).
    """
    n = len(labels)
    number = np.full(n, -1, dtype=np.int32)
    order = np.empty(n, dtype=np.int32)
    size = np.zeros(n, dtype=np.int32)
    low = np.zeros(n, dtype=np.int32)
    parent = np.full(n, -1, dtype=np.int32)
    weight = np.zeros(n, dtype=np.int32)
    side = np.zeros(n, dtype=np.int8)
    step = np.array([-width, 1, width, -1])
    count = 0
    for start in starts:
        number[start] = low[start] = count
        order[count] = start
        count += 1
        size[start] = 1
        here = start
        while here >= 0:
            if side[here] < 4:
                there = here + step[side[here]]
                side[here] += 1
                if labels[there] == labels[here]:
                    if number[there] < 0:
                        number[there] = low[there] = count
                        order[count] = there
                        count += 1
                        size[there] = weight[there] = 1
                        parent[there] = here
                        here = there
                    elif number[there] < low[here]:
                        low[here] = number[there]
            else:
                above = parent[here]
                if above >= 0:
                    size[above] += size[here]
                    if low[here] >= number[above] and weight[above] > 0:
                        weight[above] += size[here]
                    low[above] = min(low[above], low[here])
                here = above
    return number, order, size, low, parent, weight


@numba.njit  # of several signatures: no cache of its own (see .ci/signatures)
def move_hanging(labels, cell, to, width, number, order, size, low, parent):  # type: ignore[no-untyped-def]
    """Give `cell` and all that hangs on it to region `to`, by the fresh results of `hanging`."""
    own = labels[cell]
    labels[cell] = to
    for there in (cell - width, cell + 1, cell + width, cell - 1):
        if labels[there] == own and parent[there] == cell and low[there] >= number[cell]:
            for at in range(number[there], number[there] + size[there]):
                labels[order[at]] = to
