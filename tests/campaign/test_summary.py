"""What the runs prove."""

import csv
import io

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from quarterdeck.campaign.summary import as_csv, as_parquet, badness, kinds, wilson


def row(number: int, **changes: object) -> dict[str, object]:
    """Return a row of a run that passed."""
    base = {
        "number": number,
        "passed": True,
        "error": "",
        "reasons": "",
        "coverage_driven": 0.99,
        "clearance": None,
        "time": 9.0,
    }
    return base | changes


@given(runs=st.integers(1, 5000), data=st.data(), confidence=st.sampled_from([0.9, 0.95, 0.99]))
def test_the_interval_is_scipys(runs: int, data: st.DataObject, confidence: float) -> None:
    """Wilson's interval, as scipy's binomial test has it."""
    passed = data.draw(st.integers(0, runs))
    want = binomtest(passed, runs).proportion_ci(confidence, method="wilson")
    assert wilson(passed, runs, confidence) == pytest.approx((want.low, want.high), abs=1e-12)


def test_nothing_is_known_without_runs() -> None:
    """Any probability is possible."""
    assert wilson(0, 0) == (0.0, 1.0)


def test_the_worst_comes_first() -> None:
    """Errors, then failures with more reasons, then those that passed with less coverage."""
    rows = [
        row(0),
        row(1, coverage_driven=0.9),
        row(2, passed=False, reasons="collision: a"),
        row(3, passed=False, error="ValueError: x"),
        row(4, passed=False, reasons="collision: a | did not finish: a"),
    ]
    assert [r["number"] for r in sorted(rows, key=badness)] == [3, 4, 2, 1, 0]


def test_a_reason_with_a_semicolon_counts_once() -> None:
    """What is told of the limit, or what to do, is no reason of its own."""
    told = "coverage 94.63% driven of 98.16% planned; 1.00% of the area may be lost | collision: a"
    assert kinds(row(0, passed=False, reasons=told)) == {"coverage", "collision"}


def test_tables_do_not_depend_on_the_order_of_the_runs() -> None:
    """CSV and Parquet hold the same rows, by number, whoever was done first; an error's row has gaps."""
    rows = [row(0, extra=1.5), row(1), row(2, passed=False, error="x")]
    one, other = ({r["number"]: r for r in order} for order in (rows, rows[::-1]))
    assert as_csv(one) == as_csv(other)
    read = list(csv.DictReader(io.StringIO(as_csv(one))))
    assert [r["number"] for r in read] == ["0", "1", "2"]
    assert [r["extra"] for r in read] == ["1.5", "", ""]
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is absent (extra `campaign`)")
    data = as_parquet(one)
    assert data == as_parquet(other)
    assert parquet.read_table(io.BytesIO(data)).to_pylist()[0]["extra"] == 1.5
