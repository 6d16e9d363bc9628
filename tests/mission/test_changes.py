"""Every kind of change, for every method: it has its effect, or one clear line refuses it; no change changes nothing."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import MultiPolygon, Point, box

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Obstacle, Precedence, Scenario, Site, Task, Vehicle
from quarterdeck.geo.triangulation import triangulate
from quarterdeck.geo.visibility import visibility_polygons
from quarterdeck.mission.assign import assign
from quarterdeck.mission.changes import Changes, read_changes
from quarterdeck.mission.check import trespasses
from quarterdeck.mission.cover import cover
from quarterdeck.mission.guard_check import unproved
from quarterdeck.mission.guards import plan_guards
from quarterdeck.mission.lines import plan_lines
from quarterdeck.mission.mission import unbroken
from quarterdeck.mission.planfile import plan_text, read_plan
from quarterdeck.mission.progress import planned_progress
from quarterdeck.mission.replan import replan
from quarterdeck.mission.timing import shortfalls

FRAME = Frame(8.0, 54.0)
METHODS = ("stc", "lines", "guards", "assign")
SURVEYS = ("stc", "lines")
PILLAR = box(20, 16, 26, 22)


@cache
def plan(method):
    """Return a small plan of each method: two areas side by side, a pillar, three rovers."""
    rover = load_model("jackal")
    fleet = tuple(
        Vehicle(f"r{i}", rover, (x, 1.0), speed=1.0, clearance=0.5, range=15.0) for i, x in enumerate((4.0, 30.0, 56.0))
    )
    areas = (Area("west", MultiPolygon([box(0, 0, 30, 40)])), Area("east", MultiPolygon([box(30, 0, 60, 40)])))
    site = Site(areas, MultiPolygon([box(0, 0, 60, 40)]), (Obstacle("pillar", PILLAR),))
    tasks = tuple(Task(f"t{i}", (6.0 + 8 * i, 6.0 + 20 * (i % 2)), service_time=10.0) for i in range(7))
    tasks = (*tasks[:-1], replace(tasks[-1], after=(Precedence("t0"),)))
    scenario = Scenario("yard", FRAME, site, fleet, spacing=4.0)
    if method == "assign":
        return assign(replace(scenario, tasks=tasks), iterations=5)
    return {"stc": cover, "lines": plan_lines, "guards": plan_guards}[method](scenario)


def end(mission):
    """Return when the last vehicle is home."""
    return max(r.duration for r in mission.routes)


def changed(mission, time, changes):
    """Replan, through the PLAN file's text at both ends, and check what must hold of every plan."""
    after = replan(mission, planned_progress(mission, time, stopped=dict.fromkeys(changes.lost, time)), changes)
    assert trespasses(after) == ()
    assert unproved(after) == []
    for vehicle, route in zip(after.vehicles, after.routes, strict=True):
        assert np.allclose(route.xyz[-1, :2], vehicle.home, atol=1e-6)
        assert not shortfalls(vehicle, route)
    return after


def write(tmp_path, *features):
    """Write features, given as (geometry in metres or None, properties), and return the file."""
    made = []
    for geometry, properties in features:
        drawn = None
        if geometry is not None:
            placed = shapely.transform(geometry, FRAME.to_degrees)
            drawn = shapely.geometry.mapping(placed)
        made.append({"type": "Feature", "geometry": drawn, "properties": properties})
    path = tmp_path / "changes.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": made}))
    return path


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(METHODS), st.floats(0.0, 1.3), st.floats(0.0, 1.0))
def test_no_change_is_the_same_plan_from_there_on(method, part, split):
    """Replanned without changes, at once or in two steps, every route is what was left of it, to a micrometre."""
    before = plan(method)
    time = part * end(before)
    once = replan(before, planned_progress(before, time))
    half = replan(before, planned_progress(before, split * time))
    twice = replan(half, planned_progress(half, time - split * time))
    for old, new, again, vehicle in zip(before.routes, once.routes, twice.routes, once.vehicles, strict=True):
        left = [w for w in old.waypoints if w.time > time]
        for route in (new, again):
            assert [w.leg for w in route.waypoints[1:]] == [w.leg for w in left]
            assert [w.task for w in route.waypoints[1:]] == [w.task for w in left]
            assert np.allclose(route.xyz[1:], [(w.x, w.y, w.z) for w in left] or np.empty((0, 3)), atol=1e-6, rtol=0)
            assert np.allclose([w.time for w in route.waypoints[1:]], [w.time - time for w in left], atol=1e-6)
            assert np.allclose(route.xyz[-1, :2], vehicle.home, atol=1e-6)
        assert np.allclose(new.xyz[0], again.xyz[0], atol=1e-6)
        used = old.energy - new.energy
        assert new.energy == pytest.approx(again.energy)
        assert vehicle.battery == pytest.approx(before.vehicle(vehicle.id).battery - used / 0.8)
        assert vehicle.battery == pytest.approx(twice.vehicle(vehicle.id).battery)
    assert any("all was done at" in note for note in once.figures.get("notes", ())) == (time >= end(before))
    assert once.tasks == tuple(t for t in once.tasks if t.id in {w.task for r in once.routes for w in r.waypoints})


