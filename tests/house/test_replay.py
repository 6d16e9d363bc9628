"""The same input, seed and options give the same bytes, and `quarterdeck replay` says so."""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from quarterdeck.cli import main
from quarterdeck.cli.replay import differences

DATA = Path(__file__).parents[2] / "data"
PLANS = {
    "stc": ("plan", "plant_yard", "--angle", "33", "--spacing", "4", "--seed", "3"),
    "lines": ("plan", "farm_survey", "--method", "lines", "--spacing", "60", "--angle", "100"),
    "guards": ("plan", "plant_yard", "--method", "guards", "--range", "25"),
    "assign": ("assign", "inspection_hall", "--iterations", "3", "--weights", "0,0.2,0.3,1"),
}


def call(*words: object) -> int:
    """Run the command line in this process and return its exit status."""
    with pytest.raises(SystemExit) as stop:
        main([*map(str, words)])
    return int(stop.value.code or 0)


def site(kind: str) -> Path:
    """Return the site of one of PLANS."""
    return DATA / f"{PLANS[kind][1]}.geojson"


@pytest.mark.parametrize("kind", PLANS)
def test_the_same_bytes_in_one_process_and_in_others(kind: str, tmp_path: Path, capsys) -> None:
    """Two plans of this process, one of another with other string hashes, and what the header alone says: all the same."""
    verb, _, *options = PLANS[kind]
    for name in ("first", "second"):
        call(verb, site(kind), *options, "-o", tmp_path / name)
    command = [sys.executable, "-m", "quarterdeck", verb, str(site(kind)), *options, "-o", str(tmp_path / "other")]
    subprocess.run(command, env={**os.environ, "PYTHONHASHSEED": "7"}, check=False, capture_output=True)
    first = (tmp_path / "first").read_bytes()
    assert (tmp_path / "second").read_bytes() == first
    assert (tmp_path / "other").read_bytes() == first
    assert call("replay", tmp_path / "first", "--site", site(kind)) == 0
    assert "the same again" in capsys.readouterr().err


RUNS = {  # verbs that go on from others, each with what it writes
    "triage": [
        (
            "triage {data}/triage_drill.geojson --seed 3 --fail ugv1@60 -o {out}/outcome.geojson"
            " --log-csv {out}/log.csv --plan {out}/plan.geojson"
        ),
    ],
    "stc": [
        "plan {data}/plant_yard.geojson --placement none -o {out}/plan.geojson",
        "replan {out}/plan.geojson --at 300 --lost ugv-2 -o {out}/after.geojson",
    ],
    "assign": [
        "assign {data}/inspection_hall.geojson --iterations 3 -o {out}/plan.geojson",
        "replan {out}/plan.geojson --at 60 --lost r2 -o {out}/after.geojson",
        "simulate {out}/plan.geojson --wind 1,2 --gusts 0.5 --fail random:1 --recover --trace {out}/run.npz --told {out}/t",
    ],
}


@pytest.mark.parametrize("kind", RUNS)
def test_drills_replans_and_runs_are_the_same_in_others(kind: str, tmp_path: Path) -> None:
    """Each file that comes of some verbs in a row has the same bytes: twice here, and in processes of other hashes."""
    if kind == "assign":
        pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")
    made = []
    for name, hashes in (("first", ""), ("second", ""), ("other", "7")):
        out = tmp_path / name
        out.mkdir()
        for line in RUNS[kind]:
            words = line.format(data=DATA, out=out).split()
            if hashes:
                command = [sys.executable, "-m", "quarterdeck", *words]
                status = subprocess.run(
                    command, env={**os.environ, "PYTHONHASHSEED": hashes}, check=False, capture_output=True
                ).returncode
            else:
                status = call(*words)
            assert status in (0, 1)
        made.append({path.name: path.read_bytes() for path in out.iterdir()})
    assert len(made[0]) >= 2
    assert made[0] == made[1] == made[2]
    if kind == "triage":
        for name in ("outcome.geojson", "plan.geojson"):
            assert call("replay", tmp_path / "first" / name, "--site", DATA / "triage_drill.geojson") == 0


