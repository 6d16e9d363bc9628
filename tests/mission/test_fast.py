"""The fast world beside the plan: the same ways in the same time, and the director that recovers woken in time."""

from pathlib import Path

import numpy as np
import pytest

from quarterdeck.coverage.metrics import covered_fraction, track_length
from quarterdeck.geo.reader import read_scenario
from quarterdeck.mission.assign import assign
from quarterdeck.mission.cover import cover
from quarterdeck.mission.director import Command, fixed
from quarterdeck.mission.fast import run_fast
from quarterdeck.mission.inspection import default_director
from quarterdeck.mission.mission import Waypoint
from quarterdeck.mission.recovery import recovering
from quarterdeck.mission.routes import survey_lines
from quarterdeck.mission.world import Fault

DATA = Path(__file__).parents[2] / "data"


@pytest.fixture(scope="module")
def hall():
    """Return a plan of tasks."""
    return assign(read_scenario(DATA / "inspection_hall.geojson"), iterations=10)


def test_all_tasks_are_served_no_later_than_planned(hall):
    """Waits end as soon as they may; what is driven takes no less than the time of its length."""
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


@pytest.fixture(scope="module", params=[("plant_yard", 8.0), ("farm_survey", 40.0)], ids=["rovers", "copters"])
def survey(request):
    """Return a coarse survey on land, and one in the air."""
    site, spacing = request.param
    return cover(read_scenario(DATA / f"{site}.geojson"), spacing=spacing)


def test_a_plan_comes_to_what_it_reckons(survey):
    """Turns and climbs counted, the times and energy are the plan's, and its lines are surveyed."""
    run = run_fast(survey, fixed(survey))
    assert run.finished == {v.id for v in survey.vehicles}
    for route in survey.routes:
        assert run.energy[route.vehicle] == pytest.approx(route.energy, rel=0.005)  # less the wait before some take off
        if survey.vehicle(route.vehicle).domain == "ground":  # a landing is no move on the plan
            assert run.times[route.vehicle] == pytest.approx(route.duration)
    planned, area = survey_lines(survey.routes), survey.site.coverable
    assert covered_fraction(run.surveyed, area, survey.spacing) == covered_fraction(planned, area, survey.spacing)


def test_who_is_slow_takes_as_much_longer(survey):
    """At half the pace from a second on, what was left then takes twice as long, and no more energy."""
    first = survey.routes[0]
    run = run_fast(survey, fixed(survey), [Fault(first.vehicle, 100.0, "slow", pace=0.5)])
    for route in survey.routes:
        plain = run_fast(survey, fixed(survey)).times[route.vehicle]
        late = plain - 100.0 if route is first else 0.0
        assert run.times[route.vehicle] == pytest.approx(plain + late, rel=0.01)
        assert run.energy[route.vehicle] == pytest.approx(route.energy, rel=0.005)
    plain = run_fast(survey, fixed(survey)).times[first.vehicle]
    over = run_fast(survey, fixed(survey), [Fault(first.vehicle, 100.0, "slow", 300.0, 0.5)])
    assert over.times[first.vehicle] == pytest.approx(plain + 100.0, rel=0.01)


def test_a_slow_vehicle_is_relieved(survey):
    """The director finds it by its places alone, and all are done sooner."""
    told = []
    first = survey.routes[0].vehicle
    fault = [Fault(first, 100.0, "slow", pace=0.5)]
    run = run_fast(survey, recovering(survey, tell=lambda *plan: told.append(plan)), fault)
    assert told[0][1].vehicle(first).speed == pytest.approx(0.55 * survey.vehicle(first).speed, rel=0.2)
    assert run.time < run_fast(survey, fixed(survey), fault).time - 60.0
    assert sum(map(track_length, run.surveyed)) > 0.95 * sum(map(track_length, survey_lines(survey.routes)))


def test_the_silent_are_not_heard_and_hear_nothing(survey):
    """Of who is silent the director has what was last heard, and its new command reaches it when it is heard again."""
    first = survey.routes[0].vehicle
    known = {}

    def direct(time, states, events, memory):
        known[time] = states[first]
        if memory is None:
            return fixed(survey)(time, states, events, None)
        again = [e.vehicle for e in events if e.kind == "lost"]
        return {v: Command((Waypoint(0.0, 0.0),)) for v in again}, memory

    run = run_fast(survey, direct, [Fault(first, 50.0, "mute", 90.0)])
    assert not known[50.0].alive
    assert (known[50.0].x, known[50.0].y) != (known[90.0].x, known[90.0].y)
    track = run.tracks[first]
    ahead = [np.interp(90.0 + 1.0, track[:, 0], track[:, n]) - np.interp(90.0, track[:, 0], track[:, n]) for n in (1, 2)]
    here = np.array([known[90.0].x, known[90.0].y])
    assert np.dot(ahead, -here) == pytest.approx(np.hypot(*ahead) * np.hypot(*here))  # straight to the origin
    assert track[-1, 1:] == pytest.approx([0.0, 0.0])
