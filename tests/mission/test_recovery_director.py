"""The director that recovers, in PyBullet: what the lost were to cover is covered by the others."""

from dataclasses import replace
from functools import cache
from math import inf
from pathlib import Path

import numpy as np
import pytest
from shapely import LineString, Point, union_all

from quarterdeck.coverage.metrics import track_length
from quarterdeck.geo.reader import read_scenario
from quarterdeck.mission.cover import cover
from quarterdeck.mission.director import Event, State
from quarterdeck.mission.fast import run_fast
from quarterdeck.mission.mission import unbroken
from quarterdeck.mission.recovery import recovering
from quarterdeck.mission.world import Fault

DATA = Path(__file__).parents[2] / "data"
SPACING = {"plant_yard": 5.0, "farm_survey": 40.0, "west_ant_island": 100.0}


@cache
def plan(site, spacing=None):
    """Return a coarse plan of a sample site."""
    return cover(read_scenario(DATA / f"{site}.geojson"), spacing=spacing or SPACING[site])


def to_survey(mission):
    """Return the metres that are to be surveyed."""
    return sum(track_length(line) for r in mission.routes for line in unbroken(r.xyz[:, :2], r.survey))


@pytest.mark.parametrize(("site", "fault"), [("plant_yard", "ugv-1@300"), ("farm_survey", "uav-2@200")])
def test_survivors_cover_the_rest(site, fault):
    """With a loss in the run all is covered that was planned, without a collision; without recovery much is missed."""
    pytest.importorskip("pybullet", reason="PyBullet is not installed")
    from quarterdeck.physics.simulate import simulate

    mission = plan(site)
    plain = simulate(mission, faults=[fault], sample=1.0).report.figures
    told = []
    director = recovering(mission, delay=10.0, tell=lambda *plan: told.append(plan))
    figures = simulate(mission, director=director, faults=[fault], sample=1.0).report.figures
    assert plain["coverage_driven"] < figures["coverage_planned"] - 0.05
    assert figures["coverage_driven"] > figures["coverage_planned"] - 0.015
    assert figures["collisions"] == 0
    assert len(told) == 1


def test_a_wreck_is_an_obstacle_until_it_is_heard_of_and_what_the_site_has_stays():
    """A lost robot is in the others' way; back, it goes on from where it is, and the site has its own obstacles again."""
    mission = plan("plant_yard")
    own = replace(mission.site.obstacles[0], id="wreck of ugv-1")
    mission = replace(mission, site=replace(mission.site, obstacles=(own, *mission.site.obstacles[1:])))
    told = []
    director = recovering(mission, tell=lambda _, after: told.append(after))

    def states(part):
        places = {r.vehicle: r.waypoints[int(part * len(r.waypoints))] for r in mission.routes}
        return {v: State(w.x, w.y) for v, w in places.items()}

    _, memory = director(0.0, states(0.0), (), None)
    _, memory = director(100.0, states(0.3), (Event("lost", "ugv-1"),), memory)
    _, memory = director(200.0, states(0.5), (Event("returned", "ugv-1"),), memory)
    before = {o.id for o in mission.site.obstacles}
    assert [{o.id for o in after.site.obstacles} for after in told] == [before | {"wreck of ugv-1 (2)"}, before]
    route = next(r for r in told[1].routes if r.vehicle == "ugv-1")
    assert (route.waypoints[0].x, route.waypoints[0].y) == (states(0.5)["ugv-1"].x, states(0.5)["ugv-1"].y)


def test_false_alarm_changes_nothing():
    """Who is heard of again within the delay keeps its route."""
    pytest.importorskip("pybullet", reason="PyBullet is not installed")
    from quarterdeck.physics.simulate import simulate

    mission = plan("plant_yard")
    told = []
    director = recovering(mission, delay=60.0, tell=lambda *plan: told.append(plan))
    run = simulate(mission, director=director, faults=["comms:ugv-1@100-130"], sample=1.0)
    assert not told
    assert run.report.passed


@pytest.mark.parametrize("between", [False, True], ids=["at once", "after another plan"])
def test_who_is_lost_as_it_is_told_of_a_plan_has_done_nothing_of_it(between):
    """What a vehicle was given in the second in which it is lost goes to the others, however far it had come before."""
    mission = plan("west_ant_island")
    told = []
    director = recovering(mission, tell=lambda *plan: told.append(plan[1]))
    states = {r.vehicle: State(*r.xyz[-1], reached=len(r.waypoints) - 1) for r in mission.routes}  # all are home
    first, second, third, *others = states
    states[first] = State(*mission.routes[0].xyz[0], reached=0, idle=False)
    _, memory = director(0.0, states, (), None)
    states[first] = State(*mission.routes[0].xyz[0], alive=False)
    _, memory = director(10.0, states, (Event("lost", first),), memory)
    states[second] = replace(states[second], alive=False)  # as it was when it was told
    states |= {v: replace(states[v], reached=0, idle=False) for v in (third, *others)}
    if between:
        states[third] = replace(states[third], alive=False)
        _, memory = director(10.5, states, (Event("lost", third),), memory)
    director(11.0, states, (Event("lost", second),), memory)
    assert len(told) == 2 + between
    assert to_survey(told[-1]) == pytest.approx(to_survey(told[0]), rel=0.02)