def test_another_drill_is_told(tmp_path: Path, capsys) -> None:
    """What did not come of the header's seed differs; a damaged header is one line."""
    out, site = tmp_path / "out.geojson", DATA / "triage_drill.geojson"
    assert call("triage", site, "--seed", 4, "--position-error", 1, "-o", out) == 0
    text = out.read_text(encoding="utf-8")
    capsys.readouterr()
    for was, now, status, words in (
        ('"seed": 4', '"seed": 5', 1, "triage.properties.figures"),
        ('"clusters": 5', '"clusters": "x"', 2, "does not tell what it came of"),
        ('"method": "relay"', '"method": "other"', 2, "does not tell what it came of"),
    ):
        out.write_text(text.replace(was, now), encoding="utf-8")
        assert call("replay", out, "--site", site) == status
        assert words in capsys.readouterr().err


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of a small plan under wind, with a limit and a fault at random."""
    pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")
    folder = tmp_path_factory.mktemp("replay")
    call("assign", DATA / "inspection_hall.geojson", "--iterations", "2", "-o", folder / "plan.geojson")
    options = ("--wind", "1,2", "--gusts", "0.5", "--fail", "random:1", "--limit", "delay=4", "--seed", "5")
    call("simulate", folder / "plan.geojson", *options, "--report", folder / "report.json")
    return folder / "report.json"


def test_a_report_is_had_again(report: Path, capsys) -> None:
    """The report alone says how: every option, the seed and the plan."""
    assert call("replay", report, "--site", DATA / "inspection_hall.geojson") == 0
    assert capsys.readouterr().err.strip().endswith("report.json: the same again")
    command = json.loads(report.read_text(encoding="utf-8"))["command"]
    plan = report.with_name("plan.geojson")
    assert command["files"] == {"plan": hashlib.sha256(plan.read_bytes()).hexdigest()}
    assert command["options"]["faults"] == ["random:1"]


@pytest.mark.parametrize("where", [".", "elsewhere"])
def test_a_report_finds_its_files_from_anywhere(where: str, tmp_path: Path, monkeypatch, capsys) -> None:
    """Files that the command named from its folder are found from any other, by the report's; another's are not taken."""
    pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")
    (tmp_path / "out").mkdir()
    (tmp_path / "elsewhere" / "out").mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    call("plan", DATA / "first_site.geojson", "--placement", "none", "-o", "out/plan.geojson")
    call("simulate", "out/plan.geojson", "--report", "out/report.json")
    (tmp_path / "elsewhere" / "out" / "plan.geojson").write_text("another", encoding="utf-8")
    monkeypatch.chdir(tmp_path / where)
    assert call("replay", tmp_path / "out" / "report.json") == 0
    (tmp_path / "out" / "plan.geojson").unlink()
    assert call("replay", tmp_path / "out" / "report.json") == 2
    told = capsys.readouterr().err.splitlines()[-1]
    assert ("another SHA-256" if where == "elsewhere" else "is not there") in told
    assert "--plan" in told


def test_what_differs_is_told(report: Path, tmp_path: Path, capsys) -> None:
    """A figure that was changed by hand is found, with both values; another version alone is told and no failure."""
    document = json.loads(report.read_text(encoding="utf-8"))
    document["version"] = "0.0.9"
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps(document), encoding="utf-8")
    assert call("replay", changed) == 0
    assert 'version: was "0.0.9"' in capsys.readouterr().err
    document["figures"]["energy"] *= 1 + 1e-6
    changed.write_text(json.dumps(document), encoding="utf-8")
    assert call("replay", changed, "--json") == 1
    assert [d["where"] for d in json.loads(capsys.readouterr().out)] == ["version", "figures.energy"]
    assert call("replay", changed, "--within", "1e-5") == 0
    document["figures"]["energy"] = 10**400
    changed.write_text(json.dumps(document), encoding="utf-8")
    assert call("replay", changed, "--within", "1e-5") == 1


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"command": None}, "does not tell the command"),
        ({"command": {"options": {}, "files": []}}, "does not tell the command"),
        ({"command": {"options": {"plan": "plan.geojson", "seed": "x"}, "files": {}}}, "options cannot be used"),
        ({"type": "else"}, "neither a report"),
    ],
)
def test_a_damaged_report_is_one_line(report: Path, tmp_path: Path, capsys, change: dict, words: str) -> None:
    """Status 2, and what is wrong."""
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps(json.loads(report.read_text(encoding="utf-8")) | change), encoding="utf-8")
    assert call("replay", changed, "--plan", report.with_name("plan.geojson")) == 2
    err = capsys.readouterr().err.strip()
    assert words in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize(
    "option",
    [{"wind": [0.0]}, {"wind": [0, 10**400]}, {"current": [0, 1, 2]}, {"amcl": 91.0}, {"limits": [["cross_track"]]}],
)
def test_a_report_of_options_that_nobody_could_give_is_one_line(report: Path, capsys, option: dict) -> None:
    """Numbers too few, too many or too large, a flag that is a number, a limit without its value."""
    document = json.loads(report.read_text(encoding="utf-8"))
    document["command"]["options"] |= option
    changed = report.with_name("options.json")
    changed.write_text(json.dumps(document), encoding="utf-8")
    assert call("replay", changed) == 2
    err = capsys.readouterr().err.strip()
    assert "options cannot be used" in err
    assert len(err.splitlines()) == 1


def test_another_plan_or_site_is_refused(report: Path, tmp_path: Path, capsys) -> None:
    """What is not the input that the hash tells is no replay."""
    other = tmp_path / "other.geojson"
    other.write_text(report.with_name("plan.geojson").read_text(encoding="utf-8") + " ", encoding="utf-8")
    assert call("replay", report, "--plan", other) == 2
    assert "is not the plan" in capsys.readouterr().err
    assert call("replay", other, "--site", DATA / "plant_yard.geojson") == 2
    assert "is not the site" in capsys.readouterr().err


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(), lambda s: st.lists(s) | st.dictionaries(st.text(), s)
)


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(a=JSON, b=JSON)
def test_no_difference_is_overlooked(a: object, b: object) -> None:
    """Documents without differences are equal; a document has none with itself."""
    assert list(differences(a, a)) == []
    if not list(differences(a, b)):
        assert _dense(a) == _dense(b)


def _dense(value: object) -> object:
    """Return JSON without members that are null and empty ends of lists: what is absent is null."""
    if isinstance(value, dict):
        return {k: d for k, v in value.items() if (d := _dense(v)) is not None}
    if isinstance(value, list):
        kept = [_dense(v) for v in value]
        while kept and kept[-1] is None:
            kept.pop()
        return kept
    return value
