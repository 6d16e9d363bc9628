"""The errors that a user can cause."""


class QuarterdeckError(Exception):
    """Base of all errors that Quarterdeck raises on purpose; its text is one line meant for the user."""


class InputError(QuarterdeckError, ValueError):
    """The input is wrong. The text names the feature, the place in the file and what to do; exit status 2."""


class UnavailableError(QuarterdeckError, RuntimeError):
    """Something that this machine lacks is needed, such as PyBullet. The text says how to get it; exit status 2."""


class OutOfTimeError(QuarterdeckError, RuntimeError):
    """The time limit came before there was any result, or Ctrl-C where `interrupted`: exit status 2, or 130."""

    def __init__(self, text: str, *, interrupted: bool) -> None:
        super().__init__(text)
        self.interrupted = interrupted


def one_line(text: str) -> str:
    """Return a message as one line of at most 1000 characters, without what steers a terminal: names are from files."""
    line = "".join(c if c.isprintable() else "\ufffd" for c in " ".join(text.split()))
    return line if len(line) <= 1000 else f"{line[:997]}..."
