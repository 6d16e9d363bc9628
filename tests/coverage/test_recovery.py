from itertools import permutations

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from quarterdeck.coverage.forest import multi_prims
from quarterdeck.coverage.graph import Graph, graph_of
from quarterdeck.coverage.recovery import contacts, printed_supportive, recover, redivide, unseen_by
from quarterdeck.coverage.reduced import reduced_cdt

# Guards 0 to 5 in two rows of three; the rows are linked by the obstacle endpoint 6 alone (errata of Lemma 1).
TWO_ROWS = graph_of(
    np.array([[0.0, 0], [1, 0], [2, 0], [0, 9], [1, 9], [2, 9], [1, 4.5]]),
    np.array([[0, 1], [1, 2], [3, 4], [4, 5], [1, 6], [4, 6]]),
)


def _mask(n: int, *which: int) -> np.ndarray:
    mask = np.zeros(n, dtype=np.bool_)
    mask[list(which)] = True
    return mask


def test_lemma_1_fails_as_printed_and_holds_for_the_true_bridge() -> None:
    """The endpoint belongs to neither tree: no bridge by Definition 1, and yet the graph is connected."""
    forest = multi_prims(TWO_ROWS, np.arange(6), [0, 5])
    assert [sorted(c.tolist()) for c in forest.chosen] == [[0, 1, 2], [3, 4, 5]]
    assert nx.is_connected(TWO_ROWS.networkx())
    assert printed_supportive(TWO_ROWS, forest, _mask(2, 0)) == ()
    result = recover(TWO_ROWS, np.arange(6), forest, seen=_mask(7), lost=_mask(2, 0))
    assert result.supportive == (1,)
    assert sorted(result.forest.chosen[1].tolist()) == [0, 1, 2, 3, 4, 5]


def test_what_a_lost_robot_has_told_is_not_visited_again() -> None:
    """Only guards without a confirmed observation are released."""
    forest = multi_prims(TWO_ROWS, np.arange(6), [0, 5])
    result = recover(TWO_ROWS, np.arange(6), forest, seen=_mask(7, 0, 1, 5), lost=_mask(2, 0))
    assert sorted(unseen_by(result.forest, _mask(7, 0, 1, 5))[1].tolist()) == [2, 3, 4]


def test_nobody_left_in_a_part_is_told() -> None:
    """Where no working robot is, the guards come back as unreachable instead of an endless loop."""
    apart = graph_of(TWO_ROWS.points, TWO_ROWS.edges[(TWO_ROWS.edges != 6).all(axis=1)])
    forest = multi_prims(apart, np.arange(6), [0, 5])
    result = recover(apart, np.arange(6), forest, seen=_mask(7, 3), lost=_mask(2, 1))
    assert result.supportive == ()
    assert result.unreachable.tolist() == [4, 5]
    assert result.forest.chosen[0].tolist() == [0, 1, 2]


def test_only_robots_that_the_news_reaches_help() -> None:
    """The neighbour has not heard of the loss; the one beyond it has, and walks through."""
    line = graph_of(np.array([[float(i), 0.0] for i in range(9)]), np.array([[i, i + 1] for i in range(8)]))
    forest = multi_prims(line, np.arange(9), [0, 4, 8])
    heard = ~_mask(3, 1)
    result = recover(line, np.arange(9), forest, seen=_mask(9), lost=_mask(3, 0), informed=heard)
    assert result.supportive == (2,)
    assert set(forest.chosen[0].tolist()) <= set(result.forest.chosen[2].tolist())
    assert result.forest.chosen[1].tolist() == forest.chosen[1].tolist()


def test_a_common_start_goes_to_the_other_robot_when_its_owner_is_lost() -> None:
    """The start is the root of both trees; the second robot gave it up to the first, and takes it back."""
    line = graph_of(np.array([[float(i), 0.0] for i in range(5)]), np.array([[i, i + 1] for i in range(4)]))
    forest = multi_prims(line, np.arange(5), [2, 2])
    result = recover(line, np.arange(5), forest, seen=_mask(5), lost=_mask(2, 0))
    assert sorted(unseen_by(result.forest, _mask(5))[1].tolist()) == [0, 1, 2, 3, 4]


