"""Recovered runs in PyBullet: who is slow is relieved, and what was recovered from fails no run."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from shapely import Point

from quarterdeck.geo.reader import read_scenario
from quarterdeck.mission.cover import cover
from quarterdeck.mission.recovery import recovering
from quarterdeck.physics.simulate import simulate

pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")

YARD = Path(__file__).parents[2] / "data" / "plant_yard.geojson"


@cache
def plan():
    """Return a coarse plan of the yard."""
    return cover(read_scenario(YARD), spacing=8.0)


def test_a_slow_vehicle_is_found_and_relieved():
    """With half the wheels at half power others take over, so that all are done sooner, and all is covered."""
    mission, fault = plan(), "thruster:ugv-2@100"
    plain = simulate(mission, faults=[fault], sample=1.0, duration=2000.0).report.figures
    told = []
    run = simulate(mission, director=recovering(mission, tell=lambda *plan: told.append(plan)), faults=[fault], sample=1.0)
    [(time, after)] = told
    assert 100.0 < time < 200.0
    assert after.vehicle("ugv-2").speed == pytest.approx(0.5, abs=0.1)
    assert after.vehicle("ugv-1").speed == mission.vehicle("ugv-1").speed
    assert run.report.figures["time"] < plain["time"] - 60.0
    assert run.report.figures["coverage_driven"] > plain["coverage_planned"] - 0.01


def test_a_recovered_loss_is_told_and_does_not_fail_the_run():
    """Where others do what a lost vehicle left, in the time told, the run passes; where nobody is left to, it fails."""
    mission = plan()
    run = simulate(mission, director=recovering(mission), faults=["ugv-2@100"], sample=1.0)
    recovered = run.report
    assert recovered.passed, recovered.reasons
    assert recovered.figures["lost"] == 1
    assert recovered.figures["time_planned"] > 1.5 * max(r.duration for r in mission.routes)
    assert recovered.notes == ("ugv-2: lost; at 100 s others were given its part",)
    assert [(m.time, m.vehicle, m.what) for m in run.moments] == [(100.0, "ugv-2", "lost"), (100.0, "ugv-1", "told")]
    at = np.array([run.moments[0].x, run.moments[0].y])
    assert np.linalg.norm(at - [run.trace.x[100, 1], run.trace.y[100, 1]]) < 1e-9
    wreck = next(o for o in run.followed.site.obstacles if o.id == "wreck of ugv-2")
    assert wreck.polygon.distance(Point(at)) < 1.0
    alone = simulate(mission, director=recovering(mission), faults=["ugv-2@100", "ugv-1@600"], sample=1.0).report
    assert "did not finish: ugv-1" in alone.reasons
    assert any(reason.startswith("coverage") for reason in alone.reasons)
