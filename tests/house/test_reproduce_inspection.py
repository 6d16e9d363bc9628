"""`quarterdeck reproduce inspection`: the published plans, and the behaviours of Figs 3 to 6 on a ward of our own."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from quarterdeck.geo.errors import InputError
from quarterdeck.mission.tours.exact import enumerate_plans
from quarterdeck.mission.tours.problem import problem
from quarterdeck.mission.tours.search import search
from quarterdeck.reproduce.inspection import command, read_distances

CASES = Path(__file__).parents[2].parent / "shared" / "data" / "casestudy_dist.json"


@pytest.mark.skipif(not CASES.exists(), reason=f"needs {CASES}")
def test_every_published_plan_is_optimal_on_the_authors_distances():
    """All five published plans have the best fitness of all plans, and our search finds it."""
    result = CliRunner().invoke(command, ["--distances", str(CASES), "--json"])
    assert result.exit_code == 0, result.output
    rows = {row["case"]: row for row in json.loads(result.stdout)}
    fitness = {"none": 21.22, "priority": 28.01, "time": 92.08, "precedence": 23.09, "mixed": 42.75}
    for case, expected in fitness.items():
        found = [rows[case][key] for key in ("published_fitness", "optimum", "ours")]
        assert found == pytest.approx([expected] * 3, abs=0.005)
        assert rows[case]["paper_ga_reached"] >= 5
        assert rows[case]["operator_optimal"]


def test_our_hall_draws(tmp_path):
    """The pictures of all five cases are made on our own hall, and not overwritten unasked."""
    result = CliRunner().invoke(command, ["-o", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert len(list(tmp_path.glob("*.png"))) == 5
    assert isinstance(CliRunner().invoke(command, ["-o", str(tmp_path)]).exception, InputError)


def test_a_wrong_matrix_is_one_line(tmp_path):
    """A file that is no 7 x 7 matrix is told in one line."""
    (tmp_path / "d.json").write_text('{"dist": [[0, 1], [2, 0]]}')
    with pytest.raises(InputError, match="7 x 7"):
        read_distances(str(tmp_path / "d.json"))


# A ward of our own: two robots at (0, 0) and (100, 0); t0 the nurse, t1 the paperwork on the way to t2, the medicine,
# t3 the gauge. Metres, 1 m/s.
WARD = np.array([[90.0, 30.0], [22.0, 25.0], [10.0, 60.0], [95.0, -30.0], [0.0, 0.0], [100.0, 0.0]])


def ward(priority=(0, 0, 0, 0), service=(0, 0, 0, 0), after=()):
    """The ward under eq. 4-6: each robot's tasks in order, by enumeration, which the search must reach."""
    distance = np.linalg.norm(WARD[:, None] - WARD, axis=2)
    p = problem(
        distance[:4, :4],
        distance[4:, :4],
        distance[4:, :4],
        service=np.array(service, float),
        level=np.array(priority, float),
        after=[(a, b, True) for a, b in after],
        paper=True,
    )
    seq, length, optimum, _ = enumerate_plans(p)
    assert search(p, iterations=5).objective == pytest.approx(optimum, rel=1e-9)
    return [seq[r, : length[r]].tolist() for r in range(2)]


def order(rows, first, then):
    """Whether one robot does both tasks, in this order."""
    return any(first in row and then in row and row.index(first) < row.index(then) for row in rows)


def test_priorities_change_orders():
    """Fig. 4: with t0 and t2 urgent each comes first; with t1 important too, it is taken on the way."""
    rows = ward(priority=(3, 0, 3, 0))
    assert order(rows, 2, 1)
    assert order(rows, 0, 3)
    assert order(ward(priority=(3, 1, 3, 0)), 1, 2)


def test_service_time_flips_them_back():
    """Fig. 5: with three minutes at t1 the emergency waits for it no more; with five at t0 one robot does that alone."""
    assert not order(ward(priority=(3, 1, 3, 0), service=(0, 180, 0, 0)), 1, 2)
    rows = ward(service=(300, 0, 0, 0))
    assert [0] in rows


def test_precedence_is_kept_by_one_robot():
    """Fig. 6: t1 before t0 before t2, and t3 before t2, in one robot each."""
    rows = ward(after=[(1, 0), (0, 2)])
    assert order(rows, 1, 0)
    assert order(rows, 0, 2)
    assert order(ward(after=[(3, 2)]), 3, 2)
