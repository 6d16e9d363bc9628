"""The grid against shapely's predicates."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import MultiPolygon, Polygon, box

from quarterdeck.geo.grid import area_edges, lay_grid
from quarterdeck.geo.scanline import held
from quarterdeck.geo.scenario import as_multipolygon


@st.composite
def areas(draw):
    """Random polygons with up to three holes, about 200 m wide."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    area = _star(rng, 0.0, 0.0, 100.0)
    for _ in range(draw(st.integers(0, 3))):
        area = area.difference(_star(rng, *rng.uniform(-80, 80, 2), rng.uniform(2, 40)))
    return as_multipolygon(area)


def _star(rng, x, y, radius):
    angle = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(5, 14)))
    reach = radius * rng.uniform(0.3, 1.0, len(angle))
    return Polygon(np.column_stack([x + reach * np.cos(angle), y + reach * np.sin(angle)])).buffer(0)


placed = {
    "area": areas(),
    "angle": st.floats(0, np.pi / 2),
    "x": st.floats(0, 20),
    "y": st.floats(0, 20),
}


@settings(deadline=None, max_examples=60)
@given(**placed)
def test_cells_and_moves_are_those_that_shapely_finds(area, angle, x, y):
    """A cell is free if shapely finds its centre inside, a move if it finds the whole segment inside, and only then."""
    grid = lay_grid(area, 10.0, angle, (x, y))
    cells = np.argwhere(np.ones_like(grid.cells))
    inside = shapely.contains_xy(area.buffer(-1e-5), *grid.centres(cells).T).reshape(grid.cells.shape)
    assert (grid.cells == inside).all()
    for moves, step in ((grid.right, (0, 1)), (grid.up, (1, 0))):
        lines = shapely.linestrings(np.stack([grid.centres(cells), grid.centres(cells + step)], axis=1))
        covered = shapely.covers(area.buffer(-1e-5), lines).reshape(moves.shape)
        assert (moves == covered).all()


@settings(deadline=None, max_examples=60)
@given(**placed)
def test_adjacent_hypervertices_are_joined(area, angle, x, y):
    """Within a hypervertex and between any two adjacent ones every move is inside."""
    grid = lay_grid(area, 10.0, angle, (x, y))
    h, right, up = grid.hypervertices, grid.right, grid.up
    assert (right[::2, ::2] & right[1::2, ::2] & up[::2, ::2] & up[::2, 1::2])[h].all()
    assert (right[::2, 1:-1:2] & right[1::2, 1:-1:2])[h[:, :-1] & h[:, 1:]].all()
    assert (up[1:-1:2, ::2] & up[1:-1:2, 1::2])[h[:-1] & h[1:]].all()


@given(angle=st.floats(-4, 4), x=st.floats(0, 20), y=st.floats(0, 20))
@settings(deadline=None, max_examples=30)
def test_centres_and_their_inverse(angle, x, y):
    """The cell at a cell's centre is that cell."""
    grid = lay_grid(MultiPolygon([box(1000, -500, 1100, -440)]), 10.0, angle, (x, y))
    cells = np.argwhere(grid.cells)
    assert (grid.cells_at(grid.centres(cells)) == cells).all()


def test_rectangle_by_hand():
    """A 60 x 40 m rectangle at 10 m holds 3 x 2 hypervertices when the lattice sits in its corner."""
    grid = lay_grid(MultiPolygon([box(0, 0, 60, 40)]), 10.0, 0.0, (0.0, 0.0))
    assert grid.hypervertices.sum() == 6
    assert grid.cells.sum() == 24
    assert np.allclose(grid.centres(np.argwhere(grid.cells)).min(axis=0), 5.0)


@pytest.mark.parametrize("thickness", [0.5, 4.0])
def test_sliver_between_hypervertices_drops_the_fewest(thickness):
    """A wall between two columns of hypervertices, half as long as they are, costs the shorter side of pairs."""
    wall = box(20 - thickness / 2, 0, 20 + thickness / 2, 45)
    grid = lay_grid(as_multipolygon(box(0, 0, 40, 80).difference(wall)), 10.0, 0.0, (0.0, 0.0))
    assert grid.hypervertices.sum() == 8 - 3
    assert grid.cells.sum() == 32


def test_strip_thinner_than_half_a_cell_has_no_moves():
    """A strip that holds no centre beside the lattice's first column gives no cells and no moves in its rows."""
    area = as_multipolygon(box(1, 0, 3, 60).union(box(1, 50, 95, 100)))
    grid = lay_grid(area, 10.0, 0.0, (0.0, 0.0))
    assert not grid.cells[:5].any()
    assert not grid.right[:5].any()


def test_what_a_lattice_holds_takes_no_more_than_the_area_has():
    """Two squares a thousand kilometres apart, whose box has a million million cells: each holds what it would alone."""
    far = 1_000_000.0
    squares = [box(0, 0, 8, 8), box(far, far, far + 8, far + 8)]
    both = np.concatenate([area_edges(MultiPolygon([square]), 1.0) for square in squares])
    count, width, _, margin_x, _ = held(both, 0.0, 0.0, 0.0, False)
    assert count == 2 * held(area_edges(MultiPolygon(squares[:1]), 1.0), 0.0, 0.0, 0.0, False)[0] > 0
    assert width == pytest.approx(far + 8, abs=2)
    assert margin_x == pytest.approx(0.0, abs=1e-6)
