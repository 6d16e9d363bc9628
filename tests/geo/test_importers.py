"""Sites from other people's files: our own exports come back, real samples are read, damage is one line."""

import json
from pathlib import Path

import numpy as np
import pytest
import shapely
from fuzzing import samples
from hypothesis import given, settings
from hypothesis import strategies as st

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.importers import as_geojson
from quarterdeck.geo.reader import read_scenario

PLANS = Path(__file__).resolve().parents[2].parent / "shared" / "formats" / "mavsdk_plans"
KML, GPX = samples.KML.decode(), samples.GPX.decode()


def plan(**mission):
    """Return a .plan with a survey, a fence and an exclusion circle."""
    survey = {"type": "ComplexItem", "complexItemType": "survey", "polygon": [[54, 10], [54, 10.01], [54.01, 10.01]]}
    fence = {"inclusion": True, "polygon": [[53.99, 9.99], [53.99, 10.02], [54.02, 10.02], [54.02, 9.99]]}
    circle = {"inclusion": False, "circle": {"center": [54.002, 10.006], "radius": 50.0}}
    return {
        "fileType": "Plan",
        "mission": {"items": [survey], "plannedHomePosition": [54.001, 10.002, 0], "vehicleType": 11} | mission,
        "geoFence": {"polygons": [fence], "circles": [circle]},
    }


def test_kml_names_say_what_shapes_are(tmp_path):
    """A polygon is an area, in a folder of no-fly zones an obstacle; points are tasks, or starts by name."""
    path = tmp_path / "site.kml"
    path.write_text(KML)
    scenario = read_scenario(path)
    assert [a.id for a in scenario.site.areas] == ["field"]
    assert len(scenario.site.obstacles) == 1
    assert [v.id for v in scenario.vehicles] == ["north"]
    assert [t.id for t in scenario.tasks] == ["pump"]
    assert scenario.frame.to_degrees(np.array([scenario.tasks[0].position]))[0] == pytest.approx([10.002, 54.002], abs=1e-9)


def test_gpx_points_are_tasks_with_names_of_their_own(tmp_path):
    """Waypoints and route points, names made different."""
    path = tmp_path / "points.gpx"
    path.write_text(GPX)
    assert [t.id for t in read_scenario(path).tasks] == ["a", "a-2", "task"]


def test_plan_gives_survey_fence_exclusion_and_home(tmp_path):
    """The survey is the area, the fence the operating area, a circle an obstacle no smaller than it, home the start."""
    path = tmp_path / "m.plan"
    path.write_text(json.dumps(plan()))
    scenario = read_scenario(path)
    assert [v.domain for v in scenario.vehicles] == ["surface"]
    (obstacle,) = scenario.site.obstacles
    centre = shapely.Point(scenario.frame.to_metres(np.array([[10.006, 54.002]]))[0])
    assert obstacle.polygon.buffer(0.01).covers(centre.buffer(50.0))
    assert scenario.site.operating.contains(scenario.site.area)


def test_a_fence_alone_is_the_area(tmp_path):
    """A .plan without a survey is covered within its fence."""
    path = tmp_path / "m.plan"
    path.write_text(json.dumps(plan(items=[])))
    scenario = read_scenario(path)
    assert scenario.site.area.area == pytest.approx(scenario.site.operating.area)


@pytest.mark.skipif(not PLANS.exists(), reason=f"{PLANS} is absent: no real .plan was read")
def test_a_real_survey(tmp_path):
    """QGroundControl's own survey gives an area with the spacing of its camera."""
    scenario = read_scenario(PLANS / "qgroundcontrol_sample_with_survey.plan")
    assert scenario.site.area.area > 1000.0
    assert scenario.spacing > 1.0
    assert scenario.vehicles[0].domain == "aerial"


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"<kml", "no sound XML"),
        (b"<html></html>", "<html>"),
        (b"<kml></kml>", "no polygon"),
        (b"PK\x03\x04 no zip", "damaged KMZ"),
        (b'{"fileType": "Plan"}', "damaged .plan"),
        (KML.replace("10.001,54.001,3", "x,54").encode(), "not a number"),
        (GPX.replace('lat="54.1"', "").encode(), "without lon and lat"),
    ],
)
def test_damage_is_one_line(data, words):
    """What cannot be read is said in one line."""
    with pytest.raises(InputError, match=words) as error:
        as_geojson(data)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("radius", [0, -5, 1e300, 10**400, "50", None, [50]])
def test_circles_that_are_none(radius):
    """A fence of no size, or of one beyond Earth's, is damage."""
    document = plan()
    document["geoFence"]["circles"][0]["circle"]["radius"] = radius
    with pytest.raises(InputError, match=r"damaged \.plan"):
        as_geojson(json.dumps(document).encode())


@settings(deadline=None, max_examples=200)
@given(st.integers(0, len(KML)), st.integers(0, len(KML)), st.sampled_from(["", "<", "&x;", "\0", "9e999,"]))
def test_no_damage_makes_a_traceback(start, end, patch):
    """KML with a piece cut out and another put in is read or refused, never anything else."""
    damaged = KML[: min(start, end)] + patch + KML[max(start, end) :]
    said = ""
    try:
        as_geojson(damaged.encode())
    except InputError as error:
        said = str(error)
    assert "\n" not in said
