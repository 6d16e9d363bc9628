"""The ECDIS paper's tables: what is claimed of them holds, and the command prints them."""

import json

import pytest
from click.testing import CliRunner

from quarterdeck.reproduce.ecdis import TABLE_1, command, table_1, table_2, table_delta


def test_table_1_optimised_beats_none_and_f1_holds_the_most():
    """Every optimised row beats no optimisation, and as many cells fit as the paper's 4.48 km."""
    rows = {row["index"]: row for row in table_1(range(2))}
    for way in ("F1", "F1+F2", "F1+F2+F3"):
        assert min(rows[way]["poc"]) > max(rows["none"]["poc"])
        assert max(rows[way]["length"]) <= max(rows["F1"]["length"])
    assert min(rows["F1"]["length"]) >= TABLE_1["F1"][2]
    assert min(rows["F1+F2+F3"]["cell_poc"]) >= 0.9142


def test_table_2_coverage_hardly_depends_on_the_number_of_vehicles():
    """Ten times the vehicles change the coverage by less than 2 points; five get their shares to within one hypervertex."""
    few, many = table_2([5, 50])
    assert few["poc"] == pytest.approx(many["poc"], abs=0.02)
    assert few["share_error_hypervertices"] <= 1.0
    assert many["turns"] > few["turns"]


def test_claim_at_delta_10_holds_with_the_cells_at_the_edge():
    """More than 97 % at delta = 10 m, once the free cells at the edge are covered too."""
    rows = {row["edge"]: row["poc"] for row in table_delta([10.0])}
    assert rows["cells"] > 0.97
    assert rows["lap"] > rows["cells"] > rows["whole"]


def test_command_prints_json_and_a_table():
    """One JSON object for programs; for people a table with the paper's figures and the reasons for differences."""
    result = CliRunner().invoke(command, ["--table", "delta", "--json"])
    assert list(json.loads(result.stdout)) == ["delta"]
    result = CliRunner().invoke(command, ["--table", "1", "--seeds", "1"])
    assert "91.42" in result.stdout
    assert "Does not follow" in result.stdout
