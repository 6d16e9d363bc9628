"""Who waits so that nobody meets anybody, and what is told where a check would refuse a plan."""

import numpy as np
import pytest
from shapely import MultiPolygon, box

from quarterdeck.cli.advice import refused
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Site, Vehicle
from quarterdeck.mission.check import check_mission
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.timing import timed_route
from quarterdeck.mission.waits import parted, waits


def boats(*ways, spacing=10.0):
    """Return a survey in which boats drive straight from and to, (x, y) metres each."""
    model = load_model("otter")
    vehicles = [
        Vehicle(f"usv-{i}", model, start, end, speed=1.0, clearance=5.0, battery=915.0, endurance=1e4)
        for i, (start, end) in enumerate(ways, start=1)
    ]
    routes = [timed_route(v, np.array([(*v.start, 0.0), (*v.end, 0.0)]), ["start", "survey"]) for v in vehicles]
    square = MultiPolygon([box(-150, -150, 150, 150)])
    site = Site((Area("all", square),), square, ())
    return Mission("boats", Frame(10.0, 54.0), site, tuple(vehicles), tuple(routes), "stc", spacing=spacing)


CROSSING = ((-50.0, 0.0), (50.0, 0.0)), ((0.0, -50.0), (0.0, 50.0))


def test_who_would_meet_another_waits_and_no_longer_than_it_needs():
    """Of two boats that would meet the second waits till a check finds nothing; with a step less it would."""
    plan = boats(*CROSSING)
    assert check_mission(plan)
    after = parted(plan)
    assert check_mission(after) == ()
    assert waits(plan) == {"usv-2": 5.0}
    assert after.routes[1].waypoints[0].hold == 5.0
    assert after.figures["makespan"] == pytest.approx(105.0)
    assert any("usv-2 waits 5 s" in note for note in after.figures["notes"])
    assert parted(after) == after


def test_nobody_waits_where_another_comes_by():
    """A boat on whose place another bears down before it could leave it has nowhere to wait."""
    head_on = ((-20.0, 0.0), (100.0, 0.0)), ((20.0, 0.0), (-100.0, 0.0))
    assert check_mission(boats(*head_on))
    assert waits(boats(*head_on)) == {}


def test_what_a_check_would_refuse_is_told_with_what_helps():
    """The notes of a plan have the check's words and a wait that helps, and a sound plan has none."""
    problem, advice = refused(boats(*CROSSING))
    assert problem == check_mission(boats(*CROSSING))[0]
    assert "--unsafe" in advice
    assert "usv-2 sets out 5 s later" in advice
    assert not list(refused(parted(boats(*CROSSING))))