@pytest.mark.parametrize("method", METHODS)
def test_slow(method):
    """A vehicle at a quarter of its speed gets less to do than as if nothing were done about it."""
    before = plan(method)
    time = 0.1 * end(before)
    after = changed(before, time, Changes(speeds={"r1": 0.25}))
    assert after.vehicle("r1").speed == 0.25
    crawl = (before.routes[1].duration - time) / 0.25
    assert end(after) < 0.8 * crawl


@pytest.mark.parametrize("method", METHODS)
def test_lost_then_back(method, tmp_path):
    """Who was given up by one replan may come back in the next, through the PLAN file, and takes a part again."""
    before = plan(method)
    first = changed(before, 0.1 * end(before), Changes(lost=frozenset({"r2"})))
    assert [v.id for v in first.lost] == ["r2"]
    path = tmp_path / "plan.geojson"
    path.write_text(plan_text(first))
    read = read_plan(path)
    alone = end(first)
    place = (55.0, 5.0)
    back = read_changes(write(tmp_path, (Point(place), {"role": "vehicle", "change": "back", "id": "r2"})), read)
    second = changed(read, 5.0, back)
    assert not second.lost
    if method in SURVEYS:  # what was covered before both replans counts too
        assert second.figures["poc"] > before.figures["poc"] - 0.02
    assert np.allclose(second.vehicle("r2").start, place, atol=1e-3)
    assert second.vehicle("r2").battery <= before.vehicle("r2").battery
    assert second.routes[-1].duration > 0.0
    assert end(second) < alone - 5.0 + 1e-6


@pytest.mark.parametrize("method", METHODS)
def test_joining(method, tmp_path):
    """A vehicle that joins takes a part of the work."""
    before = plan(method)
    newcomer = {"role": "vehicle", "id": "new", "model": "jackal", "speed": 1.0, "clearance": 0.5, "range": 15.0}
    changes = read_changes(write(tmp_path, (Point(45, 38), newcomer)), before)
    after = changed(before, 0.05 * end(before), changes)
    assert after.routes[-1].vehicle == "new"
    assert after.routes[-1].length > 5.0


@pytest.mark.parametrize("method", METHODS)
def test_obstacle_appears(method, tmp_path):
    """What appears is kept clear of; a start inside it is refused in one line."""
    before = plan(method)
    wall = box(38, 15, 46, 21)
    changes = read_changes(write(tmp_path, (wall, {"role": "obstacle", "id": "wall"})), before)
    after = changed(before, 0.02 * end(before), changes)
    for vehicle, route in zip(after.vehicles, after.routes, strict=True):
        away = shapely.LineString(route.xyz[:, :2]).distance(wall) if len(route.waypoints) > 1 else 1.0
        assert away >= vehicle.clearance - 0.02
    progress = planned_progress(before, 0.1 * end(before))
    around = Obstacle("around", Point(progress.positions["r0"]).buffer(2.0))
    with pytest.raises(InputError, match="vehicle 'r0' is inside obstacle 'around'"):
        replan(before, progress, Changes(obstacles=(around,)))


@pytest.mark.parametrize("method", METHODS)
def test_home_is_taken(method):
    """Where an obstacle stands on a vehicle's end, it stops before it, and that is told."""
    before = plan(method)
    progress = planned_progress(before, 0.5 * end(before))
    over = Obstacle("crate", Point(before.vehicles[0].home).buffer(1.5))
    if over.polygon.distance(Point(progress.positions["r0"][:2])) < 1.0:
        pytest.skip("r0 stands there")
    after = replan(before, progress, Changes(obstacles=(over,)))
    assert any(str(r).startswith("r0: its end is inside obstacle 'crate'") for r in after.reasons)
    assert trespasses(after) == ()


@pytest.mark.parametrize("method", ["stc", "lines", "guards"])
def test_obstacle_goes(method):
    """Where an obstacle was is covered too, or seen."""
    before = plan(method)
    after = changed(before, 0.3 * end(before), Changes(gone=frozenset({"pillar"})))
    assert not after.site.obstacles
    if method == "guards":
        return  # proved by `unproved`, without the guards whose views the pillar had cut
    surveyed = [t for r in after.routes for t in unbroken(r.xyz[:, :2], r.survey)]
    assert shapely.MultiLineString([shapely.LineString(t) for t in surveyed]).intersection(PILLAR).length > 5.0


