"""The lidar: exact, whatever it is compared with."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, Point, Polygon

from quarterdeck.physics.lidar import beam_angles, cast, edge_grid, noisy

REACH = 40.0


def random_site(rng: np.random.Generator, count: int) -> list[Polygon]:
    """Return star-shaped polygons that do not overlap, scattered over 200 m."""
    polygons: list[Polygon] = []
    while len(polygons) < count:
        centre, corners = rng.uniform(-100, 100, 2), int(rng.integers(3, 12))
        angle = np.sort(rng.uniform(0, 2 * np.pi, corners))
        radius = rng.uniform(2, 9, corners)
        polygon = Polygon(centre + radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))
        if polygon.is_valid and polygon.area > 1 and not any(polygon.intersects(p) for p in polygons):
            polygons.append(polygon)
    return polygons


def outside(rng: np.random.Generator, polygons: list[Polygon], count: int) -> np.ndarray:
    """Return (count, 3) poses clear of the polygons, some of them outside the grid."""
    solid = shapely.unary_union(polygons)
    poses = np.column_stack([rng.uniform(-130, 130, (4 * count, 2)), rng.uniform(-np.pi, np.pi, 4 * count)])
    return poses[~shapely.contains_xy(solid, poses[:, 0], poses[:, 1])][:count]


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 30))
def test_ranges_are_shapelys(seed: int, count: int) -> None:
    """Every range is the distance to the nearest point that shapely finds on the beam."""
    rng = np.random.default_rng(seed)
    polygons = random_site(rng, count)
    poses, angles = outside(rng, polygons, 5), beam_angles(24)
    got = cast(edge_grid(polygons), poses, angles, REACH)
    walls = shapely.unary_union([p.boundary for p in polygons])
    for k, (x, y, heading) in enumerate(poses):
        for b, angle in enumerate(heading + angles):
            beam = LineString([(x, y), (x + REACH * np.cos(angle), y + REACH * np.sin(angle))])
            hit = beam.intersection(walls)
            want = np.inf if hit.is_empty else hit.distance(Point(x, y))
            assert got[k, b] == pytest.approx(want, abs=1e-9) or abs(want - REACH) < 1e-9


def test_ranges_are_pybullets() -> None:
    """The caster and PyBullet's rayTestBatch against the extruded polygons see the same to a micrometre."""
    pybullet = pytest.importorskip("pybullet", reason="PyBullet is absent")
    rng = np.random.default_rng(7)
    polygons = random_site(rng, 40)
    poses, angles = outside(rng, polygons, 50), beam_angles(180)
    client = pybullet.connect(pybullet.DIRECT)
    try:
        for polygon in polygons:
            ring = np.asarray(polygon.exterior.coords)[:-1]
            n = len(ring)
            vertices = np.vstack([np.column_stack([ring, np.full(n, z)]) for z in (-1.0, 1.0)])
            walls = [(i, (i + 1) % n, i + n) for i in range(n)] + [((i + 1) % n, (i + 1) % n + n, i + n) for i in range(n)]
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_MESH,
                vertices=vertices.tolist(),
                indices=np.ravel(walls).tolist(),
                flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
                physicsClientId=client,
            )
            pybullet.createMultiBody(0, shape, physicsClientId=client)
        aim = poses[:, 2, None] + angles
        start = np.repeat(np.column_stack([poses[:, :2], np.zeros(len(poses))]), len(angles), axis=0)
        end = start + REACH * np.column_stack([np.cos(aim).ravel(), np.sin(aim).ravel(), np.zeros(aim.size)])
        rays = pybullet.rayTestBatch(start.tolist(), end.tolist(), physicsClientId=client)
    finally:
        pybullet.disconnect(client)
    want = np.array([REACH * r[2] if r[0] >= 0 else np.inf for r in rays]).reshape(aim.shape)
    got = cast(edge_grid(polygons), poses, angles, REACH)
    assert np.isfinite(want).sum() > 1000
    np.testing.assert_array_equal(np.isfinite(got), np.isfinite(want))
    np.testing.assert_allclose(got, want, atol=1e-6)


def test_no_ray_slips_through_a_corner() -> None:
    """Beams aimed exactly at the corners of a ring around the scanner all meet it."""
    rng = np.random.default_rng(3)
    ring = 10 * np.column_stack([f(np.sort(rng.uniform(0, 2 * np.pi, 500))) for f in (np.cos, np.sin)])
    grid = edge_grid([Polygon(ring)])
    for x, y in rng.uniform(-2, 2, (20, 2)):
        angles = np.arctan2(ring[:, 1] - y, ring[:, 0] - x)
        ranges = cast(grid, np.array([[x, y, 0.0]]), angles, 100.0)[0]
        np.testing.assert_allclose(ranges, np.hypot(ring[:, 0] - x, ring[:, 1] - y), atol=1e-9)


def test_discs_hide_what_is_behind_them() -> None:
    """A robot between scanner and wall is seen instead of the wall, the scanner's own disc is not."""
    grid = edge_grid([shapely.box(10, -5, 11, 5)])
    discs = np.array([[5.0, 0.0, 0.5], [0.0, 0.0, 0.5]])
    assert cast(grid, np.zeros((1, 3)), np.zeros(1), REACH)[0, 0] == pytest.approx(10.0)
    assert cast(grid, np.zeros((1, 3)), np.zeros(1), REACH, discs)[0, 0] == pytest.approx(4.5)
    assert cast(grid, np.zeros((1, 3)), np.array([np.pi]), REACH, discs)[0, 0] == np.inf


def test_an_empty_site_shows_nothing() -> None:
    """Without polygons, every beam runs out."""
    assert np.isinf(cast(edge_grid([]), np.zeros((2, 3)), beam_angles(8), REACH)).all()


def test_noise_has_its_deviation_and_its_dropouts() -> None:
    """Noise is normal with the deviation given, a tenth of the echoes is lost, none is negative."""
    told = noisy(np.full(100_000, 5.0), np.random.default_rng(1), deviation=0.03, dropout=0.1)
    kept = told[np.isfinite(told)]
    assert kept.std() == pytest.approx(0.03, rel=0.02)
    assert kept.mean() == pytest.approx(5.0, abs=1e-3)
    assert 1 - len(kept) / len(told) == pytest.approx(0.1, abs=0.005)
    assert (noisy(np.zeros(1000), np.random.default_rng(2), deviation=0.5) >= 0).all()


def test_beams_cover_the_circle_once() -> None:
    """A full circle has no beam twice; a sector has one at either end."""
    assert np.diff(beam_angles(180)) == pytest.approx(2 * np.pi / 180)
    assert beam_angles(3, np.pi) == pytest.approx([-np.pi / 2, 0, np.pi / 2])
