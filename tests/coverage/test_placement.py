"""Placement against exhaustive search, the published counts and itself."""

import json
from pathlib import Path

import numpy as np
import pytest
import shapely
from shapely import MultiPolygon, Polygon, box
from shapely.geometry import shape

from quarterdeck.coverage.placement import Annealing, Objective, index, place
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.grid import area_edges
from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.scenario import as_multipolygon

DATA = Path(__file__).resolve().parents[2] / "data"
REGIONS = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "regions"
PUBLISHED = {"roi13": 59, "roi16": 342}  # their counts are an artefact; the published tours hold these
SLANTED = as_multipolygon(Polygon([(0, 0), (300, 80), (260, 260), (60, 220)]).difference(box(120, 100, 150, 150)))


def region(path):
    """A published region in metres, and its properties."""
    document = json.loads(path.read_text(encoding="utf-8"))
    polygon = shape(document["geometry"])
    centre = polygon.envelope.centroid
    return as_multipolygon(shapely.transform(polygon, Frame(centre.x, centre.y).to_metres)), document["properties"]


def exhaustive(area, spacing, angles=90, shifts=32):
    """The best F of a full search."""
    edges = area_edges(area, spacing)
    edges = (edges - np.tile(edges[:, :2].mean(axis=0), 2)) / spacing
    target = (area.area / spacing**2, 0.68, 0.32, 0.25)
    grid = np.arange(shifts) * 2.0 / shifts
    turns = np.arange(angles) * np.pi / 2 / angles
    return max(index(edges, target, (x, y, angle))[0] for angle in turns for x in grid for y in grid)


@pytest.mark.parametrize("name", ["roi03", "roi06", "roi08", "roi13"])
def test_published_regions(name):
    """As many hypervertices as published, and 0.99 of an exhaustive search."""
    path = REGIONS / f"{name}.geojson"
    if not path.exists():
        pytest.skip(f"{path} is not on this machine")
    area, properties = region(path)
    placement = place(area, 40.0)
    assert placement.grid.hypervertices.sum() >= PUBLISHED.get(name, properties["mega_nodes"])
    assert placement.f >= 0.99 * exhaustive(area, 40.0, angles=45, shifts=12)


def test_index_counts_what_the_grid_holds():
    """F1 is four path cells a hypervertex over the area, as the grid that comes back holds them."""
    for seed in range(10):
        placement = place(SLANTED, 20.0, seed=seed)
        count = placement.grid.hypervertices.sum()
        assert placement.f1 == pytest.approx(4 * count * 20.0**2 / SLANTED.area)
        assert placement.f == pytest.approx(0.68 * placement.f1 + 0.32 * placement.f2 - 0.25 * placement.f3)


def test_same_seed_same_grid_and_annealing_beats_none():
    """One seed gives one grid to the last bit; the annealed index is above that of the corner of the bounding box."""
    one, two = place(SLANTED, 20.0, seed=3), place(SLANTED, 20.0, seed=3)
    assert one.grid.origin == two.grid.origin
    assert one.grid.angle == two.grid.angle
    assert (one.grid.cells == two.grid.cells).all()
    assert one.f > place(SLANTED, 20.0, method="none").f


def test_a_needle_is_found():
    """On a small area where one of 90 x 32 x 32 states is best, every seed comes within 0.99 of it."""
    area = read_scenario(DATA / "dalian_harbour.geojson").site.coverable
    found = [place(area, 40.0, seed=seed).f for seed in range(4)]
    assert min(found) >= 0.99 * 0.8928849573248553  # of the exhaustive search


def test_a_large_area_takes_few_states():
    """Of a square of a million path cells nearly all is held, after few evaluations."""
    placement = place(MultiPolygon([box(0, 0, 10000, 10000)]), 10.0)
    assert placement.f1 > 0.995
    assert placement.evaluations < 1000


def test_rectangle_is_filled_exactly():
    """A turned rectangle that 5 x 3 hypervertices fill is filled by them."""
    rectangle = shapely.affinity.rotate(box(0, 0, 200, 120), 33.0)
    placement = place(MultiPolygon([rectangle]), 20.0)
    assert placement.grid.hypervertices.sum() == 15
    assert placement.f3 == pytest.approx(0.0, abs=0.05)
    assert np.degrees(placement.grid.angle) % 90 == pytest.approx(33.0, abs=2.0)


def test_fixed_angle_is_kept():
    """The angle given is the lattice's."""
    assert place(SLANTED, 20.0, angle=0.3).grid.angle == 0.3
    assert place(SLANTED, 20.0, angle=0.3, method="none").grid.angle == 0.3


def test_printed_algorithm_runs_and_is_no_better():
    """The algorithm as printed ends, and on average does not beat the corrected one."""
    printed = [place(SLANTED, 20.0, seed=s, method="paper").grid.hypervertices.sum() for s in range(5)]
    meant = [place(SLANTED, 20.0, seed=s).grid.hypervertices.sum() for s in range(5)]
    assert np.mean(printed) <= np.mean(meant)


def test_weights_are_those_of_the_index():
    """With F1 alone the index is F1; without F3 the margins may be lopsided, with it they are even."""
    alone = place(SLANTED, 20.0, objective=Objective(1.0, 0.0, 0.0))
    assert alone.f == pytest.approx(alone.f1)
    assert alone.f1 > place(SLANTED, 20.0, method="none").f1
    even, free = (place(SLANTED, 20.0, objective=Objective(k3=k3)) for k3 in (1.0, 0.0))
    assert even.f3 < free.f3


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: place(SLANTED, 500.0), "smaller spacing"),
        (lambda: place(SLANTED, 0.0), "positive"),
        (lambda: place(MultiPolygon([]), 20.0), "smaller spacing"),
        (lambda: place(as_multipolygon(box(0, 0, 1000, 15)), 20.0), "smaller spacing"),
        (lambda: Objective(0.5, 0.6, 0.2), "k1 \\+ k2 = 1"),
        (lambda: Annealing(alpha=1.0), "alpha"),
    ],
)
def test_what_cannot_be_placed_is_refused(call, says):
    """Each refusal says what to do, in one line."""
    with pytest.raises(InputError, match=says) as caught:
        call()
    assert "\n" not in str(caught.value)
