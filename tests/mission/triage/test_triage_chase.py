"""Finding somebody who moves: meetings in closed form, searches that leave nothing out."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, MultiPolygon, Point, Polygon, box

from quarterdeck.mission.triage.chase import LEGS, chase, expanding_square, meeting_time, predict, straight
from quarterdeck.mission.triage.records import Belief
from quarterdeck.mission.triage.team import ways_in

PLACE = st.tuples(st.integers(0, 80), st.integers(0, 50))


@given(PLACE, st.lists(PLACE, max_size=5), PLACE, st.floats(1.5, 10), st.floats(0, 90))
@settings(deadline=None, max_examples=80)
def test_a_pursuer_meets_the_predicted_course_as_early_as_can_be(
    start: tuple[int, int], stops: list[tuple[int, int]], here: tuple[int, int], speed: float, now: float
) -> None:
    """At the meeting time the course is exactly as far as the pursuer gets, and at no sampled time before."""
    belief = Belief(0.0, *start, speed=1.4, treat=10.0, busy=3.0, stops=tuple((x, y, 0) for x, y in stops))
    knots = predict(belief, straight)
    met = meeting_time(knots, here, speed, now)

    def gap(times: np.ndarray) -> np.ndarray:
        x, y = (np.interp(times, knots[:, 0], knots[:, i]) for i in (1, 2))
        return np.hypot(x - here[0], y - here[1]) - speed * (times - now)

    assert abs(gap(np.array([met]))[0]) < 1e-6
    assert (gap(np.linspace(now, met, 500)[:-1]) > -1e-6).all()
    corners = chase(knots, here, speed, now, straight)
    assert corners[-1] == (knots[-1, 1], knots[-1, 2])


@given(st.tuples(st.floats(0, 80), st.floats(0, 50)), st.floats(2, 8))
@settings(deadline=None, max_examples=30)
def test_an_expanding_square_passes_every_place_of_the_field(centre: tuple[float, float], reach: float) -> None:
    """Legs `LEGS` ranges apart come within range of all of the field, its borders and corners too, without leaving it."""
    field = MultiPolygon([box(0, 0, 80, 50)])
    path = LineString([centre, *expanding_square(centre, field, LEGS * reach, straight)])
    assert field.buffer(1e-6).covers(path)
    gx, gy = np.meshgrid(np.linspace(0, 80, 41), np.linspace(0, 50, 26))
    far = max(path.distance(Point(p)) for p in zip(gx.ravel(), gy.ravel(), strict=True))
    assert far <= reach


def test_an_expanding_square_goes_around_what_is_in_the_way() -> None:
    """In an L-shaped room with a pillar no leg leaves the room, and all of it is passed."""
    room = MultiPolygon(
        [Polygon([(0, 0), (30, 0), (30, 10), (10, 10), (10, 30), (0, 30)], [[(4, 4), (6, 4), (6, 6), (4, 6)]])]
    )
    path = LineString([(2.0, 2.0), *expanding_square((2.0, 2.0), room, 1.8, ways_in(room))])
    assert room.buffer(1e-3).covers(path)
    assert room.difference(path.buffer(1.4)).area < 0.01 * room.area
