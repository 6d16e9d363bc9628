"""Shortest paths over an occupancy grid between tasks and depots: one search a source, strings pulled tight.

8-connected: a step costs 1 or sqrt 2 cells, and no step cuts a blocked cell's corner.
"""

import heapq
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit
from scipy.ndimage import distance_transform_edt

from quarterdeck.geo.deadline import go_on
from quarterdeck.geo.occupancy import Occupancy

Heuristic = Literal["none", "octile", "manhattan"]
HEURISTICS: tuple[Heuristic, ...] = ("none", "octile", "manhattan")


@dataclass(frozen=True, slots=True)
class Ways:
    """The ways between m points. `steps` (m, m) metres along the grid, `lengths` (m, m) along the pulled paths; inf is
    none.

    `paths[i][j]` for i < j is the (q, 2) pulled path in metres from point i to point j, None where there is none.
    `expanded` is the number of cells that the searches took up.
    """

    steps: np.ndarray
    lengths: np.ndarray
    paths: list[list[np.ndarray | None]]
    expanded: int

    def path(self, i: int, j: int) -> np.ndarray | None:
        """Return the (q, 2) path in metres from point i to point j."""
        way = self.paths[min(i, j)][max(i, j)]
        return way if way is None or i <= j else way[::-1]


def find_ways(occupancy: Occupancy, free: np.ndarray, points: np.ndarray, heuristic: Heuristic = "none") -> Ways:
    """Return the shortest ways between all (m, 2) points in metres over the `free` cells (rows, cols) of a map.

    `none` is one Dijkstra search a source that ends when all other points are reached: the fastest for a few dozen points.
    `octile` is A* for each pair with the admissible heuristic, so as short. `manhattan` is the paper's heuristic,
    inadmissible where diagonal steps are allowed: its ways may be longer. A point on a cell that is not free has no way.

    Raises OutOfTimeError where it is abandoned.
    """
    m = len(points)
    where = occupancy.to_cells(points)
    cells = np.floor(where).astype(np.int64)
    rows, columns = free.shape
    on = (cells >= 0).all(axis=1) & (cells[:, 0] < rows) & (cells[:, 1] < columns)
    on[on] = free[cells[on, 0], cells[on, 1]]
    flat = np.where(on, cells[:, 0] * columns + cells[:, 1], -1)
    steps, lengths = np.full((m, m), np.inf), np.full((m, m), np.inf)
    np.fill_diagonal(steps, 0.0)
    np.fill_diagonal(lengths, 0.0)
    paths: list[list[np.ndarray | None]] = [[None] * m for _ in range(m)]
    expanded = 0
    # The grid gets a blocked border, so that the search need not ask where the map ends.
    walled = np.zeros((rows + 2, columns + 2), np.bool_)
    walled[1:-1, 1:-1] = free
    goal = np.where(flat < 0, -1, (flat // columns + 1) * (columns + 2) + flat % columns + 1)
    kind = HEURISTICS.index(heuristic)
    found, wanted = 0, int(np.sum(goal >= 0)) * (int(np.sum(goal >= 0)) - 1) // 2
    scratch = np.empty(walled.size), np.empty(walled.size, np.int32)
    for i in range(m):
        later = np.flatnonzero(goal[i + 1 :] >= 0) + i + 1
        if goal[i] < 0 or not len(later):
            continue
        for targets in [later] if kind == 0 else [later[q : q + 1] for q in range(len(later))]:
            go_on(f"the search for ways after {found:,} of {wanted:,} between tasks and depots")
            found += len(targets)
            cost, before = scratch
            expanded += grow(walled, int(goal[i]), goal[targets], kind, cost, before)
            for j in targets.tolist():
                if cost[goal[j]] < np.inf:
                    steps[i, j] = steps[j, i] = cost[goal[j]] * occupancy.resolution
                    chain = trace(before, int(goal[i]), int(goal[j]))
                    middle = np.column_stack([chain // (columns + 2), chain % (columns + 2)]) - 0.5
                    bent = pull(free, np.vstack([where[i], middle, where[j]]))
                    way = occupancy.to_metres(bent)
                    way[0], way[-1] = points[i], points[j]
                    paths[i][j] = way
                    lengths[i, j] = lengths[j, i] = np.linalg.norm(np.diff(way, axis=0), axis=1).sum()
    return Ways(steps, lengths, paths, expanded)


def nearest_free(occupancy: Occupancy, free: np.ndarray, points: np.ndarray, reach: float) -> np.ndarray:
    """Return (m, 2) metres: each point, or the centre of the nearest free cell where its own is not, up to `reach`."""
    out = np.array(points, dtype=float).reshape(-1, 2)
    cells = np.floor(occupancy.to_cells(out)).astype(np.int64)
    inside = (cells >= 0).all(axis=1) & (cells < free.shape).all(axis=1)
    blocked = inside.copy()
    blocked[inside] = ~free[cells[inside, 0], cells[inside, 1]]
    if not blocked.any() or not free.any():
        return out
    _, near = distance_transform_edt(~free, return_indices=True)
    for i in np.flatnonzero(blocked):
        centre = occupancy.to_metres(near[:, cells[i, 0], cells[i, 1]] + 0.5)[0]
        if np.hypot(*(centre - out[i])) <= reach:
            out[i] = centre
    return out


@njit(cache=True)
def grow(walled: np.ndarray, source: int, targets: np.ndarray, kind: int, cost: np.ndarray, before: np.ndarray) -> int:
    """Search from a cell until all targets are settled; fill `cost` in cells and `before`; return how many were settled.

    `walled` (rows, cols) bool has a border of False; cells are flat indices into it. `kind` is the place in `HEURISTICS`.
    """
    columns = walled.shape[1]
    open_ = walled.ravel()
    settled = np.zeros(open_.size, np.bool_)
    wanted = np.zeros(open_.size, np.bool_)
    wanted[targets] = True
    left = int(np.sum(wanted))
    cost[:] = np.inf
    cost[source] = 0.0
    before[source] = -1
    heap = [(0.0, source)]
    around = np.array([1, -1, columns, -columns, columns + 1, columns - 1, 1 - columns, -columns - 1])
    row, column = targets[0] // columns, targets[0] % columns
    diagonal = np.sqrt(2.0)
    count = 0
    while heap and left > 0:
        here = heapq.heappop(heap)[1]
        if settled[here]:
            continue
        settled[here] = True
        count += 1
        if wanted[here]:
            left -= 1
        for q in range(8):
            there = here + around[q]
            if not open_[there] or settled[there]:
                continue
            step = 1.0
            if q >= 4:
                along = 1 if q in (4, 6) else -1
                if not (open_[here + along] and open_[there - along]):
                    continue
                step = diagonal
            worth = cost[here] + step
            if worth < cost[there] - 1e-12:
                cost[there] = worth
                before[there] = here
                if kind > 0:
                    dx, dy = abs(there % columns - column), abs(there // columns - row)
                    worth += dx + dy if kind == 2 else max(dx, dy) + (diagonal - 1.0) * min(dx, dy)
                heapq.heappush(heap, (worth, there))
    for i in range(open_.size):  # what was seen but not settled is not known to be shortest
        if not settled[i]:
            cost[i] = np.inf
    return count


@njit(cache=True)
def trace(before: np.ndarray, source: int, target: int) -> np.ndarray:
    """Return the flat cells from source to target."""
    count = 1
    here = target
    while here != source:
        here = before[here]
        count += 1
    chain = np.empty(count, np.int64)
    here = target
    for i in range(count - 1, -1, -1):
        chain[i] = here
        here = before[here]
    return chain


@njit(cache=True)
def pull(free: np.ndarray, path: np.ndarray) -> np.ndarray:
    """Return the points of a (q, 2) path in cells that are left when it is pulled tight: each sees the next."""
    keep = [0]
    here = 0
    last = path.shape[0] - 1
    while here < last:
        there = here + 1
        step = 1
        while there + step <= last and sees(free, path[here], path[there + step]):
            there += step
            step *= 2
        while step > 1:  # the farthest seen is within the last step
            step //= 2
            if there + step <= last and sees(free, path[here], path[there + step]):
                there += step
        keep.append(there)
        here = there
    return path[np.array(keep)]


@njit(cache=True)
def sees(free: np.ndarray, a: np.ndarray, b: np.ndarray) -> bool:
    """Whether the segment between two points in cells touches free cells only (Amanatides & Woo 1987)."""
    i, j = int(np.floor(a[0])), int(np.floor(a[1]))
    goal_i, goal_j = int(np.floor(b[0])), int(np.floor(b[1]))
    di, dj = b[0] - a[0], b[1] - a[1]
    step_i, step_j = (1 if di > 0 else -1), (1 if dj > 0 else -1)
    delta_i = abs(1.0 / di) if di != 0.0 else np.inf
    delta_j = abs(1.0 / dj) if dj != 0.0 else np.inf
    next_i = (i + (step_i > 0) - a[0]) / di if di != 0.0 else np.inf
    next_j = (j + (step_j > 0) - a[1]) / dj if dj != 0.0 else np.inf
    for _ in range(abs(goal_i - i) + abs(goal_j - j) + 1):
        if not free[i, j]:
            return False
        if i == goal_i and j == goal_j:
            return True
        if abs(next_i - next_j) < 1e-9:  # through a corner: both cells beside it must be free
            if i == goal_i or j == goal_j or not (free[i + step_i, j] and free[i, j + step_j]):
                return bool(free[goal_i, goal_j]) and next_i >= 1.0 - 1e-9
            i += step_i
            j += step_j
            next_i += delta_i
            next_j += delta_j
        elif next_i < next_j:
            i += step_i
            next_i += delta_i
        else:
            j += step_j
            next_j += delta_j
        if not (0 <= i < free.shape[0] and 0 <= j < free.shape[1]):
            return False
    return bool(free[goal_i, goal_j])
