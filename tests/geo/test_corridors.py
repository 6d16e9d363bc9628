"""An area along a line: what it holds, where it ends, and what is refused in which words."""

import json

import jsonschema
import numpy as np
import pytest
import shapely
from shapely import LineString

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.geojson import read_corridor
from quarterdeck.geo.properties import json_schema
from quarterdeck.geo.reader import read_scenario

FRAME = Frame(5.0, 52.0)
BEND = np.array([[0.0, 0.0], [1000.0, 0.0], [1000.0, 800.0], [300.0, 400.0]])


def degrees(xy, frame=FRAME):
    """Return metres as a list of positions."""
    return frame.to_degrees(np.asarray(xy, dtype=float)).tolist()


def site(kind, coordinates, **properties):
    """Return a site with one area along a line, and a vehicle where it begins."""
    area = {"type": kind, "coordinates": coordinates}
    start = {"type": "Point", "coordinates": degrees([[0, 0]])[0]}
    features = [
        {"type": "Feature", "properties": {"role": "area", "spacing": 20} | properties, "geometry": area},
        {"type": "Feature", "properties": {"role": "vehicle"}, "geometry": start},
    ]
    return {"type": "FeatureCollection", "features": features}


def read(tmp_path, document):
    """Write a document and read it."""
    path = tmp_path / "site.geojson"
    path.write_text(json.dumps(document), encoding="utf-8")
    return read_scenario(path)


def test_corridor_is_what_is_near_its_line():
    """Points nearer than half the width are in, others out, but beyond its square ends; repeated positions are harmless."""
    corridor = read_corridor({"type": "LineString", "coordinates": degrees(np.repeat(BEND, 2, axis=0))}, 120.0, FRAME)
    points = np.random.default_rng(1).uniform((-100, -100), (1100, 900), (4000, 2))
    distance = shapely.distance(LineString(BEND), shapely.points(points))
    beyond = (points[:, 0] < 0) | ((points - BEND[3]) @ (BEND[3] - BEND[2]) > 0)
    held = shapely.contains_xy(corridor, *points.T)
    assert held[(distance < 59.5) & ~beyond].all()
    assert not held[distance > 60.5].any()
    assert not held[points[:, 0] < -0.1].any()


def test_parts_that_meet_and_the_antimeridian_make_no_notch():
    """A line cut in two, even where the date line is, is the same corridor as the whole line."""
    frame = Frame(180.0, 10.0)
    whole = np.array([[-500.0, 0.0], [0.0, 0.0], [0.0, 500.0]])
    cut = [degrees(whole[:2], frame), degrees(whole[1:], frame)]
    cut[0][-1][0], cut[1][0][0] = 180.0, -180.0
    parts = read_corridor({"type": "MultiLineString", "coordinates": cut}, 100.0, frame)
    one = read_corridor({"type": "LineString", "coordinates": degrees(whole, frame)}, 100.0, frame)
    assert parts.symmetric_difference(one).area < 0.01
    loop = read_corridor({"type": "LineString", "coordinates": degrees([*whole, whole[0]], frame)}, 100.0, frame)
    assert loop.covers(shapely.Point(0.0, 0.0))
    assert loop.covers(shapely.Point(-530.0, -20.0))  # outside the bend where it closes: round, not notched


def test_a_site_with_a_corridor_reads_and_fits_the_schema(tmp_path):
    """Width and length give the area; the JSON Schema wants a width of a line and of nothing else."""
    line = site("LineString", degrees([[0, 0], [1000, 0]]), width=60)
    assert read(tmp_path, line).site.area.area == pytest.approx(60_000, rel=1e-4)
    jsonschema.validate(line, json_schema())
    for wrong in (site("LineString", degrees(BEND)), site("Polygon", [degrees([*BEND, BEND[0]])], width=60)):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(wrong, json_schema())


BAD = {
    "no width": (site("LineString", degrees(BEND)), 'a LineString needs the property "width"'),
    "null": (site("LineString", degrees(BEND), width=None), 'needs the property "width"'),
    "zero": (site("LineString", degrees(BEND), width=0), "width must be a number above 0"),
    "text": (site("LineString", degrees(BEND), width="20 m"), "width must be a number above 0"),
    "polygon": (site("Polygon", [degrees([*BEND, BEND[0]])], width=20), "width belongs to a LineString"),
    "one": (site("LineString", degrees(BEND[:1]), width=20), "the line has 1 positions"),
    "point": (site("MultiLineString", [degrees(BEND), degrees([[9, 9], [9, 9]])], width=20), "line 1 has no length"),
    "nested": (site("LineString", [degrees(BEND)], width=20), "the line has 1 positions"),
    "flat": (site("MultiLineString", degrees(BEND), width=20), "line 0, position 0: a position must be"),
    "wide": (site("LineString", degrees(BEND), width=1e6), "km from the site's centre"),
    "none": (site("LineString", [], width=20), "no positions"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_wrong_corridors_are_refused_in_one_line(tmp_path, name):
    """Each is refused with the feature's place and what to do."""
    document, words = BAD[name]
    with pytest.raises(InputError) as error:
        read(tmp_path, document)
    assert "features[0]" in str(error.value)
    assert words in str(error.value)
    assert "\n" not in str(error.value)
