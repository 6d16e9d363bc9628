"""Covering an area: shares kept, tracks inside, routes clear, everything timed, infeasible told."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, MultiPolygon, Point, box
from shapely.ops import unary_union

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.scenario import Area, Obstacle, Scenario, Site, Vehicle, as_multipolygon
from quarterdeck.mission.cover import cover
from quarterdeck.mission.planfile import plan_text

DATA = Path(__file__).parents[2] / "data"


def legs(route, kind):
    """Return the lines of a route's legs of a kind."""
    points = route.waypoints
    return [LineString([(a.x, a.y), (b.x, b.y)]) for a, b in pairwise(points) if b.leg == kind]


def check(mission):
    """Check what must hold of every mission that covers an area."""
    area = mission.site.coverable.buffer(1e-6)
    for vehicle, route in zip(mission.vehicles, mission.routes, strict=True):
        assert route.vehicle == vehicle.id
        assert np.allclose(route.xyz[0, :2], vehicle.start)
        space = mission.site.navigable(vehicle.domain, vehicle.clearance).buffer(1e-4)
        assert all(area.covers(line) for line in legs(route, "survey"))
        inside = space.covers(Point(vehicle.start))
        assert all(space.covers(line) for line in legs(route, "transit")) or not inside
        times = [w.time for w in route.waypoints]
        assert times == sorted(times)
        assert np.isfinite([route.energy, route.duration, route.length]).all()


@pytest.mark.parametrize("site", ["dalian_harbour", "west_ant_island", "plant_yard", "farm_survey"])
def test_sample_sites(site):
    """Each sample site is covered by feasible routes inside the area that end at home, shares within one hypervertex."""
    mission = cover(read_scenario(DATA / f"{site}.geojson"))
    check(mission)
    assert mission.feasible
    assert mission.figures["share_error_hypervertices"] <= 1.0
    for vehicle, route in zip(mission.vehicles, mission.routes, strict=True):
        assert np.allclose(route.xyz[-1, :2], vehicle.home)
    assert mission.figures["poc"] > 0.85


def test_areas_too_far_apart_for_one_grid():
    """Two small areas 100 km apart at 0.5 m would need a lattice of billions of cells: refused with what to do."""
    areas = tuple(Area(f"a{i}", MultiPolygon([box(x, x, x + 50, x + 50)])) for i, x in enumerate((-35e3, 35e3)))
    site = Site(areas, MultiPolygon([box(-4e4, -4e4, 4e4, 4e4)]))
    boat = Vehicle("a", load_model("otter"), (-35e3, -35e3), speed=1.0, battery=1e6, clearance=0.0)
    with pytest.raises(InputError, match="one by one"):
        cover(Scenario("far", Frame(10.0, 54.0), site, (boat,)), spacing=0.5)


def test_published_shares():
    """Figure 7 of the paper: 10, 10, 20, 20, 40 % of the area, each to within one hypervertex."""
    mission = cover(read_scenario(DATA / "west_ant_island.geojson"))
    cells = np.array(mission.figures["shares"]) * mission.figures["hypervertices"]
    assert np.abs(cells - np.array([0.1, 0.1, 0.2, 0.2, 0.4]) * mission.figures["hypervertices"]).max() <= 1.0


def test_same_bytes_for_the_same_seed():
    """The same site, options and seed give the same PLAN to the byte."""
    scenario = read_scenario(DATA / "plant_yard.geojson")
    assert plan_text(cover(scenario, seed=3)) == plan_text(cover(scenario, seed=3))


def test_too_far_is_told():
    """A battery that is too small makes the mission infeasible, and says which vehicle and by how much."""
    scenario = read_scenario(DATA / "plant_yard.geojson")
    vehicles = (replace(scenario.vehicles[0], battery=10.0), scenario.vehicles[1])
    mission = cover(replace(scenario, vehicles=vehicles))
    assert not mission.feasible
    assert str(mission.reasons[0]).startswith("ugv-1: needs")
    assert "short by" in mission.reasons[0].why
    assert (mission.reasons[0].kind, mission.reasons[0].about) == ("energy", "ugv-1")


def scenario_of(area, obstacles, starts, spacing):
    """Return a scenario of ground vehicles from shapes in metres."""
    model = load_model("jackal")
    operating = as_multipolygon(unary_union([area, *[Point(s).buffer(2) for s in starts]]).convex_hull.buffer(3))
    return Scenario(
        name="random",
        frame=Frame(5.0, 52.0),
        site=Site(
            (Area("a", as_multipolygon(area)),), operating, tuple(Obstacle(f"o{i}", o) for i, o in enumerate(obstacles))
        ),
        vehicles=tuple(Vehicle(f"v{i}", model, s, speed=1.0, clearance=0.5) for i, s in enumerate(starts)),
        spacing=spacing,
    )


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5))
def test_random_sites(seed, count):
    """Random areas of several parts with holes: all that must hold of a mission holds, or one clear line refuses it."""
    rng = np.random.default_rng(seed)
    parts = [box(x, y, x + w, y + h) for x, y, w, h in rng.uniform([0, 0, 8, 8], [60, 60, 50, 50], (3, 4))]
    obstacles = [box(x, y, x + w, y + h) for x, y, w, h in rng.uniform([0, 0, 1, 1], [80, 80, 15, 15], (4, 4))]
    blocked = unary_union(obstacles).buffer(0.6)
    starts = [tuple(p) for p in rng.uniform(0, 90, (40, 2)) if not blocked.covers(Point(p))][:count]
    scenario = scenario_of(unary_union(parts), obstacles, starts, 3.0)
    roomy = as_multipolygon(scenario.site.coverable.intersection(scenario.site.navigable("ground", 0.5)))
    if roomy.buffer(-2 * 3.0 * 2**0.5).is_empty:  # a hypervertex may not fit, wherever the lattice lies; in a disc two do
        return
    mission = cover(scenario)
    check(mission)
    assert mission.figures["share_error_hypervertices"] <= 2.0 or mission.figures["notes"] or mission.reasons


def test_two_areas_one_vehicle():
    """One vehicle covers two separate areas, with a transit between them around what blocks it."""
    area = MultiPolygon([box(0, 0, 30, 30), box(60, 0, 90, 30)])
    mission = cover(scenario_of(area, [box(40, -5, 50, 20)], [(1.0, 1.0)], 3.0))
    check(mission)
    assert mission.feasible
    assert mission.figures["poc"] > 0.85


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"vehicles": ()}, "vehicle"),
        ({"spacing": 1e6}, "smaller spacing"),
        ({"spacing": 1e-3}, "at least"),
        ({"spacing": float("nan")}, "positive"),
    ],
)
def test_refusals(change, words):
    """No vehicle, a spacing too wide or too fine or no number: one line that says what to do."""
    scenario = read_scenario(DATA / "plant_yard.geojson")
    fleet = {"vehicles": change["vehicles"]} if "vehicles" in change else {}
    with pytest.raises(InputError, match=words):
        cover(replace(scenario, **fleet), spacing=change.get("spacing"))


def test_one_way():
    """A vehicle that does not return stays where its last track ends; the others come home; the PLAN keeps it."""
    scenario = read_scenario(DATA / "plant_yard.geojson")
    one, other = scenario.vehicles
    mission = cover(replace(scenario, vehicles=(replace(one, returns=False), other)))
    assert mission.routes[0].waypoints[-1].leg in ("survey", "turn")
    assert np.allclose(mission.routes[1].xyz[-1, :2], other.home)
    assert '"returns": false' in plan_text(mission)
