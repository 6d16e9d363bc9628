"""Encounters: nobody touches anybody, and everybody arrives."""

from dataclasses import replace

import numpy as np
import pytest
from shapely import MultiPolygon, box

from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Obstacle, Scenario, Site, Task, Vehicle
from quarterdeck.mission.assign import assign
from quarterdeck.mission.mission import Route
from quarterdeck.mission.recovery import recovering
from quarterdeck.physics.simulate import simulate

pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")
REACH = {"otter": 100.0, "wam-v": 100.0, "husky": 30.0, "survey-quad": 150.0, "crazyflie": 20.0}

ENCOUNTERS = {
    "head-on": [((-1, 0), (1, 0)), ((1, 0), (-1, 0))],
    "crossing": [((-1, 0), (1, 0)), ((0, -1), (0, 1))],
    "oblique": [((-1, 0), (1, 0)), ((0.8, -0.6), (-0.8, 0.6))],
    "one start": [((0, 0), (1, 0)), ((0, 0), (1, 0.05)), ((0, 0), (1, -0.05))],
    "one home": [((-1, 0), (0, 0)), ((1, 0), (0, 0)), ((0, 1), (0, 0))],
}


@pytest.mark.parametrize("encounter", ENCOUNTERS)
@pytest.mark.parametrize("model", REACH)
def test_they_give_way(sail, model, encounter):
    """Two or three vehicles whose routes meet at the same time: apart by at least a tenth of a length, all finished."""
    paths = [[(x * REACH[model], y * REACH[model]) for x, y in path] for path in ENCOUNTERS[encounter]]
    figures = simulate(sail(model, *paths)).report.figures
    assert figures["collisions"] == 0
    assert figures["finished"] == len(paths)
    assert figures["separation"] > 0.1 * load_model(model).length


@pytest.mark.parametrize("model", REACH)
def test_the_faster_stays_behind_the_slower(sail, model):
    """On one track, the one behind at cruise and the one ahead at 60 % of it."""
    kind, reach = load_model(model), REACH[model]
    paths = [[(-reach, 0), (reach, 0)], [(-reach + 6 * kind.length, 0), (reach, 0)]]
    run = simulate(sail(model, *paths, speeds=[kind.speed, 0.6 * kind.speed]))
    assert run.report.figures["collisions"] == 0
    assert run.report.figures["separation"] > 0.5 * kind.length


def test_head_on_both_turn_to_starboard(sail):
    """Rule 14: each leaves the other to port."""
    trace = simulate(sail("otter", [(-60, 0), (60, 0)], [(60, 0), (-60, 0)])).trace
    passing = abs(trace.x[:, 0] - trace.x[:, 1]).argmin()
    assert trace.y[passing, 0] < -1.0
    assert trace.y[passing, 1] > 1.0


def test_crossing_the_one_with_the_other_to_starboard_lets_it_pass(sail):
    """Rule 15: the one that goes north has the other, going west, to starboard, and passes astern of it."""
    trace = simulate(sail("otter", [(0, -60), (0, 60)], [(60, 0), (-60, 0)])).trace
    north, west = (trace.y[:, 0] > 0).argmax(), (trace.x[:, 1] < 0).argmax()
    assert west < north  # the west-going one is first at the crossing
    assert abs(trace.y[:, 1]).max() < 0.5  # and keeps its course


@pytest.mark.parametrize("model", ["otter", "jackal", "survey-quad"])
@pytest.mark.parametrize("off", [0.0, 1.9, 2.1, 2.3])
def test_one_that_lies_still_is_passed_however_near_to_the_leg(sail, model, off):
    """As many half diagonals off: no distance is too near for the brakes and too far to go around."""
    kind = load_model(model)
    reach, aside = 12.0 * kind.length, off * np.hypot(kind.length, kind.width) / 2
    mission = sail(model, [(0.0, aside), (0.01, aside)], [(-reach, 0), (reach, 0)])
    there = replace(mission.vehicles[0], end=(0.0, 10 * reach))  # far from home it is not taken out of the way
    routes = tuple(replace(r, waypoints=tuple(w for w in r.waypoints if w.leg != "landing")) for r in mission.routes)
    trace = simulate(replace(mission, vehicles=(there, mission.vehicles[1]), routes=routes), duration=300.0).trace
    assert not trace.contact.any()
    assert trace.x[-1, 1] > reach - kind.length
    assert trace.time[-1] < 3.0 * 2 * reach / kind.speed + 20.0


