"""Kinds of option values that several commands take."""

import math
from typing import Any

import click


class Numbers(click.ParamType):
    """So many numbers with commas."""

    def __init__(self, name: str, *counts: int) -> None:
        self.name = name
        self.counts = counts

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        """Return the numbers."""
        if isinstance(value, tuple):
            return value
        try:
            numbers = tuple(float(part) for part in value.split(","))
        except ValueError:
            self.fail(f"{value!r} is not {self.name}: numbers with commas", param, ctx)
        if len(numbers) not in self.counts or not all(map(math.isfinite, numbers)):
            self.fail(f"{value!r} is not {self.name}", param, ctx)
        return numbers
