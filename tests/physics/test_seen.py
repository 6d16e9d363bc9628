"""What is seen from tracks, walls counted."""

from dataclasses import replace

import pytest
import shapely
from shapely import LineString, MultiPolygon, box

from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Obstacle, Site, Vehicle
from quarterdeck.mission.gaps import gap_site
from quarterdeck.mission.mission import Mission
from quarterdeck.physics.seen import seen_fraction, unseen


def looking(area, reach, *obstacles):
    """A mission of one rover that sees `reach` metres in `area`."""
    kind = load_model("jackal")
    site = Site((Area("area", MultiPolygon([area])),), MultiPolygon([area]), obstacles)
    rover = Vehicle("ugv", kind, (5.0, 5.0), clearance=kind.clearance)
    return Mission("look", Frame(0.0, 0.0), site, (rover,), (), "guards", parameters={"range": reach})


def test_in_the_open_it_is_what_lies_within_range():
    """A straight track in a field: the track widened by the range, to the 0.2 % that inscribed discs and strides lose."""
    field, track = box(0, 0, 100, 60), LineString([(20, 30), (80, 30)])
    expected = track.buffer(15.0, quad_segs=64).intersection(field).area / field.area
    seen = seen_fraction(looking(field, 15.0), [track])
    assert seen <= expected
    assert seen == pytest.approx(expected, rel=5e-3)


def test_a_vehicles_own_range_is_what_it_sees():
    """Whether the plan has a range for all, or none: guards were planned for the vehicles' own."""
    field, track = box(0, 0, 100, 60), LineString([(20, 30), (80, 30)])
    mission = looking(field, 15.0)
    own = replace(mission, vehicles=tuple(replace(v, range=15.0) for v in mission.vehicles))
    for default in (None, 40.0):
        plan = replace(own, parameters={"range": default})
        assert seen_fraction(plan, [track]) == seen_fraction(mission, [track])
        assert [a.id for a in gap_site(plan, unseen(plan, [track]))[0].site.areas] == ["gap-1"]


def test_a_wall_hides_what_is_behind_it():
    """From one place before a long wall nothing beyond it is seen; from both sides all is."""
    wall = Obstacle("wall", box(49, 0, 51, 60))
    hall = box(0, 0, 100, 60)
    here, there = LineString([(20, 30), (20.5, 30)]), LineString([(80, 30), (80.5, 30)])
    half = 49 * 60 / (98 * 60)
    assert seen_fraction(looking(hall, 200.0, wall), [here]) == pytest.approx(half, abs=1e-6)
    assert seen_fraction(looking(hall, 200.0, wall), [here, there]) == pytest.approx(1.0, abs=1e-9)


def test_a_pillar_throws_a_shadow():
    """The shadow of a square pillar, by similar triangles."""
    pillar, room = Obstacle("pillar", box(18, 28, 22, 32)), box(0, 0, 60, 60)
    eye = LineString([(10, 30), (10.0005, 30)])
    # Behind the near face, 8 m ahead and 4 m wide, the shadow is 25 m wide at the far wall, 50 m ahead.
    shadow = shapely.Polygon([(18, 28), (18, 32), (60, 42.5), (60, 17.5)]).area - 16.0
    seen = seen_fraction(looking(room, 200.0, pillar), [eye])
    assert seen == pytest.approx(1 - shadow / (3600 - 16), abs=1e-3)


def test_nothing_is_seen_from_nowhere():
    """No tracks."""
    assert seen_fraction(looking(box(0, 0, 10, 10), 5.0), []) == 0.0
