"""What users add in packages of their own: functions that entry points of a group name, beside those that are ours."""

from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Any

from quarterdeck.geo.errors import UnavailableError

FORMATS = "quarterdeck.formats"  # (mission, settings) -> content of each file by its name
METHODS = "quarterdeck.methods"  # (scenario, *, seed, **options) -> Mission


def addon_names(group: str) -> list[str]:
    """Return the names that installed packages add to a group."""
    return sorted({point.name for point in entry_points(group=group)})


def addon(group: str, name: str) -> Callable[..., Any]:
    """Return the function that a package adds under a name. Raises UnavailableError if it cannot be imported."""
    (point, *_) = entry_points(group=group, name=name)
    try:
        return point.load()
    except (ImportError, AttributeError) as error:
        raise UnavailableError(f"{name!r} of {point.value} cannot be used ({error}); install its package again") from None
