"""When searches and runs have to end: at a time limit, or when Ctrl-C asks for it. They keep what they have."""

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from quarterdeck.geo.errors import OutOfTimeError


@dataclass
class Limit:
    """A limit: when it `ends` on `running_time`, whether Ctrl-C was pressed, and what was `cut` short by it."""

    ends: float
    interrupted: bool = False
    cut: list[str] = field(default_factory=list)

    @property
    def cause(self) -> str:
        """Why it cut: `interrupted` or `time limit`."""
        return "interrupted" if self.interrupted else "time limit"


_LIMIT: ContextVar[Limit | None] = ContextVar("limit", default=None)
_ADVICE: ContextVar[str] = ContextVar("advice", default="")  # what to do; "" outside `abandoning`


@contextmanager
def limited(seconds: float | None = None, *, interruptible: Callable[[], None] | None = None) -> Iterator[Limit]:
    """Have searches and runs within end after `seconds` of `running_time`, and when what is around them has to end.

    With `interruptible` at the first Ctrl-C too (in the main thread, which alone hears it), when it is called to say so.
    What cannot be cut, since there would be no result without it, still takes its time, but within `abandoning`; a second
    Ctrl-C ends it.
    """
    limit = _LIMIT.get() or Limit(math.inf)
    ended = limit.ends
    limit.ends = ended if seconds is None else min(ended, running_time() + seconds)
    token = _LIMIT.set(limit)

    def stop(*_: object) -> None:
        if limit.interrupted:
            raise KeyboardInterrupt
        limit.interrupted = True
        if interruptible:
            interruptible()

    hears = interruptible is not None and threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGINT, stop) if hears else None
    try:
        yield limit
    finally:
        if hears:
            signal.signal(signal.SIGINT, before)
        limit.ends = ended
        _LIMIT.reset(token)


def time_is_up(what: str) -> bool:
    """Tell whether the limit is reached; `what`, in the user's words, is then noted as cut short."""
    limit = _LIMIT.get()
    if limit is None or not (limit.interrupted or (limit.ends < math.inf and running_time() >= limit.ends)):
        return False
    if what not in limit.cut:
        limit.cut.append(what)
    return True


@contextmanager
def abandoning(advice: str) -> Iterator[None]:
    """Have work within that has no result before its end be abandoned at the limit, by `go_on`; elsewhere it is finished.

    `advice` says what to do then.
    """
    token = _ADVICE.set(advice)
    try:
        yield
    finally:
        _ADVICE.reset(token)


def go_on(what: str) -> None:
    """Return if there is time for `what`, in the user's words. At the limit raises OutOfTimeError within `abandoning`."""
    if _ADVICE.get() and time_is_up(what):
        text = f"{cause()}: it ended {what}, before there was any result; {_ADVICE.get()}"
        raise OutOfTimeError(text, interrupted=cause() == "interrupted")


def time_left() -> float | None:
    """Return the seconds until the limit, for what waits; None where there is none."""
    limit = _LIMIT.get()
    return None if limit is None or limit.ends == math.inf else max(0.0, limit.ends - running_time())


def cause() -> str:
    """Return why the time is up: `interrupted` or `time limit`; nothing where there is no limit."""
    limit = _LIMIT.get()
    return "" if limit is None else limit.cause


def running_time() -> float:
    """Return seconds that pass but while hot loops are compiled: that is once after installation, and no part of a run."""
    return time.monotonic() - _compiling().seconds


@cache
def _compiling() -> Any:
    """Return what counts in `seconds` how long numba has compiled from now on."""
    from numba.core import event

    class Counted(event.Listener):
        depth, began, seconds = 0, 0.0, 0.0

        def on_start(self, _: Any) -> None:
            self.began = self.began if self.depth else time.monotonic()
            self.depth += 1

        def on_end(self, _: Any) -> None:
            self.depth -= 1
            self.seconds += 0.0 if self.depth else time.monotonic() - self.began

    counted = Counted()
    event.register("numba:compile", counted)
    return counted
