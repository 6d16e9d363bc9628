"""Wrong input at the command line: one line, exit status 2, nothing written."""

import io
import json
from pathlib import Path

import pytest

from quarterdeck.api import write_plan
from quarterdeck.cli import main
from quarterdeck.geo.reader import read_scenario
from quarterdeck.mission.cover import cover

DATA = Path(__file__).parents[2] / "data"


def refused(capsys, *arguments, usage=False):
    """Run the command line and return its one line of refusal; an option's wrong value is told below its usage."""
    with pytest.raises(SystemExit) as stop:
        main([str(a) for a in arguments])
    assert stop.value.code == 2
    captured = capsys.readouterr()
    assert not captured.out
    lines = captured.err.strip().splitlines()
    if usage:  # click tells it first
        assert [line.split(" ")[0] for line in lines[:-1]] == ["Usage:", "Try", ""], lines
        return lines[-1]
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


def test_an_existing_file_is_refused_before_the_work(tmp_path, capsys):
    """The output is looked at before the site is read, but after whether it is there; --force may stand anywhere."""
    (tmp_path / "plan.geojson").write_text("mine")
    (tmp_path / "site.geojson").write_text("no site")
    output = ("-o", tmp_path / "plan.geojson")
    assert "none.geojson" in refused(capsys, "plan", *output, "none.geojson")
    assert "--force" in refused(capsys, "plan", tmp_path / "site.geojson", *output)
    assert "not JSON" in refused(capsys, "plan", tmp_path / "site.geojson", *output, "--force")


def test_a_missing_file_of_an_option_comes_first_too(tmp_path, capsys):
    """What is to be read is looked for before what would be overwritten, wherever it stands."""
    site = DATA / "dalian_harbour.geojson"
    (tmp_path / "plan.geojson").write_text("mine")
    assert "nowhere.tif" in refused(capsys, "plan", site, "-o", tmp_path / "plan.geojson", "--terrain", "nowhere.tif")


def test_a_file_of_another_verb_is_told_what_it_is(tmp_path, capsys):
    """Whatever is given where something else is wanted: what it is, and which verbs take it."""
    plan, study, model = (
        tmp_path / "plan.geojson",
        DATA.parent / "examples" / "triage.toml",
        DATA / "vehicles" / "otter.toml",
    )
    with pytest.raises(SystemExit):
        main(["plan", str(DATA / "dalian_harbour.geojson"), "--spacing", "80", "-o", str(plan)])
    capsys.readouterr()
    assert "is a PLAN; `check`, `simulate`" in refused(capsys, "plan", plan)
    assert "is a PLAN; `check`, `simulate`" in refused(capsys, "campaign", plan)
    assert "to run it again give its site by --site" in refused(capsys, "replay", plan)
    assert "not a PLAN, but a site; `check`, `plan`" in refused(capsys, "simulate", DATA / "dalian_harbour.geojson")
    assert "is a site; `check`, `plan`" in refused(capsys, "replay", DATA / "dalian_harbour.geojson")
    assert "is a study; `campaign` takes it" in refused(capsys, "check", study)
    assert "is a vehicle model" in refused(capsys, "plan", model)
    assert "is an ENC cell; `chart`" in refused(capsys, "plan", DATA / "sample_chart.000")
    assert "is a PLAN; `check`" in refused(capsys, "report", plan, "--track", plan)
    assert "is a PLAN; `check`" in refused(capsys, "replan", plan, "--state", plan)


