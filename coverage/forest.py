"""Multi-Prim's: a tree a robot, grown by turns over the Reduced-CDT (fault-tolerant-cdt, section II-C)."""

from collections.abc import Sequence
from dataclasses import dataclass
from heapq import heappop, heappush

import numpy as np
from numba import njit

from quarterdeck.coverage.graph import Graph
from quarterdeck.geo.deadline import go_on

ROOT, ABSENT = -2, -1
NEVER = np.iinfo(np.int64).max
ROUNDS = 128  # of turns, between two looks at the limit
TIE = 1e-9  # relative: guards this near to equally far are a tie


@dataclass(frozen=True, slots=True)
class Forest:
    """A tree a robot. `parents` (k, n): a vertex's parent in the robot's tree, ROOT or ABSENT.

    `chosen`: per robot the guards that it visits, in the order of their selection; `ticks` (k, n): when it chose each,
    NEVER where it did not. A guard's owner is the robot with the smallest tick.
    """

    parents: np.ndarray
    chosen: tuple[np.ndarray, ...]
    ticks: np.ndarray

    @property
    def owners(self) -> np.ndarray:
        """(n,) int: the robot that chose each vertex first, -1 where none did."""
        first = np.argmin(self.ticks, axis=0)
        return np.where(self.ticks.min(axis=0) == NEVER, -1, first)

    def edges(self, robot: int) -> np.ndarray:
        """Return the (m, 2) edges, child and parent, of a robot's tree."""
        child = np.flatnonzero(self.parents[robot] >= 0)
        return np.column_stack([child, self.parents[robot, child]])


def multi_prims(reduced: Graph, guards: np.ndarray, starts: Sequence[int] | np.ndarray) -> Forest:
    """Grow a tree for each robot from its (k,) start vertices until every guard that can be reached is visited.

    `guards` are vertices of `reduced`. Robots take turns by index, one guard a turn. A start that is a guard is visited at
    once, and owned by the robot of the lowest index that starts there.
    """
    k, n = len(starts), len(reduced.points)
    parents = np.full((k, n), ABSENT, dtype=np.int64)
    ticks = np.full((k, n), NEVER, dtype=np.int64)
    guard = np.zeros(n, dtype=np.bool_)
    guard[guards] = True
    last = np.array(starts, dtype=np.int64)
    for robot, start in enumerate(last):
        parents[robot, start] = ROOT
        if guard[start]:
            ticks[robot, start] = robot
    visited = (ticks != NEVER).any(axis=0)
    grow(reduced, guard, parents, ticks, visited, last, np.arange(k), k)
    return prune(Forest(parents, in_order(ticks), ticks))


def grow(
    reduced: Graph,
    guard: np.ndarray,
    parents: np.ndarray,
    ticks: np.ndarray,
    visited: np.ndarray,
    last: np.ndarray,
    turns: np.ndarray,
    tick: int,
) -> bool:
    """Let the robots in `turns` add a guard each by turns until none is left unvisited; changes the arrays in place.

    A turn takes the nearest immediate guard that nobody has visited; where there is none, the nearest that another has. An
    immediate guard can be reached from the tree by a path with no other guard and no vertex of the tree inside. Of guards
    equally near, the one farthest from those `last` chosen by the other robots, summed. Returns whether all are visited.
    """
    graph = (reduced.starts, reduced.indices, reduced.lengths, reduced.points)
    turns = np.asarray(turns, dtype=np.int64)
    while True:
        left, moved, tick = _grow(*graph, guard, parents, ticks, visited, last, turns, tick)
        if not left or not moved:
            return not left
        go_on("the growth of trees to the guards")


def prune(forest: Forest, robots: np.ndarray | None = None, seen: np.ndarray | None = None) -> Forest:
    """Let robots give up, from the most recently chosen on, guards that another visited sooner, or that are `seen` (n,).

    All go by the same ticks, so that no guard is lost. `robots` are indices, default all.
    """
    owners, ticks = forest.owners, forest.ticks.copy()
    parents = forest.parents.copy()
    for robot in range(len(parents)) if robots is None else robots:
        chosen = forest.chosen[robot]
        kept = len(chosen)
        while kept and (owners[chosen[kept - 1]] != robot or (seen is not None and seen[chosen[kept - 1]])):
            kept -= 1
        ticks[robot, chosen[kept:]] = NEVER
        root = np.flatnonzero(forest.parents[robot] == ROOT)
        parents[robot] = _chains(forest.parents[robot], np.concatenate([root, chosen[:kept]]))
    return Forest(parents, in_order(ticks), ticks)


