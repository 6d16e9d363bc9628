from dataclasses import replace

import numpy as np
import pytest
import shapely

from quarterdeck.coverage.guards.certificate import uncovered_by_shadows
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Obstacle, Scenario, Site, Vehicle, as_multipolygon
from quarterdeck.mission.director import Event, State
from quarterdeck.mission.guard_check import unproved
from quarterdeck.mission.guard_recovery import guards_from_now
from quarterdeck.mission.guards import plan_guards
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.progress import planned_progress
from quarterdeck.mission.recovery import recovering
from quarterdeck.mission.replan import Changes, replan

BORDER = shapely.box(0, 0, 60, 40)
PILLARS = (shapely.box(10, 10, 20, 30), shapely.Polygon([(30, 5), (50, 8), (45, 20)]), shapely.box(30, 28, 50, 34))
RANGE = 12.0


def scenario(*vehicles: Vehicle) -> Scenario:
    """Return vehicles among three pillars."""
    obstacles = tuple(Obstacle(f"o{i}", p) for i, p in enumerate(PILLARS))
    site = Site((Area("a", as_multipolygon(BORDER)),), as_multipolygon(BORDER), obstacles)
    return Scenario("pillars", Frame(8.0, 54.0), site, vehicles)


def husky(name: str, x: float, y: float) -> Vehicle:
    """Return a point husky."""
    return Vehicle(name, load_model("husky"), (x, y))


