"""Assignments as missions: timing, precedence in real time, people, windows, every error in one line, both worlds."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, MultiPolygon, Point, box

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.occupancy import site_occupancy, write_map
from quarterdeck.geo.scenario import Obstacle, Precedence, Scenario, Site, Task, Vehicle
from quarterdeck.mission.assign import assign
from quarterdeck.mission.inspection import inspection
from quarterdeck.mission.planfile import plan_text, read_plan
from quarterdeck.mission.twin import map_scenario
from quarterdeck.mission.world import Actor, Fault, run_world

ROVER = load_model("husky")
WALL = Obstacle("wall", box(-2, 10, 2, 60))


def yard(tasks, vehicles=None, obstacles=(WALL,)):
    """A field of 120 m x 120 m with a wall in the middle."""
    fleet = vehicles or (Vehicle("a", ROVER, (-20.0, 0.0), clearance=1.0), Vehicle("b", ROVER, (20.0, 0.0), clearance=1.0))
    return Scenario(
        "yard", Frame(8.5, 47.4), Site((), MultiPolygon([box(-60, -60, 60, 60)]), tuple(obstacles)), fleet, tuple(tasks)
    )


def random_tasks(rng, count, precedence=True):
    """Tasks with all that a task can have."""
    tasks = []
    for i in range(count):
        after = tuple(
            Precedence(f"t{j}", "same_robot" if rng.random() < 0.3 else "finish_to_start")
            for j in range(i)
            if precedence and rng.random() < 0.25
        )
        x, y = rng.uniform(-50, 50, 2)
        x = x + 6 * np.sign(x) if abs(x) < 4 else x
        tasks.append(Task(f"t{i}", (float(x), float(y)), int(rng.integers(0, 4)), float(rng.uniform(0, 40)), after))
    return tasks


def run(mission, faults=()):
    """The mission in the event-driven world, by its director."""
    actors = [Actor(v.id, *v.start, 0.0, v.speed) for v in mission.vehicles]
    return run_world(inspection(mission), actors, [], [], 0.0, faults=faults)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6), st.integers(1, 8))
def test_nothing_breaks_a_precedence_in_plan_or_execution(seed, count):
    """In the plan and in the event-driven world each task is served once, after its predecessors, by the right robots."""
    scenario = yard(random_tasks(np.random.default_rng(seed), count))
    mission = assign(scenario, iterations=2, seed=seed)
    visits = {v["task"]: v for v in mission.figures["schedule"]}
    assert sorted(visits) == sorted(t.id for t in scenario.tasks)
    outcome = run(mission)
    served = {e.subject: (t, e.vehicle) for t, e in outcome.events if e.kind == "served"}
    assert sorted(served) == sorted(visits)
    for task in scenario.tasks:
        for first in task.after:
            assert visits[first.task]["finish"] <= visits[task.id]["start"] + 1e-6
            assert served[first.task][0] <= served[task.id][0] - task.service_time + 1e-6
            if first.mode == "same_robot":
                assert served[first.task][1] == served[task.id][1]
    for route, vehicle in zip(mission.routes, scenario.vehicles, strict=True):
        assert Point(route.xyz[-1, :2]).distance(Point(vehicle.home)) < 1e-6
        if len(route.waypoints) > 1:
            assert LineString(route.xyz[:, :2]).distance(WALL.polygon) >= vehicle.clearance - 1e-6


def test_the_plan_reads_back_and_is_the_same_again(tmp_path):
    """One seed gives one PLAN, byte for byte, and the PLAN holds the mission."""
    scenario = yard(random_tasks(np.random.default_rng(5), 7))
    text = plan_text(assign(scenario, iterations=3, seed=1))
    assert text == plan_text(assign(scenario, iterations=3, seed=1))
    (tmp_path / "p.geojson").write_text(text)
    back = read_plan(tmp_path / "p.geojson")
    assert [w.task for r in back.routes for w in r.waypoints if w.task] == [
        t for r in assign(scenario, iterations=3, seed=1).routes for t in (w.task for w in r.waypoints) if t
    ]
    assert run(back).reason == ""


def test_people_and_capabilities_are_kept_to():
    """A task that needs a person goes to the vehicle that is or carries one, and windows are waited for."""
    person = Vehicle("crew", ROVER, (-20.0, 0.0), clearance=1.0, speed=1.4, can=frozenset({"person"}))
    robot = Vehicle("robot", ROVER, (20.0, 0.0), clearance=1.0)
    tasks = [
        Task("valve", (30.0, 30.0), needs=frozenset({"person"})),
        Task("gauge", (25.0, 5.0), window=(300.0, 400.0)),
        Task("pump", (-30.0, 20.0), after=(Precedence("valve"),)),
    ]
    mission = assign(yard(tasks, (person, robot)), iterations=5)
    visits = {v["task"]: v for v in mission.figures["schedule"]}
    assert visits["valve"]["vehicle"] == "crew"
    assert 300.0 <= visits["gauge"]["start"] <= 400.0
    assert visits["pump"]["start"] >= visits["valve"]["finish"]
    assert mission.feasible


def test_a_window_that_cannot_be_met_is_a_reason_not_an_error():
    """Two tasks far apart at one moment for one robot: the plan says which is late and by how much."""
    one = (Vehicle("a", ROVER, (0.0, 0.0), clearance=1.0),)
    tasks = [Task("west", (-50.0, 0.0), window=(50.0, 60.0)), Task("east", (50.0, 0.0), window=(50.0, 60.0))]
    mission = assign(yard(tasks, one), iterations=3)
    assert not mission.feasible
    assert "after its window" in mission.reasons[0].why


def test_a_lost_robot_leaves_nothing_skipped_and_nobody_waiting_for_ever():
    """When the predecessor's robot is lost, the successor is not served; who waited for it goes home."""
    tasks = [Task("first", (-40.0, 0.0), service_time=50.0), Task("then", (40.0, 0.0), after=(Precedence("first"),))]
    mission = assign(yard(tasks), iterations=3)
    assert {v["vehicle"] for v in mission.figures["schedule"]} == {"a", "b"}
    outcome = run(mission, faults=[Fault("a", 5.0)])
    assert [e.subject for _, e in outcome.events if e.kind == "served"] == []
    assert set(outcome.memory.abandoned) == {"then"}
    np.testing.assert_allclose(outcome.tracks["b"][-1, 1:], [20.0, 0.0], atol=1e-6)