@pytest.mark.parametrize(
    ("arguments", "usage", "words"),
    [
        (["init", "-o", ""], True, "there is no path"),
        (["init", "-o", "FILE/site.geojson"], False, "/FILE is a file"),
        (["check", "FILE"], False, "FILE: is empty"),
        (["triage", "--generate", "1", "--field", "1e9", "1e9"], True, "is not in the range"),
        (["export", "PLAN", "--to", ""], True, "--to names no format; known: csv"),
        (["export", "PLAN", "--to", "qgc-wpl", "--altitude", "amsl", "--ground", "1e9"], True, "is not in the range"),
        (["report", "PLAN", "--track", "usv-1="], False, "--track usv-1=: there is no path"),
    ],
)
def test_slips_of_a_newcomer(tmp_path, capsys, monkeypatch, arguments, usage, words):
    """What is empty, no folder or beyond all bounds is told as that."""
    monkeypatch.chdir(tmp_path)
    Path("FILE").touch()
    if "PLAN" in arguments:
        write_plan(cover(read_scenario(DATA / "dalian_harbour.geojson"), placement="none"), "PLAN")
    assert words in refused(capsys, *arguments, usage=usage)


def test_a_name_too_long_for_a_file(tmp_path, capsys):
    """A name of 300 characters is one line."""
    assert "cannot be written" in refused(capsys, "init", "-o", tmp_path / ("n" * 300))


@pytest.mark.parametrize("angle", ["nan", "inf"])
def test_an_angle_that_is_no_number(tmp_path, capsys, angle):
    """Such an angle is refused as the option's value."""
    plan = ["plan", DATA / "dalian_harbour.geojson", "--spacing", "80", "--angle", angle, "-o", tmp_path / "plan.geojson"]
    assert f"Invalid value for '--angle': '{angle}' is not a finite number" in refused(capsys, *plan, usage=True)


def test_two_areas_of_one_id(tmp_path, capsys):
    """A second area of the same id is named, with the first."""
    path = changed(tmp_path, "dalian_harbour", lambda f: f.append(next(a for a in f if a["properties"]["role"] == "area")))
    assert "too; give each its own" in refused(capsys, "plan", path, "-o", tmp_path / "plan.geojson")


def test_properties_that_are_a_list(tmp_path, capsys):
    """`check` names the feature."""
    path = changed(tmp_path, "dalian_harbour", lambda f: f[0].update(properties=[1]))
    with pytest.raises(SystemExit) as stop:
        main(["check", str(path)])
    assert stop.value.code == 2
    assert "features[0]: properties" in capsys.readouterr().out


def test_markup_in_a_vehicles_name(tmp_path, capsys):
    """A name that looks like rich's markup is printed as it is."""
    path = changed(tmp_path, "dalian_harbour", lambda f: f[-1].update(id="[/v] :ship:"))
    with pytest.raises(SystemExit) as stop:
        main(["plan", str(path), "--spacing", "80", "-o", str(tmp_path / "plan.geojson")])
    assert stop.value.code in (0, 1)
    assert "[/v] :ship:" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["site", "plan"])
def test_check_reads_standard_input(tmp_path, capsys, monkeypatch, kind):
    """A sound site, and a PLAN, from standard input have no problem."""
    data = (DATA / "dalian_harbour.geojson").read_bytes()
    if kind == "plan":
        with pytest.raises(SystemExit):
            main(["plan", str(DATA / "dalian_harbour.geojson"), "--spacing", "80", "-o", str(tmp_path / "plan.geojson")])
        data = (tmp_path / "plan.geojson").read_bytes()
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(data), encoding="utf-8"))
    with pytest.raises(SystemExit) as stop:
        main(["check", "-"])
    assert (stop.value.code or 0) == 0, capsys.readouterr().out


@pytest.mark.parametrize("verb", ["simulate", "export", "replan"])
def test_a_site_is_no_plan(tmp_path, capsys, verb):
    """A site where a PLAN is wanted is told apart."""
    extra = {"simulate": [], "export": ["--to", "qgc-wpl", "-o", tmp_path / "out"], "replan": ["--at", "5"]}[verb]
    assert "not a PLAN" in refused(capsys, verb, DATA / "dalian_harbour.geojson", *extra)


def test_a_missing_file(capsys):
    """A path that leads nowhere is named."""
    assert "nowhere.geojson" in refused(capsys, "plan", "nowhere.geojson")
