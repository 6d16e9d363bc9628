"""`quarterdeck simulate` from the command line."""

import json

import jsonschema
import pytest

from quarterdeck.cli import main
from quarterdeck.mission.planfile import plan_text
from quarterdeck.physics.report import report_schema

pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")


@pytest.fixture
def plan(mow, tmp_path):
    """A PLAN file of one rover on two legs."""
    path = tmp_path / "plan.geojson"
    path.write_text(plan_text(mow("husky", spacing=5.0, length=20.0)), encoding="utf-8")
    return path


def run(*args):
    """Run the command line and return its exit status."""
    with pytest.raises(SystemExit) as stop:
        main(["simulate", *map(str, args)])
    return stop.value.code


def test_picture_and_recording_on_standard_output(plan, tmp_path, capfdbinary, monkeypatch):
    """`-` is standard output for bytes too, not a file of that name."""
    monkeypatch.chdir(tmp_path)
    assert run(plan, "--picture", "-") == 0
    assert capfdbinary.readouterr().out.startswith(b"\x89PNG")
    assert run(plan, "--rrd", "-") == 0
    assert capfdbinary.readouterr().out.startswith(b"RRF")
    assert not (tmp_path / "-").exists()


def test_report_by_the_schema_and_exit_0(plan, tmp_path, capfd):
    """Standard output carries the JSON and nothing else, not even what PyBullet prints; the file holds the same."""
    path = tmp_path / "report.json"
    assert run(plan, "--json", "--report", path) == 0
    out, err = capfd.readouterr()
    document = json.loads(out)
    jsonschema.validate(document, report_schema())
    assert document == json.loads(path.read_text(encoding="utf-8"))
    assert "passed" in err


def test_recording_and_picture_are_written(plan, tmp_path):
    """Both files, of the kinds that they say they are."""
    rrd, png = tmp_path / "run.rrd", tmp_path / "run.png"
    assert run(plan, "--rrd", rrd, "--picture", png) == 0
    assert rrd.read_bytes()[:4] == b"RRF2"
    assert png.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_failed_verdict_exits_1_and_names_the_limit(plan, capfd):
    """A limit that cannot be met."""
    assert run(plan, "--limit", "delay=0.5") == 1
    assert "took" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--limit", "collision=1"], "did you mean 'collisions'"),
        (["--limit", "collisions"], "is not NAME=VALUE"),
        (["--current", "fast"], "two numbers with a comma"),
        (["--step", "0.07"], "divide a second"),
        (["--snapshots", "s.png"], "are for plans of triage"),
        (["--casualties", "c.geojson"], "are for plans of triage"),
    ],
)
def test_wrong_options_exit_2_with_one_line(plan, capfd, monkeypatch, options, text):
    """Nothing is simulated, nothing written."""
    monkeypatch.setattr("quarterdeck.physics.simulate.open_world", lambda _: pytest.fail("it is simulated"))
    assert run(plan, *options) == 2
    assert text in capfd.readouterr().err


def test_existing_report_is_not_overwritten(plan, tmp_path, capfd):
    """Told before the run."""
    path = tmp_path / "report.json"
    path.write_text("mine", encoding="utf-8")
    assert run(plan, "--report", path) == 2
    assert "--force" in capfd.readouterr().err
    assert path.read_text(encoding="utf-8") == "mine"


def test_not_a_plan(tmp_path, capfd):
    """A site in the place of a plan."""
    path = tmp_path / "site.geojson"
    path.write_text('{"type": "FeatureCollection", "features": []}', encoding="utf-8")
    assert run(path) == 2
    assert len(capfd.readouterr().err.strip().splitlines()) == 1
