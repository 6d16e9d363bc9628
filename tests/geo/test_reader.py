"""From GeoJSON to a scenario: what is repaired, what is refused, and in which words."""

import copy
import json
import runpy
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.properties import json_schema
from quarterdeck.geo.reader import examine, read_scenario

ROOT = Path(__file__).parents[2]
SITES = sorted((ROOT / "data").glob("*.geojson"))


def feature(role, coordinates, kind="Polygon", **properties):
    """Return a feature."""
    return {
        "type": "Feature",
        "properties": {"role": role, **properties},
        "geometry": {"type": kind, "coordinates": coordinates},
    }


def square(lon, lat, size=0.01):
    """Return a closed ring."""
    return [[lon, lat], [lon + size, lat], [lon + size, lat + size], [lon, lat + size], [lon, lat]]


def site(lon=5.0, lat=52.0):
    """Return a small good site: an area with an islet, and two vehicles."""
    return {
        "type": "FeatureCollection",
        "features": [
            feature("area", [square(lon, lat)]),
            feature("obstacle", [square(lon + 0.004, lat + 0.004, 0.002)], id="islet"),
            feature("vehicle", [lon + 0.001, lat + 0.001], "Point", id="a", share=0.5),
            feature("vehicle", [lon + 0.002, lat + 0.001], "Point", id="b", share=0.5),
        ],
    }


def write(tmp_path, document):
    """Write a document and return its path."""
    path = tmp_path / "site.geojson"
    path.write_text(document if isinstance(document, str) else json.dumps(document), encoding="utf-8")
    return path


@pytest.mark.parametrize("path", SITES, ids=lambda p: p.stem)
def test_sample_sites_read_and_fit_the_schema(path):
    """Every sample site reads, and fits the JSON Schema that ships."""
    assert read_scenario(path).vehicles
    jsonschema.validate(json.loads(path.read_text()), json_schema())


def test_generated_files_are_current():
    """docs/geojson.md and the shipped schema are what `make docs` makes."""
    made = runpy.run_path(str(ROOT / "docs" / "generate.py"))
    assert (ROOT / "docs" / "geojson.md").read_text(encoding="utf-8") == made["geojson_page"]()
    assert (ROOT / "geo" / "site.schema.json").read_text(encoding="utf-8") == made["schema_text"]()


def test_published_areas():
    """The harbour has the paper's 196,000 m2, the sea area by West Ant Island 20 km2 (ecdis-sa-darp, section IV)."""
    assert abs(read_scenario(ROOT / "data" / "dalian_harbour.geojson").site.coverable.area - 196_000) < 100
    assert abs(read_scenario(ROOT / "data" / "west_ant_island.geojson").site.coverable.area - 20e6) < 1000


@settings(max_examples=200)
@given(st.floats(-180, 179.99), st.floats(-80, 80), st.floats(-50_000, 50_000), st.floats(-50_000, 50_000))
def test_frame_round_trip(lon, lat, x, y):
    """Metres to degrees and back is exact to 0.1 mm over 100 km, over any meridian and at 80 degrees."""
    frame = Frame(lon, lat)
    assert np.allclose(frame.to_metres(frame.to_degrees([[x, y]])), [[x, y]], atol=1e-4)


@pytest.mark.parametrize(("lon", "lat"), [(179.995, 10.0), (-180.0, -20.0), (20.0, 75.0), (20.0, -75.0), (0.0, 0.0)])
def test_anywhere_on_earth(tmp_path, lon, lat):
    """A site across the antimeridian, or far north, has the same shape as anywhere else."""
    document = site(lon, lat)
    for f in document["features"]:
        rings = f["geometry"]["coordinates"]
        for p in rings[0] if isinstance(rings[0], list) else [rings]:
            p[0] = round((p[0] + 180) % 360 - 180, 9)
    scenario = read_scenario(write(tmp_path, document))
    width = np.ptp(np.array(scenario.site.area.geoms[0].exterior.coords)[:, 0])
    assert abs(width - 0.01 * 111_320 * np.cos(np.radians(lat))) < 5
    assert len(scenario.site.area.geoms) == 1


def test_cut_at_the_antimeridian(tmp_path):
    """An area that RFC 7946 cuts in two at 180 degrees is one area again."""
    document = site(179.99, 10.0)
    document["features"] = [
        feature("area", [[square(179.99, 10.0)], [square(-180.0, 10.0)]], "MultiPolygon"),
        feature("vehicle", [179.995, 10.005], "Point"),
    ]
    assert len(read_scenario(write(tmp_path, document)).site.area.geoms) == 1


