"""Cameras and sonars against figures worked by hand and the pinhole itself."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.sensors import CAMERAS, fit, swath


def test_phantom_4_pro_at_100_metres():
    """Its maker's formula: ground resolution is the altitude over 36.5 centimetres a pixel, near enough."""
    sensor, altitude = fit({"kind": "camera", "camera": "dji-phantom-4-pro", "side_overlap": 0.6}, 100.0)
    assert altitude == 100.0
    assert sensor.parameters["ground_resolution"] == pytest.approx(1.0 / 36.5, rel=0.01)
    assert sensor.swath == pytest.approx(150.0 * 0.4)
    assert sensor.parameters["trigger_distance"] == pytest.approx(100.0 * 0.3)


@pytest.mark.parametrize(
    ("name", "equivalent"), [("dji-phantom-4-pro", 24.0), ("dji-mavic-3e", 24.0), ("sony-rx1r2", 35.0)]
)
def test_equivalent_focal_lengths_are_the_makers(name, equivalent):
    """By the diagonals, 43.27 mm of a 35 mm picture, the focal length is that which the maker gives, within 3 %."""
    focal, width, height, *pixels = CAMERAS[name]
    assert focal * math.hypot(36, 24) / math.hypot(width, height) == pytest.approx(equivalent, rel=0.03)
    assert pixels[0] / pixels[1] == pytest.approx(width / height, rel=0.01)


@given(st.sampled_from(sorted(CAMERAS)), st.floats(0.002, 1.0))
def test_resolution_gives_the_altitude_that_gives_it(name, resolution):
    """The altitude from a ground resolution yields that resolution, and a swath of so many pixels."""
    sensor, altitude = fit({"kind": "camera", "camera": name, "ground_resolution": resolution, "side_overlap": 0.0}, None)
    again, _ = fit({"kind": "camera", "camera": name, "side_overlap": 0.0}, altitude)
    assert again.parameters["ground_resolution"] == pytest.approx(resolution)
    assert sensor.swath == pytest.approx(resolution * CAMERAS[name][3])
    assert swath(sensor, 2 * altitude) == pytest.approx(2 * sensor.swath)


@given(st.floats(1.0, 500.0), st.floats(10.0, 160.0))
def test_multibeam_is_a_triangle(depth, angle):
    """The swath is the base of the isosceles triangle under the boat."""
    sensor, _ = fit({"kind": "sonar", "depth": depth, "angle": angle, "overlap": 0.0}, None)
    assert math.degrees(2 * math.atan(sensor.swath / 2 / depth)) == pytest.approx(angle)


def test_side_scan_is_a_right_angle():
    """Slant range 50 m from 30 m above the bottom reaches 40 m to each side."""
    sensor, _ = fit({"kind": "sonar", "range": 50, "height": 30, "overlap": 0.0}, None)
    assert sensor.swath == pytest.approx(80.0)


@pytest.mark.parametrize(
    ("given_", "words"),
    [
        ({"kind": "swath"}, "swath"),
        ({"kind": "camera"}, "focal_length"),
        ({"kind": "camera", "camera": "dji-phantom-4"}, "did you mean"),
        ({"kind": "camera", "camera": "sony-rx1r2", "side_overlap": 70}, "from 0 to 0.95"),
        ({"kind": "camera", "camera": "sony-rx1r2"}, "altitude"),
        ({"kind": "camera", "camera": "sony-rx1r2", "ground_resolution": 250}, "metres a pixel"),
        ({"kind": "sonar", "angle": 120}, "depth"),
        ({"kind": "sonar", "angle": 180, "depth": 5}, "below 180"),
        ({"kind": "sonar", "range": 20, "height": 20}, "height"),
    ],
)
def test_what_is_missing_or_wrong_is_named(given_, words):
    """One line names the figure."""
    with pytest.raises(InputError, match=words):
        fit(given_, None)
