"""The swept-path check against an oracle made another way."""

import numpy as np
import pytest
import shapely
from shapely import MultiPolygon, box

from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Obstacle, Site, Vehicle
from quarterdeck.physics.swept import closest_approaches, excursion, sweep
from quarterdeck.physics.trace import COLUMNS, Trace

OTTER = Vehicle("usv", load_model("otter"), (0.0, 0.0))


def trace_of(x, y, heading, z=None):
    """A trace of one vehicle with what the check reads."""
    columns = {name: np.zeros((len(x), 1), dtype) for name, dtype in COLUMNS.items()}
    columns |= {"x": np.c_[x], "y": np.c_[y], "heading": np.c_[heading], "z": np.c_[np.zeros(len(x)) if z is None else z]}
    return Trace(("usv",), time=np.arange(len(x), dtype=float), **columns)


def site_of(*obstacles):
    area = MultiPolygon([box(-1000, -1000, 1000, 1000)])
    return Site((Area("a", area),), area, obstacles)


def test_random_runs_against_a_dense_oracle():
    """450 runs past an obstacle, most near a graze: the same hits as hulls drawn fifty to a step.

    Hulls drawn one by one, and the convex hull of two that turn, leave room for a difference: of 2 mm, no more.
    """
    random = np.random.default_rng(1)
    hull = np.array([(1.0, 0.54), (-1.0, 0.54), (-1.0, -0.54), (1.0, -0.54)])
    hits = close = 0
    for _ in range(75):
        steps = random.normal(0.3, 0.05, 40)
        heading = random.uniform(-np.pi, np.pi) + np.cumsum(random.normal(0, 0.02, 40))
        x, y = np.cumsum(steps * np.cos(heading)), np.cumsum(steps * np.sin(heading))
        at = random.integers(5, 35, 6)
        side = heading[at] + random.choice([-1, 1], 6) * np.pi / 2
        away = 0.54 + 0.3 + random.normal(0, 0.3, 6)
        obstacles = [
            Obstacle(str(i), shapely.Point(x[a] + d * np.cos(s), y[a] + d * np.sin(s)).buffer(0.3, quad_segs=3))
            for i, (a, s, d) in enumerate(zip(at, side, away, strict=True))
        ]
        found = set(sweep(site_of(*obstacles), OTTER, trace_of(x, y, heading), 0).hits)
        at = np.arange(0, 39.0001, 0.02)
        poses = np.column_stack([np.interp(at, range(40), column) for column in (x, y, heading)])
        cos, sin = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
        corners = np.dstack(
            [cos * hull[:, 0] - sin * hull[:, 1] + poses[:, :1], sin * hull[:, 0] + cos * hull[:, 1] + poses[:, 1:2]]
        )
        hulls = shapely.polygons(corners)
        for obstacle in obstacles:
            gap = float(shapely.distance(hulls, obstacle.polygon).min())
            hits += gap == 0
            if 0 < gap < 0.002:
                close += 1
                continue
            assert (obstacle.id in found) == (gap == 0), (obstacle.id, gap)
    assert hits > 75
    assert close < 12


def test_thin_obstacle_between_two_samples_is_hit():
    """A wall of 1 cm that no sampled hull touches."""
    wall = Obstacle("wall", box(4.995, -5, 5.005, 5))
    found = sweep(site_of(wall), OTTER, trace_of([0.0, 10.0], [0.0, 0.0], [0.0, 0.0]), 0)
    assert found.hits == ("wall",)
    assert found.clearance == 0.0


@pytest.mark.parametrize(("y", "clearance"), [(10.0, 10.0 - 1.0 - 0.54), (3.0, 1.46)])
def test_clearance_is_from_the_hull(y, clearance):
    """A square beside a straight run: its distance less half the beam."""
    square = Obstacle("square", box(4, y - 1, 6, y + 1))
    found = sweep(site_of(square), OTTER, trace_of(np.linspace(0, 10, 200), np.zeros(200), np.zeros(200)), 0)
    assert found.clearance == pytest.approx(clearance)
    assert found.obstacle == "square"


def test_what_does_not_block_or_lies_below_is_clear():
    """A mast for aerial craft alone is no matter to a vessel; a quad above a roof is clear of it."""
    quad = Vehicle("uav", load_model("survey-quad"), (0.0, 0.0))
    mast = Obstacle("mast", box(4, -1, 6, 1), blocks=frozenset({"aerial"}), height=20.0)
    run = [0.0, 10.0], [0.0, 0.0], [0.0, 0.0]
    assert sweep(site_of(mast), OTTER, trace_of(*run), 0).hits == ()
    assert sweep(site_of(mast), quad, trace_of(*run, z=[40.0, 40.0]), 0).hits == ()
    assert sweep(site_of(mast), quad, trace_of(*run, z=[40.0, 5.0]), 0).hits == ("mast",)


def test_closest_approach_and_excursion():
    """Two that cross at different times; one that leaves the operating area by 3 m."""
    t = np.arange(11.0)
    x, y = np.column_stack([t, np.full(11, 5.0)]), np.column_stack([np.zeros(11), t - 2.0])
    best, other, when = closest_approaches(x, y, np.zeros_like(x), np.ones(x.shape, bool), np.array([1.0, 1.0]))
    apart = np.hypot(x[:, 0] - x[:, 1], y[:, 0] - y[:, 1]) - 1.0
    assert best[0] == best[1] == pytest.approx(apart.min())
    assert list(other) == [1, 0]
    assert when[0] == np.argmin(apart)
    assert excursion(site_of(), trace_of([999.0, 1003.0], [0.0, 0.0], [0.0, 0.0]), 0) == pytest.approx(3.0)
