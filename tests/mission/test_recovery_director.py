"""The director that recovers, in PyBullet: what the lost were to cover is covered by the others."""

from functools import cache
from pathlib import Path

import pytest

from quarterdeck.geo.reader import read_scenario
from quarterdeck.mission.cover import cover
from quarterdeck.mission.recovery import recovering

DATA = Path(__file__).parents[2] / "data"


@cache
def plan(site):
    """Return a coarse plan of a sample site."""
    return cover(read_scenario(DATA / f"{site}.geojson"), spacing={"plant_yard": 5.0, "farm_survey": 40.0}[site])


@pytest.mark.parametrize(("site", "fault"), [("plant_yard", "ugv-1@300"), ("farm_survey", "uav-2@200")])
def test_survivors_cover_the_rest(site, fault):
    """With a loss in the run all is covered that was planned, without a collision; without recovery much is missed."""
    pytest.importorskip("pybullet", reason="PyBullet is not installed")
    from quarterdeck.physics.simulate import simulate

    mission = plan(site)
    plain = simulate(mission, faults=[fault], sample=1.0).report.figures
    told = []
    director = recovering(mission, delay=10.0, tell=lambda *plan: told.append(plan))
    figures = simulate(mission, director=director, faults=[fault], sample=1.0).report.figures
    assert plain["coverage_driven"] < figures["coverage_planned"] - 0.05
    assert figures["coverage_driven"] > figures["coverage_planned"] - 0.015
    assert figures["collisions"] == 0
    assert len(told) == 1


def test_false_alarm_changes_nothing():
    """Who is heard of again within the delay keeps its route."""
    pytest.importorskip("pybullet", reason="PyBullet is not installed")
    from quarterdeck.physics.simulate import simulate

    mission = plan("plant_yard")
    told = []
    director = recovering(mission, delay=60.0, tell=lambda *plan: told.append(plan))
    run = simulate(mission, director=director, faults=["comms:ugv-1@100-130"], sample=1.0)
    assert not told
    assert run.report.passed
