"""The command line: one file a verb, imported only when it is called."""

import os
import signal
import sys
import threading
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path

import click
from click.shell_completion import CompletionItem

from quarterdeck import __version__
from quarterdeck.geo.errors import OutOfTimeError, QuarterdeckError, one_line

VERBS = {
    "chart": "ENC cells as a site.",
    "assign": "Visit tasks with priority, time and precedence.",
    "campaign": "Many runs of one plan, or of triage, on this machine or a cluster.",
    "check": "Every problem of a site or a plan.",
    "export": "Autopilot and ECDIS files, recording, pictures.",
    "init": "A small site to start from.",
    "plan": "Cover an area.",
    "replan": "From what has happened so far: losses, additions, withdrawals.",
    "replay": "Run a report or a plan again, and compare.",
    "report": "Measure a real mission from its logs as simulate measures a virtual one.",
    "reproduce": "A paper's tables beside ours.",
    "simulate": "Execute a plan in PyBullet; report and verdict.",
    "triage": "Search, relay, treat; the four methods.",
}


class LazyGroup(click.Group):
    """A group whose commands are modules with a `command`, imported only when called: `--help` stays fast.

    `package` holds the modules, `verbs` maps a command's name, which is its module's, to its one line of help.
    """

    def __init__(self, package: str, verbs: dict[str, str], **attributes: object) -> None:
        super().__init__(**attributes)  # type: ignore[arg-type]
        self.package = package
        self.verbs = verbs

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """Return the names of the commands."""
        return sorted(self.verbs)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:  # noqa: ARG002
        """Import and return a command."""
        return import_module(f"{self.package}.{name}").command if name in self.verbs else None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """Write the list of commands without importing any."""
        with formatter.section("Commands"):
            formatter.write_dl(sorted(self.verbs.items()))

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Return the commands that begin so, without importing any, and the group's own options."""
        own = [CompletionItem(name, help=text) for name, text in sorted(self.verbs.items()) if name.startswith(incomplete)]
        return own or click.Command.shell_complete(self, ctx, incomplete)

    def resolve_command(self, ctx: click.Context, args: list[str]) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, or suggest the nearest."""
        if args and args[0] not in self.verbs and not args[0].startswith("-"):
            near = get_close_matches(args[0], self.verbs, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(sorted(self.verbs))}"
            ctx.fail(f"No such command {args[0]!r}; {hint}")
        return super().resolve_command(ctx, args)


def _versions(ctx: click.Context, param: click.Parameter, asked: bool) -> None:  # noqa: ARG001
    """Print the versions of what results depend on, and end."""
    if not asked or ctx.resilient_parsing:
        return
    import platform
    from importlib.metadata import PackageNotFoundError, version

    import pyproj
    import shapely

    click.echo(f"quarterdeck, version {__version__}")
    inside = {"shapely": f" (GEOS {shapely.geos_version_string})", "pyproj": f" (PROJ {pyproj.proj_version_str})"}
    click.echo(f"python {platform.python_version()}")
    for name in ("numpy", "scipy", "numba", "shapely", "pyproj", "pybullet"):
        try:
            click.echo(f"{name} {version(name)}{inside.get(name, '')}")
        except PackageNotFoundError:
            click.echo(f"{name} is not installed")
    ctx.exit()


@click.command(
    cls=LazyGroup,
    package="quarterdeck.cli",
    verbs=VERBS,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Exit status: 0 done; 1 the mission is infeasible or the verdict fails; 2 wrong input or usage; 130 stopped.",
)
@click.option("--version", is_flag=True, is_eager=True, expose_value=False, callback=_versions,
              help="Show the versions of Quarterdeck and of what its results depend on.")  # fmt: skip
def group() -> None:
    """Plan, prove and export missions for fleets on land, at sea and in the air."""


def main(args: list[str] | None = None) -> None:
    """Run the command line: our own errors are one line on stderr and exit status 2; a SIGTERM is as a Ctrl-C."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:  # closed by whoever called us
            setattr(sys, name, Path(os.devnull).open(mode, encoding="utf-8"))  # noqa: SIM115 - for good
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # else what is being written would be left behind
    try:
        status = group.main(args=args, prog_name="quarterdeck", standalone_mode=False)
    except QuarterdeckError as error:
        _stop(f"quarterdeck: {one_line(str(error))}", 130 if isinstance(error, OutOfTimeError) and error.interrupted else 2)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except (click.Abort, KeyboardInterrupt):
        _stop("quarterdeck: interrupted", 130)
    except MemoryError:
        _stop("quarterdeck: out of memory; give a larger spacing or resolution, or a smaller site", 2)
    except BrokenPipeError:  # the reader of our standard output has gone: nothing is wrong
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as error:  # standard output: files say theirs themselves
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        _stop(f"quarterdeck: standard output cannot be written ({error.strerror or error}); give a file with -o", 2)
    sys.exit(status if isinstance(status, int) else 0)


def _stop(text: str, status: int) -> None:
    click.echo(text, err=True)
    sys.exit(status)
