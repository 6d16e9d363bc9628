"""The likelihood field: distances that are right, and what a scan tells."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from quarterdeck.physics.lidar import beam_angles, cast, edge_grid
from quarterdeck.physics.likelihood import FAR, distance_at, distance_field, log_likelihoods, scan_information


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 2**32 - 1))
def test_distances_are_shapelys(seed: int) -> None:
    """At its nodes the field holds the signed distance to the nearest edge of what may overlap and have holes."""
    rng = np.random.default_rng(seed)
    shapes = [shapely.Point(*rng.uniform(0, 20, 2)).buffer(rng.uniform(0.5, 4), quad_segs=3) for _ in range(4)]
    shapes[0] = shapes[0].difference(shapes[0].buffer(-0.3))
    shapes = [s for s in shapes if not s.is_empty]
    field = distance_field(shapes, (0, 0, 20, 20), 0.5)
    solid = shapely.union_all(shapes)
    i, j = np.indices(field.values.shape)
    points = shapely.points(field.origin[0] + j * field.spacing, field.origin[1] + i * field.spacing)
    want = np.minimum(shapely.distance(points, solid.boundary), FAR)
    inside = shapely.contains_properly(solid, points)
    np.testing.assert_allclose(np.abs(field.values), want, atol=1e-5)
    clear = want > 1e-6
    np.testing.assert_array_equal((field.values < 0)[clear], inside[clear])


def test_a_straight_wall_is_exact_between_nodes() -> None:
    """Across a wall the interpolated distance goes through zero, on it and off it, whatever the nodes."""
    field = distance_field([shapely.box(3.03, -50, 9, 50)], (0, -10, 10, 10), 0.25)
    for x in np.linspace(1.5, 4.5, 31):
        assert distance_at(field.values, field.origin, field.spacing, x, 0.1) == pytest.approx(3.03 - x, abs=1e-6)
    assert distance_at(field.values, field.origin, field.spacing, 1e6, 0.0) == FAR


def test_the_true_pose_is_the_likeliest() -> None:
    """A noiseless scan fits best where it was taken: there its beams have likelihood 1."""
    boxes = [shapely.box(5, 5, 9, 7), shapely.box(-4, 8, -2, 15), shapely.box(2, -9, 4, -3)]
    grid, field = edge_grid(boxes), distance_field(boxes, (-20, -20, 20, 20))
    pose, angles = np.array([0.3, 0.2, 0.7]), beam_angles(90)
    ranges = cast(grid, pose[None], angles, 30.0)[0]
    rng = np.random.default_rng(0)
    others = pose + rng.uniform(0.1, 1.0, (200, 3)) * rng.choice([-1, 1], (200, 3))
    told, fit = log_likelihoods(
        field.values, field.origin, field.spacing, np.vstack([pose, others]), angles, ranges, 0.1, 0.05
    )
    assert fit[0] > 0.99
    assert told[0] > told[1:].max()


def test_one_wall_tells_its_distance_and_nothing_along_it() -> None:
    """The information of a scan of one long wall is full across it and none along it; one beam's is 1 / deviation^2."""
    boxes = [shapely.box(-500, 5, 500, 6)]
    grid, field = edge_grid(boxes), distance_field(boxes, (-40, -10, 40, 10))
    pose, angles = np.zeros(3), np.array([0.9, np.pi / 2, 2.0])
    ranges = cast(grid, pose[None], angles, 30.0)[0]
    told = scan_information(field.values, field.origin, field.spacing, pose, angles, ranges, 0.1)
    assert told[0] == pytest.approx(0.0, abs=1e-6)
    assert told[1, 1] == pytest.approx(3 / 0.1**2, rel=1e-4)
    lever = 5 / np.tan(angles)
    assert told[2, 2] == pytest.approx((lever**2).sum() / 0.1**2, rel=1e-3)
