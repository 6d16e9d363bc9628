"""The problem that searches, bounds and oracle take: plain arrays, times in seconds, robots and tasks by index."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from quarterdeck.geo.errors import InputError

LINEAR, POWER, LOGISTIC = 0, 1, 2
SHAPES = ("linear", "power", "logistic")


class Problem(NamedTuple):
    """n tasks and k robots in c classes (robots of a class travel alike). A NamedTuple, as numba takes it whole.

    `travel` (c, n, n) between tasks, symmetric; `out` (k, n) from a robot's start, `home` (k, n) to its end, `idle` (k,)
    from start to end; `kind` (k,) a robot's class. `service` (n,), `weight` (n,) of a task's start in the objective,
    `opens` and `closes` (n,) the window of its start, `tier` (n,) for hard tiers (all zero without), `can` (k, n),
    `endurance` (k,). `pred` (n, n) bool: row task waits for column task, transitively closed; `before` (n, most)
    the same as lists, filled up with -1; `group` (n,): tasks of one
    group ride with one robot, -1 is none. `near` (n, n - 1) the other tasks, nearest first. `level` (n,) is the paper's
    priority, read with `paper`. `shape`, `shape_a`, `shape_b`: the priority function and its parameters; `coupled`: a
    route's times depend on more than sums of its legs, so that candidates are judged by the whole schedule.
    """

    travel: np.ndarray
    out: np.ndarray
    home: np.ndarray
    idle: np.ndarray
    kind: np.ndarray
    service: np.ndarray
    weight: np.ndarray
    opens: np.ndarray
    closes: np.ndarray
    tier: np.ndarray
    can: np.ndarray
    endurance: np.ndarray
    pred: np.ndarray
    before: np.ndarray
    group: np.ndarray
    near: np.ndarray
    level: np.ndarray
    shape: int
    shape_a: float
    shape_b: float
    paper: bool
    mixed: bool
    coupled: bool


def problem(
    travel: np.ndarray,
    out: np.ndarray,
    home: np.ndarray,
    *,
    idle: np.ndarray | None = None,
    kind: np.ndarray | None = None,
    service: np.ndarray | None = None,
    weight: np.ndarray | None = None,
    windows: np.ndarray | None = None,
    tier: np.ndarray | None = None,
    can: np.ndarray | None = None,
    endurance: np.ndarray | None = None,
    after: Sequence[tuple[int, int, bool]] = (),
    level: np.ndarray | None = None,
    shape: str = "linear",
    shape_parameters: tuple[float, float] = (1.0, 1.0),
    paper: bool = False,
    names: Sequence[str] | None = None,
) -> Problem:
    """Return the problem of these arrays (see `Problem`); what is left out does not constrain.

    `travel` may be (n, n) for one class. `windows` is (n, 2). `after` holds (first, then, same_robot) task indices. `tier`
    makes a robot do higher tiers first; a task inherits the tier of those that wait for it. `paper` is the objective of the
    paper's eq. 4-6 with priorities `level`.

    Raises InputError if the precedence has a cycle, named with `names`.
    """
    travel = np.ascontiguousarray(np.atleast_3d(travel) if np.ndim(travel) == 3 else np.asarray(travel)[None], dtype=float)
    out, home = np.ascontiguousarray(out, dtype=float), np.ascontiguousarray(home, dtype=float)
    k, n = out.shape
    pred = closure(n, after, names or [str(i) for i in range(n)])
    group = groups(n, after)
    allowed = np.ones((k, n), bool) if can is None else np.array(can, dtype=bool)
    for g in range(group.max() + 1 if n else 0):  # a robot does the whole group or nothing of it
        allowed[:, group == g] = allowed[:, group == g].all(axis=1, keepdims=True)
    tiers = np.zeros(n, np.int64) if tier is None else np.array(tier, dtype=np.int64)
    tiers = np.array([max([tiers[i], *tiers[pred[:, i]]]) for i in range(n)], dtype=np.int64)
    window = np.tile([0.0, np.inf], (n, 1)) if windows is None else np.asarray(windows, dtype=float).reshape(n, 2)
    nearest = np.argsort(travel.min(axis=0) + np.diag(np.full(n, np.inf)), axis=1, kind="stable")[:, :-1]
    coupled = bool(paper or pred.any() or (group >= 0).any() or tiers.any() or shape != "linear")
    coupled |= bool((window[:, 0] > 0).any() or np.isfinite(window[:, 1]).any())
    return Problem(
        travel=travel,
        out=out,
        home=home,
        idle=np.zeros(k) if idle is None else np.ascontiguousarray(idle, dtype=float),
        kind=np.zeros(k, np.int64) if kind is None else np.asarray(kind, dtype=np.int64),
        service=np.zeros(n) if service is None else np.array(service, dtype=float),
        weight=np.zeros(n) if weight is None else np.array(weight, dtype=float),
        opens=np.ascontiguousarray(window[:, 0]),
        closes=np.ascontiguousarray(window[:, 1]),
        tier=tiers,
        can=allowed,
        endurance=np.full(k, np.inf) if endurance is None else np.array(endurance, dtype=float),
        pred=pred,
        before=_lists(pred),
        group=group,
        near=np.ascontiguousarray(nearest, dtype=np.int64),
        level=np.zeros(n) if level is None else np.array(level, dtype=float),
        shape=SHAPES.index(shape),
        shape_a=float(shape_parameters[0]),
        shape_b=float(shape_parameters[1]),
        paper=paper,
        mixed=not bool(allowed.all()),
        coupled=coupled,
    )


def closure(n: int, after: Sequence[tuple[int, int, bool]], names: Sequence[str]) -> np.ndarray:
    """Return (n, n) bool: row task comes after column task, transitively. Raises InputError naming a cycle."""
    import networkx as nx

    graph = nx.DiGraph()
    graph.add_nodes_from(range(n))
    graph.add_edges_from((a, b) for a, b, _ in after)
    try:
        cycle = nx.find_cycle(graph)
    except nx.NetworkXNoCycle:
        pred = np.zeros((n, n), bool)
        for task in nx.topological_sort(graph):
            for first in graph.predecessors(task):
                pred[task] |= pred[first]
                pred[task, first] = True
        return pred
    ring = " before ".join(names[a] for a, _ in cycle)
    raise InputError(f"tasks wait for each other in a circle: {ring} before {names[cycle[0][0]]}; remove one 'after'")


def _lists(pred: np.ndarray) -> np.ndarray:
    lists = np.full((len(pred), int(pred.sum(axis=1).max(initial=0))), -1, np.int64)
    for task, row in enumerate(pred):
        lists[task, : row.sum()] = np.flatnonzero(row)
    return lists


def groups(n: int, after: Sequence[tuple[int, int, bool]]) -> np.ndarray:
    """Return (n,) int: the group of tasks that `same_robot` ties together, numbered from 0 by first task; -1 is none."""
    import networkx as nx

    graph = nx.Graph()
    graph.add_edges_from((a, b) for a, b, same in after if same)
    group = np.full(n, -1, np.int64)
    for number, members in enumerate(sorted(nx.connected_components(graph), key=min)):
        group[list(members)] = number
    return group
