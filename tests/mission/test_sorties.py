"""Sorties: all the work is done, none beyond the endurance, each as long as it can be."""

from dataclasses import replace

import numpy as np
import pytest
from shapely import LineString, MultiPolygon, box, union_all

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Obstacle, Site, Vehicle
from quarterdeck.mission.check import check_mission
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.sorties import sorties
from quarterdeck.mission.timing import RESERVE, timed_route


def survey(domain: str, endurance: float) -> Mission:
    """Return a lawnmower survey of 20 lines of 400 m, with a rock between the start and the area."""
    model = load_model({"surface": "otter", "aerial": "survey-quad"}[domain])
    vehicle = Vehicle("v", model, (0.0, 0.0), speed=model.speed, clearance=5.0, endurance=endurance, altitude=30.0)
    z = 30.0 if domain == "aerial" else 0.0
    points, legs = [(0.0, 0.0, z)], ["start"]
    for i in range(20):
        xs = (100.0, 500.0) if i % 2 == 0 else (500.0, 100.0)
        points += [(x, 20.0 * i, z) for x in xs]
        legs += ["transit" if i == 0 else "turn", "survey"]
    points.append((0.0, 0.0, z))
    legs.append("transit")
    site = Site(
        (Area("a", MultiPolygon([box(90, -10, 510, 400)])),),
        MultiPolygon([box(-50, -50, 600, 450)]),
        (Obstacle("rock", box(40, 100, 60, 300)),),
    )
    return Mission("far", Frame(1.0, 50.0), site, (vehicle,), (timed_route(vehicle, np.array(points), legs),), "test")


def surveyed(missions):
    """Return the union of the survey legs."""
    lines = []
    for mission in missions:
        for route in mission.routes:
            xy = route.xyz[:, :2]
            lines += [LineString(xy[i - 1 : i + 1]) for i in np.flatnonzero(route.survey) if (xy[i] != xy[i - 1]).any()]
    return union_all(lines)


@pytest.mark.parametrize(("domain", "endurance"), [("surface", 4000.0), ("surface", 2000.0), ("aerial", 500.0)])
def test_sorties_do_all_the_work_within_the_endurance(domain, endurance):
    """Together they survey what the route did, each keeps the reserve, passes the checker and ends at home."""
    mission = survey(domain, endurance)
    rounds = sorties(mission)
    assert len(rounds) > 1
    missing = surveyed([mission]).difference(surveyed(rounds).buffer(0.01))
    assert missing.length < 0.1
    for sortie in rounds:
        (route,) = sortie.routes
        assert route.duration <= endurance * (1 - RESERVE) + 1e-6
        assert check_mission(sortie) == ()
        assert np.allclose(route.xyz[[0, -1], :2], 0.0)
    # All but the last are full: with a few per cent more endurance none of them would have come home so early.
    assert all(m.routes[0].duration > 0.93 * endurance * (1 - RESERVE) for m in rounds[:-1])


def test_a_vehicle_that_can_do_it_is_left_alone():
    """One round, the mission itself."""
    mission = survey("surface", 1e6)
    mission = replace(mission, vehicles=(replace(mission.vehicles[0], battery=1e6),))
    assert sorties(mission) == (mission,)


def test_work_out_of_reach_is_told():
    """An endurance that does not even cover the way out and home is one line."""
    with pytest.raises(InputError, match="cannot reach its work"):
        sorties(survey("surface", 120.0))


def test_sorties_keep_height_pace_and_delay():
    """As planned: transits in their layer above the survey, a slow leg slow, the launch after the same wait."""
    whole = survey("aerial", 500.0)
    (vehicle,), (route,) = whole.vehicles, whole.routes
    xyz, legs = route.xyz, [w.leg for w in route.waypoints]
    out, home = [[0, 0, 0], [0, 0, 45], [*xyz[1, :2], 45], xyz[1]], [[*xyz[-2, :2], 45], [0, 0, 45], [0, 0, 0]]
    points = np.array([*out, *xyz[2:-1], *home], dtype=float)
    legs = ["start", "takeoff", "transit", "transit", *legs[2:-1], "transit", "transit", "landing"]
    pace, holds = np.where(np.array(legs) == "survey", 0.5, 1.0), [20.0] + [0.0] * (len(points) - 1)
    made = sorties(replace(whole, routes=(timed_route(vehicle, points, legs, pace=pace, holds=holds),)))
    assert len(made) > 1
    for (sortie,) in (m.routes for m in made):
        way = sortie.waypoints
        assert way[0].hold == 20.0
        assert all(w.speed == pytest.approx(0.5 * vehicle.speed) for w in way if w.leg == "survey")
        first, last = np.flatnonzero(sortie.survey)[[0, -1]]
        assert [w.z for w in way[1 : first - 1]] == [45.0] * (first - 2)
        assert [w.z for w in way[last + 1 : -1]] == [45.0] * (len(way) - last - 2)
        assert sortie.duration <= 500.0 * (1 - RESERVE) + 1e-6