@settings(max_examples=20, deadline=None)
@given(st.randoms())
def test_order_does_not_matter(tmp_path_factory, random):
    """Neither the order of features nor where a ring begins or which way it runs changes the scenario."""
    document = site()
    before = read_scenario(write(tmp_path_factory.mktemp("a"), document))
    vehicles = [f for f in document["features"] if f["properties"]["role"] == "vehicle"]
    others = [f for f in document["features"] if f not in vehicles]
    for f in others:
        ring = f["geometry"]["coordinates"][0][:-1]
        cut = random.randrange(len(ring))
        ring = ring[cut:] + ring[:cut]
        ring = ring[::-1] if random.random() < 0.5 else ring
        f["geometry"]["coordinates"][0] = [*ring, ring[0], ring[0]]
    mixed = others + vehicles
    random.shuffle(mixed)
    document["features"] = [f for f in mixed if f not in vehicles] + vehicles
    after = read_scenario(write(tmp_path_factory.mktemp("b"), document))
    assert after.frame == before.frame
    assert after.site.coverable.symmetric_difference(before.site.coverable).area < 1e-6
    assert after.vehicles == before.vehicles


def at(*path):
    """Return a function that sets a value deep in a document."""

    def put(document, value):
        for key in path[:-1]:
            document = document[key]
        document[path[-1]] = value

    return put


BAD = {
    "text": ("hello", "not JSON"),
    "nan": ('{"type": "FeatureCollection", "features": [NaN]}', "finite"),
    "type": ('{"type": "Topology"}', "FeatureCollection"),
    "empty": ('{"type": "FeatureCollection", "features": []}', "at least one"),
    "crs": (lambda d: at("crs")(d, {"properties": {"name": "EPSG:3857"}}), "WGS84"),
    "crossing": (lambda d: d["features"][0]["geometry"]["coordinates"][0].insert(2, [5.0, 52.02]), "crosses itself"),
    "unclosed": (lambda d: d["features"][0]["geometry"]["coordinates"][0].pop(), "not closed"),
    "few": (lambda d: at("features", 0, "geometry", "coordinates")(d, [[[5, 52], [6, 52], [5, 52]]]), "at least 4"),
    "latitude": (lambda d: at("features", 2, "geometry", "coordinates")(d, [52.0, 105.0]), "order swapped"),
    "longitude": (lambda d: at("features", 2, "geometry", "coordinates")(d, [190.0, 10.0]), "longitude 190"),
    "twice": (lambda d: at("features", 3, "properties", "id")(d, "a"), "its own"),
    "role": (lambda d: at("features", 0, "properties", "role")(d, "aera"), "did you mean 'area'"),
    "domain": (lambda d: at("features", 2, "properties", "domain")(d, "surfce"), "did you mean 'surface'"),
    "model": (lambda d: at("features", 2, "properties", "model")(d, "oter"), "did you mean 'otter'"),
    "misspelt": (lambda d: at("features", 2, "properties", "clearence")(d, 3), "did you mean 'clearance'"),
    "inside": (lambda d: at("features", 2, "geometry", "coordinates")(d, [5.005, 52.005]), "inside obstacle 'islet'"),
    "far": (lambda d: at("features", 2, "geometry", "coordinates")(d, [60.0, 10.0]), "km from the site"),
    "speed": (lambda d: at("features", 2, "properties", "speed")(d, "fast"), "speed must be a number"),
    "negative": (lambda d: at("features", 2, "properties", "speed")(d, -1), "speed must be a number above 0"),
    "continent": (lambda d: at("features", 0, "geometry", "coordinates")(d, [square(-10, 40, 30)]), "split it"),
    "geometry": (lambda d: at("features", 0, "geometry")(d, None), "must be a Polygon"),
    "norole": (lambda d: at("features", 0, "properties")(d, None), "has no role"),
    "coordinates": (lambda d: at("features", 0, "geometry", "coordinates")(d, "x"), "features[0]"),
    "hole": (lambda d: d["features"][0]["geometry"]["coordinates"].append(square(6, 52)), "hole lies outside"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_line(tmp_path, name):
    """Each kind of bad input is refused in one line that says what to do."""
    change, words = BAD[name]
    document = change if isinstance(change, str) else copy.deepcopy(site())
    if not isinstance(change, str):
        change(document)
    with pytest.raises(InputError) as error:
        read_scenario(write(tmp_path, document))
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_all_problems_are_found(tmp_path):
    """`check` lists every problem, not the first alone."""
    document = site()
    document["features"][2]["properties"]["speed"] = "fast"
    document["features"][3]["properties"]["domain"] = "sea"
    assert len(examine(write(tmp_path, document))[1]) == 2
