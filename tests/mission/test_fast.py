"""The fast world beside the plan: the same ways at the same speeds, and the director that recovers woken in time."""

from pathlib import Path

import numpy as np
import pytest

from quarterdeck.geo.reader import read_scenario
from quarterdeck.mission.assign import assign
from quarterdeck.mission.fast import run_fast
from quarterdeck.mission.inspection import default_director
from quarterdeck.mission.recovery import recovering
from quarterdeck.mission.world import Fault

HALL = Path(__file__).parents[2] / "data" / "inspection_hall.geojson"


@pytest.fixture(scope="module")
def hall():
    """Return a plan of tasks."""
    return assign(read_scenario(HALL), iterations=10)


def test_all_tasks_are_served_no_later_than_planned(hall):
    """Plans count turns, the fast world does not; what is driven straight takes the time of its length."""
    run = run_fast(hall, default_director(hall))
    assert run.served.keys() == {t.id for t in hall.tasks}
    for route in hall.routes:
        for w in route.waypoints:
            if w.task is not None:
                assert run.served[w.task] <= w.time + w.hold + 1e-6
        least = np.linalg.norm(np.diff(route.xyz, axis=0), axis=1).sum() / hall.vehicle(route.vehicle).speed
        assert run.times[route.vehicle] >= least - 1e-6


def test_a_loss_is_recovered_from_when_the_delay_is_over(hall):
    """Nothing happens at the end of the delay: the director has asked to be woken, and replans then."""
    told = []
    director = recovering(hall, delay=30.0, tell=lambda *plan: told.append(plan[0]))
    first = hall.routes[0].vehicle
    run = run_fast(hall, director, [Fault(first, 1.0)])
    assert told == [31.0]
    assert run.served.keys() == {t.id for t in hall.tasks}


def test_who_is_heard_again_in_time_changes_nothing(hall):
    """A silence shorter than the delay is a false alarm."""
    told = []
    director = recovering(hall, delay=30.0, tell=lambda *plan: told.append(plan[0]))
    run = run_fast(hall, director, [Fault(hall.routes[0].vehicle, 1.0, "mute", 20.0)])
    assert not told
    assert run.served.keys() == {t.id for t in hall.tasks}
