"""A lap along the border: half a spacing in, around holes, in pieces where vehicles share it."""

import numpy as np
import pytest
import shapely
from shapely import MultiPolygon, box

from quarterdeck.coverage.laps import lap_space, lay_laps
from quarterdeck.coverage.lines import lay_lines
from quarterdeck.geo.scenario import as_multipolygon
from quarterdeck.geo.transit import roadmap

FIELD = as_multipolygon(box(0, 0, 200, 100).difference(box(80, 40, 120, 60)))


def test_laps_by_hand():
    """Around a field of 200 x 100 m with a hole: 5 m off the border, then 5 m off the hole, each closed, nearest first."""
    border, hole = lay_laps(lap_space(FIELD, FIELD, 10.0), FIELD, 10.0, (0.0, 50.0))
    assert np.allclose(border[[0, -1]], (5.0, 50.0), atol=1e-3)
    assert shapely.length(shapely.linestrings(border)) == pytest.approx(2 * (190 + 90))
    assert shapely.length(shapely.linestrings(hole)) == pytest.approx(2 * (50 + 30))
    assert (hole[0] == hole[-1]).all()
    assert hole[0] == pytest.approx((75.0, 50.0), abs=1e-3)


def test_clearance_keeps_the_lap_off():
    """Where tracks must stay farther off than half a spacing, the lap runs along that."""
    area = as_multipolygon(FIELD.difference(box(70, 30, 130, 70)))
    hole = lay_laps(lap_space(FIELD, area, 10.0), FIELD, 10.0, (0.0, 50.0))[1]
    assert shapely.length(shapely.linestrings(hole)) == pytest.approx(2 * (60 + 40), abs=1e-3)


def test_two_vehicles_share_the_lap():
    """What lies in one part and what lies in the other make up the whole lap, and nobody drives along the seam."""
    space = lap_space(FIELD, FIELD, 10.0)
    halves = [as_multipolygon(FIELD.intersection(box(*b))) for b in ((0, 0, 93, 100), (93, 0, 200, 100))]
    own = [lay_laps(space, half, 10.0, (0.0, 0.0)) for half in halves]
    assert sum(shapely.length(shapely.linestrings(lap)) for laps in own for lap in laps) == pytest.approx(720.0)
    assert len(own[0]) == len(own[1]) == 2


def test_laps_come_before_the_lines_and_are_linked():
    """All of the path is one, in the field: border, hole, lines; the strip along borders that lines leave is covered."""
    lines = lay_lines(FIELD, FIELD, 10.0, roadmap(FIELD), angle=0.7, start=(0.0, 0.0), lap=lap_space(FIELD, FIELD, 10.0))
    assert len(lines.laps) == 2
    assert len(lines.links) == len(lines.swaths) + 1
    assert (lines.path[0] == lines.laps[0][0]).all()
    assert shapely.covers(FIELD.buffer(1e-3), shapely.linestrings(lines.path))
    for i, link in enumerate(lines.links):
        assert np.allclose(link[0], lines.driven[i][-1])
        assert np.allclose(link[-1], lines.driven[i + 1][0])


def test_no_room_for_a_lap():
    """An area narrower than the spacing has none."""
    strip = MultiPolygon([box(0, 0, 100, 8)])
    assert lay_laps(lap_space(strip, strip, 10.0), strip, 10.0) == []