def test_news_travels_by_hops_between_working_robots() -> None:
    """Robots 10 m apart in a row with 12 m of range hear each other unless the one between is lost."""
    places = np.array([[0.0, 0], [10, 0], [20, 0]])
    assert contacts(places, np.array([True, True, True]), 12.0).all()
    assert not contacts(places, np.array([True, False, True]), 12.0)[0, 2]


def test_a_robot_that_joins_gets_a_part() -> None:
    """A new division from where the robots are now covers what is unseen, and only that."""
    line = graph_of(np.array([[float(i), 0.0] for i in range(9)]), np.array([[i, i + 1] for i in range(8)]))
    seen = _mask(9, 0, 1)
    forest = redivide(line, np.arange(9), seen=seen, entries=np.array([1, 8]), lost=_mask(2))
    left = unseen_by(forest, seen)
    assert sorted(np.concatenate(left).tolist()) == [2, 3, 4, 5, 6, 7, 8]
    assert min(map(len, left)) >= 3


def random_reduced(rng: np.random.Generator) -> tuple[Graph, np.ndarray]:
    """Return the Reduced-CDT of a random Delaunay graph, and its guards."""
    points = rng.uniform(0, 100, (int(rng.integers(8, 50)), 2))
    triangles = Delaunay(points).simplices
    edges = np.unique(np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    guards = np.sort(rng.permutation(len(points))[: int(rng.integers(4, len(points)))])
    return reduced_cdt(graph_of(points, edges), guards), guards


@pytest.mark.parametrize("seed", range(4))
def test_all_orders_of_all_losses_of_five_robots_leave_nothing_unseen(seed: int) -> None:
    """Theorem 1, exhaustively: whoever is left owns every guard that is not seen, after each of 120 orders."""
    rng = np.random.default_rng(seed)
    reduced, guards = random_reduced(rng)
    first = multi_prims(reduced, guards, rng.choice(np.unique(reduced.edges), 5))
    for order in permutations(range(5)):
        forest, lost, seen = first, _mask(5), np.zeros(len(reduced.points), dtype=np.bool_)
        for robot in order[:4]:
            mine = unseen_by(forest, seen)[robot]
            seen[mine[: len(mine) // 2]] = True
            lost[robot] = True
            result = recover(reduced, guards, forest, seen=seen, lost=lost)
            forest = result.forest
            assert not len(result.unreachable)
            owned = np.concatenate(unseen_by(forest, seen))
            assert sorted(owned.tolist()) == sorted(guards[~seen[guards]].tolist())


@settings(deadline=None, max_examples=120)
@given(st.integers(0, 2**32 - 1))
def test_any_batches_of_losses_leave_nothing_unseen(seed: int) -> None:
    """2 to 10 robots, batches of any size up to all but one: owned guards and seen ones are all guards, each owned once."""
    rng = np.random.default_rng(seed)
    reduced, guards = random_reduced(rng)
    k = int(rng.integers(2, 11))
    forest = multi_prims(reduced, guards, rng.choice(np.unique(reduced.edges), k))
    doomed = rng.permutation(k)[: int(rng.integers(1, k))]
    lost, seen = _mask(k), np.zeros(len(reduced.points), dtype=np.bool_)
    for batch in np.split(doomed, np.sort(rng.integers(0, len(doomed), int(rng.integers(0, 3))))):
        seen[rng.choice(guards, int(rng.integers(0, len(guards) // 2)), replace=False)] = True
        lost[batch] = True
        forest = recover(reduced, guards, forest, seen=seen, lost=lost).forest
        assert sorted(np.concatenate(unseen_by(forest, seen)).tolist()) == guards[~seen[guards]].tolist()
        assert all(not len(forest.chosen[r]) for r in np.flatnonzero(lost))


def test_the_printed_definition_loses_guards_in_random_schedules() -> None:
    """Among graphs like those above, Definition 1 leaves a lost tree without any supportive one."""
    rng = np.random.default_rng(0)
    without = 0
    for _ in range(60):
        reduced, guards = random_reduced(rng)
        forest = multi_prims(reduced, guards, rng.choice(np.unique(reduced.edges), 3))
        without += any(len(forest.chosen[r]) and not printed_supportive(reduced, forest, _mask(3, r)) for r in range(3))
    assert without > 0
