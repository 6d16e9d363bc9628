"""What replanning takes from logs and changes: the given up, low batteries, all withdrawn; and what is told of the rest."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from shapely import Point

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.version import VERSION
from quarterdeck.mission.changes import Changes, read_changes
from quarterdeck.mission.cover import cover
from quarterdeck.mission.guards import plan_guards
from quarterdeck.mission.progress import planned_progress
from quarterdeck.mission.recorded import recorded_progress
from quarterdeck.mission.replan import replan
from quarterdeck.mission.tracks import read_tracks

YARD = Path(__file__).parents[2] / "data" / "plant_yard.geojson"


@cache
def survey():
    """Return a coarse survey of the yard by two rovers."""
    return cover(read_scenario(YARD), spacing=8.0)


@cache
def watch():
    """Return a plan of guards of the yard."""
    return plan_guards(read_scenario(YARD), range=20.0)


def logged(mission, folder, seconds):
    """Return the file of what each vehicle did of its plan, a position a second."""
    rows = ["time,vehicle,lon,lat,energy"]
    for t in np.arange(0.0, seconds):
        now = planned_progress(mission, float(t))
        for vehicle, (x, y, _) in now.positions.items():
            lon, lat = mission.frame.to_degrees(np.array([[x, y]]))[0]
            rows.append(f"{t},{vehicle},{lon:.9f},{lat:.9f},{now.energy[vehicle]:.6f}")
    path = folder / "log.csv"
    path.write_text("\n".join(rows))
    return str(path)


def test_the_log_of_who_was_given_up_tells_where_it_is(tmp_path):
    """A vehicle that drove on unheard comes back where its log ends, and what it surveyed is not driven again."""
    before = survey()
    heard = replan(before, planned_progress(before, 0.0), Changes(lost=frozenset({"ugv-2"})))
    record = read_tracks(heard, [logged(before, tmp_path, 300.0)])
    assert any(note.startswith("ugv-2: given up by this plan; where it is") for note in record.notes)
    progress, _ = recorded_progress(heard, record.tracks, 299.0, lost=record.lost)
    place = planned_progress(before, 299.0).positions["ugv-2"]
    after = replan(heard, progress, Changes(back={"ugv-2": None}))
    assert Point(after.vehicle("ugv-2").start).distance(Point(place[:2])) < 0.1
    without, _ = recorded_progress(heard, record.tracks, 299.0)
    blind = replan(heard, without, Changes(back={"ugv-2": place[:2]}))
    assert after.figures["length"] < blind.figures["length"] - 100.0


def test_lost_later_than_now_is_refused(tmp_path):
    """Who is said to be lost in the future is told in one line, whatever the progress is made of."""
    mission = survey()
    with pytest.raises(InputError, match=r"'ugv-2': lost since 900 s, but it is 300 s now"):
        planned_progress(mission, 300.0, stopped={"ugv-2": 900.0})
    record = read_tracks(mission, [logged(mission, tmp_path, 60.0)])
    with pytest.raises(InputError, match=r"'ugv-2': lost since 900 s"):
        recorded_progress(mission, record.tracks, 50.0, stopped={"ugv-2": 900.0})


def test_nothing_left_to_see_sends_everybody_home():
    """Where the whole area of a guards plan is withdrawn, robots go home from where they are."""
    mission = watch()
    after = replan(mission, planned_progress(mission, 80.0), Changes(withdrawn=frozenset({mission.site.areas[0].id})))
    assert after.feasible
    for vehicle, route in zip(after.vehicles, after.routes, strict=True):
        assert np.hypot(*np.subtract(route.xyz[-1, :2], vehicle.home)) < 0.01
        assert not [w for w in route.waypoints if w.task]
    assert after.figures["guards"] == 0


def test_guards_plans_tell_version_and_energy():
    """A guards plan and what is replanned of it say what made them, and what they cost."""
    mission = watch()
    after = replan(mission, planned_progress(mission, 80.0), Changes(lost=frozenset({"ugv-2"})))
    for plan in (mission, after):
        assert plan.version == VERSION
        assert plan.figures["energy"] == pytest.approx(sum(r.energy for r in plan.routes))
    assert after.figures["undone_m2"] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("plan", [survey, watch])
def test_figures_of_the_rest_are_of_the_rest(plan):
    """Halfway all figures are of what is left; all that is covered in the end still counts."""
    mission = plan()
    after = replan(mission, planned_progress(mission, mission.routes[0].duration / 2))
    assert after.figures["length"] == pytest.approx(mission.figures["length"] / 2, rel=0.15)
    assert after.figures["energy"] == pytest.approx(sum(r.energy for r in after.routes))
    assert not {"turns", "shares", "ratio", "paper"} & after.figures.keys()
    if mission.spacing:
        assert after.figures["poc"] == pytest.approx(mission.figures["poc"], abs=1e-3)


def test_a_low_battery_is_told_and_relieved(tmp_path):
    """With little left in one battery its robot drives no farther than that, and the other does the rest."""
    mission = survey()
    properties = {"role": "vehicle", "id": "ugv-2", "change": "set", "battery": 10.0}
    path = tmp_path / "low.geojson"
    path.write_text(
        json.dumps(
            {"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": None, "properties": properties}]}
        )
    )
    after = replan(mission, planned_progress(mission, 100.0), read_changes(path, mission))
    assert after.feasible, after.reasons
    spent = {r.vehicle: r.energy for r in after.routes}
    assert spent["ugv-2"] <= 8.0  # a fifth is kept
    assert spent["ugv-1"] > 30.0
