"""Arguments and options that are files: what is to be read is looked for first, then what would be overwritten."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from quarterdeck.geo.files import refuse_existing, refuse_missing

Decorator = Callable[[Any], Any]


class Source(click.Path):
    """A file to read, with `allow_dash` - for standard input; shells complete its name."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the path as it was given. Raises InputError if nothing is there."""
        if not value:
            self.fail("there is no path; give that of a file", param, ctx)
        if value == "-" and not self.allow_dash:
            self.fail("standard input is not read here; give the path of a file", param, ctx)
        if value == "-" and sys.stdin.isatty():
            self.fail("standard input is the keyboard; give the path of a file, or pipe one in", param, ctx)
        refuse_missing(value)
        return str(value)


def takes(name: str, *, pipe: bool = True, **attributes: Any) -> Decorator:
    """Return the argument of a file to read; with `pipe`, - is standard input. Eager: read before options are looked at."""
    return click.argument(name, type=Source(allow_dash=pipe), is_eager=True, **attributes)


def reads(*names: str, pipe: bool = False, metavar: str = "FILE", help: str, **attributes: Any) -> Decorator:  # noqa: A002
    """Return the option of a file to read, as `takes`."""
    return click.option(*names, type=Source(allow_dash=pipe), is_eager=True, metavar=metavar, help=help, **attributes)


def writes(*names: str, metavar: str = "FILE", help: str, **attributes: Any) -> Decorator:  # noqa: A002 - click's own name
    """Return the option of a file to write; one that exists is refused before the work without --force."""
    written = click.Path(readable=False, allow_dash=True)
    return click.option(*names, type=written, metavar=metavar, callback=_not_there, help=help, **attributes)


def _not_there(ctx: click.Context, param: click.Parameter, output: Any) -> Any:
    if output == "":
        raise click.BadParameter("there is no path; give that of a file", ctx, param)
    if output and output != "-":
        refuse_existing(Path(output), force=ctx.params["force"])
    return output
