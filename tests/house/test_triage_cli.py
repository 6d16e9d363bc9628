"""`quarterdeck triage` from the command line: results, files, statuses, one-line errors."""

import json
from pathlib import Path

import pytest

from quarterdeck.cli import main
from quarterdeck.geo.reader import read_scenario
from quarterdeck.mission.planfile import read_plan


def run(capsys: pytest.CaptureFixture[str], *args: str) -> tuple[int, str, str]:
    """Run the command line; return its status, standard output and standard error."""
    with pytest.raises(SystemExit) as stop:
        main(["triage", *args])
    captured = capsys.readouterr()
    return int(stop.value.code or 0), captured.out, captured.err


@pytest.fixture
def site(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """A generated site."""
    path = tmp_path / "site.geojson"
    assert run(capsys, "--generate", "1", "--seed", "3", "-o", str(path))[0] == 0
    return str(path)


def test_all_files_of_a_mission(site: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Casualties on standard output, every other product in its file, the table on standard error."""
    names = {"--casualty-csv": "c.csv", "--log-csv": "l.csv", "--cot": "c.xml", "--timeline": "t.png", "--map": "m.png"}
    files = [a for option, name in names.items() for a in (option, str(tmp_path / name))]
    status, out, err = run(capsys, site, "--start", "2026-05-01T09:00:00Z", *files)
    assert status == 0
    assert {f["properties"]["role"] for f in json.loads(out)["features"]} == {"triage", "casualty"}
    assert "red, mean wait" in err
    assert all((tmp_path / name).stat().st_size > 100 for name in names.values())
    assert (tmp_path / "t.png").read_bytes()[:4] == b"\x89PNG"


def test_figures_as_json_for_all_methods(site: str, capsys: pytest.CaptureFixture[str]) -> None:
    """--compare --json gives a program the figures of the four methods."""
    status, _, err = run(capsys, site, "--compare", "--json")
    figures = json.loads(err)
    assert status == 0
    assert list(figures) == ["relay", "no-relay", "no-priority", "constant"]
    assert all(f["figures"]["treated"] == f["figures"]["casualties"] for f in figures.values())


def test_what_cannot_be_done_is_told_with_status_1(site: str, capsys: pytest.CaptureFixture[str]) -> None:
    """All UGVs are lost early: who was not found, or not told of, is told, each in its line."""
    status, _, err = run(capsys, site, *(a for i in (1, 2, 3) for a in ("--fail", f"ugv{i}@30")))
    assert status == 1
    untreated = [c.id for c in read_scenario(site).casualties if f"casualty {c.id} (" in err]
    assert untreated
    assert err.count("before its section was searched") == 3


def test_the_plan_is_one_that_simulate_takes(site: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """--plan writes a PLAN with a route a member of the team; --snapshots a picture."""
    plan, picture = tmp_path / "plan.geojson", tmp_path / "s.png"
    assert run(capsys, site, "--plan", str(plan), "--snapshots", str(picture))[0] == 0
    mission = read_plan(plan)
    assert mission.method == "triage"
    assert [r.vehicle for r in mission.routes] == ["medic1", "ugv1", "ugv2", "ugv3", "uav1"]
    assert mission.feasible
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_generated_cases_are_readable_seeded_sites(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Cases of consecutive seeds, the same again for the same seed, within the numbers asked for."""
    for folder in ("a", "b"):
        args = ["--generate", "4", "--seed", "7", "--casualties", "3", "5", "--clustered", "-o", str(tmp_path / folder)]
        assert run(capsys, *args)[0] == 0
    made = sorted((tmp_path / "a").iterdir())
    assert [p.read_bytes() for p in made] == [p.read_bytes() for p in sorted((tmp_path / "b").iterdir())]
    assert len({p.read_bytes() for p in made}) == 4
    assert all(3 <= len(read_scenario(p).casualties) <= 5 for p in made)
    assert run(capsys, "--generate", "1", "--seed", "7", "-o", str(tmp_path / "one"))[0] == 0
    assert [p.name for p in (tmp_path / "one").iterdir()] == [made[0].name]


@pytest.mark.parametrize(
    ("args", "words"),
    [
        ([], "give a SITE"),
        (["SITE", "--cot", "x.xml"], "--cot needs --start"),
        (["SITE", "--fail", "uav1"], "not ID@SECONDS"),
        (["SITE", "--fail", "uav9@3"], "uav9"),
        (["SITE", "--treat", "blue=3"], "COLOUR=SECONDS"),
        (["--generate", "2"], "name their folder"),
        (["--generate", "2", "-o", "drill.geojson"], "name their folder"),
        (["--generate", "1", "--casualties", "5", "3"], "fewest and the most"),
    ],
)
def test_wrong_usage_is_one_line_and_status_2(
    site: str, capsys: pytest.CaptureFixture[str], args: list[str], words: str
) -> None:
    """Nothing is written, and the reason is named."""
    status, out, err = run(capsys, *(site if a == "SITE" else a for a in args))
    assert status == 2
    assert out == ""
    assert words in err
