"""Parallel lines as a mission: inside, linked, named, home."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from quarterdeck.api import default_method, plan, read_plan
from quarterdeck.cli import main
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


def status(command):
    """Return what the command line exits with."""
    with pytest.raises(SystemExit) as stop:
        main(command)
    return stop.value.code


def test_entry_and_alternate_from_the_command_line(tmp_path, capsys):
    """The plan's first survey leg begins at the end of a line nearest to --entry; a wrong one is refused in one line."""
    site, out = DATA / "west_ant_island.geojson", tmp_path / "plan.geojson"
    scenario = read_scenario(site)
    area = scenario.site.area.bounds
    lon, lat = scenario.frame.to_degrees([area[2:]])[0]
    command = ["plan", str(site), "--method", "lines", "--spacing", "400", "-o", str(out)]
    assert status([*command, "--entry", f"{lon},{lat}"]) == 0
    mission = read_plan(out)
    for route in mission.routes:
        own = [g for g, p in zip(mission.layers[0].geometries, mission.layers[0].properties, strict=True)
               if p["vehicle"] == route.vehicle]  # fmt: skip
        ends = np.array([g.coords for g in own])
        first = route.xyz[np.flatnonzero(route.survey)[0] - 1, :2]
        assert np.hypot(*(first - area[2:])) == pytest.approx(np.linalg.norm(ends - area[2:], axis=2).min(), abs=0.1)
    for wrong in (["--entry", f"{lat},{lon}"], ["--entry", "0,0"], ["--entry", "5"], ["--alternate", "1"]):
        assert status([*command, "--force", *wrong]) == 2
    capsys.readouterr()
    assert status([*command, "--force", "--method", "stc", "--alternate", "2"]) == 2
    assert "--alternate does not belong to --method stc" in capsys.readouterr().err


@pytest.mark.parametrize("site", ["farm_survey", "dalian_harbour"])
def test_a_lap_covers_the_edge(site):
    """Laps stay inside, come first, have names of their own, and leave less uncovered."""
    scenario = read_scenario(DATA / f"{site}.geojson")
    mission, without = plan_lines(scenario, angle=0.5, lap=True), plan_lines(scenario, angle=0.5)
    assert not trespasses(mission)
    assert mission.figures["laps"] >= len(scenario.vehicles)
    assert 1 - mission.figures["poc"] < 0.5 * (1 - without.figures["poc"])
    names = [(p["vehicle"], p["name"]) for p in mission.layers[0].properties]
    assert len(names) == len(set(names)) == mission.figures["lines"] + mission.figures["laps"]
