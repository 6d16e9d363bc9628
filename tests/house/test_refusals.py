"""Wrong input at the command line: one line, exit status 2, nothing written."""

import json
from pathlib import Path

import pytest

from quarterdeck.cli import main

DATA = Path(__file__).parents[2] / "data"


def refused(capsys, *arguments):
    """Run the command line and return its one line of refusal."""
    with pytest.raises(SystemExit) as stop:
        main([str(a) for a in arguments])
    assert stop.value.code == 2
    captured = capsys.readouterr()
    assert not captured.out
    lines = captured.err.strip().splitlines()
    assert len(lines) == 1, lines
    return lines[0]


def changed(tmp_path, site, change):
    """Write a sample site with a change and return its path."""
    document = json.loads((DATA / f"{site}.geojson").read_text(encoding="utf-8"))
    change(document["features"])
    path = tmp_path / "site.geojson"
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def test_shares_that_do_not_sum_to_one(tmp_path, capsys):
    """The sum is named."""
    path = changed(tmp_path, "west_ant_island", lambda f: f[-1]["properties"].update(share=0.3))
    assert "sum to 0.9" in refused(capsys, "plan", path, "-o", tmp_path / "plan.geojson")
    assert not (tmp_path / "plan.geojson").exists()


def test_spacing_without_a_free_cell(tmp_path, capsys):
    """An area too small for the spacing is refused with what to do."""
    line = refused(capsys, "plan", DATA / "dalian_harbour.geojson", "--spacing", "600", "-o", tmp_path / "plan.geojson")
    assert "smaller spacing" in line


def test_folder_that_cannot_be_written(tmp_path, capsys):
    """An output in the place of a file is refused, and the file stays."""
    (tmp_path / "file").write_text("mine")
    line = refused(capsys, "plan", DATA / "dalian_harbour.geojson", "-o", tmp_path / "file" / "plan.geojson")
    assert "cannot be written" in line
    assert (tmp_path / "file").read_text() == "mine"


def test_no_overwriting_without_force(tmp_path, capsys):
    """A file that stands already is kept."""
    (tmp_path / "plan.geojson").write_text("mine")
    line = refused(capsys, "plan", DATA / "dalian_harbour.geojson", "-o", tmp_path / "plan.geojson")
    assert "--force" in line
    assert (tmp_path / "plan.geojson").read_text() == "mine"


@pytest.mark.parametrize("verb", ["simulate", "export", "replan"])
def test_a_site_is_no_plan(tmp_path, capsys, verb):
    """A site where a PLAN is wanted is told apart."""
    extra = {"simulate": [], "export": ["--to", "qgc-wpl", "-o", tmp_path / "out"], "replan": ["--at", "5"]}[verb]
    assert "not a PLAN" in refused(capsys, verb, DATA / "dalian_harbour.geojson", *extra)


def test_a_missing_file(capsys):
    """A path that leads nowhere is named."""
    assert "nowhere.geojson" in refused(capsys, "plan", "nowhere.geojson")
