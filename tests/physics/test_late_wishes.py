"""Late wishes in a run: obstacles come and go in the world too, tasks are asked for and not, and the run is judged so."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from shapely import Point, Polygon, box

from quarterdeck.cli import main
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.scenario import Area, Obstacle, Task, as_multipolygon
from quarterdeck.mission.assign import assign
from quarterdeck.mission.changes import Changes
from quarterdeck.mission.cover import cover
from quarterdeck.mission.guards import plan_guards
from quarterdeck.mission.planfile import plan_text, read_plan
from quarterdeck.mission.recovery import recovering
from quarterdeck.physics.simulate import simulate

pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")
DATA = Path(__file__).parents[2] / "data"


@cache
def survey():
    """Return a coarse survey of the yard by two rovers."""
    return cover(read_scenario(DATA / "plant_yard.geojson"), spacing=8.0)


def run(mission, *changes):
    """Return the run, recovered, under (second, changes)."""
    return simulate(mission, director=recovering(mission, changes=changes), changes=changes, sample=1.0)


def test_a_truck_parks_and_a_tank_is_removed():
    """Who comes later drives around the one and over where the other was; who was there before hit nothing."""
    mission = survey()
    tank = next(o for o in mission.site.obstacles if o.id == "tank")
    route = mission.routes[0]
    done = next(w for w in route.waypoints if w.leg == "survey" and w.time > 60.0)  # driven before the truck comes
    late = next(w for w in route.waypoints if w.leg == "survey" and w.time > 500.0)
    trucks = tuple(
        Obstacle(name, Point(w.x, w.y).buffer(2.0), frozenset({"ground"})) for name, w in (("done", done), ("late", late))
    )
    came = run(mission, (200.0, Changes(obstacles=trucks, gone=frozenset({"tank"}))))
    assert came.report.passed, came.report.reasons
    track = came.trace.x, came.trace.y

    def nearest(place, times):
        return min(float(np.hypot(track[0][times] - place.x, track[1][times] - place.y).min()), 1e9)

    assert nearest(done, came.trace.time < 200.0) < 0.5
    assert nearest(late, came.trace.time > 200.0) > 2.0
    over = Polygon(tank.polygon)
    assert any(over.contains(Point(x, y)) for xs, ys in zip(*track, strict=True) for x, y in zip(xs, ys, strict=True))


def test_the_truck_is_really_there():
    """A director that is told nothing of an obstacle that appears runs into it."""
    mission = survey()
    late = next(w for w in mission.routes[0].waypoints if w.leg == "survey" and w.time > 500.0)
    truck = Obstacle("truck", box(late.x - 2.0, late.y - 2.0, late.x + 2.0, late.y + 2.0), frozenset({"ground"}))
    came = simulate(mission, changes=[(200.0, Changes(obstacles=(truck,)))], sample=1.0, duration=900.0)
    assert came.report.vehicles[0].touched or "truck" in came.report.vehicles[0].hits


def test_a_late_task_is_done_and_judged():
    """A task that is asked for in the run is served by the end of it, and stands in the report; one withdrawn does not."""
    mission = assign(read_scenario(DATA / "inspection_hall.geojson"), iterations=10)
    last = mission.tasks[-1].id
    free = mission.tasks[0].position
    new = Task("late", (free[0] + 1.0, free[1]), 3, service_time=2.0)
    came = run(mission, (3.0, Changes(tasks=(new,), withdrawn=frozenset({last}))))
    assert {t.id for t in came.report.tasks} == {*(t.id for t in mission.tasks), "late"} - {last}
    assert all(t.driven is not None for t in came.report.tasks)


def test_all_withdrawn_sends_guards_home():
    """Where all that guards were to see is withdrawn in the run, they go home, and nothing was missed."""
    mission = plan_guards(read_scenario(DATA / "plant_yard.geojson"), range=30.0)
    came = run(mission, (40.0, Changes(withdrawn=frozenset(a.id for a in mission.site.areas))))
    assert came.report.passed, came.report.reasons
    assert came.report.figures["time"] < max(r.duration for r in mission.routes)


def test_the_plan_as_told_is_of_what_is_asked_for(tmp_path):
    """It has the site and the tasks that the run is judged by, none that was withdrawn, done or not, and can be read."""
    mission = survey()
    x, y = mission.site.operating.bounds[2:]
    area = Area("late", as_multipolygon(box(x, y - 60.0, x + 20.0, y - 30.0)), 2)
    truck = Obstacle("truck", box(x - 50.0, y - 60.0, x - 48.0, y - 40.0), frozenset({"ground"}))
    changes = [(20.0, Changes(areas=(area,), obstacles=(truck,), gone=frozenset({"tank"})))]
    came = simulate(mission, director=recovering(mission, changes=changes), changes=changes, sample=1.0, duration=25.0)
    for site in (came.told.site, came.site):
        assert [(a.id, a.priority) for a in site.areas] == [*((a.id, a.priority) for a in mission.site.areas), ("late", 2)]
        assert {o.id for o in site.obstacles} == {*(o.id for o in mission.site.obstacles), "truck"} - {"tank"}
    tasks = assign(read_scenario(DATA / "inspection_hall.geojson"), iterations=10)
    done = min((w for r in tasks.routes for w in r.waypoints if w.task), key=lambda w: w.time + w.hold)
    told = run(tasks, (done.time + done.hold + 10.0, Changes(withdrawn=frozenset({done.task})))).told
    assert {w.task for r in told.routes for w in r.waypoints if w.task} == {t.id for t in told.tasks}
    (tmp_path / "told.geojson").write_text(plan_text(told))
    assert done.task not in {t.id for t in read_plan(tmp_path / "told.geojson").tasks}


def test_vehicles_change_by_faults_only():
    """A change of a vehicle is refused in a run, with the option that does it."""
    with pytest.raises(InputError, match=r"'ugv-2': in a run vehicles change by faults \(--fail"):
        recovering(survey(), changes=[(5.0, Changes(lost=frozenset({"ugv-2"})))])


def test_the_command_takes_them(tmp_path, capsys):
    """`--changes FILE@T` reads a file as `replan --changes` does, and the report names it with its hash."""
    plan, file, report = tmp_path / "plan.geojson", tmp_path / "late.geojson", tmp_path / "report.json"
    plan.write_text(plan_text(survey()))
    gone = {"type": "Feature", "geometry": None, "properties": {"role": "obstacle", "id": "tank", "change": "remove"}}
    file.write_text(json.dumps({"type": "FeatureCollection", "features": [gone]}))
    with pytest.raises(SystemExit) as refused:
        main([*("simulate", str(plan)), "--changes", f"{file}@100"])
    assert refused.value.code == 2
    with pytest.raises(SystemExit) as ended:
        main(["simulate", str(plan), "--recover", "--changes", f"{file}@100", "--report", str(report)])
    assert ended.value.code == 0
    assert str(file) in json.loads(report.read_text())["command"]["files"]
    assert "0:01:40: replanned for ugv-1, ugv-2" in capsys.readouterr().err
