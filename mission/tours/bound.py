"""What no schedule can beat."""

import numpy as np
from scipy.sparse.csgraph import minimum_spanning_tree

from quarterdeck.mission.tours.problem import Problem
from quarterdeck.mission.tours.schedule import shaped


def lower_bound(p: Problem) -> float:
    """Return a lower bound of the objective; 0 under the paper's, whose costs are no times.

    Travel obeys the triangle rule. The makespan is at least the way to the farthest task, its service and the way home,
    after all that must come before it; and at least the k-th part of all service and of a tree that spans tasks and
    depots. Starts are at least the earliest.
    """
    k, n = p.out.shape
    if p.paper or n == 0:
        return 0.0
    out = np.where(p.can, p.out, np.inf).min(axis=0)
    home = np.where(p.can, p.home, np.inf).min(axis=0)
    travel = p.travel.min(axis=0)
    earliest = np.maximum(out, p.opens)
    for task in np.argsort(p.pred.sum(axis=1), kind="stable"):  # fewer before it comes first: the relation is transitive
        for first in np.flatnonzero(p.pred[task]):
            ride = travel[first, task] if p.group[first] >= 0 and p.group[first] == p.group[task] else 0.0
            earliest[task] = max(earliest[task], earliest[first] + p.service[first] + ride)
    farthest = float((earliest + p.service + home).max())
    graph = np.zeros((n + 1, n + 1))
    graph[1:, 1:], graph[0, 1:] = travel, out
    graph = np.where(np.isfinite(graph), graph + 1e-12, 0.0)  # zero would be no edge to scipy
    spanning = float(minimum_spanning_tree(graph).sum()) - 1e-12 * (n + 1)
    shared = (spanning + float(p.service.sum() + home.min())) / k
    urgent = sum(float(p.weight[i]) * shaped(p, float(earliest[i])) for i in np.flatnonzero(p.weight > 0))
    return max(farthest, shared, float(p.idle.max())) + urgent