def confirmed(mission: Mission, served: frozenset[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return places and ranges of the guards served."""
    used = [g for i, g in enumerate(mission.guards) if f"guard-{i}" in served]
    return np.array([(g.x, g.y) for g in used]).reshape(-1, 2), np.array([g.range for g in used])


@pytest.fixture(scope="module")
def plan() -> tuple[Scenario, Mission]:
    """Three robots from three sides."""
    given = scenario(husky("a", 1, 1), husky("b", 59, 39), husky("c", 30, 1))
    return given, plan_guards(given, range=RANGE)


def moved(mission: Mission, time: float, stopped: dict[str, float]) -> tuple[tuple[Vehicle, ...], frozenset[str]]:
    """Return the robots that work where they are at a time, with their homes, and what is confirmed."""
    progress = planned_progress(mission, time, stopped=stopped)
    working = tuple(
        replace(v, start=progress.positions[v.id][:2], end=v.home) for v in mission.vehicles if v.id not in stopped
    )
    return working, progress.served


def test_a_guard_confirmed_before_a_plan_confirms_none_of_it(plan: tuple[Scenario, Mission]) -> None:
    """Each plan numbers its guards anew: one that is seen before two losses is one that is seen after both, no more."""
    _, mission = plan
    told: list[Mission] = []
    director = recovering(mission, tell=lambda _, after: told.append(after))
    states = {v.id: State(*v.start) for v in mission.vehicles}
    first = next(w.task for w in mission.routes[0].waypoints if w.task)
    _, memory = director(0.0, states, (), None)
    _, memory = director(1.0, states, (Event("served", "a", first), Event("lost", "c")), memory)
    _, memory = director(2.0, states, (Event("lost", "b"),), memory)
    assert [sum(g.seen for g in after.guards) for after in told] == [1, 1]


@pytest.mark.parametrize("share", [0.0, 0.3, 0.8])
def test_two_of_three_are_lost_one_after_the_other_and_all_is_seen(plan: tuple[Scenario, Mission], share: float) -> None:
    """Lost in mid-mission and again during recovery: what was confirmed and what is planned together see everything."""
    given, mission = plan
    time = share * mission.figures["duration"]
    working, served = moved(mission, time, {"a": 0.7 * time})
    second = guards_from_now(mission, replace(given, vehicles=working), served)
    assert second.feasible
    assert {r.vehicle for r in second.routes} == {"b", "c"}
    later = 0.4 * second.figures["duration"]
    rest, again = moved(second, later, {"c": later})
    third = guards_from_now(second, replace(given, vehicles=rest), again)
    assert third.figures["guards"] <= second.figures["guards"] - len(again)  # nothing confirmed is visited twice
    final = planned_progress(third, third.figures["duration"] + 1.0)
    parts = [confirmed(m, s) for m, s in ((mission, served), (second, again), (third, final.served))]
    places, ranges = np.concatenate([p for p, _ in parts]), np.concatenate([r for _, r in parts])
    area = given.site.coverable
    assert uncovered_by_shadows(area, given.site.navigable("ground"), places, ranges).area < 3e-9 * area.area
    assert third.routes[0].xyz[-1, :2] == pytest.approx(np.array(mission.vehicle("b").home))


def test_a_robot_that_joins_shortens_what_is_left(plan: tuple[Scenario, Mission]) -> None:
    """The newcomer takes a part, and the makespan from now on is shorter than without it."""
    given, mission = plan
    working, served = moved(mission, 10.0, {"a": 10.0})
    alone = guards_from_now(mission, replace(given, vehicles=working), served)
    helped = guards_from_now(mission, replace(given, vehicles=(*working, husky("d", 2, 38))), served)
    assert helped.figures["makespan"] < alone.figures["makespan"]
    assert any(w.task for w in next(r for r in helped.routes if r.vehicle == "d").waypoints)
    assert helped.feasible


def test_what_the_energy_left_cannot_pay_is_told_as_an_area(plan: tuple[Scenario, Mission]) -> None:
    """The survivor comes home with what it has, sees what it can, and names the square metres that it cannot."""
    given, mission = plan
    working, served = moved(mission, 5.0, {"a": 1.0, "b": 1.0})
    weak = tuple(replace(v, endurance=60.0) for v in working)
    after = guards_from_now(mission, replace(given, vehicles=weak), served)
    assert not after.feasible
    assert "m2 can no longer be seen: the energy left does not suffice" in after.reasons[0].why
    assert after.routes[0].duration <= 60.0
    assert len(after.reasons) == 1


def test_a_new_obstacle_gets_new_guards_and_nothing_left_needs_none(plan: tuple[Scenario, Mission]) -> None:
    """A wall in the way hides a part from the old guards; at the mission's end nothing is left to do."""
    given, mission = plan
    wall = Obstacle("wall", shapely.box(22, 22, 28, 24))
    changed = replace(given, site=replace(given.site, obstacles=(*given.site.obstacles, wall)))
    after = guards_from_now(mission, changed, frozenset())
    assert after.feasible
    guards, ranges = confirmed(after, frozenset(f"guard-{i}" for i in range(200)))
    area = changed.site.coverable
    assert uncovered_by_shadows(area, changed.site.navigable("ground"), guards, ranges).area < 2e-9 * area.area
    working, served = moved(mission, mission.figures["duration"] + 1, {})
    done = guards_from_now(mission, replace(given, vehicles=working), served)
    assert done.figures["guards"] == 0
    assert done.feasible


def test_replan_takes_guards_plans_and_its_plans_pass_the_check(plan: tuple[Scenario, Mission]) -> None:
    """Through the common door: nothing changed, and one lost; both plans' coverage is proved from their own layers."""
    _, mission = plan
    time = 0.4 * mission.figures["duration"]
    same = replan(mission, planned_progress(mission, time))
    assert unproved(same) == []
    stopped = {"b": 0.5 * time}
    after = replan(mission, planned_progress(mission, time, stopped=stopped), Changes(lost=frozenset(stopped)))
    assert after.feasible
    assert unproved(after) == []
    assert {r.vehicle for r in after.routes} == {"a", "c"}


def test_one_that_has_come_outside_comes_back_in(plan: tuple[Scenario, Mission]) -> None:
    """A robot that has drifted over the border goes on from there; a plan that begins there is refused."""
    given, mission = plan
    vehicles = (replace(given.vehicles[0], start=(-3.0, 1.0), end=(1.0, 1.0)), *given.vehicles[1:])
    with pytest.raises(InputError, match="'a' starts outside"):
        plan_guards(replace(given, vehicles=vehicles), range=RANGE)
    after = guards_from_now(mission, replace(given, vehicles=vehicles), frozenset())
    assert after.feasible
    assert after.routes[0].xyz[0, 0] == -3.0
