"""What a study can study: each kind reads its own conditions and makes cases that know how to run."""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

BETWEEN = " | "  # between the reasons in a row: one may well have semicolons of its own


class Case(Protocol):
    """One run of a study; it travels to the process that runs it. `levels` are the conditions that the study varies."""

    @property
    def number(self) -> int:
        """Its place among the study's runs."""

    @property
    def seed(self) -> int:
        """Of all that is random in it."""

    @property
    def levels(self) -> Mapping[str, Any]:
        """The values of what the study varies."""

    def row(self) -> dict[str, Any]:
        """Return the case as columns of a table."""

    def run(self, text: str, limits: dict[str, float]) -> dict[str, Any]:
        """Return `passed`, `reasons`, BETWEEN them, and the figures of the run of the plan or site in `text`."""

    def replay(self, source: str, limits: Mapping[str, float]) -> str:
        """Return the command that runs the case again; `source` is the path of what is run."""


@dataclass(frozen=True, slots=True)
class Kind:
    """How the conditions of a kind of study are read.

    `table` is their table in the TOML; `names` all of them; `numbers` those that can be drawn, with their unit; `lists`
    those whose one value is a list. `value` checks one and returns it as the cases take it; `case` makes a case of its
    number, seed, conditions and levels. `figures` are those that the summary tells.
    """

    table: str
    names: tuple[str, ...]
    numbers: Mapping[str, str]
    lists: tuple[str, ...]
    value: Callable[[str, Any], Any]
    case: Callable[[int, int, Mapping[str, Any], Mapping[str, Any]], Case]
    figures: tuple[str, ...]


def is_number(value: Any) -> bool:
    """Tell whether a TOML value is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max