@pytest.mark.parametrize("method", ["stc", "lines", "guards"])
def test_areas(method, tmp_path):
    """An area that is added is worked on; one that is withdrawn is not any more; with none left all go home."""
    before = plan(method)
    time = 0.1 * end(before)
    north = box(0, 40, 60, 52)
    more = changed(before, time, read_changes(write(tmp_path, (north, {"role": "area", "id": "north"})), before))
    assert sum(shapely.LineString(r.xyz[:, :2]).intersection(north).length for r in more.routes) > 20.0
    less = changed(before, time, Changes(withdrawn=frozenset({"east"})))
    inner = box(34, 4, 60, 40)
    assert not any(inner.covers(Point(w.x, w.y)) for r in less.routes for w in r.waypoints if w.task)
    if method != "guards":
        assert not any(inner.covers(Point(w.x, w.y)) for r in less.routes for w in r.waypoints if w.leg == "survey")
        none = changed(before, time, Changes(withdrawn=frozenset({"east", "west"})))
        assert not any(w.leg == "survey" for r in none.routes for w in r.waypoints)


@pytest.mark.parametrize("method", SURVEYS)
def test_priority_of_an_area(method, tmp_path):
    """An area of a higher priority is surveyed before the other by each vehicle."""
    before = plan(method)
    first = read_changes(write(tmp_path, (None, {"role": "area", "change": "set", "id": "east", "priority": 5})), before)
    after = changed(before, 0.0, first)
    for route in after.routes:
        east = [w.x > 30.0 for w in route.waypoints if w.leg == "survey" and abs(w.x - 30.0) > 1e-6]
        assert east == sorted(east, reverse=True)


def test_priority_of_an_area_for_guards():
    """Guards of an area of a higher priority come first: it is seen whole sooner, where it was not the first already."""
    before = plan("guards")
    west, east = (box(x, 0, x + 30, 40) for x in (0, 30))
    assert seen_whole(before, west) > seen_whole(before, east) + 10.0
    assert seen_whole(changed(before, 0.0, Changes(priorities={"west": 5})), west) < seen_whole(before, west) - 10.0
    assert seen_whole(changed(before, 0.0, Changes(priorities={"east": 5})), east) <= seen_whole(before, east) + 1e-6


def seen_whole(mission, part):
    """Return when the last of `part` of the yard is seen, by the views of the guards in the order of the visits."""
    visits = np.array(sorted((w.time, w.x, w.y) for r in mission.routes for w in r.waypoints if w.task))
    rest = part.difference(PILLAR)
    views = visibility_polygons(triangulate(box(0, 0, 60, 40).difference(PILLAR)), visits[:, 1:], 15.0)
    for at, view in zip(visits, views, strict=True):
        rest = rest.difference(view)
        if rest.area < 1e-3:
            return at[0]
    return np.inf


def test_tasks(tmp_path):
    """A task is added, withdrawn, made urgent and longer; one under way is finished by who began it, for what is left."""
    before = plan("assign")
    t4 = {"role": "task", "change": "set", "id": "t4", "priority": 3, "service_time": 20}
    new = {"role": "task", "id": "late", "after": ["t1"], "service_time": 5}
    gone = {"role": "task", "change": "remove", "id": "t2"}
    changes = read_changes(write(tmp_path, (None, t4), (Point(50, 30), new), (None, gone)), before)
    after = changed(before, 0.0, changes)
    visits = {w.task: (w.time, w.hold) for r in after.routes for w in r.waypoints if w.task}
    assert set(visits) == {"t0", "t1", "t3", "t4", "t5", "t6", "late"}
    assert visits["t4"][1] >= 20.0
    assert sum(visits["late"]) - 5.0 >= sum(visits["t1"]) - 1e-6
    route = before.routes[0]
    w = next(w for w in route.waypoints if w.task)
    begun = changed(before, w.time + 0.4 * w.hold, Changes(lost=frozenset({"r2"})))
    assert begun.routes[0].waypoints[0].time == 0.0
    held = next(x for r in begun.routes for x in r.waypoints if x.task == w.task)
    assert any(x.task == w.task for x in begun.routes[0].waypoints)
    assert held.hold == pytest.approx(0.6 * w.hold)


def test_task_that_nobody_can_do_any_more():
    """Out of energy, tasks that cannot be done are listed; they stay in the plan, and are done when somebody joins."""
    before = plan("assign")
    weak = replace(before, vehicles=tuple(replace(v, endurance=60.0) for v in before.vehicles))
    after = replan(weak, planned_progress(weak, 5.0), Changes(lost=frozenset({"r0", "r1"})))
    undone = after.figures["undone"]
    assert undone
    assert {r.about for r in after.reasons if r.kind == "undone"} == set(undone)
    assert not shortfalls(after.vehicles[0], after.routes[0])
    fresh = replace(before.vehicles[0], id="fresh")
    again = replan(after, planned_progress(after, 1.0), Changes(joined=(fresh,)))
    assert {w.task for r in again.routes for w in r.waypoints} >= set(undone)


