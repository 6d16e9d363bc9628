"""Where results and tables go: results to a file or standard output, tables and progress to standard error."""

import os
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import click
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from quarterdeck.cli.files import reads, writes
from quarterdeck.cli.parameters import Real
from quarterdeck.geo.files import write_file
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.reason import Reason

output_option = writes("-o", "--output", default="-", show_default=True, help="The file to write; - is standard output.")
force_option = click.option("--force", is_flag=True, is_eager=True, help="Overwrite existing files.")
terrain_option = reads(
    "--terrain", help="Elevation model (GeoTIFF, ESRI ASCII grid): what flies holds its height above it."
)
tolerance_option = click.option("--tolerance", type=Real(min=0, min_open=True), default=5.0, show_default=True,
                                help="With --terrain: metres above or below that height between waypoints.")  # fmt: skip
seed_option = click.option(
    "--seed", default=0, show_default=True, type=click.IntRange(min=0), help="Seed of all that is random."
)


time_limit_option = click.option(
    "--time-limit",
    metavar="SECONDS",
    type=Real(min=0, min_open=True),
    help="End searches and runs after so long, with what there is by then; told. Seeds then promise nothing.",
)


def tell_stopping() -> None:
    """Tell whoever pressed Ctrl-C what comes of it."""
    with suppress(OSError):  # standard error may be closed
        os.write(2, b"\nending with what there is; Ctrl-C once more leaves it\n")  # no stream: it may be writing just now


def emit(content: str | bytes, output: str, *, force: bool) -> None:
    """Write `content` to the file `output`, or to standard output for `-`."""
    if output != "-":
        write_file(Path(output), content, force=force)
        return
    if isinstance(content, str):
        sys.stdout.write(content)
    else:
        sys.stdout.buffer.write(content)
    sys.stdout.flush()


def tell_compiling() -> None:
    """From now on tell whoever sits before it that hot loops are being compiled, if they are, and how long that took."""
    if not sys.stderr.isatty():
        return
    from time import monotonic

    from numba.core import event

    class Told(event.Listener):
        depth, seconds, began = 0, 0.0, 0.0

        def on_start(self, _: Any) -> None:
            if not self.depth and not self.seconds:
                click.echo("compiling the hot loops: once after installation, up to a minute", err=True)
            self.began = self.began if self.depth else monotonic()
            self.depth += 1

        def on_end(self, _: Any) -> None:
            self.depth -= 1
            self.seconds += 0.0 if self.depth else monotonic() - self.began

    told = Told()
    event.register("numba:compile", told)

    def close() -> None:
        event.unregister("numba:compile", told)
        if told.seconds:
            click.echo(f"compiled in {told.seconds:.0f} s, and kept for the next runs", err=True)

    click.get_current_context().call_on_close(close)


class Screen(Console):
    """A console to which names from files are text alone: what steers a terminal, or turns its writing, shows as U+FFFD."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Yield the segments of what is to be printed."""
        for segment in super().render(renderable, options):
            plain = "".join(c if c.isprintable() or c == "\n" else "\ufffd" for c in segment.text)
            yield segment if segment.control or plain == segment.text else Segment(plain, segment.style)


def console() -> Console:
    """Return the console on standard error; brackets and colons in names and reasons are just that, no markup."""
    return Screen(stderr=True, highlight=False, markup=False, emoji=False)


def print_reason(screen: Console, what: str, reason: Reason | str) -> None:
    """Print a line that begins with `what` in bold."""
    screen.print(Text.assemble((f"{what}:", "bold"), f" {reason}"), soft_wrap=True)


