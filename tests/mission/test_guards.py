from dataclasses import replace

import numpy as np
import pytest
import shapely

from quarterdeck.coverage.guards import certificate
from quarterdeck.coverage.guards.certificate import uncovered_by_shadows
from quarterdeck.geo.deadline import limited
from quarterdeck.geo.errors import InputError, OutOfTimeError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Obstacle, Scenario, Site, Vehicle, as_multipolygon
from quarterdeck.mission import guards as planner
from quarterdeck.mission.guard_check import unproved
from quarterdeck.mission.guards import plan_guards
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.planfile import plan_text
from quarterdeck.reproduce.guard_maps import random_room, scenario_on

BORDER = shapely.box(0, 0, 60, 40)
PILLARS = (shapely.box(10, 10, 20, 30), shapely.Polygon([(30, 5), (50, 8), (45, 20)]), shapely.box(30, 28, 50, 34))


def scenario(*starts: tuple[float, float], clearance: float = 0.0, area: shapely.Geometry = BORDER) -> Scenario:
    """Return huskies among three pillars."""
    fleet = tuple(Vehicle(f"r{i}", load_model("husky"), xy, clearance=clearance) for i, xy in enumerate(starts))
    obstacles = tuple(Obstacle(f"o{i}", p) for i, p in enumerate(PILLARS))
    site = Site((Area("a", as_multipolygon(area)),), as_multipolygon(area), obstacles)
    return Scenario("pillars", Frame(8.0, 54.0), site, fleet)


@pytest.mark.parametrize("mode", ["paper", "optimised"])
@pytest.mark.parametrize("clearance", [0.0, 0.7])
def test_everything_is_seen_and_every_guard_is_passed_once(mode: str, clearance: float) -> None:
    """The certificate holds by the other route too, and each guard is a stop of exactly one route."""
    given = scenario((1, 1), (59, 39), (30, 1), clearance=clearance)
    mission = plan_guards(given, range=12.0, mode=mode)  # type: ignore[arg-type]
    assert mission.feasible
    assert mission.figures["certificate"]["uncovered"] == 0.0
    guards = np.array([(g.x, g.y) for g in mission.guards])
    ranges = np.array([g.range for g in mission.guards])
    site = given.site
    assert uncovered_by_shadows(site.coverable, site.navigable("ground"), guards, ranges).area < 1e-9 * site.coverable.area
    stops = [w for route in mission.routes for w in route.waypoints if w.task]
    assert sorted(w.task for w in stops) == sorted(f"guard-{i}" for i in range(len(guards)))
    assert all(np.allclose([w.x, w.y], guards[int(w.task.removeprefix("guard-"))], atol=1e-6) for w in stops)
    free = site.navigable("ground", 0.99 * clearance).buffer(1e-6)
    for vehicle, route in zip(mission.vehicles, mission.routes, strict=True):
        line = shapely.LineString(route.xyz[:, :2])
        assert free.covers(line)
        assert tuple(route.xyz[0, :2]) == tuple(route.xyz[-1, :2]) == vehicle.start
    assert mission.figures["makespan"] >= mission.bounds["makespan"] > 0


def test_a_boat_stops_to_look_where_it_turns_back() -> None:
    """Where a vessel turns sharply at a guard it stops: on an arc it would look from metres beside it; a rover need not."""
    site = scenario((2.0, 2.0), area=shapely.box(0, 0, 100, 100))
    boat = replace(site.vehicles[0], model=load_model("otter"), turn_radius=6.0)
    for vehicle, stops in ((site.vehicles[0], False), (boat, True)):
        route = plan_guards(replace(site, vehicles=(vehicle,)), range=60.0).routes[0]
        x, y, _ = route.xyz.T
        course = np.unwrap(np.arctan2(np.diff(y), np.diff(x)))
        sharp = [
            w.hold > 0
            for w, turn in zip(route.waypoints[1:-1], np.abs(np.diff(course)), strict=True)
            if w.task and turn > 2.0
        ]
        assert sharp
        assert all(held == stops for held in sharp)


def test_an_area_out_of_sight_is_refused_at_once() -> None:
    """Apart from where vehicles may be, by land or by more than they see: one line, not a search of every corner."""
    far = Area("far", as_multipolygon(shapely.box(200, 0, 400, 200)))
    given = scenario((1, 1))
    with pytest.raises(InputError, match="no part of the area can be seen"):
        plan_guards(replace(given, site=replace(given.site, areas=(far,))), range=12.0)


