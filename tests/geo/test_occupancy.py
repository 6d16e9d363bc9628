"""Occupancy maps: ROS files read and written, thresholds, rotation, inflation."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image
from shapely import MultiPolygon, Point, box

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.occupancy import FREE, OCCUPIED, UNKNOWN, Occupancy, read_map, site_occupancy, write_map
from quarterdeck.geo.scenario import Obstacle, Site

STATES = st.sampled_from([FREE, OCCUPIED, UNKNOWN])


@settings(deadline=None, max_examples=25)
@given(
    arrays(np.int8, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=STATES), st.floats(-3, 3), st.floats(0.01, 5)
)
def test_a_written_map_reads_back(tmp_path_factory, cells, yaw, resolution):
    """What is written is read back, cell for cell and figure for figure."""
    path = tmp_path_factory.mktemp("map") / "twin.yaml"
    map_ = Occupancy(cells, resolution, (1.25, -3.5), yaw)
    back = read_map(write_map(map_, path))
    np.testing.assert_array_equal(back.cells, cells)
    assert (back.resolution, back.origin, back.yaw) == (resolution, (1.25, -3.5), yaw)


def test_thresholds_negate_and_rows(tmp_path):
    """Dark is occupied, between the thresholds unknown, negate turns that around; a picture's top row is last."""
    Image.fromarray(np.array([[0, 120], [255, 254]], np.uint8)).save(tmp_path / "m.pgm")
    text = "image: m.pgm\nresolution: 0.1\norigin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.196\nnegate: "
    (tmp_path / "m.yaml").write_text(text + "0\n")
    np.testing.assert_array_equal(read_map(tmp_path / "m.yaml").cells, [[FREE, FREE], [OCCUPIED, UNKNOWN]])
    (tmp_path / "m.yaml").write_text(text + "1\n")
    np.testing.assert_array_equal(read_map(tmp_path / "m.yaml").cells, [[OCCUPIED, OCCUPIED], [FREE, UNKNOWN]])


def test_a_turned_map_finds_its_cells():
    """A map turned by 90 degrees has its columns along north; to cells and back is the identity."""
    map_ = Occupancy(np.zeros((4, 6), np.int8), 0.5, (10.0, 20.0), math.pi / 2)
    np.testing.assert_allclose(map_.to_cells(np.array([[9.9, 21.0]])), [[0.2, 2.0]], atol=1e-12)
    points = np.random.default_rng(0).uniform(-5, 5, (20, 2))
    np.testing.assert_allclose(map_.to_metres(map_.to_cells(points)), points, atol=1e-12)


def test_inflation_keeps_the_radius():
    """A cell is free to a robot of radius 1 m if its centre is at least that from every blocked cell's centre."""
    cells = np.zeros((21, 21), np.int8)
    cells[10, 10] = OCCUPIED
    free = Occupancy(cells, 0.2).free(1.0)
    rows, columns = np.indices(cells.shape)
    np.testing.assert_array_equal(free, np.hypot(rows - 10, columns - 10) * 0.2 >= 1.0)


def test_a_site_becomes_its_map():
    """Free cells of a site's map are those whose centres are in the operating area and off obstacles that block."""
    blocks = frozenset({"ground"})
    site = Site((), MultiPolygon([box(0, 0, 20, 10)]), (Obstacle("hall", box(5, 2, 9, 7), blocks),))
    map_ = site_occupancy(site, "ground", 0.5)
    rows, columns = np.indices(map_.cells.shape)
    centres = map_.to_metres(np.column_stack([rows.ravel(), columns.ravel()]) + 0.5)
    expected = [site.navigable("ground").contains(Point(c)) for c in centres]
    np.testing.assert_array_equal((map_.cells == FREE).ravel(), expected)
    assert (site_occupancy(site, "aerial", 0.5).cells == FREE).sum() == 800


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("resolution: 0.1\n", "is no map_server map"),
        ("image: m.pgm\norigin: [0, 0, 0]\n", "resolution must be a number"),
        ("image: m.pgm\nresolution: -1\norigin: [0, 0, 0]\n", "must be above 0"),
        ("image: m.pgm\nresolution: 1\norigin: [0, 0]\n", "origin must be"),
        ("image: gone.pgm\nresolution: 1\norigin: [0, 0, 0]\n", "cannot be read as an image"),
        ("image: m.pgm\nresolution: 1\nnegate: 2\norigin: [0, 0, 0]\n", "negate must be"),
        (": [", "cannot be read"),
    ],
)
def test_damaged_maps_are_one_line(tmp_path, text, message):
    """Each way to spoil a map is one line that names the file."""
    (tmp_path / "m.yaml").write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read_map(tmp_path / "m.yaml")
    assert "\n" not in str(caught.value)
