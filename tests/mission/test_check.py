"""The checker finds each kind of fault when it is put in, and nothing in a sound plan."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import MultiPolygon, box

from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Obstacle, Site, Vehicle
from quarterdeck.mission.check import check_mission, homeward
from quarterdeck.mission.mission import Mission, Route, Waypoint
from quarterdeck.mission.reason import Reason


def crossing(delay: float = 0.0) -> Mission:
    """Return two boats whose ways cross at (50, 50), the second one leaving `delay` seconds later."""
    model = load_model("otter")
    ways = {"a": ((0.0, 50.0), (100.0, 50.0)), "b": ((50.0, 0.0), (50.0, 100.0))}
    vehicles, routes = [], []
    for i, (name, (start, end)) in enumerate(ways.items()):
        vehicles.append(Vehicle(name, model, start, end, speed=1.0, clearance=5.0, battery=915.0, endurance=1e4))
        wait = delay * i
        waypoints = (
            Waypoint(*start, leg="start", hold=wait),
            Waypoint(*end, leg="survey", speed=1.0, time=wait + 100.0),
        )
        routes.append(Route(name, waypoints, 5.0))
    site = Site(
        (Area("all", MultiPolygon([box(-1, -1, 101, 101)])),),
        MultiPolygon([box(-20, -20, 120, 120)]),
        (Obstacle("rock", box(20, 60, 30, 70)),),
    )
    return Mission("crossing", Frame(10.0, 54.0), site, tuple(vehicles), tuple(routes), "test")


def with_waypoint(mission: Mission, **changes: object) -> Mission:
    """Return the mission with the last waypoint of its first route changed."""
    route = mission.routes[0]
    bad = replace(route, waypoints=(*route.waypoints[:-1], replace(route.waypoints[-1], **changes)))
    return replace(mission, routes=(bad, *mission.routes[1:]))


def test_a_sound_plan_has_no_problem():
    """Ways that cross at different times are fine."""
    assert check_mission(crossing(delay=30.0)) == ()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"y": float("nan")}, "y is nan"),
        ({"time": -5.0}, "before waypoint 0 is left"),
        ({"speed": 30.0}, "exceeds 3 m/s"),
        ({"x": 130.0, "leg": "transit"}, "leaves the operating area on leg 1 by 10.0 m"),
        ({"x": 50.0, "y": 80.0, "leg": "transit"}, "crosses no-go zone 'rock'"),
        ({"x": 50.0, "y": 60.0, "leg": "transit"}, "passes 'rock' at"),
        ({"x": 110.0}, "surveys 9.0 m outside"),
    ],
)
def test_each_fault_is_found(changes, words):
    """A fault put into a sound plan is named."""
    assert any(words in line for line in check_mission(with_waypoint(crossing(30.0), **changes)))


@pytest.mark.parametrize("depth", [0.0, 0.03, 0.06])
def test_a_leg_along_an_obstacles_edge_is_found(depth):
    """On the edge, and a little inside it, a leg is as wrong as one deep inside, and is told once."""
    mission = crossing(30.0)
    moved = replace(mission.site.obstacles[0], polygon=box(20, 50 - depth, 30, 70))
    edge = replace(mission, site=replace(mission.site, obstacles=(moved,)))
    assert sum("'rock'" in line for line in check_mission(edge)) == 1


def test_energy_and_the_planners_own_reasons_are_told():
    """A route beyond the battery, and what the planner said, are problems."""
    mission = crossing(30.0)
    poor = replace(
        mission, routes=(replace(mission.routes[0], energy=900.0), mission.routes[1]), reasons=(Reason("no way"),)
    )
    problems = check_mission(poor)
    assert problems[0] == "no way"
    assert any("a: needs 900 Wh" in line for line in problems)


@settings(deadline=None, max_examples=50)
@given(st.floats(0.0, 20.0))
def test_separation_is_exact(delay):
    """Two boats at 1 m/s on crossing ways come within delay / sqrt 2 metres, and must be two metres apart."""
    problems = check_mission(crossing(delay))
    assert any("a and b" in line for line in problems) == (delay / 2**0.5 < 2.0)


def test_the_straight_way_home_is_told():
    """Only a waypoint behind the rock is counted."""
    mission = crossing(30.0)
    behind = with_waypoint(mission, x=60.0, y=85.0)
    assert homeward(mission) == ()
    assert "from 1 of its 2 waypoints" in homeward(behind)[0]
