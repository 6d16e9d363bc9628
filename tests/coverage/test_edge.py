"""The edge: on random areas with holes, every track inside, closed, and nothing that can be reached left out."""

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely import MultiPolygon, Polygon, box

from quarterdeck.coverage.division import divide
from quarterdeck.coverage.edge import hang, lay_tracks
from quarterdeck.coverage.metrics import measure, track_length
from quarterdeck.coverage.placement import Annealing, place
from quarterdeck.coverage.tour import tours
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import as_multipolygon

QUICK = Annealing(k=10, refined=2)


@st.composite
def plans(draw):
    """A random area with holes, its grid, and the tours of one to three vehicles."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    area = _star(rng, 0.0, 0.0, 120.0)
    for _ in range(draw(st.integers(0, 3))):
        area = area.difference(_star(rng, *rng.uniform(-80, 80, 2), rng.uniform(2, 40)))
    area = as_multipolygon(area)
    try:
        grid = place(area, 10.0, annealing=QUICK).grid
    except InputError:
        assume(False)
    free = np.argwhere(grid.hypervertices)
    starts = free[rng.permutation(len(free))[: draw(st.integers(1, 3))]]
    labels = divide(grid.hypervertices, starts).labels
    return area, grid, tours(labels, starts)


def _star(rng, x, y, radius):
    angle = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(5, 14)))
    reach = radius * rng.uniform(0.3, 1.0, len(angle))
    return Polygon(np.column_stack([x + reach * np.cos(angle), y + reach * np.sin(angle)])).buffer(0)


@settings(deadline=None, max_examples=12)
@given(plans(), st.sampled_from(["whole", "cells", "lap"]))
def test_tracks_are_closed_inside_and_begin_where_the_tour_does(plan, edge):
    """Whatever the edge, each track is closed, begins at its tour's first cell, and shapely finds it inside the area."""
    area, grid, walks = plan
    tracks = lay_tracks(area, grid, walks, edge=edge)
    assert len(tracks) == len(walks)
    for track, walk in zip(tracks, walks, strict=True):
        assert (track[0] == track[-1]).all()
        assert np.allclose(track[0], grid.centres(walk[:1])[0])
        assert shapely.covers(area, shapely.linestrings(track))


@settings(deadline=None, max_examples=8)
@given(plans())
def test_more_edge_covers_more_and_the_lap_keeps_its_budget(plan):
    """Cells and lap cover at least what whole does; a lap costs at most 21 % more per square metre covered."""
    area, grid, walks = plan
    whole, cells, lap = (measure(lay_tracks(area, grid, walks, edge=e), area, grid) for e in ("whole", "cells", "lap"))
    assert cells.poc >= whole.poc - 1e-9
    assert cells.cell_poc >= whole.cell_poc - 1e-9
    assert lap.poc >= whole.poc - 1e-9
    assert lap.length / lap.poc <= 1.21 * whole.length / whole.poc


@settings(deadline=None, max_examples=25)
@given(plans())
def test_every_cell_that_can_be_reached_is_hung_on(plan):
    """Hung tours move from cell to cell by clear moves, visit all they did, and all free cells that moves lead to."""
    _, grid, walks = plan
    hung = hang(grid, walks)
    seen = np.zeros_like(grid.cells)
    for walk, before in zip(hung, walks, strict=True):
        closed = np.vstack([walk, walk[:1]])
        step = np.diff(closed, axis=0)
        assert (np.abs(step).sum(axis=1) == 1).all()
        first = np.minimum(closed[:-1], closed[1:])
        clear = np.where(step[:, 1] != 0, grid.right[tuple(first.T)], grid.up[tuple(first.T)])
        assert clear.all()
        assert {tuple(c) for c in before} <= {tuple(c) for c in walk}
        seen[tuple(walk.T)] = True
    assert not (grid.right[:, :-1] & (seen[:, :-1] ^ seen[:, 1:])).any()
    assert not (grid.up[:-1] & (seen[:-1] ^ seen[1:])).any()


