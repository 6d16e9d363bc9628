"""The fast world's closed forms against dense sampling, and its events."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from quarterdeck.mission.director import Command, Director
from quarterdeck.mission.mission import Waypoint
from quarterdeck.mission.world import Actor, Fault, Target, run_world

XY = st.tuples(st.integers(-20, 20), st.integers(-20, 20))


def sent(routes: dict[str, list[Waypoint]]) -> Director:
    """Return a director that commands routes once."""

    def direct(time: float, states: Any, events: Any, memory: Any) -> tuple[dict[str, Command], Any]:
        return ({} if memory else {v: Command(tuple(r)) for v, r in routes.items()}), True

    return direct


def sampled(track: np.ndarray, times: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(times, track[:, 0], track[:, i]) for i in (1, 2)])


@given(st.lists(XY, min_size=1, max_size=4), st.lists(XY, min_size=1, max_size=4), st.floats(0.5, 10))
@settings(deadline=None, max_examples=60)
def test_meetings_are_where_the_distance_crosses_the_range(a: list, b: list, reach: float) -> None:
    """Each `met` is a moment at which the distance equals the range (or is below it at the start); none is missed."""
    routes = {n: [Waypoint(x, y, speed=s) for x, y in r] for n, r, s in (("a", a, 1.0), ("b", b, 2.5))}
    run = run_world(sent(routes), [Actor("a", 0, 0), Actor("b", 5, 5)], [], [(0, 1)], reach)
    met = [t for t, e in run.events if e.kind == "met"]
    times = np.linspace(0, max(run.tracks["a"][-1, 0], run.tracks["b"][-1, 0]), 4001)
    apart = np.hypot(*(sampled(run.tracks["a"], times) - sampled(run.tracks["b"], times)).T)
    for t in met:
        gap = np.hypot(*(sampled(run.tracks["a"], np.array([t])) - sampled(run.tracks["b"], np.array([t])))[0])
        assert gap == pytest.approx(reach, abs=1e-6) if t > 0 else gap <= reach + 1e-6
    entries = np.flatnonzero((apart[1:] < reach - 0.05) & (apart[:-1] >= reach - 0.05))
    for k in entries:  # the world says so before the sampling sees them clearly inside
        assert any(t <= times[k + 1] + 1e-9 for t in met)


@given(st.lists(XY, min_size=1, max_size=5), XY, st.floats(0.5, 6))
@settings(deadline=None, max_examples=60)
def test_a_target_is_seen_once_at_the_first_moment_in_range(route: list, spot: tuple[int, int], sees: float) -> None:
    """`seen` comes exactly when the distance first falls to the sensing range, never twice, and never without reason."""
    waypoints = {"a": [Waypoint(x, y, speed=1.5) for x, y in route]}
    run = run_world(sent(waypoints), [Actor("a", 0, 0, sees=sees)], [Target("t", *spot)], [], 1.0)
    seen = [t for t, e in run.events if e.kind == "seen"]
    track = run.tracks["a"]
    times = np.linspace(0, track[-1, 0], 4001)
    apart = np.hypot(*(sampled(track, times) - np.array(spot)).T)
    assert len(seen) <= 1
    if seen:
        assert not (apart[times < seen[0] - 1e-9] < sees - 1e-9).any()
        assert np.hypot(*(sampled(track, np.array(seen)) - np.array(spot))[0]) <= sees + 1e-6
    else:
        assert (apart > sees - 1e-6).all()


def test_holds_earliest_departures_and_tasks() -> None:
    """A waypoint's hold and earliest departure are kept; its task is served after the hold."""
    route = [Waypoint(10, 0, speed=2.0, hold=3.0, task="t"), Waypoint(10, 5, speed=1.0, time=20.0)]
    run = run_world(sent({"a": route}), [Actor("a", 0, 0)], [], [], 1.0)
    assert [(t, e.kind, e.subject) for t, e in run.events] == [(8.0, "served", "t")]
    assert run.tracks["a"].tolist() == [[0, 0, 0], [5, 10, 0], [8, 10, 0], [20, 10, 0], [25, 10, 5]]
    assert run.length("a") == 15.0


def test_a_stopped_actor_stands_and_a_mute_one_goes_on() -> None:
    """`stop` freezes an actor where it is, unmet; `mute` lets it go on, and tells of its beginning and its end."""
    routes = {"a": [Waypoint(10, 0, speed=1.0)], "b": [Waypoint(0, 1, speed=1.0)]}
    actors = [Actor("a", 0, 0), Actor("b", 10, 1)]
    stopped = run_world(sent(routes), actors, [], [(0, 1)], 2.0, faults=[Fault("a", 2.0)])
    assert stopped.tracks["a"][-1].tolist() == [2.0, 2.0, 0.0]
    assert [e.kind for _, e in stopped.events] == ["lost"]
    mute = run_world(sent(routes), actors, [], [(0, 1)], 2.0, faults=[Fault("a", 2.0, "mute", 3.0)])
    assert mute.tracks["a"][-1, 1] == 10.0
    assert [(t, e.kind) for t, e in mute.events if e.kind != "met"] == [(2.0, "lost"), (3.0, "returned")]


def test_a_run_is_cut_at_its_time_limit_with_a_reason() -> None:
    """A mission that does not end in time is told as such."""
    run = run_world(sent({"a": [Waypoint(100, 0, speed=1.0)]}), [Actor("a", 0, 0)], [], [], 1.0, until=30.0)
    assert "30 s" in run.reason
    assert run.tracks["a"][-1].tolist() == [30.0, 30.0, 0.0]