def in_order(ticks: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return, per robot, the vertices that it has chosen in the order of their ticks (k, n)."""
    rows = [np.flatnonzero(row != NEVER) for row in ticks]
    return tuple(mine[np.argsort(row[mine], kind="stable")] for row, mine in zip(ticks, rows, strict=True))


@njit(cache=True)
def _chains(parent: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Return the parents of the kept vertices and all above them."""
    result = np.full(len(parent), -1, dtype=np.int64)
    for i in range(len(kept)):
        v = kept[i]
        while result[v] == -1:
            result[v] = parent[v]
            if parent[v] < 0:
                break
            v = parent[v]
    return result


@njit(cache=True)
def _grow(
    starts: np.ndarray,
    indices: np.ndarray,
    lengths: np.ndarray,
    points: np.ndarray,
    guard: np.ndarray,
    parents: np.ndarray,
    ticks: np.ndarray,
    visited: np.ndarray,
    last: np.ndarray,
    turns: np.ndarray,
    tick: int,
) -> tuple[int, bool, int]:
    """Let each robot take ROUNDS turns; return how many guards are left, whether any could move, and the next tick."""
    n = len(guard)
    for robot in turns:  # a start that another owned until it was lost is in the tree already
        for v in range(n):
            if guard[v] and not visited[v] and parents[robot, v] != -1:
                visited[v], ticks[robot, v], last[robot] = True, tick, v
                tick += 1
    left = 0
    for v in range(n):
        left += guard[v] and not visited[v]
    distance, before = np.empty(n), np.empty(n, dtype=np.int64)
    moved = True
    for _ in range(ROUNDS):
        if not (left and moved):
            break
        moved = False
        for robot in turns:
            if left == 0:
                break
            v = _nearest(
                starts, indices, lengths, points, guard, parents[robot], visited, last, turns, robot, distance, before
            )
            if v < 0:
                continue
            moved = True
            left -= not visited[v]
            visited[v] = True
            ticks[robot, v] = tick
            tick += 1
            last[robot] = v
            while parents[robot, v] == -1:
                parents[robot, v] = before[v]
                v = before[v]
    return left, moved, tick


@njit(cache=True)
def _nearest(
    starts: np.ndarray,
    indices: np.ndarray,
    lengths: np.ndarray,
    points: np.ndarray,
    guard: np.ndarray,
    parent: np.ndarray,
    visited: np.ndarray,
    last: np.ndarray,
    turns: np.ndarray,
    robot: int,
    distance: np.ndarray,
    before: np.ndarray,
) -> int:
    """Return the guard that a robot takes next, -1 if there is none; `before` then leads back to the tree."""
    distance[:] = np.inf
    heap = [(0.0, -1)]
    heappop(heap)
    for v in range(len(guard)):
        if parent[v] != -1:
            distance[v] = 0.0
            heappush(heap, (0.0, v))
    found = [-1, -1]  # unvisited, visited by another
    reach = [np.inf, np.inf]
    apart = [-1.0, -1.0]
    while heap:
        d, v = heappop(heap)
        if d > distance[v]:
            continue
        if d > reach[0] * (1 + TIE):
            break
        if guard[v] and parent[v] == -1:
            sort = 1 if visited[v] else 0
            if found[sort] < 0:
                reach[sort] = d
            if d <= reach[sort] * (1 + TIE):
                far = 0.0
                for other in turns:
                    if other != robot:
                        far += np.hypot(points[v, 0] - points[last[other], 0], points[v, 1] - points[last[other], 1])
                if far > apart[sort] * (1 + TIE) or (far >= apart[sort] * (1 - TIE) and v < found[sort]):
                    found[sort], apart[sort] = v, far
            continue
        for e in range(starts[v], starts[v + 1]):
            w = indices[e]
            if parent[w] == -1 and d + lengths[e] < distance[w]:
                distance[w], before[w] = d + lengths[e], v
                heappush(heap, (distance[w], w))
    return found[0] if found[0] >= 0 else found[1]
