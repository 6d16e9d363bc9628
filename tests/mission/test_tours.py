"""The evaluator against longest paths, the searches against enumeration, on random problems of every combination."""

import json
from itertools import pairwise
from pathlib import Path

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from quarterdeck.geo.errors import InputError
from quarterdeck.mission.tours.descent import descend
from quarterdeck.mission.tours.exact import enumerate_plans
from quarterdeck.mission.tours.problem import Problem, problem
from quarterdeck.mission.tours.rng import stream
from quarterdeck.mission.tours.schedule import schedule
from quarterdeck.mission.tours.search import search

CASES = Path(__file__).parents[2].parent / "shared" / "data" / "casestudy_dist.json"
SHARED = pytest.mark.skipif(not CASES.exists(), reason=f"needs {CASES}")


def small(seed: int) -> Problem:
    """A random problem of up to 5 tasks and 3 robots: each of the 64 combinations of features comes every 64 seeds."""
    rng = np.random.default_rng(seed)
    priority, service, precedence, depots, speeds, windows = ((seed >> bit) & 1 for bit in range(6))
    n, k = int(rng.integers(1, 6)), int(rng.integers(1, 4))
    points, starts = rng.uniform(0, 100, (n, 2)), rng.uniform(0, 100, (k, 2)) if depots else np.tile([[50.0, 50.0]], (k, 1))
    ends = rng.uniform(0, 100, (k, 2)) if depots and seed % 3 == 0 else starts
    pace = 1 / rng.uniform(0.5, 2.0, k) if speeds else np.ones(k)
    travel = np.linalg.norm(points[:, None] - points, axis=2) * pace[:, None, None]
    order = rng.permutation(n)
    pairs = [(int(order[a]), int(order[b])) for a in range(n) for b in range(a + 1, n) if rng.random() < 0.3]
    late = np.where(rng.random(n) < 0.3, rng.uniform(50, 150, n), np.inf)
    able = rng.random((k, n)) < 0.8
    able[0] = True
    return problem(
        travel,
        np.linalg.norm(starts[:, None] - points, axis=2) * pace[:, None],
        np.linalg.norm(ends[:, None] - points, axis=2) * pace[:, None],
        idle=np.linalg.norm(starts - ends, axis=1) * pace,
        kind=np.arange(k),
        service=rng.uniform(0, 60, n) if service else None,
        weight=rng.choice([0.0, 0.1, 0.3, 1.0], n) if priority else None,
        windows=np.column_stack([np.where(rng.random(n) < 0.3, 40.0, 0.0), late]) if windows else None,
        endurance=rng.uniform(150, 400, k) if windows else None,
        can=able if seed % 5 == 0 else None,
        after=[(a, b, bool(rng.random() < 0.4)) for a, b in pairs] if precedence else (),
        tier=rng.integers(0, 3, n) if seed % 7 == 0 else None,
        shape=("linear", "power", "logistic")[seed % 3] if seed % 11 == 0 else "linear",
        shape_parameters=(60.0, 2.0),
    )


def test_search_agrees_with_enumeration_on_500_problems():
    """The search reaches the exact optimum, and its bound never exceeds it."""
    for seed in range(500):
        p = small(seed)
        found = search(p, iterations=4, seed=seed)
        optimum = enumerate_plans(p)[2]
        assert found.objective + 1000.0 * found.late == pytest.approx(optimum, rel=1e-9, abs=1e-7), seed
        assert found.bound <= optimum * (1 + 1e-9), seed


