"""The PLAN file: round trip, stable bytes, damage told."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.scenario import Precedence, Task
from quarterdeck.mission.mission import Guard, Layer, Mission, Route, Waypoint
from quarterdeck.mission.planfile import plan_text, read_plan
from quarterdeck.mission.reason import Reason

DATA = Path(__file__).parents[2] / "data"


def mission(site: str = "farm_survey") -> Mission:
    """Return a mission with everything that a PLAN can hold."""
    scenario = read_scenario(DATA / f"{site}.geojson")
    tasks = (
        Task("a", (1.0, 2.0), 3, 5.0, (Precedence("b", "same_robot"),), frozenset({"arm"}), "ground"),
        Task("b", (3.0, 4.0)),
    )
    routes = tuple(
        Route(
            v.id, (Waypoint(*v.start, 0.0, "start"), Waypoint(10.123456, 20.0, 40.0, "survey", 8.0, 1.5, 60.25, "a")), 12.5
        )
        for v in scenario.vehicles
    )
    return Mission(
        name="Ölhafen",
        frame=scenario.frame,
        site=scenario.site,
        vehicles=scenario.vehicles,
        routes=routes,
        method="test",
        parameters={"x": np.float64(1.5), "y": math.inf},
        seed=7,
        spacing=25.0,
        tasks=tasks,
        figures={"poc": 0.5},
        reasons=(Reason("uav-1: too far"), Reason("needs 9 Wh and has 8 Wh", "energy", "uav-1")),
        layers=(Layer("region", (scenario.site.area,), ({"vehicle": "uav-1"},)),),
        input_hash="abc",
        version="0.1",
    )


def test_round_trip(tmp_path):
    """What is written is read back: to 0.2 mm in place, exactly otherwise."""
    before = mission()
    path = tmp_path / "plan.geojson"
    path.write_text(plan_text(before), encoding="utf-8")
    after = read_plan(path)
    assert after.reasons == before.reasons
    assert not after.feasible
    for a, b in zip(after.routes, before.routes, strict=True):
        assert np.allclose(a.xyz, b.xyz, atol=2e-4)
        strip = [[replace(w, x=0.0, y=0.0, z=0.0) for w in r.waypoints] for r in (a, b)]
        assert strip[0] == strip[1]
    assert [replace(t, position=(0, 0)) for t in after.tasks] == [replace(t, position=(0, 0)) for t in before.tasks]
    assert [replace(v, start=(0, 0)) for v in after.vehicles] == [replace(v, start=(0, 0)) for v in before.vehicles]
    assert abs(after.site.coverable.area - before.site.coverable.area) < 1e-2


def test_same_bytes_again(tmp_path):
    """A plan that is read and written again has the same bytes."""
    text = plan_text(mission("west_ant_island"))
    path = tmp_path / "plan.geojson"
    path.write_text(text, encoding="utf-8")
    assert plan_text(read_plan(path)) == text


def test_a_guard_sees_as_far_as_a_vehicle_may(tmp_path):
    """Ranges that a site could not give are refused; a guard that sees to the sun overflows what looks at it."""
    path = tmp_path / "plan.geojson"
    for reach in (-1e300, 1e300, 0.0):
        path.write_text(plan_text(replace(mission(), guards=(Guard(1.0, 2.0, reach),))), encoding="utf-8")
        with pytest.raises(InputError, match="guard-0: range must be a number above 0"):
            read_plan(path)


@pytest.mark.parametrize("damage", ["legs", "frame", "site"])
def test_damage_is_one_line(tmp_path, damage):
    """A PLAN with a part missing, or a site in its place, is refused in one line."""
    document = json.loads(plan_text(mission()))
    if damage == "legs":
        next(f for f in document["features"] if f["properties"]["role"] == "route")["properties"]["leg"] = ["start"] * 3
    if damage == "frame":
        del document["features"][0]["properties"]["origin"]
    if damage == "site":
        document["features"] = document["features"][1:]
    path = tmp_path / "plan.geojson"
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(InputError) as error:
        read_plan(path)
    assert "\n" not in str(error.value)
    assert "PLAN" in str(error.value)
