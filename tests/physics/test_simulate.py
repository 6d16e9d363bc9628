"""A mission executed, end to end."""

import json

import jsonschema
import numpy as np
import pytest
from shapely import box

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Obstacle
from quarterdeck.physics.report import report_schema
from quarterdeck.physics.simulate import simulate

pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")


@pytest.mark.parametrize("model", ["otter", "wam-v", "husky", "jackal", "survey-quad", "crazyflie"])
def test_every_packaged_model_drives_its_mission_and_passes(mow, model):
    """Two legs and home: finished, no collision, coverage as planned, back at the start, a report by the schema."""
    mission = mow(
        model, spacing=40.0 if model in ("otter", "wam-v") else 10.0, length=150.0 if model != "crazyflie" else 30.0
    )
    run = simulate(mission, limits={"coverage_loss": 0.05})
    assert run.report.passed, run.report.reasons
    assert np.hypot(run.trace.x[-1, 0], run.trace.y[-1, 0]) < 2.0
    jsonschema.validate(json.loads(run.report.to_json()), report_schema())


def test_route_into_an_obstacle_fails_and_says_so(mow):
    """A vessel sent through a rock on purpose: PyBullet stops it, the swept path tells of it, the verdict names both."""
    rock = Obstacle("rock", box(50.0, -5.0, 60.0, 5.0))
    run = simulate(mow("otter", obstacles=[rock]))
    (vehicle,) = run.report.vehicles
    assert not run.report.passed
    assert vehicle.touched >= 1
    assert vehicle.aground
    assert vehicle.hits == ("rock",)
    assert run.trace.x[:, 0].max() < 50.0  # the bow stops at the rock: PyBullet has the word
    assert any("collision" in reason for reason in run.report.reasons)


def test_obstacle_that_does_not_block_the_domain_is_driven_over(mow):
    """What blocks only aerial vehicles stops no vessel."""
    rock = Obstacle("mast", box(50.0, -5.0, 60.0, 5.0), blocks=frozenset({"aerial"}))
    run = simulate(mow("otter", obstacles=[rock]), limits={"coverage_loss": 0.1})
    assert run.report.passed, run.report.reasons


def test_same_seed_same_trajectory(mow):
    """The hash of the trace repeats with the seed, gusts and all, and changes with it."""
    mission = mow("survey-quad", count=2)
    first, again, other = (simulate(mission, gusts=3.0, seed=seed, duration=20.0).trace.hash for seed in (5, 5, 6))
    assert first == again
    assert first != other


@pytest.mark.parametrize("weather", [{"current": (1e9, 0.0)}, {"gusts": 100.0}])
def test_weather_in_which_no_model_holds_is_refused(mow, weather):
    """What throws a vessel out of all bounds is one clear line that names it, not a report."""
    with pytest.raises(InputError, match=r"otter-?\d?: its model does not hold in such weather"):
        simulate(mow("otter"), **weather)


def test_wrong_options_are_one_line(mow):
    """Unknown limits and odd steps are refused before anything is simulated."""
    with pytest.raises(InputError, match="did you mean 'collisions'"):
        simulate(mow("otter"), limits={"colisions": 1}, duration=1.0)
    with pytest.raises(InputError, match="divide a second"):
        simulate(mow("otter"), step=0.03)
