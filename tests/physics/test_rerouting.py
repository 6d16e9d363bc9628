"""Inspection live: doors that are closed are found, driven around, told; what can be reached is served, in order."""

import runpy
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from shapely import MultiPolygon, box

from quarterdeck.api import plan
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.reader import read_obstacles, read_scenario
from quarterdeck.geo.scenario import Area, Obstacle, Precedence, Scenario, Site, Task, Vehicle
from quarterdeck.mission.assign import assign
from quarterdeck.mission.mission import Waypoint
from quarterdeck.mission.recovery import recovering
from quarterdeck.physics.rerouting import _past
from quarterdeck.physics.sensing import Sensing
from quarterdeck.physics.simulate import simulate

pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")
DOORS = SimpleNamespace(**runpy.run_path(str(Path(__file__).parents[2] / "benchmarks" / "closed_doors.py")))


@cache
def driven(seed, amcl=False):
    """Return a building of the benchmark, its plan and its run."""
    b = DOORS.building(seed)
    return (b, *DOORS.drive(b, amcl=amcl, seed=seed))


@pytest.mark.parametrize(("seed", "amcl"), [(0, True), (9, False), (14, False)])
def test_what_can_be_reached_is_served_in_order_and_the_rest_is_told(seed, amcl):
    """With a third of the doors closed: no collision, every reachable task served, no task before its predecessors."""
    b, mission, run = driven(seed, amcl)
    can = DOORS.reachable(b)
    assert len(can) < len(mission.tasks)
    assert not run.report.figures["collisions"]
    done = {t.id: t.driven for t in run.report.tasks if t.driven}
    assert set(done) == can
    for task in mission.tasks:
        if task.id in done:
            for before in task.after:
                assert done[before.task].leave <= done[task.id].begin + 1.0
        else:
            told = next(t.reason for t in run.report.tasks if t.id == task.id)
            assert "no way" in told or "after" in told
    assert all(v.finished for v in run.report.vehicles)


def test_the_same_seed_is_the_same_run_to_the_last_digit():
    """Replans, maps and particles and all."""
    _, _, run = driven(0, True)
    b = DOORS.building(0)
    again = DOORS.drive(b, amcl=True, seed=0)[1]
    assert again.report.to_json() == run.report.to_json()


def corridor(*tasks, robots=1):
    """Return a site of two rooms with two doors, (10, 2) and (10, 8), and robots in the western one."""
    walls = (box(9.9, 0, 10.1, 1), box(9.9, 3, 10.1, 7), box(9.9, 9, 10.1, 10))
    model = load_model("jackal")
    vehicles = tuple(
        Vehicle(f"r{n + 1}", model, (2.0, 2.0 + 3 * n), speed=1.0, clearance=0.45, battery=model.battery)
        for n in range(robots)
    )
    site = Site((), MultiPolygon([box(0, 0, 20, 10)]), tuple(Obstacle(f"w{n}", w) for n, w in enumerate(walls)))
    return Scenario("rooms", Frame(8.5, 47.4), site, vehicles, tasks)


SOUTH, NORTH = Obstacle("south door", box(9.95, 1, 10.05, 3)), Obstacle("north door", box(9.95, 7, 10.05, 9))


def test_around_a_closed_door_by_the_other_one():
    """The planned way goes by the southern door; it is closed, and the robot takes the northern one."""
    mission = assign(corridor(Task("valve", (15.0, 2.0), service_time=5.0)), iterations=5)
    run = simulate(mission, sensing=Sensing(lidar=True, unmapped=(SOUTH,)))
    assert not [r for r in run.report.reasons if "took" not in r]
    crossing = np.flatnonzero(np.diff(np.sign(run.trace.x[:, 0] - 10.0)))
    assert (np.abs(run.trace.y[crossing, 0] - 8.0) < 1.0).all()
    assert run.report.vehicles[0].clearance > 0.05
    task = run.report.tasks[0]
    assert task.driven.arrival > task.planned.arrival + 5.0
    assert task.driven.leave - task.driven.begin == pytest.approx(5.0)


def test_survey_lines_go_on_past_what_stands_on_them():
    """Two trucks, one long and one wide, and a crate by the border: around them and on along the lines, 1 % not covered."""
    model = load_model("jackal")
    robot = Vehicle("r1", model, (1.0, 1.0), speed=1.0, clearance=0.45, battery=model.battery)
    site = Site((Area("yard", box(0, 0, 60, 20)),), MultiPolygon([box(-2, -2, 62, 22)]), ())
    mission = plan(Scenario("yard", Frame(8.5, 47.4), site, (robot,)), method="lines", spacing=4.0, angle=0.0)
    trucks = [box(15, 5, 16.5, 15), box(34, 8, 46, 12), box(1, 17, 2, 19)]
    sensing = Sensing(lidar=True, unmapped=tuple(Obstacle(f"truck {i}", t) for i, t in enumerate(trucks)))
    report = simulate(mission, sensing=sensing, limits={"cross_track": 2.0}).report
    assert report.passed, report.reasons


