"""`quarterdeck report`, and `replan` from logs, at the command line."""

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from quarterdeck.cli import main
from quarterdeck.geo.reader import read_scenario
from quarterdeck.mission.cover import cover
from quarterdeck.mission.planfile import plan_text, read_plan
from quarterdeck.physics.report import report_schema

DATA = Path(__file__).parents[2] / "data"


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Return the paths of a plan of three aerial vehicles and of a CSV log of a perfect run of it."""
    folder = tmp_path_factory.mktemp("flown")
    mission = cover(read_scenario(DATA / "farm_survey.geojson"))
    plan, log = folder / "plan.geojson", folder / "log.csv"
    plan.write_text(plan_text(mission), encoding="utf-8")
    rows = ["vehicle,time,lon,lat,height"]
    for route in read_plan(str(plan)).routes:
        at = np.array([(t, w.x, w.y, w.z) for w in route.waypoints for t in (w.time, w.time + w.hold)])
        time = np.append(np.arange(0.0, route.duration, 0.5), route.duration)
        x, y, z = (np.interp(time, at[:, 0], at[:, i]) for i in (1, 2, 3))
        places = mission.frame.to_degrees(np.column_stack([x, y]))
        rows += [f"{route.vehicle},{t},{a:.7f},{b:.7f},{h:.2f}" for t, (a, b), h in zip(time, places, z, strict=True)]
    log.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return plan, log


def run(*args):
    """Run the command line and return its exit status."""
    with pytest.raises(SystemExit) as stop:
        main([str(a) for a in args])
    return stop.value.code


def test_a_good_flight_passes(flown, tmp_path, capsys):
    """Exit 0; the report is by the schema, and says that energy was reckoned; pictures and recording are written."""
    plan, log = flown
    report, png, rrd = (tmp_path / name for name in ("report.json", "run.png", "run.rrd"))
    assert run("report", plan, "--track", log, "--json", "--report", report, "--picture", png, "--rrd", rrd) == 0
    out, err = capsys.readouterr()
    document = json.loads(out)
    jsonschema.validate(document, report_schema())
    assert document == json.loads(report.read_text(encoding="utf-8"))
    assert document["settings"] == {"tracks": [str(log)], "start": None}
    assert "as driven" in err
    assert "no energy in its log" in err
    assert png.read_bytes()[:4] == b"\x89PNG"
    assert rrd.read_bytes()[:4] == b"RRF2"


def test_a_report_of_logs_is_had_again_from_anywhere(flown, tmp_path, capsys, monkeypatch):
    """It tells its verb, options and the hashes of plan and logs; another log in the place of one is refused."""
    plan, log = flown
    monkeypatch.chdir(plan.parent)
    run("report", plan.name, "--track", log.name, "--report", "out/report.json")
    report = plan.parent / "out" / "report.json"
    told = json.loads(report.read_text(encoding="utf-8"))["command"]
    assert (told["verb"], sorted(told["files"])) == ("report", sorted(["plan", log.name]))
    monkeypatch.chdir(tmp_path)
    assert run("replay", report) == 0
    assert "the same again" in capsys.readouterr().err
    alone = report.rename(tmp_path / "report.json")
    assert run("replay", alone, "--plan", plan) == 2
    assert f"{log.name}: the report's log is not there" in capsys.readouterr().err


def test_gaps_are_planned_again(flown, tmp_path, capsys):
    """What a flight with a hole in its log leaves is a site that `plan` takes, and exit status 1."""
    plan, log = flown
    holed, gaps = tmp_path / "holed.csv", tmp_path / "gaps.geojson"
    lines = log.read_text(encoding="utf-8").splitlines()
    holed.write_text("\n".join(x for x in lines if not (x.startswith("uav-2") and 300 < float(x.split(",")[1]) < 600)))
    assert run("report", plan, "--track", holed, "--gaps", gaps) == 1
    err = capsys.readouterr().err
    assert "gaps: 1, of 300 s" in err
    assert "failed: coverage" in err
    site, before = read_scenario(gaps), read_plan(str(plan))
    assert 0 < site.site.area.area < 0.5 * before.site.area.area
    assert [v.id for v in site.vehicles] == [v.id for v in before.vehicles]
    assert run("plan", gaps, "--method", "lines", "-o", tmp_path / "infill.geojson") == 0
    assert read_plan(str(tmp_path / "infill.geojson")).figures["poc"] > 0.8


def test_nothing_missed_leaves_nothing_to_plan(flown, tmp_path, capsys):
    """A perfect flight leaves a site without an area, in the place of older gaps, and `plan` says that it has none."""
    plan, log = flown
    gaps = tmp_path / "gaps.geojson"
    gaps.write_text("older gaps", encoding="utf-8")
    run("report", plan, "--track", log, "--gaps", gaps, "--force")
    assert "gaps: none" in capsys.readouterr().err
    assert run("plan", gaps, "-o", tmp_path / "infill.geojson") == 2
    assert 'no feature has the role "area"' in capsys.readouterr().err


def test_replan_from_logs_and_from_the_report(flown, tmp_path, capsys):
    """The same rest by logs up to now, by the report of them, and by the plan's own times."""
    plan, log = flown
    so_far, report = tmp_path / "so_far.csv", tmp_path / "report.json"
    lines = log.read_text(encoding="utf-8").splitlines()
    so_far.write_text("\n".join([lines[0], *(x for x in lines[1:] if float(x.split(",")[1]) <= 400)]))
    run("report", plan, "--track", so_far, "--report", report)
    rest = []
    for name, how in (("log", ["--track", so_far]), ("state", ["--state", report]), ("plan", ["--at", 400])):
        assert run("replan", plan, *how, "-o", tmp_path / f"{name}.geojson") == 0
        rest.append(read_plan(str(tmp_path / f"{name}.geojson")))
    for mission in rest[:2]:
        assert mission.parameters["replanned_at"] == pytest.approx(400, abs=0.6)
        for mine, theirs in zip(mission.routes, rest[2].routes, strict=True):
            assert np.allclose(mine.xyz[2:], theirs.xyz[len(theirs.xyz) - len(mine.xyz) + 2 :], atol=1e-6)
            assert mine.duration == pytest.approx(theirs.duration, abs=1.0)
    assert "no energy in its log" in capsys.readouterr().err
    document = json.loads(report.read_text(encoding="utf-8"))
    document["vehicles"][0]["lost"] = True
    report.write_text(json.dumps(document), encoding="utf-8")
    run("replan", plan, "--state", report, "-o", tmp_path / "without.geojson")
    gone = document["vehicles"][0]["id"]
    assert f"{gone} was lost, by the report" in capsys.readouterr().err
    assert gone in {v.id for v in read_plan(str(tmp_path / "without.geojson")).lost}


