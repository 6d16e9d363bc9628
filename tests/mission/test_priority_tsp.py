"""The priority TSP against brute force, and its bound against its own length."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from quarterdeck.mission.priority_tsp import brute_force, priority_order

PLACES = st.lists(st.tuples(st.integers(0, 80), st.integers(0, 50), st.integers(0, 2)), min_size=1, max_size=7)


def distances(points: np.ndarray) -> np.ndarray:
    return np.hypot(*(points[:, None, :] - points[None, :, :]).transpose(2, 0, 1))


@given(PLACES)
@settings(deadline=None, max_examples=60)
def test_exact_order_is_as_short_as_the_best_of_all_orders(places: list[tuple[int, int, int]]) -> None:
    """Held-Karp per class finds what brute force finds, classes in order, each place once."""
    points = np.array([(40.0, 25.0), *((x, y) for x, y, _ in places)])
    ranks = np.array([r for _, _, r in places])
    ours, best = priority_order(distances(points), ranks), brute_force(distances(points), ranks)
    assert sorted(ours.order) == list(range(len(places)))
    assert [ranks[i] for i in ours.order] == sorted(ranks)
    # A tie in one class may end elsewhere and start the next from there: only the first class's length must agree exactly.
    first = [i for i in ours.order if ranks[i] == min(ranks)]
    reference = [i for i in best.order if ranks[i] == min(ranks)]
    assert path(points, first) == pytest.approx(path(points, reference))
    assert ours.length == pytest.approx(path(points, list(ours.order)))
    assert ours.gap == 0.0


def path(points: np.ndarray, order: list[int]) -> float:
    stops = points[[0, *(i + 1 for i in order)]]
    return float(np.hypot(*np.diff(stops, axis=0).T).sum())


@pytest.mark.parametrize("n", [12, 15])
def test_local_search_lies_between_its_bound_and_the_optimum(n: int) -> None:
    """Where the optimum is known, bound <= optimum <= local search, and the gap told covers the true one."""
    points = np.random.default_rng(n).uniform(0, 100, (n + 1, 2))
    one_class = np.zeros(n, dtype=int)
    exact = priority_order(distances(points), one_class)
    heuristic = priority_order(distances(points), one_class, exact_to=0)
    assert heuristic.bound <= exact.length + 1e-9 <= heuristic.length + 2e-9
    assert heuristic.length <= 1.02 * exact.length
    assert heuristic.gap >= 1 - exact.length / heuristic.length - 1e-9


def test_two_hundred_places_have_a_small_gap() -> None:
    """Beyond 15 places of a class the order is a permutation whose gap is told, and below 5 %."""
    points = np.random.default_rng(0).uniform(0, 100, (201, 2))
    found = priority_order(distances(points), np.zeros(200, dtype=int))
    assert sorted(found.order) == list(range(200))
    assert 0.0 < found.gap < 0.05


def test_nothing_to_visit() -> None:
    """No place, no path."""
    assert priority_order(np.zeros((1, 1)), np.zeros(0, dtype=int)).order == ()
