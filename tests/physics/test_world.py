"""The PyBullet world: solid obstacles, bodies that go where they are sent unless something is in the way."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Point, Polygon, box

from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Obstacle, Vehicle
from quarterdeck.physics.world import open_world, prism

pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")
OTTER = Vehicle("usv", load_model("otter"), (0.0, 0.0))


@settings(deadline=None, max_examples=30)
@given(st.integers(3, 40), st.floats(0.5, 50), st.floats(0.1, 0.8), st.floats(0.5, 30))
def test_prism_is_closed_and_holds_its_volume(corners, radius, hole, height):
    """Every edge belongs to two triangles, and the caps have the polygon's area."""
    angles = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    ring = np.c_[np.cos(angles), np.sin(angles)] * radius
    polygon = Polygon(ring, [ring * hole])
    triangles = prism(polygon, -1.0, height)
    edges = np.sort(
        np.round(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2, 3), 9).view("V24").reshape(-1, 2), axis=1
    )
    assert np.all(np.unique(edges.copy().view("V48"), return_counts=True)[1] == 2)
    flat = np.ptp(triangles[:, :, 2], axis=1) == 0
    a, b = (triangles[flat][:, k, :2] - triangles[flat][:, 0, :2] for k in (1, 2))
    assert np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum() / 2 == pytest.approx(2 * polygon.area)


def test_free_bodies_go_exactly_where_they_are_sent():
    """A thousand steps of velocities: PyBullet's pose is the sum of them to a nanometre, far from the origin too."""
    random = np.random.default_rng(0)
    with open_world(0.1) as world:
        place, psi = np.array([[2e4, -1e4, 0.0]]), np.zeros(1)
        world.add_vehicles([OTTER], place, psi)
        for _ in range(1000):
            velocity, rate = np.r_[random.normal(0, 2, 2), 0.0], random.normal(0, 0.3)
            assert world.advance(velocity[None, :], np.array([rate])) == {}
            place, psi = place + velocity * 0.1, psi + rate * 0.1
        body, heading, _, _ = world.state(0)
    np.testing.assert_allclose(body, place[0], atol=1e-8)
    assert np.exp(1j * heading) == pytest.approx(np.exp(1j * psi[0]), abs=1e-9)


def test_an_obstacle_of_many_corners_is_chunked_and_solid():
    """More vertices than PyBullet takes in one mesh: still stops a body at its edge."""
    many = Obstacle("round", Point(30.0, 0.0).buffer(10.0, quad_segs=7000))
    with open_world(0.1) as world:
        world.add_obstacles([many])
        assert len(world.obstacles) >= 2
        world.add_vehicles([OTTER], np.zeros((1, 3)), np.zeros(1))
        touched = [world.advance(np.array([[2.0, 0, 0]]), np.zeros(1)) for _ in range(150)]
        x = world.state(0)[0][0]
    assert touched[-1] == {0: frozenset({-1})}
    assert x + 1.0 == pytest.approx(20.0, abs=0.3)


def test_only_the_domains_that_it_blocks_are_stopped_and_only_those_underway_collide():
    """A mast stops no vessel; two vessels being launched pass through each other, under way they do not."""
    other = Vehicle("two", load_model("otter"), (6.0, 0.0))
    with open_world(0.1) as world:
        world.add_obstacles([Obstacle("mast", box(-3, -1, -2, 1), blocks=frozenset({"aerial"}))])
        world.add_vehicles([OTTER, other], np.array([[0.0, 0, 0], [6.0, 0, 0]]), np.zeros(2))
        still = np.zeros(2)
        assert all(world.advance(np.array([[-1.0, 0, 0], [0, 0, 0]]), still) == {} for _ in range(50))
        world.set_underway(0, True)
        assert all(world.advance(np.array([[2.0, 0, 0], [0, 0, 0]]), still) == {} for _ in range(50))
        world.set_underway(1, True)
        hits = [world.advance(np.array([[2.0, 0, 0], [0, 0, 0]]), still) for _ in range(20)]
    assert {0: frozenset({1}), 1: frozenset({0})} in hits
