"""A plan of tasks after losses: nothing done again, all that is left done once, precedence kept."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.scenario import Precedence, Task
from quarterdeck.mission.assign import assign
from quarterdeck.mission.progress import planned_progress
from quarterdeck.mission.replan import Changes, replan

DATA = Path(__file__).parents[2] / "data"


@cache
def plan():
    """Return a short search's plan of the hall's five tasks, each with ten seconds of service."""
    scenario = read_scenario(DATA / "inspection_hall.geojson")
    tasks = tuple(replace(t, service_time=10.0) for t in scenario.tasks)
    return assign(replace(scenario, tasks=tasks), iterations=20)


def visited(mission):
    """Return the ids of the tasks on the routes of a mission."""
    return [w.task for r in mission.routes for w in r.waypoints if w.task]


@pytest.mark.parametrize("time", [0.0, 15.0, 30.0])
def test_the_survivor_does_the_rest(time):
    """After a loss each task that is not done is on the survivor's route once, and none that is done."""
    before = plan()
    progress = planned_progress(before, time)
    after = replan(before, progress, Changes(lost=frozenset({"r1"})))
    assert sorted(visited(after)) == sorted({t.id for t in before.tasks} - progress.served)
    assert [v.id for v in after.vehicles] == ["r2"]


def test_all_done_goes_home():
    """When nothing is left the survivor goes home."""
    before = plan()
    after = replan(before, planned_progress(before, 1e4), Changes(lost=frozenset({"r1"})))
    assert visited(after) == []
    assert after.feasible


def test_who_began_a_task_and_is_lost_leaves_it_to_others():
    """A service under way is finished by who began it, as far as it really was, until he too is lost."""
    before = plan()
    task = next(w.task for w in before.routes[0].waypoints if w.task)
    begun = replace(planned_progress(before, 0.0), begun={task: ("r1", 4.0)})
    after = replan(before, begun, anew=True)
    first = next(w for w in after.routes[0].waypoints if w.task)
    assert (first.task, first.hold) == (task, pytest.approx(6.0))
    last = replan(after, planned_progress(after, 0.0), Changes(lost=frozenset({"r1"})))
    assert task in visited(last)
    assert last.figures["undone"] == []


def test_a_carried_thing_that_is_lost_is_told():
    """A task in the same robot as one that a lost robot has done can't be done, nor what comes after it: both are told."""
    before = plan()
    route = next(r for r in before.routes if r.vehicle == "r1")
    done = next(w for w in route.waypoints if w.task)
    first, *others = [t.id for t in before.tasks if t.id != done.task]
    tasks = [replace(t, after=(Precedence(done.task, "same_robot"),)) if t.id == first else t for t in before.tasks]
    tasks = [replace(t, after=(Precedence(first),)) if t.id == others[0] else t for t in tasks]
    progress = planned_progress(before, done.time + done.hold + 0.1)
    after = replan(replace(before, tasks=tuple(tasks)), progress, Changes(lost=frozenset({"r1"})))
    left = {t.id for t in tasks} - progress.served - {first, others[0]}
    assert sorted(visited(after)) == sorted(left)
    assert not after.feasible
    assert any((r.kind, r.about) == ("undone", first) for r in after.reasons)


def test_a_pair_that_no_robot_can_do_whole_is_parted():
    """The only robot that could do both tasks of a pair in one robot is lost: the first is done, the second is told."""
    scenario = read_scenario(DATA / "inspection_hall.geojson")
    a, b = scenario.tasks[:2]
    first = replace(a, needs=frozenset({"arm"}), after=())
    second = replace(b, needs=frozenset({"camera"}), after=(Precedence(a.id, "same_robot"),))
    r1, r2 = scenario.vehicles
    team = (replace(r1, can=frozenset({"arm", "camera"})), replace(r2, can=frozenset({"arm"})))
    third = replace(r2, id="r3", can=frozenset({"camera"}))
    before = assign(replace(scenario, tasks=(first, second), vehicles=(*team, third)), quick=True, iterations=5)
    after = replan(before, planned_progress(before, 0.0), Changes(lost=frozenset({"r1"})))
    assert visited(after) == [a.id]
    assert [(r.kind, r.about) for r in after.reasons] == [("undone", b.id)]


def test_a_new_task_is_done():
    """A task that is added is on somebody's route."""
    before = plan()
    after = replan(before, planned_progress(before, 5.0), Changes(tasks=(Task("late", before.tasks[0].position),)))
    assert "late" in visited(after)


def test_what_was_done_unheard_is_done():
    """A task that no route has any more, done by a silent robot, bars no successor, and ties it to who has done it."""
    before = plan()
    first, *others = [t.id for t in before.tasks]
    tasks = [replace(t, after=(Precedence(first, "same_robot"),)) if t.id == others[0] else t for t in before.tasks]
    routes = [replace(r, waypoints=tuple(replace(w, task=None) for w in r.waypoints)) for r in before.routes]
    start, changes = planned_progress(before, 0.0), Changes(speeds={"r1": before.vehicle("r1").speed})
    for doer in ("r1", "r2"):
        progress = replace(start, served=frozenset({first}), servers={first: doer})
        after = replan(replace(before, routes=tuple(routes), tasks=tuple(tasks)), progress, changes)
        assert after.feasible
        assert sorted(visited(after)) == sorted(others)
        assert others[0] in [w.task for r in after.routes if r.vehicle == doer for w in r.waypoints]