def test_who_was_lost_is_named(tmp_path, capsys):
    """By the plan as told: who, and when its part was given away; by a plan of the survivors: who is not in it."""
    plan, trace, told, rest, track = (tmp_path / n for n in ("plan", "run.npz", "told", "rest", "rest.npz"))
    assert run("plan", DATA / "plant_yard.geojson", "--spacing", 8, "-o", plan) == 0
    assert "share" in capsys.readouterr().err
    seen, logged = tmp_path / "seen.json", tmp_path / "logged.json"
    run("simulate", plan, "--recover", "--fail", "lost:ugv-2@100", "--trace", trace, "--told", told, "--report", seen)
    simulated = capsys.readouterr().err
    assert "note: ugv-2: lost; at 130 s others were given its part" in simulated
    assert run("report", told, "--track", trace, "--report", logged) == 0
    driven = capsys.readouterr().err
    apart = [json.loads(path.read_text())["figures"]["separation"] for path in (seen, logged)]
    assert apart[0] == pytest.approx(apart[1], abs=0.1)  # from the wreck, which others pass by
    assert run("report", plan, "--track", trace) == 1
    assert "note: ugv-1: surveyed lines that the plan gives to others" in capsys.readouterr().err
    assert "finished 1 of 2; lost 1" in " ".join(driven.split())
    assert "note: ugv-2: lost; at 130 s others were given its part" in driven
    assert run("replay", told, "--site", DATA / "plant_yard.geojson") == 2
    assert "told in a run" in capsys.readouterr().err
    assert run("replan", plan, "--at", 100, "--lost", "ugv-2", "-o", rest) == 0
    again = capsys.readouterr().err
    assert "covered before: " in again
    assert "share" not in again
    assert run("simulate", rest, "--trace", track) == 0
    assert "covered before: " in capsys.readouterr().err
    assert run("report", rest, "--track", track) == 0
    assert "ugv-2: lost before this plan began" in capsys.readouterr().err
    assert run("replan", told, "--at", 100, "-o", tmp_path / "later") == 0
    assert "lost_at" not in read_plan(str(tmp_path / "later")).parameters


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["report", "PLAN", "--track", "nowhere.bin"], "cannot be read"),
        (["report", "PLAN", "--track", "uav-9=LOG"], "unknown vehicle 'uav-9'"),
        (["report", "PLAN", "--track", "uav-1=LOG#x"], "no 'x' in the file"),
        (["report", "PLAN", "--track", "LOG", "--start", "noon"], "no time such as"),
        (["replan", "PLAN"], "--at is missing"),
        (["replan", "PLAN", "--state", "PLAN"], "is a PLAN; `check`"),
        (["replan", "PLAN", "--track", "uav-1=LOG"], "no track given"),
        (["replan", "PLAN", "--track", "LOG", "--state", "PLAN"], "give one of them"),
        (["replan", "PLAN", "--at", "5", "--start", "2026-06-01"], "needs --track"),
    ],
)
def test_refusals(flown, arguments, words, capsys):
    """One line on standard error and exit status 2."""
    plan, log = flown
    given = [a.replace("PLAN", str(plan)).replace("LOG", str(log)) for a in arguments]
    assert run(*given) == 2
    captured = capsys.readouterr()
    assert not captured.out
    assert words in captured.err
    assert len(captured.err.strip().splitlines()) == 1
