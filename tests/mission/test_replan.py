"""When things change: nothing done is done again, all that is left is done, survivors come home."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import box

from quarterdeck.coverage.metrics import swath
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.scenario import Obstacle
from quarterdeck.mission.cover import cover
from quarterdeck.mission.progress import planned_progress
from quarterdeck.mission.replan import Changes, replan
from quarterdeck.mission.routes import survey_tracks
from quarterdeck.mission.timing import shortfalls

DATA = Path(__file__).parents[2] / "data"


@cache
def plan(site="farm_survey"):
    """Return a plan of three aerial vehicles, or of another site."""
    return cover(read_scenario(DATA / f"{site}.geojson"))


def lines(mission):
    """Return all survey tracks of a mission."""
    return [t for v, r in zip(mission.vehicles, mission.routes, strict=True) for t in survey_tracks(v, r)]


@settings(max_examples=5, deadline=None)
@given(st.floats(0, 2000))
def test_no_change_is_the_same_plan_from_there_on(time):
    """Without changes each route is what was left of it: same waypoints, same times less what has passed."""
    before = plan()
    after = replan(before, planned_progress(before, time))
    for old, new in zip(before.routes, after.routes, strict=True):
        left = [w for w in old.waypoints if w.time > time]
        assert [(w.x, w.y, w.z, w.leg) for w in new.waypoints[1:]] == [(w.x, w.y, w.z, w.leg) for w in left]
        assert np.allclose([w.time for w in new.waypoints[1:]], [w.time - time for w in left])


@settings(max_examples=6, deadline=None)
@given(st.sampled_from(["farm_survey", "west_ant_island"]), st.floats(0.05, 0.95), st.integers(1, 2), st.randoms())
def test_losses_are_taken_over(site, part, count, random):
    """Whoever is lost and whenever: done and replanned tracks together cover what the plan covered, and all come home."""
    before = plan(site)
    time = part * max(r.duration for r in before.routes)
    lost = frozenset(random.sample([v.id for v in before.vehicles], count))
    progress = planned_progress(before, time)
    after = replan(before, progress, Changes(lost=lost))
    assert {v.id for v in after.vehicles} == {v.id for v in before.vehicles} - lost
    covered = swath([*progress.tracks, *lines(after)], before.spacing)
    promised = swath(lines(before), before.spacing).intersection(before.site.coverable)
    assert promised.difference(covered).area < 0.01 * promised.area + after.figures["undone_m2"]
    assert after.feasible == (after.figures["undone_m2"] < 1e-3 * promised.area)
    for vehicle, route in zip(after.vehicles, after.routes, strict=True):
        assert np.allclose(route.xyz[0], progress.positions[vehicle.id], atol=1e-9)
        assert np.allclose(route.xyz[-1, :2], before.vehicle(vehicle.id).home)
        space = after.site.navigable(vehicle.domain, vehicle.clearance).buffer(1e-3)
        assert all(space.covers(shapely.LineString(t)) for t in survey_tracks(vehicle, route))


def test_little_is_done_twice():
    """What was done before the loss is not driven again, but for what lies in hypervertices begun."""
    before = plan("west_ant_island")
    time = 0.5 * max(r.duration for r in before.routes)
    progress = planned_progress(before, time)
    after = replan(before, progress, Changes(lost=frozenset({"usv-5"})))
    again = swath(progress.tracks, 80.0).intersection(swath(lines(after), 80.0)).area
    assert again < 0.1 * swath(progress.tracks, 80.0).area


def test_new_obstacle_is_avoided():
    """An obstacle that appears is kept clear of by all that is driven from then on."""
    before = plan("west_ant_island")
    wreck = Obstacle("wreck", box(500, 700, 900, 1000))
    after = replan(before, planned_progress(before, 3000.0), Changes(obstacles=(wreck,)))
    for vehicle, route in zip(after.vehicles, after.routes, strict=True):
        assert shapely.LineString(route.xyz[:, :2]).distance(wreck.polygon) >= vehicle.clearance - 1e-6


def test_all_but_one():
    """One vehicle of five does what its battery allows and comes home; the rest is told as an area."""
    before = plan("west_ant_island")
    after = replan(before, planned_progress(before, 5000.0), Changes(lost=frozenset({"usv-1", "usv-2", "usv-3", "usv-4"})))
    assert len(after.routes) == 1
    assert not after.feasible
    assert "can no longer be covered: the energy left does not suffice" in after.reasons[0].why
    assert not shortfalls(after.vehicles[0], after.routes[0])
    told = next(layer for layer in after.layers if layer.name == "undone")
    assert shapely.area(told.geometries).sum() == pytest.approx(after.figures["undone_m2"])


def test_joining():
    """A vehicle that joins takes a part."""
    before = plan("farm_survey")
    fresh = replace(before.vehicles[0], id="uav-9", start=(0.0, -250.0))
    after = replan(before, planned_progress(before, 200.0), Changes(joined=(fresh,)))
    assert after.vehicle("uav-9")
    assert len(after.routes) == 4
    assert max(r.duration for r in after.routes) < max(r.duration for r in before.routes) - 200.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (Changes(lost=frozenset({"usv-9"})), "unknown vehicle 'usv-9'"),
        (Changes(gone=frozenset({"atlantis"})), "unknown obstacle"),
        (Changes(lost=frozenset(f"usv-{i}" for i in range(1, 6))), "nobody is left"),
    ],
)
def test_refusals(changes, words):
    """What is not in the plan, and a fleet with nobody left, are refused in one line."""
    before = plan("west_ant_island")
    with pytest.raises(InputError, match=words):
        replan(before, planned_progress(before, 100.0), changes)


def test_start_inside():
    """A vehicle in what appears is refused by name; one within its clearance of it goes straight out, and is clear then."""
    before = plan("west_ant_island")
    progress = planned_progress(before, 3000.0)
    x, y, _ = progress.positions["usv-2"]
    with pytest.raises(InputError, match="vehicle 'usv-2' is inside obstacle 'wreck'"):
        replan(before, progress, Changes(obstacles=(Obstacle("wreck", box(x - 5, y - 5, x + 5, y + 5)),)))
    near = 0.4 * before.vehicle("usv-2").clearance
    beside = Obstacle("wreck", box(x + near, y - 20, x + near + 40, y + 20))
    after = replan(before, progress, Changes(obstacles=(beside,)))
    route = next(r for r in after.routes if r.vehicle == "usv-2")
    assert np.allclose(route.xyz[0, :2], (x, y))
    assert shapely.LineString(route.xyz[:, :2]).distance(beside.polygon) >= near - 1e-6
    assert shapely.LineString(route.xyz[1:, :2]).distance(beside.polygon) >= before.vehicle("usv-2").clearance - 1e-3


def test_who_has_landed_does_not_set_out_to_come_home_by_inches():
    """A vehicle that stands a few centimetres from its end, with nothing left to do, stays there."""
    before = plan()
    home = planned_progress(before, 1e5)
    off = replace(home, positions={v: (x + 0.1, y - 0.1, 0.0) for v, (x, y, _) in home.positions.items()})
    after = replan(before, off, anew=True)
    assert [len(r.waypoints) for r in after.routes] == [1] * len(after.routes)
    assert after.feasible