@pytest.mark.parametrize("model", ["otter", "husky", "survey-quad"])
def test_who_finds_another_where_it_is_to_go_goes_on_from_beside_it(sail, model):
    """One is done and stays at the other's waypoint: the other comes as near as it can, and then home."""
    reach = 0.3 * REACH[model]
    mission = sail(model, [(-0.8 * reach, 0), (reach, 0)], [(-reach, 0), (reach, 0), (-reach, 0)])
    there = replace(mission.vehicles[0], end=(0.0, 10 * reach))  # far from home it is not taken out of the water
    first, second = (tuple(w for w in r.waypoints if w.leg != "landing") for r in mission.routes)
    held = tuple(replace(w, hold=5.0) if w.x == reach else w for w in second)
    run = simulate(
        replace(mission, vehicles=(there, mission.vehicles[1]), routes=(Route("v1", first), Route("v2", held))),
        duration=300.0,
    )
    assert run.report.vehicles[1].finished
    assert run.report.figures["collisions"] == 0
    assert np.hypot(run.trace.x[:, 1] - reach, run.trace.y[:, 1]).min() < 2.5 * load_model(model).length


def test_who_lies_beyond_a_leg_is_not_in_its_way(sail):
    """Between walls that leave no room to pass, a rover goes to its place though another lies two metres past it."""
    mission = sail("jackal", [(-10, 0), (0, 0)], [(8, 0.1), (2, 0)])
    walls = tuple(Obstacle(f"wall {i}", box(-20, y, 20, y + 1)) for i, y in enumerate((-1.8, 0.8)))
    vehicles = mission.vehicles[0], replace(mission.vehicles[1], end=None)  # whom nobody takes out of the way there
    run = simulate(replace(mission, vehicles=vehicles, site=replace(mission.site, obstacles=walls)))
    assert all(v.finished for v in run.report.vehicles)
    assert run.trace.time[-1] < 30.0


def test_separation_holds_while_replanning():
    """Four vessels whose routes cross replan when two are lost: none of the others comes near another or a wreck."""
    area = MultiPolygon([box(-150.0, -150.0, 150.0, 150.0)])
    model = load_model("otter")
    starts = {"north": (0.0, 140.0), "east": (140.0, 0.0), "south": (0.0, -140.0), "west": (-140.0, 0.0)}
    vehicles = tuple(
        Vehicle(name, model, place, speed=model.speed, turn_radius=model.turn_radius, clearance=model.clearance)
        for name, place in starts.items()
    )

    places = [(80.0, 80.0), (-80.0, 80.0), (-80.0, -80.0), (80.0, -80.0), (90.0, 10.0), (-90.0, -10.0)]
    tasks = tuple(Task(f"t{i}", place) for i, place in enumerate(places))
    site = Site((Area("area", area),), area)
    mission = assign(Scenario("crossing", Frame(0.0, 60.0), site, vehicles, tasks), iterations=20)
    told = []
    director = recovering(mission, delay=5.0, tell=lambda *plan: told.append(plan))
    run = simulate(mission, director=director, faults=["north@40", "east@60"])
    assert len(told) == 2
    assert {o.id for o in told[1][1].site.obstacles} == {"wreck of north", "wreck of east"}
    assert run.report.figures["collisions"] == 0
    assert run.report.figures["tasks_served"] == len(tasks)
    assert run.report.figures["separation"] > 0.1 * model.length