@pytest.mark.parametrize("recover", [False, True])
def test_both_doors_closed_ends_with_the_reason(recover):
    """What is behind them is told as undone, and what comes after it; what is in front is done; nobody waits for ever."""
    tasks = (
        Task("valve", (15.0, 2.0), priority=3),
        Task("near", (5.0, 5.0)),
        Task("after", (5.0, 8.0), after=(Precedence("valve"),)),
    )
    mission = assign(corridor(*tasks, robots=2), iterations=5)
    director = recovering(mission) if recover else None
    run = simulate(mission, director=director, sensing=Sensing(lidar=True, unmapped=(SOUTH, NORTH)))
    reasons = {t.id: t.reason for t in run.report.tasks}
    assert reasons["near"] == ""
    assert "no way" in reasons["valve"]
    assert "valve" in reasons["after"]
    assert not run.report.figures["collisions"]
    assert run.trace.time[-1] < 200
    assert all(v.finished for v in run.report.vehicles)


def test_who_is_shut_in_stays_and_says_so():
    """The doors close behind a robot that serves in the other room: it is told that there is no way home."""
    mission = assign(corridor(Task("valve", (15.0, 2.0))), iterations=5)
    shut = replace(mission, vehicles=tuple(replace(v, start=(17.0, 5.0), end=(2.0, 2.0)) for v in mission.vehicles))
    run = simulate(
        assign(replace(corridor(*mission.tasks), vehicles=shut.vehicles), iterations=5),
        sensing=Sensing(lidar=True, unmapped=(SOUTH, NORTH)),
    )
    assert "r1: found no way home" in run.report.reasons
    assert run.report.tasks[0].driven is not None
    assert not run.report.vehicles[0].finished


def test_two_that_meet_in_a_door_make_room():
    """One backs out of the doorway, and both serve what lies beyond it."""
    scenario = corridor(Task("east", (18.0, 2.0)), Task("west", (2.0, 2.0)), robots=2)
    west, east = (
        replace(v, start=xy, can=frozenset({v.id})) for v, xy in zip(scenario.vehicles, ((2, 2), (18, 2.1)), strict=True)
    )
    tasks = tuple(replace(t, needs=frozenset({n})) for t, n in zip(scenario.tasks, ("r1", "r2"), strict=True))
    mission = assign(replace(scenario, vehicles=(west, east), tasks=tasks), iterations=5)
    run = simulate(mission, sensing=Sensing(lidar=True, unmapped=(NORTH,)))
    assert run.report.figures["tasks_served"] == 2
    assert not run.report.figures["collisions"]
    assert all(v.finished for v in run.report.vehicles)
    assert run.trace.time[-1] < 200


def test_the_way_leads_past_all_who_stand_not_to_a_corner_among_them():
    """A corner near somebody is left out, and so are those up to where the legs are clear of all; a stop never is."""
    ahead = [Waypoint(x, 0.0) for x in (1.0, 2.0, 3.0, 4.0, 5.0)]
    here, others = np.zeros(2), {1: np.array([[2.5, 0.5]]), 2: np.array([[0.5, 7.0]])}
    assert ahead[_past(here, ahead, others, 0.9)].x == 4.0
    assert ahead[_past(here, ahead[:3], others, 0.9)].x == 3.0
    assert _past(here, ahead, {2: others[2]}, 0.9) == 0
    assert _past(np.array([2.6, 0.0]), ahead[3:], others, 0.9) == 0  # it is getting away


def test_what_the_map_does_not_have_does_not_lead_the_filter_astray():
    """A fence around a task in a hall of few features: the robot knows its place, and says that there is no way in."""
    root = Path(__file__).parents[2]
    hall = read_scenario(root / "data" / "inspection_hall.geojson")
    surprises = read_obstacles(str(root / "examples" / "hall_surprises.geojson"), hall.frame)
    run = simulate(assign(hall, iterations=10), sensing=Sensing(amcl=True, unmapped=surprises))
    assert max(v.localisation.p95 for v in run.report.vehicles) < 0.1
    assert [t.id for t in run.report.tasks if t.driven is None] == ["t1"]
    assert "found no way" in run.report.tasks[1].reason
    assert not run.report.figures["collisions"]
