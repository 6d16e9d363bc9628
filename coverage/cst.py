"""Closed tours on trees: Double-MST, Revised-DMST and the constrained spanning tour (fault-tolerant-cdt, section II-D)."""

import numpy as np

from quarterdeck.coverage.graph import Graph


def doubled(parent: np.ndarray, points: np.ndarray) -> list[int]:
    """Return the vertices of Double-MST: a depth-first walk from the root and back, every edge twice.

    `parent` (n,) holds -2 at the root, -1 outside the tree; children go by length of the edge, then index.
    """
    root = int(np.flatnonzero(parent == -2)[0])
    children: dict[int, list[int]] = {}
    for v in np.flatnonzero(parent >= 0).tolist():
        children.setdefault(int(parent[v]), []).append(v)
    for v, below in children.items():
        below.sort(key=lambda w, v=v: (-np.linalg.norm(points[w] - points[v]), -w))  # type: ignore[misc] # popped from the end
    walk, stack = [root], [root]
    while stack:
        if below := children.get(stack[-1], []):
            stack.append(below.pop())
            walk.append(stack[-1])
        else:
            stack.pop()
            if stack:
                walk.append(stack[-1])
    return walk


def constrained_tour(parent: np.ndarray, guards: np.ndarray, graph: Graph) -> list[int]:
    """Return the vertices of CST: closed, from the root to every one of the (m,) guards and back.

    It walks Double-MST and from each place cuts across to the farthest place, up to the next guard not yet visited, that an
    edge of `graph` (the CDT) leads to; the next place of the walk is always one. So it is never longer than Double-MST.
    """
    walk = doubled(parent, graph.points)
    wanted = {int(g) for g in guards}
    tour, at = [walk[0]], 0
    wanted.discard(walk[0])
    while at < len(walk) - 1:
        goal = next((i for i in range(at + 1, len(walk)) if walk[i] in wanted), len(walk) - 1)
        here = walk[at]
        around = set(graph.indices[graph.starts[here] : graph.starts[here + 1]].tolist())
        at = next((i for i in range(goal, at + 1, -1) if walk[i] in around or walk[i] == here), at + 1)
        if walk[at] != here:
            tour.append(walk[at])
        wanted.discard(walk[at])
    return tour


def revised_tour(parent: np.ndarray, guards: np.ndarray, points: np.ndarray) -> list[int]:
    """Return Revised-DMST over the guards: the walk's first visits, straight on, through walls if need be.

    Only a yardstick for Property 1. It visits root and guards alone: measured over all vertices the property fails, as CST
    leaves out obstacle endpoints.
    """
    walk = doubled(parent, points)
    wanted = {int(g) for g in guards} | {walk[0]}
    first = [v for v in dict.fromkeys(walk) if v in wanted]
    return [*first, walk[0]]


def tour_length(tour: list[int], points: np.ndarray) -> float:
    """Return the metres along a tour of vertices."""
    return float(np.linalg.norm(np.diff(points[tour], axis=0), axis=1).sum())
