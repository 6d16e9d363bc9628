"""The potential field: touches nothing, arrives where it can, and knows when it is stuck."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from quarterdeck.physics.lidar import EdgeGrid, beam_angles, cast, edge_grid
from quarterdeck.physics.potential_field import (
    PAPER,
    SCALED,
    FieldParams,
    field_velocity,
    hull_reach,
    safe_speed,
    watch_progress,
)

ANGLES, HULL, STEP = beam_angles(180), 0.4, 0.1


def drive(
    grid: EdgeGrid, start: tuple[float, float], goal: tuple[float, float], seconds: float, params: FieldParams = SCALED
) -> tuple[np.ndarray, bool]:
    """Return the (n, 2) track of a round robot of radius HULL in the field, and whether it stalled."""
    pose, track = np.array([[*start, 0.0]]), [start]
    best, since = np.full(1, np.inf), np.zeros(1)
    keep = np.full((1, len(ANGLES)), HULL + 0.05)
    for _ in range(round(seconds / STEP)):
        ranges = cast(grid, pose, ANGLES, 10.0)
        velocity = field_velocity(pose, np.array([goal]), np.ones(1), ANGLES, ranges, keep, np.empty((0, 2)), params)
        pose[:, :2] += STEP * velocity
        pose[0, 2] = np.arctan2(velocity[0, 1], velocity[0, 0])
        track.append(tuple(pose[0, :2]))
        remaining = np.hypot(*(pose[:, :2] - goal).T)
        if remaining[0] < 0.1:
            return np.array(track), False
        if watch_progress(best, since, remaining, np.ones(1, bool), STEP)[0]:
            return np.array(track), True
    return np.array(track), False


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), paper=st.booleans())
def test_it_touches_nothing_in_a_field_of_discs(seed: int, paper: bool) -> None:
    """Whatever discs stand in the way, the hull stays off them, in either form; and it arrives or says that it stalled."""
    rng = np.random.default_rng(seed)
    discs = [shapely.Point(*rng.uniform((2, -5), (14, 5))).buffer(rng.uniform(0.2, 1.2)) for _ in range(12)]
    grid, solid = edge_grid(discs), shapely.union_all(discs)
    track, stalled = drive(grid, (0.0, rng.uniform(-2, 2)), (16.0, rng.uniform(-2, 2)), 120, PAPER if paper else SCALED)
    assert shapely.distance(shapely.points(track), solid).min() > HULL
    assert stalled or np.hypot(*(track[-1] - track[0])) > 14


def test_most_fields_of_discs_are_crossed() -> None:
    """Discs with room between them are no trap: at least 27 of 30 fields are crossed."""
    crossed = 0
    for seed in range(30):
        rng, discs = np.random.default_rng(seed), []
        while len(discs) < 8:
            disc = shapely.Point(*rng.uniform((2, -4), (14, 4))).buffer(rng.uniform(0.2, 1.0))
            if all(disc.distance(d) > 2 for d in discs):
                discs.append(disc)
        crossed += not drive(edge_grid(discs), (0.0, 0.0), (16.0, 0.0), 90)[1]
    assert crossed >= 27


@pytest.mark.parametrize("params", [PAPER, SCALED], ids=["paper", "scaled"])
def test_a_stall_in_a_trap_is_told(params: FieldParams) -> None:
    """In a U that opens towards it, with the goal behind, the robot stalls, says so, and touches nothing."""
    trap = shapely.LineString([(2, 3), (6, 3), (6, -3), (2, -3)]).buffer(0.2)
    track, stalled = drive(edge_grid([trap]), (0.0, 0.0), (12.0, 0.0), 120, params)
    assert stalled
    assert shapely.distance(shapely.points(track), trap).min() > HULL


def test_a_goal_beside_an_obstacle_is_reached_by_the_scaled_form_alone() -> None:
    """The plain repulsion keeps the robot off a goal near a wall (GNRON); scaled by the goal's distance it does not."""
    wall = edge_grid([shapely.box(5.6, -20, 8, 20)])
    with_paper, _ = drive(wall, (0.0, 0.0), (5.0, 0.0), 120, replace(PAPER, obstacles=0.3))
    scaled, stalled = drive(wall, (0.0, 0.0), (5.0, 0.0), 60)
    assert np.hypot(*(scaled[-1] - (5.0, 0.0))) < 0.1
    assert not stalled
    assert np.hypot(*(with_paper[-1] - (5.0, 0.0))) > 0.15


def test_the_papers_gains_leave_it_at_a_third_of_a_metre_a_second() -> None:
    """With nothing near, the published attraction of 0.3 is the speed; ours is the vehicle's."""
    far = np.full((1, len(ANGLES)), np.inf)
    pose, goal = np.zeros((1, 3)), np.array([[30.0, 40.0]])
    for params, speed in ((PAPER, 0.3), (SCALED, 0.9)):
        got = field_velocity(pose, goal, np.array([0.9]), ANGLES, far, np.zeros_like(far), np.empty((0, 2)), params)
        assert got[0] == pytest.approx([0.6 * speed, 0.8 * speed])


def test_robots_push_one_another_apart() -> None:
    """Two robots that face each other are turned aside, and to opposite sides."""
    pose = np.array([[0.0, 0.0, 0.0], [1.2, 0.0, np.pi]])
    goal = np.array([[10.0, 0.0], [-10.0, 0.0]])
    far = np.full((2, len(ANGLES)), np.inf)
    got = field_velocity(pose, goal, np.ones(2), ANGLES, far, np.full_like(far, 0.5), pose[:, :2])
    assert got[0, 0] < 0.5
    assert got[0] == pytest.approx(-got[1])
    assert abs(got[0, 1]) > 0.1


@given(seed=st.integers(0, 2**32 - 1))
def test_safe_speed_leaves_room_to_stop(seed: int) -> None:
    """At the speed allowed, no thing seen comes nearer by more than half of what is left of its distance in a third of a
    second.
    """
    rng = np.random.default_rng(seed)
    ranges = rng.uniform(0.6, 5, (1, len(ANGLES)))
    keep = hull_reach(ANGLES, 0.99, 0.67, 0.05)[None]
    speed = safe_speed(ANGLES, ranges, keep)[0]
    closing = speed * np.cos(ANGLES) / 3
    front = np.cos(ANGLES) > 0.05
    assert (closing[front] <= 0.5 * np.maximum(ranges - keep, 0)[0, front] + 1e-9).all()


def test_the_hull_reaches_its_corners() -> None:
    """Along the axes the reach is half the length and half the width; at the corner it is half the diagonal."""
    got = hull_reach(np.array([0.0, np.pi / 2, np.arctan2(0.6, 1.0)]), 1.0, 0.6, 0.1)
    assert got == pytest.approx([0.6, 0.4, np.hypot(0.5, 0.3) + 0.1])


def test_progress_is_watched() -> None:
    """Waiting is no stall; going to and fro without coming nearer is."""
    best, since = np.full(2, np.inf), np.zeros(2)
    stalled = np.zeros(2, bool)
    for i in range(110):
        remaining = np.array([10 + 0.1 * (-1) ** i, 10.0])
        stalled = watch_progress(best, since, remaining, np.array([True, False]), 0.1)
    assert stalled.tolist() == [True, False]
