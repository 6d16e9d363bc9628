"""Deadlines: what looks at them, what they tell."""

import os
import signal
import time

import pytest
from numba.core import event

from quarterdeck.geo.deadline import abandoning, cause, go_on, limited, time_is_up, time_left
from quarterdeck.geo.errors import OutOfTimeError


def test_without_a_limit_time_is_never_up():
    """Nobody is cut who was not limited."""
    assert not time_is_up("a search")
    assert cause() == ""


def test_a_limit_that_is_reached_is_noted_once_a_search():
    """Each search that looks after the limit is named, in order; outside, the limit is gone."""
    with limited(1e-9) as limit:
        assert time_is_up("one")
        assert time_is_up("other")
        assert time_is_up("one")
        assert cause() == "time limit"
    assert limit.cut == ["one", "other"]
    assert not time_is_up("one")


def test_a_limit_that_is_not_reached_cuts_nothing():
    """An hour is not over."""
    with limited(3600.0) as limit:
        assert not time_is_up("one")
    assert limit.cut == []


def test_compiling_counts_for_nothing(monkeypatch):
    """A minute in which numba compiles, one function within another, takes nothing from five seconds; six others do."""
    now = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now)
    with limited(5.0):
        for begins in (True, True, False, False):
            (event.start_event if begins else event.end_event)("numba:compile")
            now += 20.0 if begins else 0.0
        now += 4.0
        assert not time_is_up("one")
        assert time_left() == pytest.approx(1.0)
        now += 2.0
        assert time_is_up("one")


def test_a_limit_within_another_ends_with_it_and_is_gone_after():
    """The nearer of both ends counts; what is around goes on until its own."""
    with limited(3600.0) as outer:
        with limited(1e-9) as inner:
            assert time_is_up("one")
        assert not time_is_up("other")
        with limited(7200.0):
            assert not time_is_up("other")
    assert inner.cut == outer.cut == ["one"]
    with limited(1e-9), limited(3600.0):
        assert time_is_up("one")


@pytest.mark.usefixtures("hears_ctrl_c")
def test_the_first_interrupt_ends_searches_and_the_second_everything():
    """A real SIGINT is noted, the next one raises; then Python's own handler stands again."""
    said = []
    with limited(interruptible=lambda: said.append("ending")) as limit:
        assert not time_is_up("one")
        os.kill(os.getpid(), signal.SIGINT)
        assert said == ["ending"]
        with limited(3600.0):
            assert time_is_up("one")
        assert limit.interrupted
        assert cause() == "interrupted"
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_only_what_may_be_abandoned_is_at_the_limit():
    """What has no result before its end says so, with what to do; elsewhere it is finished, whatever the limit."""
    with limited(1e-9), abandoning("give it longer"):
        with pytest.raises(
            OutOfTimeError, match="time limit: it ended the digging, before there was any result; give it longer"
        ) as told:
            go_on("the digging")
        assert not told.value.interrupted
    with limited(1e-9) as limit:
        go_on("the digging")
    assert limit.cut == []
    with abandoning("give it longer"):
        go_on("the digging")
