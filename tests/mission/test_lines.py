"""Parallel lines as a mission: inside, linked, named, home."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from quarterdeck.api import default_method, plan
from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.scenario import Sensor
from quarterdeck.mission.check import trespasses
from quarterdeck.mission.lines import plan_lines

DATA = Path(__file__).parents[2] / "data"


@pytest.mark.parametrize("site", ["farm_survey", "plant_yard", "dalian_harbour"])
def test_lines_cover_and_stay_inside(site):
    """Lines cover nearly all, trespass nowhere, are all named, and every vehicle comes home."""
    mission = plan_lines(read_scenario(DATA / f"{site}.geojson"))
    assert mission.figures["poc"] > 0.95
    assert not trespasses(mission)
    names = [(p["vehicle"], p["name"]) for p in mission.layers[0].properties]
    assert len(names) == len(set(names)) == mission.figures["lines"]
    for vehicle, route in zip(mission.vehicles, mission.routes, strict=True):
        assert np.allclose(route.xyz[-1, :2], vehicle.home)


def test_angle_is_kept():
    """A given direction is that of every line."""
    mission = plan_lines(read_scenario(DATA / "farm_survey.geojson"), angle=0.4)
    for line in mission.layers[0].geometries:
        (x0, y0), (x1, y1) = line.coords
        assert abs((np.arctan2(y1 - y0, x1 - x0) - 0.4 + np.pi / 2) % np.pi - np.pi / 2) < 1e-6


def test_a_sensor_selects_lines():
    """Survey teams expect lines: a vehicle with a sensor selects them, and its swath gives the spacing."""
    scenario = read_scenario(DATA / "dalian_harbour.geojson")
    assert default_method(scenario) == "stc"
    vehicle = replace(scenario.vehicles[0], sensor=Sensor("swath", 30.0))
    surveying = replace(scenario, vehicles=(vehicle,), spacing=None)
    mission = plan(surveying)
    assert mission.method == "lines"
    assert mission.spacing == 30.0
