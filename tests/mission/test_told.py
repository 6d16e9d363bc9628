"""The plan as told: in the fast world everyone drives exactly what it was told, whatever was lost, silent or back."""

from functools import cache
from pathlib import Path

import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from quarterdeck.geo.reader import read_scenario
from quarterdeck.mission.assign import assign
from quarterdeck.mission.check import unsound
from quarterdeck.mission.cover import cover
from quarterdeck.mission.guards import plan_guards
from quarterdeck.mission.recovery import recovering
from quarterdeck.mission.recovery_memory import tellings
from quarterdeck.mission.told import as_told
from quarterdeck.mission.world import Actor, Fault, run_world

DATA = Path(__file__).parents[2] / "data"


@cache
def plan(method):
    """Return a plan of a sample site for two robots, in the fewest seconds."""
    site = read_scenario(DATA / ("inspection_hall.geojson" if method == "assign" else "plant_yard.geojson"))
    if method == "assign":
        return assign(site, quick=True, iterations=5)
    return plan_guards(site, range=25.0) if method == "guards" else cover(site, spacing=5.0)


@pytest.mark.parametrize("method", ["stc", "guards", "assign"])
@settings(max_examples=8, deadline=None)
@given(part=st.floats(0.05, 0.9), silent=st.floats(0.0, 0.5), stops=st.booleans())
def test_everyone_drives_what_it_was_told(method, part, silent, stops):
    """Each track lies on the route as told, whole where the vehicle works; each task is on one route."""
    mission = plan(method)
    end = max(r.duration for r in mission.routes)
    first = mission.vehicles[0].id
    faults = [Fault(first, part * end, "mute", (part + silent) * end)]
    faults += [Fault(first, (part + silent + 0.1) * end)] if stops else []
    actors = [Actor(v.id, *v.start, speed=v.speed) for v in mission.vehicles]
    run = run_world(recovering(mission, delay=5.0), actors, (), (), 0.0, faults=faults)
    told = as_told(mission, tellings(run.memory))
    for vehicle, route in zip(mission.vehicles, told.routes, strict=True):
        driven, planned = (shapely.LineString(p) for p in (run.tracks[vehicle.id][:, 1:], route.xyz[:, :2]))
        assert driven.difference(planned.buffer(0.05)).length < 0.01
        if not (stops and vehicle.id == first):
            assert planned.difference(driven.buffer(0.05)).length < 0.01
        times = [w.time for w in route.waypoints]
        assert times == sorted(times)
    tasks = [w.task for r in told.routes for w in r.waypoints if w.task]
    assert len(tasks) == len(set(tasks))
    if method == "guards":
        assert {f"guard-{i}" for i, g in enumerate(told.guards) if g.vehicle} == set(tasks)
    assert unsound(told) == ()
