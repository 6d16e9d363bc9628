"""The picture: it is there, of the size asked for, and shows what happened."""

import io
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from shapely import LineString, box

from quarterdeck.exporters.map_panel import legend
from quarterdeck.exporters.picture import picture
from quarterdeck.geo.frame import Frame
from quarterdeck.mission.mission import Layer, undone_layer


def pixels(png):
    image = pytest.importorskip("PIL.Image", reason="Pillow is not installed").open(io.BytesIO(png))
    return np.asarray(image.convert("RGB")).astype(int)


def near(image, colour):
    rgb = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return int((np.abs(image - rgb).max(axis=2) < 30).sum())


@pytest.mark.parametrize("frame", [None, Frame(179.9995, 75.0)])
def test_every_vehicle_is_seen(make_fleet, frame):
    """Each colour of the fleet covers pixels of the map, whatever the place."""
    image = pixels(picture(make_fleet(4, frame), width=900, height=600))
    assert image.shape == (600, 900, 3)
    assert all(near(image, colour) > 100 for colour in ("#0072b2", "#d55e00", "#009e73", "#cc79a7"))


def test_a_layer_with_a_colour_of_its_own_is_in_the_legend(make_fleet):
    """What was surveyed before, and what is undone, are named beside the map; a vehicle's own shapes are not."""
    figure = Figure()
    line, area = LineString([(0, 0), (1, 1)]), box(0, 0, 1, 1)
    layers = (
        Layer("surveyed", (line,), ({"stroke": "#999999"},)),
        undone_layer([(area, "no energy left")]),
        Layer("region", (area,), ({"vehicle": "usv1"},)),
    )
    legend(panel := figure.add_subplot(), replace(make_fleet(1), layers=layers))
    signs = {text.get_text() for text in panel.get_legend().get_texts()}
    assert {"surveyed", "undone"} <= signs
    assert "region" not in signs


def test_fifty_vehicles_fit(make_fleet):
    """Fifty vehicles make one picture and no warning, which tests take for an error."""
    assert picture(make_fleet(50))[:8] == b"\x89PNG\r\n\x1a\n"