def test_the_rim_of_what_can_be_seen_is_not_searched_for_ever(monkeypatch) -> None:
    """Where vehicles may not follow, most of an area is out of range: that is told, its rim is not cut ever finer."""
    cut, quarters = [], certificate._quarters
    monkeypatch.setattr(certificate, "_quarters", lambda piece: cut.append(piece) or quarters(piece))
    wide = Area("wide", as_multipolygon(shapely.box(0, 0, 60, 120)))
    given = scenario((1, 1))
    mission = plan_guards(replace(given, site=replace(given.site, areas=(wide,))), range=12.0, mode="paper")
    assert not mission.feasible
    assert "cannot be seen from where the vehicles may be" in str(mission.reasons[0])
    assert len(cut) < 1500


def test_optimised_is_never_worse_and_the_same_seed_gives_the_same_plan() -> None:
    """Fewer or as many guards, a makespan as short or shorter, and the same bytes."""
    given = scenario((1, 1), (2, 1), (3, 1))
    paper, best = plan_guards(given, range=9.0, mode="paper"), plan_guards(given, range=9.0)
    assert best.figures["guards"] <= paper.figures["guards"]
    assert best.figures["makespan"] <= paper.figures["makespan"]
    assert best.figures["paper"]["makespan"] == paper.figures["makespan"]
    assert plan_text(best) == plan_text(plan_guards(given, range=9.0))


def test_borders_are_inspected_with_fewer_guards_than_the_area() -> None:
    """Every edge of area and obstacles is within range and in sight of a guard; the middle of the room need not be."""
    given = scenario((1, 1), (59, 39))
    mission = plan_guards(given, range=9.0, inspect="border")
    assert mission.feasible
    assert mission.figures["guards"] < plan_guards(given, range=9.0, mode="paper").figures["guards"]
    guards = shapely.points([(g.x, g.y) for g in mission.guards])
    border = given.site.coverable.boundary
    steps = [border.interpolate(at) for at in np.arange(0, border.length, 0.5)]
    free = given.site.coverable.buffer(1e-6)
    for step in steps:
        near = guards[shapely.distance(guards, step) <= 9.0]
        assert any(free.covers(shapely.LineString([g, step])) for g in near)


def test_a_part_of_higher_priority_is_seen_first() -> None:
    """The urgent part is seen whole long before the rest, and sooner than without its priority."""
    urgent = Area("urgent", as_multipolygon(shapely.box(40, 20, 60, 40)), priority=2)
    given = scenario((1, 1), (2, 1))
    part, walls = urgent.polygon.intersection(given.site.coverable), given.site.navigable("ground")

    def seen_at(mission: Mission) -> float:
        stops = sorted((w.time, w.x, w.y) for route in mission.routes for w in route.waypoints if w.task)
        at = np.array(stops)
        return float(
            next(
                at[n - 1, 0]
                for n in range(1, len(at) + 1)
                if uncovered_by_shadows(part, walls, at[:n, 1:], np.full(n, 12.0)).area < 1e-9 * part.area
            )
        )

    ranked = replace(given, site=replace(given.site, areas=(*given.site.areas, urgent)))
    first, plain = plan_guards(ranked, range=12.0), plan_guards(given, range=12.0)
    assert seen_at(first) < min(seen_at(plain), 0.6 * max(r.duration for r in first.routes))


def test_a_robot_of_longer_range_leaves_guards_out() -> None:
    """With their own ranges the robots still see everything, from fewer guards than all with the shortest."""
    given = scenario((1, 1), (59, 39))
    near, far = given.vehicles
    mixed = replace(given, vehicles=(replace(near, range=12.0), replace(far, range=30.0)))
    mission = plan_guards(mixed)
    assert mission.figures["guards"] < plan_guards(given, range=12.0).figures["guards"]
    passed = [g for g in mission.guards if g.vehicle]
    ranges = np.array([g.range for g in passed])
    assert set(ranges) == {12.0, 30.0}
    site = given.site
    guards = np.array([(g.x, g.y) for g in passed])
    assert uncovered_by_shadows(site.coverable, site.navigable("ground"), guards, ranges).area < 1e-9 * site.coverable.area


