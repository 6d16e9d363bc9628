"""What boards hold: fences made simpler on the safe side, missions that are too long told."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, MultiPolygon, Polygon, box
from shapely.ops import unary_union

from quarterdeck.exporters import qgc_plan, qgc_wpl
from quarterdeck.exporters.export import STORAGES, Settings, export
from quarterdeck.exporters.fence import fence_polygons
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Obstacle, Site


def star(x, y, radius, corners, rough, seed=0):
    """Return a ring of so many corners, its radius uneven by a part `rough`."""
    angles = np.linspace(0, 2 * math.pi, corners, endpoint=False)
    size = radius * (1 + rough * np.random.default_rng(seed).uniform(-1, 1, corners))
    return Polygon(np.column_stack([x + size * np.cos(angles), y + size * np.sin(angles)]))


def bytes_in_storage(polygons):
    """What ArduPilot's fence loader writes: four bytes of magic, type and count and eight a vertex, the end's one."""
    return 4 + sum(1 + 1 + 8 * (len(p.exterior.coords) - 1) for p in polygons) + 1


def coast(boats, corners, islands, rough, seed=0):
    """The five boats in a rough bay with islands of many corners east of their tracks."""
    shore = star(200.0, 300.0, 700.0, corners, rough, seed)
    rocks = [star(420.0, 60.0 * i, 12.0, 40, 0.1, i) for i in range(islands)]
    site = Site(boats.site.areas, MultiPolygon([shore]), tuple(Obstacle(f"r{i}", p) for i, p in enumerate(rocks)))
    return replace(boats, site=site)


@settings(deadline=None, max_examples=12)
@given(st.integers(60, 600), st.integers(0, 6), st.floats(0.0, 0.05), st.integers(0, 99))
def test_simpler_fences_are_within_the_true_ones(boats, corners, islands, rough, seed):
    """The inclusion only shrinks, exclusions only grow, the route stays inside, and the board holds it; it is told."""
    mission = coast(boats, corners, islands, rough, seed)
    for settings_, fits in (
        (Settings("ardupilot"), lambda ps: bytes_in_storage(ps) <= 672),
        (Settings("px4"), lambda ps: sum(len(p.exterior.coords) - 1 for p in ps) <= 63),
    ):
        said = []
        inclusion, exclusions = fence_polygons(mission, "usv1", replace(settings_, tell=said.append))
        assert fits([inclusion, *exclusions])
        assert mission.site.operating.buffer(1e-6).covers(inclusion)
        true = unary_union([o.polygon for o in mission.site.obstacles]).intersection(inclusion)
        assert true.is_empty or unary_union(exclusions).buffer(1e-6).covers(true)
        way = LineString(mission.routes[0].xyz[:, :2])
        assert inclusion.covers(way)
        assert not any(p.intersects(way) for p in exclusions)
        if not islands:
            assert bool(said) == (not fits([mission.site.operating.geoms[0]]))


def test_a_fence_that_cannot_be_simpler_is_told_and_kept(boats):
    """Where the border hugs the route there is no room to move it: it is written as it is, and the user is told."""
    mission = coast(boats, 4, 0, 0.0)
    tight = unary_union([LineString(r.xyz[:, :2]).buffer(0.02, quad_segs=16) for r in mission.routes])
    tight = Polygon(tight.convex_hull.buffer(30.0).exterior, [])
    ring = star(200.0, 300.0, 700.0, 400, 0.0)
    comb = ring.difference(unary_union([box(-20 + 4 * i, -400, -18 + 4 * i, -0.05) for i in range(90)]))
    mission = replace(mission, site=replace(mission.site, operating=MultiPolygon([comb])))
    said = []
    inclusion, _ = fence_polygons(mission, "usv1", Settings("px4", said.append))
    assert inclusion.equals(comb)
    assert "cannot be made simpler" in said[0]


def test_small_boards_hold_less(make_fleet):
    """A mission for 16 kB is too long for a board of 4, in both file formats; PX4 holds 500 items."""
    mission = make_fleet(1, lines=150)
    for exporter in (qgc_wpl, qgc_plan):
        for kilobytes, told in ((16, False), (4, True)):
            said = []
            exporter.files(mission, Settings("ardupilot", said.append, storage=kilobytes))
            assert any("holds 166" in line for line in said) == told
        said = []
        exporter.files(make_fleet(1, lines=300), Settings("px4", said.append))
        assert any("PX4 holds 501" in line for line in said)


def test_a_storage_that_no_board_has_is_refused(boats, tmp_path):
    """One line with those that there are."""
    with pytest.raises(InputError, match="no board has 7 kB"):
        export(boats, "qgc-wpl", tmp_path, storage=7)
    assert STORAGES == (4, 8, 15, 16, 32)
