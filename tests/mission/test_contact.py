"""Messages within range alone: out of touch is not lost, and a loss out there is heard of when the vehicle is overdue."""

from dataclasses import replace

import pytest
from shapely import MultiPolygon, box

from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Scenario, Site, Vehicle
from quarterdeck.mission.fast import run_fast
from quarterdeck.mission.lines import plan_lines
from quarterdeck.mission.recovery import recovering
from quarterdeck.mission.world import Fault

RANGE = 40.0  # m; the field is 120 m long


@pytest.fixture(scope="module")
def field():
    """Return two rovers' plan of lines along a field, far beyond the range of their starts at its western end."""
    area = MultiPolygon([box(0.0, 0.0, 120.0, 40.0)])
    husky = load_model("husky")
    vehicles = tuple(
        Vehicle(f"r{i}", husky, (-3.0, y), speed=husky.speed, clearance=husky.clearance, battery=husky.battery)
        for i, y in enumerate((10.0, 30.0))
    )
    site = Site((Area("field", area),), MultiPolygon([area.buffer(10.0)]))
    return plan_lines(Scenario("field", Frame(0.0, 0.0), site, vehicles, spacing=10.0), angle=0.0)


def ranged(mission, *ranges):
    """Return the mission with its vehicles' ranges."""
    return replace(mission, vehicles=tuple(replace(v, range=r) for v, r in zip(mission.vehicles, ranges, strict=True)))


def run(mission, *faults, delay=5.0):
    """Return the times of the new plans, and the run."""
    told = []
    director = recovering(mission, delay=delay, tell=lambda *plan: told.append(plan[0]))
    return told, run_fast(mission, director, faults)


def test_out_of_range_is_not_lost(field):
    """Both are out of touch for most of the time, and no new plan is made."""
    told, came = run(ranged(field, RANGE, RANGE))
    assert not told
    assert came.time == pytest.approx(run(field)[1].time)


def test_a_loss_out_of_range_is_heard_of_when_the_vehicle_is_overdue(field):
    """The one that is lost out there is waited for until it would have been in range again, and as long as is asked."""
    fault = Fault("r0", 90.0)
    assert run(field, fault)[0] == [95.0]
    told, came = run(ranged(field, RANGE, RANGE), fault)
    assert len(told) == 1
    assert 150.0 < told[0] < 400.0  # out and back over a field of 120 m at 0.9 m/s
    assert came.times["r1"] > field.routes[1].duration * 1.2  # it did what the other had left


def test_another_vehicle_relays(field):
    """One that hears everywhere passes on what one within its reach has to say: the loss is heard of at once."""
    assert run(ranged(field, RANGE, None), Fault("r0", 90.0))[0] == [95.0]