def test_priority_is_served_earlier():
    """An emergency is served sooner than the same task without priority."""
    tasks = [Task(f"t{i}", (-50.0 + 12 * i, -30.0), service_time=60.0) for i in range(9)]
    plain = {v["task"]: v["start"] for v in assign(yard(tasks), iterations=3).figures["schedule"]}
    late = max(plain, key=lambda t: plain[t])
    urgent = [replace(t, priority=3) if t.id == late else t for t in tasks]
    assert {v["task"]: v["start"] for v in assign(yard(urgent), iterations=3).figures["schedule"]}[late] < plain[late] / 2
    tiers = assign(yard(urgent), iterations=3, tiers=True).figures["schedule"]
    rider = next(v["vehicle"] for v in tiers if v["task"] == late)
    assert next(v["task"] for v in tiers if v["vehicle"] == rider) == late


def test_a_given_map_gives_the_ways(tmp_path):
    """Planning on the map that was written from a site keeps off the site's obstacles as planning on the site does."""
    tasks = [Task("east", (30.0, 40.0)), Task("west", (-30.0, 40.0))]
    scenario = yard(tasks, (Vehicle("a", ROVER, (-20.0, 0.0), clearance=1.0),))
    write_map(site_occupancy(scenario.site, "ground", 0.25), tmp_path / "yard.yaml")
    bare = replace(scenario, site=replace(scenario.site, obstacles=()))
    mapped, twin = map_scenario(bare, tmp_path / "yard.yaml")
    on_map, on_site = assign(mapped, twin=twin, iterations=2), assign(scenario, iterations=2)
    assert on_map.figures["makespan"] == pytest.approx(on_site.figures["makespan"], rel=0.01)
    assert mapped.site.navigable("ground").symmetric_difference(scenario.site.navigable("ground")).area < 120.0


@pytest.mark.parametrize(
    ("tasks", "message"),
    [
        ([], 'has the role "task"'),
        ([Task("t", (0.0, 30.0))], "'t': is inside obstacle 'wall'"),
        ([Task("t", (0.0, 0.0)), Task("u", (200.0, 0.0))], "'u': there is no way"),
        ([Task("t", (5.0, 0.0), service_time=-1.0)], "service_time -1 s must not be negative"),
        ([Task("t", (5.0, 0.0), priority=7)], "priority 7 must be 0, 1, 2 or 3"),
        ([Task("t", (5.0, 0.0), after=(Precedence("x"),))], "unknown task 'x'"),
        ([Task("t", (5.0, 0.0), needs=frozenset({"arm"}))], "needs arm; no vehicle"),
        ([Task("t", (5.0, 0.0), service_time=1e7)], "no vehicle can be out so long"),
        (
            [Task("t", (5.0, 0.0), after=(Precedence("u"),)), Task("u", (9.0, 0.0), after=(Precedence("t"),))],
            "'t' before 'u' before 't'|'u' before 't' before 'u'",
        ),
    ],
)
def test_what_cannot_be_planned_is_one_clear_line(tasks, message):
    """Each impossible scenario is refused in one line that names the task."""
    fleet = tuple(Vehicle(i, ROVER, (x, 0.0), clearance=1.0, endurance=3600.0) for i, x in (("a", -20.0), ("b", 20.0)))
    with pytest.raises(InputError, match=message) as caught:
        assign(yard(tasks, fleet), iterations=1)
    assert "\n" not in str(caught.value)


def test_the_figures_are_json():
    """All figures of a plan are JSON's own types, so that the header can be read by any program."""
    mission = assign(yard(random_tasks(np.random.default_rng(1), 4)), iterations=1)
    header = json.loads(plan_text(mission).split("\n", 2)[1].rstrip(","))["properties"]
    assert header["figures"]["makespan"] >= 0.9 * header["bounds"]["objective"]
