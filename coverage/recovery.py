"""What the forest becomes when robots are lost, come back or join (fault-tolerant-cdt, Algorithm 2, mended).

Lemma 1 is false for bridges as Definition 1 prints them: two trees whose only link runs over an obstacle endpoint that
neither owns have none, and Algorithm 2 then loses guards or never ends. Here a bridge is a path in the reduced graph
with no guard of a working robot inside: in a connected graph every lost tree has one. Ticks of lost robots are erased
first, or their visits would pop guards that helpers must keep.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from quarterdeck.coverage.forest import ABSENT, NEVER, ROOT, Forest, grow, in_order, prune
from quarterdeck.coverage.graph import Graph


@dataclass(frozen=True, slots=True)
class Recovery:
    """The `forest` after a loss, who helped (`supportive`, robots by index) and the vertices of guards that nobody can
    reach any more (`unreachable`).
    """

    forest: Forest
    supportive: tuple[int, ...]
    unreachable: np.ndarray


def recover(
    reduced: Graph,
    guards: np.ndarray,
    forest: Forest,
    *,
    seen: np.ndarray,
    lost: np.ndarray,
    informed: np.ndarray | None = None,
) -> Recovery:
    """Return the forest in which working robots have taken over what the lost ones leave unseen.

    `guards` (m,) are vertices of `reduced`; `seen` (n,) bool: vertices from which an observation is confirmed; `lost` (k,)
    bool: all robots that are lost by now; `informed` (k,) bool: robots that the news reaches, default all. Only informed
    robots take over; what the others still have before them stays theirs. A pure function: several losses at once,
    losses during recovery and any order all have a defined result. `unreachable` is empty while a working, informed
    robot is in every connected part of the graph that has something left to see.
    """
    k, n = forest.parents.shape
    helpers = ~lost if informed is None else ~lost & informed
    is_guard = np.zeros(n, dtype=np.bool_)
    is_guard[guards] = True
    parents, ticks = forest.parents.copy(), forest.ticks.copy()
    fallen = (parents[lost] != ABSENT).any(axis=0) if lost.any() else np.zeros(n, dtype=np.bool_)
    parents[lost], ticks[lost] = ABSENT, NEVER
    visited = seen | (ticks != NEVER).any(axis=0)
    released = is_guard & ~visited
    if not released.any():
        return Recovery(Forest(parents, in_order(ticks), ticks), (), np.empty(0, dtype=np.int64))
    supportive = np.flatnonzero(_bridged(reduced.starts, reduced.indices, fallen | released, parents, helpers))
    last = np.array([_last(parents[r], ticks[r]) for r in range(k)], dtype=np.int64)
    used = ticks[ticks != NEVER]
    tick = int(used.max()) + 1 if used.size else 0
    if len(supportive):
        grow(reduced, is_guard, parents, ticks, visited, last, supportive, tick)
    after = prune(Forest(parents, in_order(ticks), ticks), supportive, seen)
    return Recovery(after, tuple(supportive.tolist()), np.flatnonzero(is_guard & ~visited))


def redivide(reduced: Graph, guards: np.ndarray, *, seen: np.ndarray, entries: np.ndarray, lost: np.ndarray) -> Forest:
    """Return a new forest over what is not yet seen, from where the working robots are: for robots that join or return.

    `entries` (k,) are the vertices at which robots are now; the rows of lost robots are empty.
    """
    k, n = len(entries), len(reduced.points)
    parents = np.full((k, n), ABSENT, dtype=np.int64)
    ticks = np.full((k, n), NEVER, dtype=np.int64)
    is_guard = np.zeros(n, dtype=np.bool_)
    is_guard[guards] = True
    turns = np.flatnonzero(~lost)
    for robot in turns:
        parents[robot, entries[robot]] = ROOT
        if is_guard[entries[robot]] and not seen[entries[robot]]:
            ticks[robot, entries[robot]] = robot
    visited = seen | (ticks != NEVER).any(axis=0)
    grow(reduced, is_guard, parents, ticks, visited, np.asarray(entries, dtype=np.int64).copy(), turns, k)
    return prune(Forest(parents, in_order(ticks), ticks), turns, seen)


def printed_supportive(reduced: Graph, forest: Forest, lost: np.ndarray) -> tuple[int, ...]:
    """Return the supportive robots by Definition 1 as printed: a vertex in common with a lost tree, or an edge between.

    Only to show that Lemma 1 fails: this can be empty in a connected graph.
    """
    inside = forest.parents != ABSENT
    fallen = inside[lost].any(axis=0)
    a, b = reduced.edges.T
    touched = fallen.copy()
    touched[a[fallen[b]]] = True
    touched[b[fallen[a]]] = True
    return tuple(np.flatnonzero((inside & touched).any(axis=1) & ~lost).tolist())


def contacts(positions: np.ndarray, working: np.ndarray, reach: float) -> np.ndarray:
    """Return (k, k) bool: who can tell whom, over any number of hops of at most `reach` metres between working robots."""
    away = np.linalg.norm(positions[:, None] - positions[None], axis=2)
    near = (away <= reach) & working[:, None] & working[None]
    _, group = connected_components(csr_array(near), directed=False)
    return (group[:, None] == group[None]) & working[:, None] & working[None]


def unseen_by(forest: Forest, seen: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return per robot the vertices of guards that it still has to visit, in the order of their selection, each once.

    A guard that two robots chose is the owner's.
    """
    owners = forest.owners
    rows: Sequence[np.ndarray] = forest.chosen
    return tuple(row[(owners[row] == robot) & ~seen[row]] for robot, row in enumerate(rows))


def _last(parent: np.ndarray, ticks: np.ndarray) -> int:
    mine = np.flatnonzero(ticks != NEVER)
    if len(mine):
        return int(mine[np.argmax(ticks[mine])])
    root = np.flatnonzero(parent == ROOT)
    return int(root[0]) if len(root) else 0


@njit(cache=True)
def _bridged(
    starts: np.ndarray, indices: np.ndarray, sources: np.ndarray, parents: np.ndarray, helpers: np.ndarray
) -> np.ndarray:
    """Return (k,) bool: helpers whose tree is met first on paths from the sources, through what is in no helper's tree."""
    k, n = parents.shape
    found = np.zeros(k, dtype=np.bool_)
    reached = np.zeros(n, dtype=np.bool_)
    queue = np.empty(n, dtype=np.int64)
    head = tail = 0
    for v in range(n):
        if sources[v]:
            queue[tail], reached[v] = v, True
            tail += 1
    while head < tail:
        v = queue[head]
        head += 1
        held = False
        for robot in range(k):
            if helpers[robot] and parents[robot, v] != -1:
                found[robot] = True
                held = True
        if held:
            continue
        for e in range(starts[v], starts[v + 1]):
            if not reached[indices[e]]:
                reached[indices[e]] = True
                queue[tail] = indices[e]
                tail += 1
    return found
