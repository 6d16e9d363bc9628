"""Kinds of option values that several commands take."""

import math
from datetime import UTC, datetime
from difflib import get_close_matches
from typing import Any

import click


class Real(click.FloatRange):
    """A finite number, within limits where they are given."""

    name = "float"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number."""
        number = super().convert(value, param, ctx)
        if not abs(number) <= 1e12:
            self.fail(f"{value!r} is not a finite number up to 1e12", param, ctx)
        return number

    def _describe_range(self) -> str:
        """Return what the help says of limits; of none nothing."""
        return "" if self.min is None and self.max is None else super()._describe_range()


class Choice(click.Choice[str]):
    """One of some words; what is none is answered with the nearest."""

    def get_invalid_choice_message(self, value: Any, ctx: click.Context | None) -> str:
        """Return what to say of a word that is none."""
        near = get_close_matches(str(value), [str(choice) for choice in self.choices], n=1)
        known = super().get_invalid_choice_message(value, ctx)
        return f"{known} Did you mean {near[0]!r}?" if near else known


class Moment(click.ParamType):
    """A date and time, ISO 8601; UTC where it says no zone."""

    name = "ISO8601"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> datetime:
        """Return the moment in UTC."""
        if isinstance(value, datetime):
            return value
        try:
            moment = datetime.fromisoformat(value)
            moment = moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)
        except (ValueError, OverflowError):
            moment = datetime.min.replace(tzinfo=UTC)
        if not 1900 <= moment.year <= 9000:
            self.fail(f"{value!r} is no date and time such as 2026-05-01T06:30Z", param, ctx)
        return moment


class Numbers(click.ParamType):
    """So many numbers with commas."""

    def __init__(self, name: str, *counts: int) -> None:
        self.name = name
        self.counts = counts

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """Return the numbers."""
        try:
            numbers = tuple(float(part) for part in (value if isinstance(value, tuple) else value.split(",")))
        except (ValueError, TypeError):
            self.fail(f"{value!r} is not {self.name}: numbers with commas", param, ctx)
        if len(numbers) not in self.counts or not all(math.isfinite(number) for number in numbers):
            self.fail(f"{value!r} is not {self.name}", param, ctx)
        return numbers
