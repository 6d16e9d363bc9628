"""Time limits and Ctrl-C at the command line: what there is by then is kept, and told."""

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from quarterdeck.cli import main
from quarterdeck.mission.planfile import read_plan

pytestmark = pytest.mark.usefixtures("hears_ctrl_c")
DATA = Path(__file__).parents[2] / "data"
STOPPED = """
import os, signal, sys
from {module} import {holder}
calls, own = [], {holder}.{name}
def counted(*args, **options):
    calls.append(1)
    if len(calls) == {count}:
        for _ in range({times}):
            os.kill(os.getpid(), signal.{sent})
    return own(*args, **options)
{holder}.{name} = counted
from quarterdeck.cli import main
main(sys.argv[1:])
"""


def interrupted(module, holder, name, count, *arguments, sent="SIGINT", times=1):
    """Run the command line in a process that gets a real signal at the n-th call of a function; return how it ended."""
    code = STOPPED.format(module=module, holder=holder, name=name, count=count, sent=sent, times=times)
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def status(*arguments):
    """Return the command line's exit status."""
    with pytest.raises(SystemExit) as stop:
        main([str(a) for a in arguments])
    return stop.value.code


@pytest.fixture(scope="module")
def hall(tmp_path_factory):
    """Return the path of a plan of tasks."""
    path = tmp_path_factory.mktemp("hall") / "plan.geojson"
    assert status("assign", DATA / "inspection_hall.geojson", "-o", path, "--iterations", "1") == 0
    return path


CUT = {
    "stc --spacing 80": ["the placement of the grid", "the growth of tracks to the edges"],
    "lines --spacing 80": ["the placement of the grid", "the search for the best direction of lines"],
    "guards --range 600": ["the search for fewer guards and shorter tours", "the bound on guards by witnesses"],
}


@pytest.mark.parametrize("method", CUT)
def test_a_plan_tells_what_its_time_limit_cut(method, tmp_path, capsys):
    """Every search ends at once, the plan is whole, header and screen say what was cut."""
    path = tmp_path / "plan.geojson"
    site = DATA / "dalian_harbour.geojson"
    assert status("plan", site, "--method", *method.split(), "--time-limit", "0.001", "-o", path) in (0, 1)
    mission = read_plan(path)
    assert mission.parameters["time_limit"] == 0.001
    assert set(CUT[method]) <= set(mission.figures["cut"])
    assert f"cut short by --time-limit: {mission.figures['cut'][0]}" in capsys.readouterr().err
    assert mission.figures.get("poc", 1.0) > 0.5


def test_a_fleet_is_cut_where_it_is_divided(tmp_path):
    """The division among five ends with what it has: regions that are whole, of shares that may be uneven."""
    path = tmp_path / "plan.geojson"
    site = DATA / "west_ant_island.geojson"
    assert status("plan", site, "--spacing", "100", "--time-limit", "0.001", "-o", path) in (0, 1)
    mission = read_plan(path)
    assert "the search for a fairer division" in mission.figures["cut"]
    assert mission.figures["poc"] > 0.9
    assert status("check", path) in (0, 1)


def test_a_plan_without_a_time_limit_says_nothing_of_it(hall):
    """No limit, no word."""
    assert "cut" not in read_plan(hall).figures


def test_a_simulation_ends_at_its_time_limit(hall, tmp_path):
    """The report says when and why, and the verdict is that it failed."""
    report = tmp_path / "report.json"
    assert status("simulate", hall, "--time-limit", "0.001", "--report", report) == 1
    assert "the run was stopped at 0 s of the mission (time limit)" in json.loads(report.read_text())["reasons"]


def test_triage_ends_at_its_time_limit(tmp_path, capsys):
    """The outcome is written, with the reason."""
    out = tmp_path / "out.geojson"
    assert status("triage", DATA / "triage_drill.geojson", "--time-limit", "0.001", "-o", out) == 1
    assert out.exists()
    assert "(time limit)" in capsys.readouterr().err


def test_an_interrupted_simulation_reports_so_far(hall, tmp_path):
    """Ctrl-C after some steps: the report is written whole, says so, and the exit status is 130."""
    report = tmp_path / "report.json"
    done = interrupted(
        "quarterdeck.physics.running", "Running", "advance", 40, "simulate", hall, "--report", report
    )  # fmt: skip
    assert done.returncode == 130, done.stderr
    assert "the run was stopped at 4 s of the mission (interrupted)" in json.loads(report.read_text())["reasons"]


def test_ways_between_tasks_end_at_a_time_limit(tmp_path, capsys):
    """Without all ways there is no plan: one line says how many there are, and nothing is written."""
    path, site = tmp_path / "plan.geojson", DATA / "inspection_hall.geojson"
    assert status("assign", site, "--time-limit", "0.001", "-o", path) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert re.search(r"time limit: it ended the search for ways after \d+ of 36 between tasks and depots", said[0])
    assert not path.exists()


def test_an_assignment_interrupted_among_its_ways_leaves_nothing(tmp_path):
    """Ctrl-C between two searches for ways: 130, no file."""
    path, site = tmp_path / "plan.geojson", DATA / "inspection_hall.geojson"
    done = interrupted("quarterdeck.geo", "gridpath", "grow", 3, "assign", site, "-o", path)
    assert done.returncode == 130
    assert done.stderr.splitlines()[-1] == "quarterdeck: interrupted"
    assert not path.exists()


