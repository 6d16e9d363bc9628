"""First regions: every free cell goes to the vehicle whose start is nearest, measured along the free cells."""

import numba
import numpy as np


@numba.njit(cache=True)
def grow(free: np.ndarray, starts: np.ndarray, width: int, across: int, along: int):  # type: ignore[no-untyped-def]
    """Return labels (n,) int32, -1 where no start leads, and the cost of the way there (n,) int32.

    `free` is (n,) bool, padded and flattened rows of length `width`. A step within a row costs `across`, within a column
    `along`: unequal costs stretch the regions. Ties go to the start that comes first. Dijkstra with buckets (Dial 1969).
    """
    n = len(free)
    labels = np.full(n, -1, dtype=np.int32)
    cost = np.full(n, 2**30, dtype=np.int32)
    ring = max(across, along) + 1
    head = np.full(ring, -1, dtype=np.int32)
    tail = np.full(ring, -1, dtype=np.int32)
    after = np.empty(4 * n + len(starts), dtype=np.int32)
    entry = np.empty(4 * n + len(starts), dtype=np.int32)
    count = 0
    for vehicle, start in enumerate(starts):
        labels[start] = vehicle
        cost[start] = 0
        entry[count], after[count] = start, -1
        if head[0] < 0:
            head[0] = count
        else:
            after[tail[0]] = count
        tail[0] = count
        count += 1
    now, idle = 0, 0
    while idle < ring:
        slot = now % ring
        if head[slot] < 0:
            now += 1
            idle += 1
            continue
        idle = 0
        at = head[slot]
        head[slot] = after[at]
        cell = entry[at]
        if cost[cell] != now:
            continue
        for side in range(4):
            there = cell + (-1 if side == 0 else 1 if side == 1 else -width if side == 2 else width)
            price = now + (across if side < 2 else along)
            if free[there] and price < cost[there]:
                cost[there] = price
                labels[there] = labels[cell]
                entry[count], after[count] = there, -1
                slot_there = price % ring
                if head[slot_there] < 0:
                    head[slot_there] = count
                else:
                    after[tail[slot_there]] = count
                tail[slot_there] = count
                count += 1
    return labels, cost
