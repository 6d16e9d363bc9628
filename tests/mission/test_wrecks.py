"""Who is lost lies in the way of those who go on, unless that is told to be otherwise."""

from functools import cache
from pathlib import Path

import pytest
from shapely import LineString, Point

from quarterdeck.cli import main
from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.scenario import Obstacle
from quarterdeck.mission.changes import Changes
from quarterdeck.mission.cover import cover
from quarterdeck.mission.planfile import plan_text, read_plan
from quarterdeck.mission.progress import planned_progress
from quarterdeck.mission.replan import replan
from quarterdeck.mission.survey_recovery import without_corners
from quarterdeck.mission.wrecks import with_wrecks

DATA = Path(__file__).parents[2] / "data"
LOST = Changes(lost=frozenset({"ugv-2"}))


@cache
def yard():
    """Return a plan of two robots."""
    return cover(read_scenario(DATA / "plant_yard.geojson"))


def status(*arguments):
    """Run a verb in this process and return its exit status."""
    with pytest.raises(SystemExit) as ended:
        main(list(arguments))
    return ended.value.code


def test_a_replan_goes_round_who_is_lost_until_it_has_been_taken_away(tmp_path, monkeypatch, capsys):
    """The new plan keeps its clearance from where a robot was last and says where; taken away, nothing lies there."""
    monkeypatch.chdir(tmp_path)
    plan = yard()
    Path("plan.geojson").write_text(plan_text(plan))
    here = Point(planned_progress(plan, 900.0).positions["ugv-2"][:2])
    nearest = {}
    for name, more in {"lies": [], "taken": ["--gone", "wreck of ugv-2"]}.items():
        assert status("replan", "plan.geojson", "--at", "900", "--lost", "ugv-2", *more, "-o", f"{name}.geojson") == 0
        assert ("ugv-2 is taken to lie at" in capsys.readouterr().err) == (name == "lies")
        nearest[name] = LineString(read_plan(f"{name}.geojson").routes[0].xyz[:, :2]).distance(here)
    assert nearest["taken"] < plan.vehicle("ugv-1").clearance < nearest["lies"]
    assert status("check", "lies.geojson") == 0
    assert status("replan", "lies.geojson", "--at", "60", "--gone", "wreck of ugv-2", "-o", "back.geojson") == 0
    assert "wreck of ugv-2" not in {o.id for o in read_plan("back.geojson").site.obstacles}


@pytest.mark.parametrize(
    ("time", "changes", "names"),
    [
        (900.0, LOST, ["wreck of ugv-2"]),
        (0.0, LOST, []),  # at its berth
        (900.0, LOST | Changes(gone=frozenset({"wreck of ugv-2"})), []),
        (900.0, LOST | Changes(obstacles=(Obstacle("wreck of ugv-2", Point(0, 0).buffer(1)),)), ["wreck of ugv-2"]),
        (900.0, Changes(), []),
    ],
)
def test_who_is_lost_is_an_obstacle_once_but_at_a_berth(time, changes, names):
    """A wreck is added where nobody gave or withdrew it, and not where somebody sees to it."""
    after = with_wrecks(yard(), planned_progress(yard(), time), changes)
    assert [o.id for o in after.obstacles] == names


def test_what_fell_from_the_air_is_in_nobodys_way():
    """An aerial vehicle that is lost is no obstacle."""
    plan = cover(read_scenario(DATA / "farm_survey.geojson"))
    lost = Changes(lost=frozenset({plan.vehicles[0].id}))
    assert with_wrecks(plan, planned_progress(plan, 300.0), lost) == lost


def test_a_loss_costs_no_coverage_but_what_is_too_near():
    """Coverage is reckoned along the lines, as a plan's: a wreck takes no more than is told as left, and no corners."""
    plan = cover(read_scenario(DATA / "west_ant_island.geojson"))
    time, lost = 8000.0, frozenset({"usv-2"})
    progress = planned_progress(plan, time)
    after = replan(plan, progress, Changes(lost=lost))
    assert after.figures["poc"] == pytest.approx(plan.figures["poc"], abs=5e-4)
    around = without_corners(replan(plan, progress, with_wrecks(plan, progress, Changes(lost=lost))))
    fewer = (after.figures["poc"] - around.figures["poc"]) * plan.site.coverable.area
    assert around.figures["undone_m2"] == pytest.approx(max(fewer, 0.0), abs=500.0)
    assert sum(area.area for area in around.layer("undone").geometries) == pytest.approx(around.figures["undone_m2"])