def test_an_interrupted_assignment_is_the_best_so_far(tmp_path):
    """Ctrl-C in the search: the plan is written and says so."""
    path, site = tmp_path / "plan.geojson", DATA / "inspection_hall.geojson"
    done = interrupted("quarterdeck.mission.tours", "search", "generation", 2, "assign", site, "-o", path)
    assert done.returncode == 130, done.stderr
    assert read_plan(path).figures["stopped"] == "interrupted"


def test_an_interrupted_plan_is_what_there_is(tmp_path):
    """Ctrl-C in a plan's searches: it is said at once, the plan is whole and says what was cut, and its replan likewise."""
    path, site = tmp_path / "plan.geojson", DATA / "west_ant_island.geojson"
    done = interrupted("quarterdeck.coverage", "placement", "index", 5, "plan", site, "--spacing", "100", "-o", path)
    assert done.returncode == 130, done.stderr
    assert "ending with what there is" in done.stderr
    assert "cut short by Ctrl-C: the placement of the grid" in done.stderr
    mission = read_plan(path)
    assert mission.figures["stopped"] == "interrupted"
    assert mission.figures["poc"] > 0.9
    after = tmp_path / "after.geojson"
    lost = ["replan", path, "--at", "900", "--lost", mission.vehicles[0].id, "-o", after]
    done = interrupted("quarterdeck.mission", "replan", "replan", 1, *lost)
    assert done.returncode == 130, done.stderr
    assert read_plan(after).figures["stopped"] == "interrupted"


def test_a_plan_interrupted_twice_leaves_nothing(tmp_path):
    """The second Ctrl-C ends at once: 130, no file."""
    path, site = tmp_path / "plan.geojson", DATA / "dalian_harbour.geojson"
    options = ["plan", site, "--spacing", "80", "-o", path]
    done = interrupted("quarterdeck.coverage", "placement", "index", 5, *options, times=2)
    assert done.returncode == 130
    assert done.stderr.splitlines()[-1] == "quarterdeck: interrupted"
    assert not list(tmp_path.iterdir())


def test_an_interrupted_drill_is_told_so_far(tmp_path):
    """Ctrl-C in triage: the outcome is written and says why it ends there."""
    out = tmp_path / "out.geojson"
    done = interrupted(
        "quarterdeck.mission.triage", "outcome", "run_triage", 1, "triage", DATA / "triage_drill.geojson", "-o", out
    )
    assert done.returncode == 130, done.stderr
    assert "(interrupted)" in done.stderr
    assert out.exists()


@pytest.mark.parametrize("sent", ["SIGINT", "SIGTERM", "SIGKILL"])
def test_what_is_stopped_in_the_middle_of_writing(hall, tmp_path, sent):
    """Of files that belong together none is changed; none is left beside them, but by what cannot be caught."""
    assert status("export", hall, "--to", "qgc-wpl", "-o", tmp_path, "--unsafe") == 0
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert len(before) >= 3
    arguments = ["export", hall, "--to", "qgc-wpl", "-o", tmp_path, "--unsafe", "--force"]
    done = interrupted("quarterdeck.geo", "files", "_beside", 3, *arguments, sent=sent)
    assert done.returncode == (-signal.SIGKILL if sent == "SIGKILL" else 130), done.stderr
    assert {path: path.read_bytes() for path in before} == before
    left = set(tmp_path.iterdir()) - set(before)
    assert all(path.name.startswith(".") for path in left) if sent == "SIGKILL" else not left


@pytest.mark.parametrize("stream", ["> /dev/full", "-o /dev/full", ">&-", "2>&-", "<&-"])
def test_streams_that_are_full_or_closed(stream):
    """One line and status 2 where a result cannot be written; whoever closes a stream does without it."""
    site = DATA / "inspection_hall.geojson"
    command = f"{sys.executable} -m quarterdeck assign {site} --iterations 1 {stream}"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=False)
    assert done.returncode == (2 if "full" in stream else 0), done.stderr
    assert "Traceback" not in done.stderr
    if "full" in stream:
        assert "cannot be written (No space left on device)" in done.stderr.splitlines()[-1]


def test_an_interrupted_campaign_goes_on_where_it_was(hall, tmp_path):
    """Ctrl-C after the first run: its row is kept, and the campaign called again does the rest alone."""
    study = tmp_path / "study.toml"
    study.write_text(f'plan = "{hall}"\nruns = 24\n')
    journal = tmp_path / "runs" / "runs.jsonl"
    command = [sys.executable, "-m", "quarterdeck", "campaign", str(study), "-o", str(journal.parent), "--jobs", "1"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None and not (journal.exists() and journal.read_text().count("\n") >= 2):
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        assert process.wait() == 130, process.stderr.read()
        assert process.stderr.read().strip() == "quarterdeck: interrupted"
    kept = journal.read_text().splitlines()[1:]
    assert 1 <= len(kept) < 24
    assert status("campaign", study, "-o", journal.parent, "--jobs", "1") == 0
    rows = journal.read_text().splitlines()[1:]
    assert rows[: len(kept)] == kept
    assert sorted(json.loads(row)["number"] for row in rows) == list(range(24))
