"""The audit: rovers on wheels in contact do what the sliding bodies of missions do."""

import numpy as np
import pytest

from quarterdeck.physics.simulate import simulate
from quarterdeck.physics.wheels import drive_on_wheels

pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")


@pytest.mark.parametrize("model", ["husky", "jackal"])
def test_wheels_and_sliding_body_agree(mow, model):
    """The same route: both finish, in times within 15 %, off straight legs by less than 0.1 m, at the same place."""
    mission = mow(model, rows=2, spacing=4.0, length=15.0)
    on_wheels = drive_on_wheels(mission.vehicles[0], mission.routes[0].waypoints, duration=120.0)
    sliding = simulate(mission).trace
    assert on_wheels.finished
    assert on_wheels.time[-1] == pytest.approx(sliding.time[-1], rel=0.15)
    assert np.percentile(np.abs(on_wheels.cross[~on_wheels.turning]), 95) <= 0.1
    assert np.hypot(*(on_wheels.track[-1, :2] - [sliding.x[-1, 0], sliding.y[-1, 0]])) < 0.2


def test_on_ice_it_does_not_arrive(mow):
    """With next to no friction the wheels spin: the audit is of contact, not of commands."""
    mission = mow("husky", rows=2, spacing=4.0, length=15.0)
    assert not drive_on_wheels(mission.vehicles[0], mission.routes[0].waypoints, duration=30.0, friction=0.001).finished
