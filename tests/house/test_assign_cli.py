"""`quarterdeck assign` from the shell: files, maps, errors, interruption."""

import json
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest
from click.testing import CliRunner

from quarterdeck.cli.assign import command
from quarterdeck.geo.errors import InputError
from quarterdeck.mission.planfile import read_plan

HALL = str(files("quarterdeck") / "data" / "inspection_hall.geojson")


def assign(*args):
    """Run the verb; return its result."""
    return CliRunner().invoke(command, [HALL, "--iterations", "3", *args])


def test_the_plan_goes_out_and_the_figures_to_stderr(tmp_path):
    """A PLAN in a file or on standard output; a table, or JSON, on standard error; no overwriting unasked."""
    plan = tmp_path / "hall.plan.geojson"
    result = assign("-o", str(plan), "--json")
    assert result.exit_code == 0, result.output
    figures = json.loads(result.stderr)
    assert figures["feasible"]
    assert figures["figures"]["makespan"] > figures["bounds"]["objective"]
    assert [v["task"] for v in figures["figures"]["schedule"]]
    assert plan.read_text() == assign().stdout
    assert len(read_plan(plan).routes) == 2
    assert "makespan" in assign().stderr
    assert isinstance(assign("-o", str(plan)).exception, InputError)


def test_the_map_written_can_be_driven_on(tmp_path):
    """A map written from the site, given back, leads to ways as long, within its cells."""
    written = assign("--write-map", str(tmp_path / "hall.yaml"), "--json")
    on_map = assign("--map", str(tmp_path / "hall.yaml"), "--json")
    assert on_map.exit_code == 0, on_map.output
    spans = [json.loads(r.stderr)["figures"]["makespan"] for r in (written, on_map)]
    assert spans[1] == pytest.approx(spans[0], rel=0.03)


@pytest.mark.parametrize(
    "options",
    [
        ("--objective", "paper"),
        ("--priority-function", "power:60,2"),
        ("--priority-function", "logistic:60,10"),
        ("--tiers",),
        ("--weights", "0,1,2,3"),
        ("--heuristic", "manhattan"),
        ("--heuristic", "octile", "--resolution", "0.2"),
        ("--time-limit", "60"),
    ],
)
def test_every_option_plans(options):
    """Each option leads to a plan of all five tasks that says how it was made."""
    result = assign("--json", *options)
    assert result.exit_code == 0, result.output
    assert len(json.loads(result.stderr)["figures"]["schedule"]) == 5


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--weights", "1,2"), "is not W0,W1,W2,W3"),
        (("--weights", "a"), "numbers with commas"),
        (("--priority-function", "cubic"), "is not one of linear, power, logistic"),
        (("--priority-function", "power:1"), "two numbers above 0"),
        (("--priority-function", "linear:1,2"), "takes no parameters"),
        (("--map-origin", "8,47"), "needs --map"),
        (("--time-limit", "0"), "not in the range"),
    ],
)
def test_wrong_usage_is_told(options, message):
    """Each wrong option exits 2 and says what was expected."""
    result = assign(*options)
    assert result.exit_code == 2
    assert message in result.output


def test_a_wrong_weight_or_map_is_one_line(tmp_path):
    """What only the planner can see is one line and exit status 2."""
    for options in (("--weights", "0,-1,2,3"), ("--map", str(tmp_path / "none.yaml"))):
        run = [sys.executable, "-m", "quarterdeck", "assign", HALL, *options]
        result = subprocess.run(run, capture_output=True, text=True, check=False, cwd=Path(__file__).parents[2])
        assert result.returncode == 2
        assert result.stdout == ""
        assert result.stderr.count("\n") == 1
