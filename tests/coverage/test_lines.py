"""Parallel lines: on random areas with holes, swaths inside, links on the road, nothing wide left out."""

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely import MultiPolygon, Polygon, box

from quarterdeck.coverage.division import divide
from quarterdeck.coverage.lines import lay_lines, split_area
from quarterdeck.coverage.metrics import uncovered
from quarterdeck.coverage.placement import Annealing, place
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.grid import lay_grid
from quarterdeck.geo.scenario import as_multipolygon
from quarterdeck.geo.transit import roadmap

FIELD = MultiPolygon([box(0, 0, 100, 60)])


@st.composite
def areas(draw):
    """Random areas with holes, all in one piece."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    area = _star(rng, 0.0, 0.0, 120.0)
    for _ in range(draw(st.integers(0, 3))):
        area = area.difference(_star(rng, *rng.uniform(-80, 80, 2), rng.uniform(2, 40)))
    area = as_multipolygon(area)
    assume(len(area.geoms) == 1)
    return area


def _star(rng, x, y, radius):
    angle = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(5, 14)))
    reach = radius * rng.uniform(0.3, 1.0, len(angle))
    return Polygon(np.column_stack([x + reach * np.cos(angle), y + reach * np.sin(angle)])).buffer(0)


@settings(deadline=None, max_examples=25)
@given(areas(), st.one_of(st.none(), st.floats(0, 3.14)), st.floats(0, 15), st.integers(0, 4))
def test_swaths_inside_links_on_the_road_and_little_left_out(area, angle, run, cross_every):
    """Lines lie in the area, all of the path is drivable and unbroken; what is left out is near the border."""
    lines = lay_lines(area, area, 10.0, roadmap(area), angle=angle, run=run, cross_every=cross_every)
    assert len(lines.links) == len(lines.swaths) - 1
    assert shapely.covers(area, shapely.linestrings(np.stack(lines.tracks))).all()
    assert shapely.covers(area.buffer(1e-3), shapely.linestrings(lines.path))
    for i, link in enumerate(lines.links):
        assert np.allclose(link[0], lines.swaths[i].run_out)
        assert np.allclose(link[-1], lines.swaths[i + 1].run_in)
    left = as_multipolygon(uncovered(lines.tracks, area, 10.0))
    assert left.area < 0.15 * area.area
    assert left.buffer(-0.5).difference(area.boundary.buffer(6.0)).is_empty
    assert any(s.cross for s in lines.swaths) == (cross_every > 0)
    assert len({s.name for s in lines.swaths}) == len(lines.swaths)


@settings(deadline=None, max_examples=15)
@given(areas(), st.integers(2, 3))
def test_parts_make_up_the_area(area, k):
    """The vehicles' parts do not overlap and add up to the area; each holds its vehicle's hypervertices."""
    try:
        grid = place(area, 10.0, annealing=Annealing(k=5, refined=1)).grid
    except InputError:
        assume(False)
    free = np.argwhere(grid.hypervertices)
    assume(len(free) >= k)
    labels = divide(grid.hypervertices, free[np.linspace(0, len(free) - 1, k).astype(int)]).labels
    parts = split_area(area, grid, labels, k)
    assert sum(p.area for p in parts) == pytest.approx(area.area, rel=1e-4)
    for vehicle, part in enumerate(parts):
        centres = grid.centres(2 * np.argwhere(labels == vehicle) + 0.5)
        held = shapely.contains_xy(part.buffer(1e-3), *centres.T)
        assert held[shapely.contains_xy(area, *centres.T)].all()


def test_rectangle_by_hand():
    """A 100 x 60 m field at 10 m: 6 lines along it, driven to and fro, 10 m of link between two."""
    lines = lay_lines(FIELD, FIELD, 10.0, roadmap(FIELD), start=(0.0, 0.0))
    assert len(lines.swaths) == 6
    assert lines.angle % np.pi == pytest.approx(0.0, abs=1e-9)
    assert [round(s.start[1]) for s in lines.swaths] == [5, 15, 25, 35, 45, 55]
    assert np.allclose([np.linalg.norm(np.diff(link, axis=0), axis=1).sum() for link in lines.links], 10.0)
    headings = [np.sign(s.end[0] - s.start[0]) for s in lines.swaths]
    assert headings == [1, -1, 1, -1, 1, -1]
    assert lines.swaths[0].name == "L1"


def test_run_in_goes_as_far_as_the_road_allows():
    """Each line is reached straight from 20 m outside the field where there is room, else from the fence."""
    fence = MultiPolygon([box(-50, -50, 107, 110)])
    lines = lay_lines(FIELD, FIELD, 10.0, roadmap(fence), angle=0.0, run=20.0)
    for s in lines.swaths:
        outer = sorted([s.run_in[0], s.run_out[0]])
        assert outer == pytest.approx([-20.0, 107.0], abs=1e-3)
        assert s.run_in[1] == pytest.approx(s.start[1])


def test_links_go_round_an_obstacle():
    """Lines on both sides of an obstacle are linked around it."""
    area = as_multipolygon(FIELD.difference(box(40, 10, 60, 50)))
    lines = lay_lines(area, area, 10.0, roadmap(area), angle=0.0)
    assert len(lines.swaths) == 2 + 2 * 4
    assert shapely.intersection(shapely.linestrings(lines.path), box(40, 10, 60, 50).buffer(-1e-3)).is_empty


def test_what_no_path_leads_to_is_counted():
    """Pieces of lines on an island of the area are left out and counted."""
    area = MultiPolygon([box(0, 0, 100, 60), box(200, 0, 260, 60)])
    lines = lay_lines(area, area, 10.0, roadmap(area), angle=0.0, start=(0.0, 0.0))
    assert lines.unreached == 6
    assert len(lines.swaths) == 6


def test_cheaper_turns_choose_another_direction():
    """A long strip is surveyed along itself, whatever its direction."""
    strip = as_multipolygon(shapely.affinity.rotate(box(0, 0, 200, 30), 25.0))
    assert np.degrees(lay_lines(strip, strip, 10.0, roadmap(strip)).angle) == pytest.approx(25.0, abs=1e-6)


def test_nobodys_area_and_wrong_options():
    """A vehicle without a region has no lines; options out of range are refused."""
    grid = lay_grid(FIELD, 10.0, 0.0, (0.0, 0.0))
    assert all(p.is_empty for p in split_area(FIELD, grid, np.full(grid.hypervertices.shape, -1), 2))
    assert lay_lines(FIELD, MultiPolygon(), 10.0, roadmap(FIELD)).swaths == ()
    with pytest.raises(InputError, match="must not be negative"):
        lay_lines(FIELD, FIELD, 10.0, roadmap(FIELD), run=-1.0)
    with pytest.raises(InputError, match="positive"):
        lay_lines(FIELD, FIELD, 0.0, roadmap(FIELD))


@settings(deadline=None, max_examples=25)
@given(areas(), st.floats(0, 3.14), st.tuples(st.floats(-150, 150), st.floats(-150, 150)))
def test_entry_is_the_nearest_end(area, angle, entry):
    """No end of any line is nearer to the entry point than where the first begins, and all lines are still driven."""
    lines = lay_lines(area, area, 10.0, roadmap(area), angle=angle, run=5.0, start=(0.0, 0.0), entry=entry)
    ends = np.concatenate(lines.tracks)
    nearest = np.linalg.norm(ends - entry, axis=1).min()
    assert np.hypot(*np.subtract(lines.swaths[0].start, entry)) == pytest.approx(nearest)
    assert len(lines.swaths) == len(lay_lines(area, area, 10.0, roadmap(area), angle=angle).swaths)


@pytest.mark.parametrize("corner", [(0.0, 0.0), (100.0, 0.0), (0.0, 60.0), (100.0, 60.0)])
def test_alternate_lines_leave_room_to_turn(corner):
    """Six lines, every second first: 1, 3, 5 out, 6, 4, 2 back, to and fro, from the corner nearest to the entry."""
    lines = lay_lines(FIELD, FIELD, 10.0, roadmap(FIELD), angle=0.0, entry=corner, alternate=2)
    y = [s.start[1] if corner[1] == 0 else 60.0 - s.start[1] for s in lines.swaths]
    assert y == pytest.approx([5, 25, 45, 55, 35, 15])
    assert [s.start[0] for s in lines.swaths] == pytest.approx([corner[0], 100.0 - corner[0]] * 3, abs=1e-3)


@settings(deadline=None, max_examples=15)
@given(areas(), st.floats(0, 3.14), st.integers(2, 5))
def test_alternate_drives_every_line_once(area, angle, n):
    """The same lines as without, each once; within a pass the next line is n lines on, so that a circle fits."""
    road = roadmap(area)
    lines = lay_lines(area, area, 10.0, road, angle=angle, alternate=n)
    assert {s.name for s in lines.swaths} == {s.name for s in lay_lines(area, area, 10.0, road, angle=angle).swaths}
    across = np.array([-np.sin(angle), np.cos(angle)])
    offset = np.array([np.dot(s.start, across) for s in lines.swaths])
    jumps = np.abs(np.diff(offset))
    height = np.diff(np.unique(np.round(offset, 5))).min(initial=np.inf)
    near = (jumps > 1e-5) & (jumps < (n - 0.01) * height)
    assert near.sum() <= n - 1  # where one pass ends and the next begins


def test_alternate_of_one_is_refused():
    """Every line first is no order of its own."""
    with pytest.raises(InputError, match="2 or more"):
        lay_lines(FIELD, FIELD, 10.0, roadmap(FIELD), alternate=1)
