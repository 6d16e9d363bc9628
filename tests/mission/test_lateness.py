"""Who falls behind its plan: told apart from who gives way, holds, or drives about."""

from dataclasses import replace

import pytest

from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.director import State
from quarterdeck.mission.lateness import WINDOW, course, looked, measured_pace
from quarterdeck.mission.mission import Waypoint

HUSKY = load_model("husky")
ROVER = Vehicle("r", HUSKY, (0.0, 0.0), speed=0.9, clearance=HUSKY.clearance, battery=HUSKY.battery)
WAY = (Waypoint(400.0, 0.0, leg="survey", speed=0.9), Waypoint(400.0, 400.0, leg="survey", speed=0.9))


def seen(*places, way=WAY):
    """Return the pace by the (x, y) places of a rover on its way, one a look."""
    known = course(ROVER, State(0.0, 0.0), way, 0.0)
    for n, (x, y) in enumerate(places, start=1):
        known = looked(known, ROVER, State(x, y, reached=0, idle=False), n * WINDOW)
    return measured_pace(known, ROVER)


def test_a_steady_half_speed_is_measured():
    """Half as far at each of four looks is half the pace; at three looks it may still be something else."""
    half = [(0.45 * WINDOW * n, 0.0) for n in range(1, 5)]
    assert seen(*half) == pytest.approx(0.5)
    assert seen(*half[:3]) == 1.0


def test_giving_way_is_not_slow():
    """Who stands for two looks and then goes on at its speed is not slow, and nor is who only stands."""
    assert seen((18.0, 0.0), (18.0, 0.0), (18.0, 0.0), (36.0, 0.0)) == 1.0
    assert seen(*[(18.0, 0.0)] * 6) == 1.0


def test_driving_around_is_not_slow():
    """Who gets no nearer to where it is going, but drives at its speed, is driving around something."""
    assert seen((18.0, 0.0), (18.0, 18.0), (18.0, 36.0), (18.0, 54.0), (18.0, 72.0)) == 1.0


def test_faster_than_planned_is_measured_too():
    """Who was planned to be slow and is not any more is told by its pace."""
    assert seen(*[(1.35 * WINDOW * n, 0.0) for n in range(1, 5)]) == pytest.approx(1.5)


def test_holding_is_not_slow():
    """While a vehicle holds at its place nothing is measured."""
    way = (replace(WAY[0], x=18.0, hold=300.0, task="t"), WAY[1])
    assert seen(*[(18.0, 0.0)] * 6, way=way) == 1.0


def test_little_left_is_not_worth_a_plan():
    """A slow vehicle that is nearly done is left alone."""
    way = (Waypoint(60.0, 0.0, leg="survey", speed=0.9),)
    assert seen(*[(0.45 * WINDOW * n, 0.0) for n in range(1, 5)], way=way) == 1.0