def test_a_wreck_that_somebody_stands_before_is_where_it_is_seen():
    """A wreck that has drifted is moved on the map once another tells that it stands before it, and then stays there."""
    mission = plan("plant_yard")
    told = []
    director = recovering(mission, tell=lambda _, after: told.append(after))
    states = {r.vehicle: State(*r.xyz[len(r.waypoints) // 2]) for r in mission.routes}
    lost, other = states
    seen = {"x": states[other].x + 3.0, "y": states[other].y}
    _, memory = director(0.0, states, (), None)
    states |= {lost: replace(states[lost], alive=False)}
    _, memory = director(1.0, states, (Event("lost", lost),), memory)
    for time in (100.0, 160.0):
        _, memory = director(time, states, (Event("held", other, lost, seen),), memory)
    wrecks = [[o.polygon.centroid for o in after.site.obstacles if o.id.startswith("wreck")] for after in told]
    assert [len(w) for w in wrecks] == [1, 1]
    assert wrecks[0][0].distance(Point(states[lost].x, states[lost].y)) < 0.01
    assert wrecks[1][0].distance(Point(*seen.values())) < 0.01


def test_who_comes_back_late_drives_all_that_is_left():
    """A vehicle heard again, with nobody else left, goes on from where it is, not from where by the plan it should be."""
    mission = plan("plant_yard")
    told = []
    director = recovering(mission, tell=lambda *plan: told.append(plan[1]))
    late, other = (r.vehicle for r in mission.routes)
    states = {r.vehicle: State(*r.xyz[0], idle=False) for r in mission.routes}
    _, memory = director(0.0, states, (), None)
    states |= {other: State(*mission.routes[1].xyz[0], alive=False)}
    _, memory = director(1.0, states, (Event("lost", other),), memory)
    states |= {late: State(*mission.routes[0].xyz[0], alive=False)}
    _, memory = director(2.0, states, (Event("lost", late),), memory)
    states |= {late: State(*mission.routes[0].xyz[0], idle=False)}
    director(2.0 + told[0].routes[0].duration / 2, states, (Event("returned", late),), memory)
    assert to_survey(told[-1]) == pytest.approx(to_survey(mission), rel=0.02)


@pytest.mark.parametrize(
    ("reach", "fault"),
    [
        (None, Fault("ugv-2", 100.0, "mute", 400.0)),  # given up and heard again
        (25.0, Fault("ugv-2", 200.0)),  # one out of touch when the other is lost: the plan was made without its place
    ],
)
def test_new_routes_begin_where_the_vehicles_are(reach, fault):
    """Who is told a new route is where it begins; its first legs are clear of obstacles and survey the plan's lines."""
    mission = plan("plant_yard", 8.0)
    mission = replace(mission, vehicles=tuple(replace(v, range=reach) for v in mission.vehicles))
    plans, told = [], {}
    direct = recovering(mission, delay=5.0, tell=lambda *plan: plans.append(plan))

    def watched(time, states, events, memory):
        commands, memory = direct(time, states, events, memory)
        told[time] = commands.keys()
        return commands, memory

    tracks = run_fast(mission, watched, [fault]).tracks
    lines = union_all([LineString(run) for r in mission.routes for run in unbroken(r.xyz[:, :2], r.survey)]).buffer(1.0)
    began = set()
    for time, after in plans:
        for route in after.routes:
            if route.vehicle in told[time]:  # those out of touch hear of a later plan
                track = tracks[route.vehicle]
                here = [np.interp(time, track[:, 0], track[:, n]) for n in (1, 2)]
                assert np.hypot(*np.subtract(here, route.xyz[0, :2])) < 0.1
                first = LineString(route.xyz[:4, :2])
                assert all(first.distance(o.polygon) > 0.3 for o in after.site.obstacles if not o.id.startswith("wreck"))
                assert all(lines.covers(LineString(run)) for run in unbroken(route.xyz[:4, :2], route.survey[:4]))
                began.add(route.vehicle)
    assert began == {v.id for v in mission.vehicles if fault.until < inf or v.id != fault.actor}


def test_who_is_heard_and_lost_in_one_second_is_lost():
    """A vehicle that was silent, is heard again and stops, all between two looks, is given no route."""
    mission = plan("plant_yard")
    told = []
    director = recovering(mission, tell=lambda *plan: told.append(plan[1]))
    one, other = (r.vehicle for r in mission.routes)
    states = {r.vehicle: State(*r.xyz[0], idle=False) for r in mission.routes}
    _, memory = director(0.0, states, (), None)
    states |= {other: replace(states[other], alive=False)}
    _, memory = director(1.0, states, (Event("lost", other),), memory)
    _, memory = director(2.0, states, (Event("returned", other), Event("lost", other)), memory)
    assert [v.id for v in told[-1].vehicles] == [one]