def test_two_cells_side_by_side_cost_two_moves():
    """A row of single path cells beside a region is taken two at a time: 2 more moves for every pair."""
    area = MultiPolygon([box(0, 0, 80, 30)])
    grid = place(area, 10.0, angle=0.0, method="none").grid
    walk = tours(np.where(grid.hypervertices, 0, -1), np.argwhere(grid.hypervertices)[:1])
    assert grid.hypervertices.sum() == 4
    assert len(walk[0]) == 16
    assert len(hang(grid, walk)[0]) == 16 + 8


def test_rectangle_gets_all_but_its_corners():
    """A rectangle that whole cells cover by two thirds is covered but for the roundness of the swath."""
    area = MultiPolygon([box(0, 0, 83, 32)])
    grid = place(area, 10.0, angle=0.0, method="none").grid
    walk = tours(np.where(grid.hypervertices, 0, -1), np.argwhere(grid.hypervertices)[:1])
    shares = [measure(lay_tracks(area, grid, walk, edge=e), area, grid).poc for e in ("whole", "cells", "lap")]
    assert shares[0] < 0.72
    assert shares[1] > 0.95
    assert shares[2] > 0.95


def test_turns_can_be_bought_with_length():
    """The dearer a turn, the fewer are made for strips."""
    area = as_multipolygon(Polygon([(0, 0), (300, 35), (260, 190), (60, 160)]))
    grid = place(area, 10.0).grid
    walk = tours(np.where(grid.hypervertices, 0, -1), np.argwhere(grid.hypervertices)[:1])
    cheap, dear = (measure(lay_tracks(area, grid, walk, turn_cost=c), area, grid) for c in (0.0, 10.0))
    assert dear.turns < cheap.turns
    assert dear.length <= cheap.length + 1e-9


def test_vertex_order_does_not_matter():
    """The area's rings may begin anywhere and run either way: the coverage and length stay."""
    points = [(0, 0), (120, 20), (150, 90), (60, 130), (-10, 70)]
    hole = [(40, 40), (70, 40), (70, 60), (40, 60)]
    results = []
    for shell, inner in ((points, hole), (points[2:] + points[:2], hole[::-1]), (points[::-1], hole[1:] + hole[:1])):
        area = MultiPolygon([Polygon(shell, [inner])])
        grid = place(area, 10.0, angle=0.3, method="none").grid
        walk = tours(np.where(grid.hypervertices, 0, -1), np.argwhere(grid.hypervertices)[:1])
        track = lay_tracks(area, grid, walk, edge="lap")[0]
        results.append((track_length(track), measure([track], area, grid).poc))
    assert np.allclose(results, results[0], rtol=1e-3)


def test_unknown_edge_is_refused():
    """The message names what there is."""
    area = MultiPolygon([box(0, 0, 80, 40)])
    grid = place(area, 10.0, method="none").grid
    with pytest.raises(InputError, match="whole, cells, lap"):
        lay_tracks(area, grid, [], edge="fringe")


def test_narrow_area_is_nearly_all_covered_by_the_lap():
    """Where whole cells cover four fifths of a small crooked area, the lap covers 98.5 % within its budget of length."""
    outline = [(0, 0), (100, -90), (290, 20), (320, 160), (200, 150), (170, 60), (60, 110)]
    area = as_multipolygon(Polygon(outline))
    grid = place(area, 25.0).grid
    walk = tours(np.where(grid.hypervertices, 0, -1), np.argwhere(grid.hypervertices)[:1])
    whole, lap = (measure(lay_tracks(area, grid, walk, edge=e), area, grid) for e in ("whole", "lap"))
    assert whole.poc < 0.9
    assert lap.poc > 0.985
    assert lap.length / lap.poc <= 1.2 * whole.length / whole.poc