@pytest.mark.parametrize(
    ("starts", "reach", "text"),
    [
        ([(15, 20)], 5.0, "vehicle 'r0' starts in an obstacle"),
        ([(-90, 0)], 5.0, "vehicle 'r0' starts outside the area"),
        ([(1, 1)], 0.0, "range 0.0 must be positive"),
        ([(1, 1)], float("nan"), "range nan must be positive"),
        ([(1, 1)], None, "vehicle 'r0' has no range"),
        ([], 5.0, "there is no vehicle"),
        ([(1, 1)], 0.5, "takes at least 2,"),
    ],
)
def test_wrong_input_is_told_in_a_line(starts: list[tuple[float, float]], reach: float | None, text: str) -> None:
    """Starts in a hole and outside, ranges of nothing: one line each, for the user."""
    with pytest.raises(InputError, match=text) as error:
        plan_guards(scenario(*starts), range=reach)
    assert "\n" not in str(error.value)


def test_a_part_that_nobody_can_reach_is_told_with_its_area() -> None:
    """Two rooms and a robot in one: the other's square metres are named."""
    rooms = shapely.union_all([BORDER, shapely.box(100, 0, 110, 10)])
    with pytest.raises(InputError, match="100 m2 of the area can be reached by no vehicle"):
        plan_guards(scenario((1, 1), area=rooms), range=12.0)
    mission = plan_guards(scenario((1, 1), (101, 1), area=rooms), range=12.0)
    assert mission.feasible
    assert mission.figures["certificate"]["uncovered"] == 0.0


def test_what_cannot_be_seen_is_told() -> None:
    """A crooked niche that the robot may not enter makes the mission infeasible, with its square metres."""
    niche = shapely.union_all([BORDER, shapely.box(60, 20, 63, 20.5), shapely.box(62, 20, 63, 30)])
    given = scenario((5, 5), area=niche)
    given = replace(given, site=replace(given.site, operating=as_multipolygon(BORDER)))
    mission = plan_guards(given, range=12.0)
    assert not mission.feasible
    unseen = float(mission.reasons[0].why.split(" m2 cannot be seen")[0])
    assert 8.0 < unseen < 10.5
    assert mission.figures["certificate"]["uncovered"] == pytest.approx(unseen, rel=0.05)


def test_a_plan_that_skips_a_guard_does_not_pass_the_check() -> None:
    """The check finds, from the PLAN's text alone, that all is seen; and what is not when a stop is left out."""
    mission = plan_guards(scenario((1, 1), (59, 39)), range=12.0)
    assert unproved(mission) == []
    route = mission.routes[0]
    stop = next(w for w in route.waypoints if w.task)
    short = replace(route, waypoints=tuple(w for w in route.waypoints if w is not stop))
    problems = unproved(replace(mission, routes=(short, *mission.routes[1:])))
    assert problems[0] == f"r0: does not pass {stop.task}"
    assert "m2 are in no guard's view" in problems[1]


def test_a_limit_before_the_first_tours_is_told_in_a_line() -> None:
    """There is no plan without guards and tours past them: where they are many, the line says what was being done."""
    site = scenario_on(random_room(1000, 0), 1)
    with (
        limited(1e-9),
        pytest.raises(OutOfTimeError, match=r"^time limit: it ended the placing of guards, .*; give it longer"),
    ):
        plan_guards(site, range=20.0)


def test_a_limit_in_any_later_stage_leaves_the_paper_s_plan(monkeypatch) -> None:
    """Once the paper's tours are there, whatever the limit ends after them, everything is still seen."""
    tours = planner.paper_tours
    with limited(3600.0) as limit:

        def slow(*given):
            made = tours(*given)
            limit.ends = 0.0
            return made

        monkeypatch.setattr(planner, "paper_tours", slow)
        monkeypatch.setattr(planner, "time_is_up", lambda _: False)  # the search for less begins, and is ended
        mission = plan_guards(scenario((10.0, 10.0)), range=20.0)
    assert mission.feasible
    assert mission.figures["certificate"]["uncovered"] == 0.0
    assert mission.figures["guards"] <= mission.figures["paper"]["guards"]
    assert mission.figures["makespan"] <= mission.figures["paper"]["makespan"]
    assert limit.cut