def print_figures(mission: Mission) -> None:
    """Print a plan's figures and each vehicle's on standard error."""
    screen = console()
    table = Table(title=f"{mission.name}: {mission.method}", title_justify="left")
    shares = mission.figures.get("shares")
    for column in ("vehicle", *(("share",) if shares is not None else ()), "length", "time", "energy"):
        table.add_column(column, justify="left" if column == "vehicle" else "right")
    for i, route in enumerate(mission.routes):
        share = [f"{100 * shares[i]:.2f} %"] if shares is not None else []
        table.add_row(
            route.vehicle, *share, f"{route.length / 1000:.2f} km", minutes(route.duration), f"{route.energy:.0f} Wh"
        )
    screen.print(table)
    known = {n: f for n, f in WORDS.items() if mission.figures.get(n) is not None}
    if "paper" in mission.figures:  # of tours along lines, as its bound and the paper's are; the table has the routes'
        known["makespan"] = ("makespan", "{:,.0f} s without turns and climbs", 1.0)
    screen.print(
        "; ".join(f"{label} {form.format(mission.figures[n] * factor)}" for n, (label, form, factor) in known.items())
    )
    if before := covered_before(mission):
        print_reason(screen, "covered before", f"{before:.2%}, which the coverage counts too")
    if paper := mission.figures.get("paper"):
        least, bound = mission.bounds["guards"], mission.bounds["makespan"]
        unseen = mission.figures["certificate"]["uncovered"]
        screen.print(f"at least {least} guards and {bound:,.0f} s; unseen {unseen:.3g} m2")
        screen.print(
            f"as the paper: {paper['guards']} guards, {paper['makespan']:,.0f} s (at least {paper['bound']:,.0f} s)"
        )
    for note in mission.figures.get("notes", ()):
        print_reason(screen, "note", note)
    print_cut(mission)
    for reason in mission.reasons:
        print_reason(screen, "infeasible", reason)


def covered_before(mission: Mission) -> float:
    """Return the part of the area that was covered before a replanned mission begins, from 0 to 1."""
    from shapely import get_coordinates

    from quarterdeck.coverage.metrics import covered_fraction

    if mission.spacing is None:
        return 0.0
    return covered_fraction([get_coordinates(line) for line in mission.surveyed], mission.site.coverable, mission.spacing)


def print_cut(mission: Mission) -> None:
    """Print what a time limit, or Ctrl-C, has cut short."""
    if cut := mission.figures.get("cut"):
        by = "Ctrl-C" if mission.figures.get("stopped") == "interrupted" else "--time-limit"
        print_reason(console(), f"cut short by {by}", ", ".join(cut))


WORDS = {
    "poc": ("coverage", "{:.2f} %", 100.0),
    "cell_poc": ("by cells", "{:.2f} %", 100.0),
    "hypervertices": ("hypervertices", "{:,.0f}", 1.0),
    "share_error_hypervertices": ("largest share error", "{:.2f} hypervertices", 1.0),
    "lines": ("lines", "{:,.0f}", 1.0),
    "laps": ("laps", "{:,.0f}", 1.0),
    "turns": ("turns", "{:,.0f}", 1.0),
    "length": ("survey length", "{:.2f} km", 0.001),
    "overlap": ("overlap", "{:.1f} %", 100.0),
    "guards": ("guards", "{:,.0f}", 1.0),
    "makespan": ("makespan", "{:,.0f} s", 1.0),
    "ratio": ("over its bound", "{:.2f}", 1.0),
    "energy": ("energy", "{:,.0f} Wh", 1.0),
    "least_overlap": ("least overlap", "{:.1f} %", 100.0),
    "lowest_above_ground": ("lowest above ground", "{:.1f} m", 1.0),
    "highest_above_ground": ("highest", "{:.1f} m", 1.0),
    "highest_amsl": ("highest above sea", "{:.1f} m", 1.0),
    "terrain_waypoints": ("waypoints for the terrain", "{:,.0f}", 1.0),
    "worst_ground_resolution": ("worst ground resolution", "{:.2f} cm", 100.0),
    "least_side_overlap": ("least side overlap", "{:.1f} %", 100.0),
    "least_frontal_overlap": ("least frontal overlap", "{:.1f} %", 100.0),
}


def minutes(seconds: float) -> str:
    """Return seconds as h:mm:ss."""
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"