@pytest.mark.parametrize("method", SURVEYS)
def test_left_out_lines_are_taken_up_again(method):
    """What the energy left does not suffice for is told as an area, and surveyed when somebody joins."""
    before = plan(method)
    weak = replace(before, vehicles=tuple(replace(v, endurance=0.4 * end(before)) for v in before.vehicles))
    after = replan(weak, planned_progress(weak, 10.0), Changes(lost=frozenset({"r0", "r2"})))
    assert not after.feasible
    assert "can no longer be covered: the energy left does not suffice" in after.reasons[0].why
    assert not shortfalls(after.vehicles[0], after.routes[0])
    undone = shapely.union_all(next(layer.geometries for layer in after.layers if layer.name == "undone"))
    assert undone.area == pytest.approx(after.figures["undone_m2"])
    fresh = replace(before.vehicles[0], id="fresh")
    again = changed(after, 0.0, Changes(joined=(fresh,)))
    done = shapely.MultiLineString([shapely.LineString(r.xyz[:, :2]) for r in again.routes if len(r.waypoints) > 1]).buffer(
        2.0
    )
    assert undone.difference(done).area < 0.03 * undone.area
    assert again.feasible


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("part", [0.0, 0.5, 1.5])
def test_all_but_one_at_any_time(method, part):
    """At the start, in the middle and after the end: one vehicle is left and its plan is right."""
    before = plan(method)
    after = changed(before, part * end(before), Changes(lost=frozenset({"r0", "r2"})))
    assert [r.vehicle for r in after.routes] == ["r1"]
    assert after.feasible
    if part > 1.0:
        assert after.routes[0].duration < 1e-6


SET = {"change": "set"}


@pytest.mark.parametrize(
    ("method", "feature", "words"),
    [
        ("stc", {"role": "vehicle", "id": "rr2", "change": "remove"}, "unknown vehicle 'rr2'; did you mean 'r2'"),
        ("stc", {"role": "vehicle", "id": "r1", "change": "lost"}, "must be one of add, remove, set, back"),
        ("stc", {"role": "vehicle", "id": "r1", "change": "back"}, "never gave it up"),
        ("stc", {"role": "vehicle", "id": "r1", **SET}, "give speed or speed_factor"),
        ("stc", {"role": "vehicle", "id": "r1", **SET, "speed": -1}, "speed must be a number above 0"),
        ("stc", {"role": "vehicle", "id": "r1", **SET, "speed_factor": 9}, "at most 2 m/s"),
        ("stc", {"role": "vehicle", "id": "r1", "change": "remove", "since": "noon"}, "number of seconds"),
        ("stc", {"role": "vehicle", "change": "remove"}, 'give it the "id"'),
        ("stc", {"role": "obstacle", "id": "pilar", "change": "remove"}, "did you mean 'pillar'"),
        ("stc", {"role": "obstacle", "id": "pillar", **SET}, "must be one of add, remove"),
        ("lines", {"role": "area", "id": "wets", "change": "remove"}, "did you mean 'west'"),
        ("lines", {"role": "area", "id": "west", **SET, "priority": "high"}, "whole number"),
        ("guards", {"role": "casualty", "id": "c", "change": "remove"}, "a plan has no casualty"),
        ("guards", {"role": "tsak", "id": "c", "change": "remove"}, "did you mean 'task'"),
        ("assign", {"role": "task", "id": "t1", **SET, "window": [9, 3]}, "earliest first"),
        ("assign", {"role": "area", "id": "west", **SET, "priority": 2}, "covers no areas"),
        ("assign", {"role": "area", "id": "west", "change": "remove"}, "covers no areas"),
    ],
)
def test_refusals(method, feature, words, tmp_path):
    """What is not in the plan, says nothing or means nothing to its method is refused in one line."""
    before = plan(method)
    with pytest.raises(InputError, match=words) as caught:
        replan(before, planned_progress(before, 5.0), read_changes(write(tmp_path, (None, feature)), before))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("method", METHODS)
def test_nobody_left(method):
    """When everything is lost there is one line, and a vehicle that joins in the same moment goes on alone."""
    before = plan(method)
    all_lost = Changes(lost=frozenset({"r0", "r1", "r2"}))
    with pytest.raises(InputError, match="nobody is left"):
        replan(before, planned_progress(before, 5.0), all_lost)
    fresh = replace(before.vehicles[0], id="fresh", start=(10.0, 36.0), end=None)
    after = changed(before, 5.0, replace(all_lost, joined=(fresh,)))
    assert [r.vehicle for r in after.routes] == ["fresh"]