@settings(deadline=None, max_examples=100)
@given(st.integers(0, 10**6))
def test_schedule_is_the_longest_path(seed):
    """Starts are the longest paths over route and precedence arcs, computed by networkx; a cycle is refused."""
    p = small(seed)
    k, n = p.out.shape
    rng = np.random.default_rng(seed)
    owner = rng.integers(0, k, n)
    rows = [[int(i) for i in rng.permutation(n) if owner[i] == r] for r in range(k)]
    seq, length = np.zeros((k, n), np.int64), np.array([len(row) for row in rows])
    for r, row in enumerate(rows):
        seq[r, : len(row)] = row
    start, done = np.empty(n), np.empty(k)
    objective, total, late = schedule(p, seq, length, start, done)
    graph = nx.DiGraph([(int(a), int(b)) for b, a in zip(*np.nonzero(p.pred), strict=True)])
    graph.add_nodes_from(range(n))
    graph.add_edges_from((a, b) for row in rows for a, b in pairwise(row))
    torn = any(len({owner[i] for i in np.flatnonzero(p.group == g)}) > 1 for g in range(n) if (p.group == g).any())
    barred = not all(p.can[owner[i], i] for i in range(n))
    upside = any(p.tier[b] > p.tier[a] for row in rows for a, b in pairwise(row))
    if torn or barred or upside or not nx.is_directed_acyclic_graph(graph):
        assert objective == np.inf
        return
    expected = {}
    for task in nx.topological_sort(graph):
        row = rows[owner[task]]
        at = row.index(task)
        travel = p.travel[owner[task]]
        begin = (
            p.out[owner[task], task]
            if at == 0
            else expected[row[at - 1]] + p.service[row[at - 1]] + travel[row[at - 1], task]
        )
        ready = [expected[first] + p.service[first] for first in np.flatnonzero(p.pred[task])]
        expected[task] = max([begin, p.opens[task], *ready])
    np.testing.assert_allclose(start, [expected[i] for i in range(n)], rtol=1e-12)
    ends = [expected[row[-1]] + p.service[row[-1]] + p.home[r, row[-1]] if row else p.idle[r] for r, row in enumerate(rows)]
    np.testing.assert_allclose(done, ends, rtol=1e-12)
    tardy = sum(max(0.0, expected[i] - p.closes[i]) for i in range(n))
    tardy += sum(max(0.0, e - m) for e, m in zip(ends, p.endurance, strict=True))
    assert late == pytest.approx(tardy)
    assert total == pytest.approx(sum(ends))


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10**6), st.integers(2, 40), st.integers(1, 6))
def test_descent_keeps_every_task_and_its_value_is_true(seed, n, k):
    """The local search, judging by prefix sums, ends with every task once and with the value of the real schedule."""
    rng = np.random.default_rng(seed)
    points, starts = rng.uniform(0, 100, (n, 2)), rng.uniform(0, 100, (k, 2))
    pace = rng.uniform(0.5, 2.0, k)
    out = np.linalg.norm(starts[:, None] - points, axis=2) * pace[:, None]
    able = rng.random((k, n)) < 0.8
    able[0] = True
    p = problem(
        np.linalg.norm(points[:, None] - points, axis=2) * pace[:, None, None],
        out,
        out,
        kind=np.arange(k),
        service=rng.uniform(0, 30, n),
        weight=rng.choice([0.0, 0.3], n),
        can=able,
        endurance=np.full(k, 300.0),
    )
    seq, length = np.zeros((k, n), np.int64), np.zeros(k, np.int64)
    seq[0], length[0] = rng.permutation(n), n
    start, done = np.empty(n), np.empty(k)
    before = schedule(p, seq, length, start, done)
    result = descend(p, seq, length, 0.01, stream(seed))
    objective, total, late = schedule(p, seq, length, start, done)
    assert sorted(int(i) for r in range(k) for i in seq[r, : length[r]]) == list(range(n))
    assert result == pytest.approx(objective + 0.01 * total + 1000.0 * late, rel=1e-9)
    assert result <= before[0] + 0.01 * before[1] + 1000.0 * before[2] + 1e-9


def test_same_seed_same_solution():
    """Two runs with one seed give one solution, bit for bit."""
    p = small(63)
    one, two = search(p, iterations=5, seed=3), search(p, iterations=5, seed=3)
    assert one.rows == two.rows
    np.testing.assert_array_equal(one.start, two.start)


def test_a_cycle_is_named():
    """Tasks that wait for each other in a circle are an error that names them in order."""
    with pytest.raises(InputError, match="b before c before b"):
        problem(
            np.zeros((3, 3)),
            np.zeros((1, 3)),
            np.zeros((1, 3)),
            after=[(1, 2, False), (2, 1, False)],
            names=["a", "b", "c"],
        )


PAPER = {  # priorities, services, precedence, published rows, fitness: PAPERS.md section 3, figures computed there
    "none": ({}, {}, (), ((0, 3), (2, 4, 1)), 21.22),
    "priority": ({2: 3, 4: 3}, {}, (), ((4, 0, 3), (2, 1)), 28.01),
    "time": ({}, {0: 20, 1: 20, 2: 20, 3: 20, 4: 60}, (), ((3, 0, 1), (2, 4)), 92.08),
    "precedence": ({}, {}, ((1, 2), (0, 4)), ((3, 0, 4), (1, 2)), 23.09),
    "mixed": ({0: 3, 2: 1}, {4: 30}, ((1, 3),), ((0, 1, 3), (2, 4)), 42.75),
}


@SHARED
@pytest.mark.parametrize("case", PAPER)
def test_published_plans_are_optimal(case):
    """Under eq. 4-6 each published plan has the fitness that enumeration finds least, and our search reaches it."""
    priorities, services, after, published, fitness = PAPER[case]
    dist = np.array(json.loads(CASES.read_text())["dist"])
    p = problem(
        dist[:5, :5],
        dist[5:, :5],
        dist[5:, :5],
        service=np.array([services.get(i, 0) for i in range(5)], float),
        level=np.array([priorities.get(i, 0) for i in range(5)], float),
        after=[(a, b, True) for a, b in after],
        paper=True,
    )
    seq, length = np.zeros((2, 5), np.int64), np.array([len(row) for row in published])
    for r, row in enumerate(published):
        seq[r, : len(row)] = row
    start, done = np.empty(5), np.empty(2)
    theirs = schedule(p, seq, length, start, done)[0]
    optimum = enumerate_plans(p)[2]
    assert optimum == pytest.approx(fitness, abs=0.005)
    assert theirs == pytest.approx(optimum, rel=1e-9)
    assert search(p, iterations=5).objective == pytest.approx(optimum, rel=1e-9)


def test_ctrl_c_gives_the_best_so_far():
    """An interrupted search returns the best it has, whole; one interrupted before it has any is an interruption."""

    def interrupt(done, best, bound):
        if done == 3:
            raise KeyboardInterrupt

    found = search(small(61), iterations=50, progress=interrupt)
    assert found.stopped == "interrupted"
    assert found.iterations == 3
    assert sorted(i for row in found.rows for i in row) == list(range(len(found.start)))


def test_the_deadline_cuts_and_says_so():
    """A time limit ends the search after the generation in which it is over."""
    ticks = iter(range(100))
    found = search(small(61), iterations=50, time_limit=4.0, clock=lambda: float(next(ticks)))
    assert found.stopped == "time limit"
    assert found.iterations == 4
