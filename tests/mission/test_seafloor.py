"""Multibeam lines that follow the depth: overlap kept everywhere, by a bottom that is known exactly."""

import json
import math

import numpy as np
import pytest

from quarterdeck.geo.depths import LEAST, depths_at
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.reader import examine, read_scenario
from quarterdeck.geo.writer import site_text
from quarterdeck.mission.lines import plan_lines

FRAME = Frame(5.0, 58.0)


def slope(x, y):
    """A bottom that falls from 4 m in the south to 20 m in the north, a little to the east: a plane."""
    return 12.0 + 0.03 * y + 0.004 * x


def bay(path, *, depth=None, boats=1, soundings=150, **sensor):
    """Write a bay of 600 by 400 metres with soundings on the plane, its corners' among them."""
    rng = np.random.default_rng(1)
    corners = [(-320, -220), (320, -220), (320, 220), (-320, 220)]
    places = np.array([*corners, *rng.uniform((-320, -220), (320, 220), (soundings, 2))], dtype=float)

    def feature(role, kind, xy, **properties):
        at = FRAME.to_degrees(np.array(xy, dtype=float)).tolist()
        coordinates = at[0] if kind == "Point" else [at]
        return {"type": "Feature", "geometry": {"type": kind, "coordinates": coordinates},
                "properties": {"role": role} | properties}  # fmt: skip

    area = [(-300, -200), (300, -200), (300, 200), (-300, 200), (-300, -200)]
    features = [feature("area", "Polygon", area)]
    features += [feature("sounding", "Point", [p], depth=slope(*p)) for p in places.tolist()] if soundings else []
    given = {"kind": "sonar", "angle": 120, "overlap": 0.2} | sensor | ({"depth": depth} if depth else {})
    features += [feature("vehicle", "Point", [(-310, 20 * i)], id=f"usv-{i}", sensor=given) for i in range(boats)]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return read_scenario(path)


def test_depths_between_soundings_are_those_of_the_plane(tmp_path):
    """Linear within the soundings, the nearest beyond them, never below the least; a row of soundings works too."""
    scenario = bay(tmp_path / "s.geojson")
    places = np.random.default_rng(2).uniform((-300, -200), (300, 200), (500, 2))
    soundings = np.array(scenario.soundings)
    assert np.allclose(depths_at(soundings, places), slope(*places.T), atol=1e-2)
    assert depths_at(soundings, np.array([[400.0, 400.0]]))[0] == pytest.approx(slope(320, 220), abs=1e-2)
    assert depths_at(np.array([[0.0, 0.0, -3.0]]), places)[0] == LEAST
    row = np.array([[0.0, 0.0, 2.0], [10.0, 0.0, 4.0], [20.0, 0.0, 6.0]])
    assert depths_at(row, np.array([[9.0, 50.0]]))[0] == 4.0


@pytest.mark.parametrize("boats", [1, 2])
def test_lines_follow_the_depth_and_keep_the_overlap(tmp_path, boats):
    """Seen from the lines alone: every place away from the border lies within 80 % of a half fan of some line."""
    mission = plan_lines(bay(tmp_path / "s.geojson", boats=boats), angle=0.0)
    places = np.random.default_rng(3).uniform((-250, -160), (250, 160), (4000, 2))
    half = slope(*places.T) * math.tan(math.radians(60.0))
    use = np.full(len(places), np.inf)
    for route in mission.routes:
        xy = route.xyz[:, :2]
        for i in np.flatnonzero(route.survey):
            a, b = xy[i - 1], xy[i]
            inside = (places[:, 0] >= min(a[0], b[0])) & (places[:, 0] <= max(a[0], b[0]))
            use[inside] = np.minimum(use[inside], np.abs(places[inside, 1] - a[1]) / half[inside])
    assert use.max() <= 0.8 + 1e-3
    assert mission.figures["least_overlap"] >= 0.2 - 1e-3
    assert mission.figures["poc"] > 0.995
    rows = np.unique(np.round([y for _, y in mission.routes[0].xyz[mission.routes[0].survey, :2]], 3))
    gaps = np.diff(rows)
    if boats == 1:
        assert gaps.max() > 2.5 * gaps.min()
        wide, close = rows[np.argmax(gaps)], rows[np.argmin(gaps)]
        assert wide > close  # the north is deep


def test_it_is_less_to_drive_than_by_the_least_depth(tmp_path):
    """By soundings there is less than 60 % of the lines' length that the least depth everywhere asks for."""
    sounded = plan_lines(bay(tmp_path / "a.geojson"))
    fixed = plan_lines(bay(tmp_path / "b.geojson", depth=slope(-300, -200)))
    assert sounded.figures["length"] < 0.6 * fixed.figures["length"]
    assert "least_overlap" not in fixed.figures
    assert fixed.parameters["spacing"] == pytest.approx(2 * slope(-300, -200) * math.tan(math.radians(60)) * 0.8)


def test_two_boats_are_done_at_about_the_same_time(tmp_path):
    """The one in the shoal half gets less of the area, for it has more lines to drive."""
    routes = plan_lines(bay(tmp_path / "s.geojson", boats=2)).routes
    times = [r.duration for r in routes]
    assert max(times) < 1.25 * min(times)


def test_a_spacing_that_is_given_holds(tmp_path):
    """With --spacing lines are that far apart, whatever the depth."""
    mission = plan_lines(bay(tmp_path / "s.geojson"), spacing=20.0, angle=0.0)
    assert mission.spacing == 20.0
    rows = np.unique(np.round(mission.routes[0].xyz[mission.routes[0].survey, 1], 3))
    assert np.allclose(np.diff(rows), 20.0, atol=0.01)


def test_soundings_are_written_and_read(tmp_path):
    """A site gives its soundings back; one without a depth is a problem with its place; without any, depth is needed."""
    scenario = bay(tmp_path / "s.geojson", soundings=5)
    (tmp_path / "again.geojson").write_text(site_text(scenario))
    again = read_scenario(tmp_path / "again.geojson")
    assert np.allclose(again.soundings, scenario.soundings, atol=1e-3)
    assert again.vehicles[0].sensor.swath == pytest.approx(scenario.vehicles[0].sensor.swath)
    text = (tmp_path / "s.geojson").read_text().replace('"depth"', '"deep"', 1)
    (tmp_path / "bad.geojson").write_text(text)
    assert "a sounding needs its depth" in examine(tmp_path / "bad.geojson")[1][0]
    with pytest.raises(InputError, match='"depth" is missing'):
        bay(tmp_path / "none.geojson", soundings=0)
