"""`quarterdeck export`: a plan as files that autopilots, charts and people read."""

from pathlib import Path
from typing import Any

import click

from quarterdeck.cli.files import takes
from quarterdeck.cli.output import force_option, terrain_option, tolerance_option
from quarterdeck.cli.parameters import Choice, Moment, Real
from quarterdeck.geo.errors import one_line


def _formats(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[str]:  # noqa: ARG001 - click calls it
    """Return what completes the last of some formats with commas."""
    from quarterdeck.exporters.export import FORMATS

    before, comma, last = incomplete.rpartition(",")
    return [f"{before}{comma}{name}" for name in ("all", *FORMATS) if name.startswith(last)]


@click.command(short_help="Autopilot and ECDIS files, recording, pictures.")
@takes("plan")
@click.option(
    "--to", "formats", required=True, shell_complete=_formats, help="Formats parted by commas, such as qgc-wpl,png; or all."
)
@click.option("-o", "--out", type=click.Path(), default=".", show_default=True, help="The folder to write into.")
@click.option(
    "--autopilot",
    type=Choice(["ardupilot", "px4"]),
    default="ardupilot",
    show_default=True,
    help="Whom mission files are for.",
)
@click.option(
    "--altitude",
    type=Choice(["relative", "terrain", "amsl"]),
    default="relative",
    show_default=True,
    help="What heights count from: home, the terrain, mean sea level.",
)
@click.option("--ground", type=Real(-500, 9000), help="Metres of the ground above mean sea level, for amsl.")
@terrain_option
@tolerance_option
@click.option("--storage", type=Choice(["4", "8", "15", "16", "32"]), default="16", show_default=True,
              help="ArduPilot: the board's storage in kB, which limits mission and fence.")  # fmt: skip
@click.option("--depart", type=Moment(), help="When the mission begins, ISO 8601: RTZ schedules get times.")
@click.option("--sorties", is_flag=True, help="Split what is beyond a vehicle's endurance into sorties, a folder each.")
@click.option("--unsafe", is_flag=True, help="Export a plan that fails a check all the same; what it fails is told.")
@force_option
def command(
    plan: str,
    formats: str,
    out: str,
    terrain: str | None,
    tolerance: float,
    storage: str,
    sorties: bool,
    unsafe: bool,
    force: bool,
    **options: Any,
) -> None:
    """Write PLAN (a file, or - for standard input) in other formats; print the paths of the files, one a line.

    A plan that `quarterdeck check` finds fault with is drawn, but not written for anything that would follow it.
    Every format and what it can't carry: docs/exports.md. A format that is not known is answered with the list.
    """
    from quarterdeck.exporters.export import FORMATS, export
    from quarterdeck.mission.planfile import read_plan

    names = list(FORMATS) if formats == "all" else [name.strip() for name in formats.split(",") if name.strip()]
    if not names:
        raise click.UsageError(f"--to names no format; known: {', '.join(FORMATS)}")
    mission = read_plan(plan)
    if terrain:
        from quarterdeck.geo.terrain import read_terrain

        options["terrain"] = read_terrain(terrain, mission.frame, mission.site.operating.bounds)
    options |= {"tolerance": tolerance, "storage": int(storage), "split": sorties, "force": force, "unsafe": unsafe}
    for path in export(mission, names, Path(out), tell=_note, **options):
        click.echo(path)


def _note(line: str) -> None:
    click.echo(one_line(f"note: {line}"), err=True)
