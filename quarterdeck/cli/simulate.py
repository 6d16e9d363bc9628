"""`quarterdeck simulate`: execute a plan in PyBullet and judge it."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from hashlib import sha256
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from quarterdeck.cli.files import reads, takes, writes
from quarterdeck.cli.output import (
    console,
    emit,
    force_option,
    minutes,
    seed_option,
    tell_compiling,
    tell_stopping,
    time_limit_option,
)
from quarterdeck.cli.parameters import Choice, Real
from quarterdeck.cli.verdict import print_report
from quarterdeck.geo.errors import InputError, one_line

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from quarterdeck.mission.mission import Mission
    from quarterdeck.physics.simulate import Run


DOCUMENTS = ("plan", "unmapped", "world")  # the options that are GeoJSON to read; --terrain is a file too


class At(click.ParamType):
    """FILE@SECONDS: a file of changes, and when they are told."""

    name = "GEOJSON@SECONDS"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the text, once the seconds are a number."""
        path, at, moment = str(value).rpartition("@")
        try:
            if not (at and path and 0 <= float(moment) < inf):
                raise ValueError
        except ValueError:
            self.fail(f"{value!r} is not GEOJSON@SECONDS, such as late.geojson@600", param, ctx)
        return str(value)


class Vector(click.ParamType):
    """Two numbers with a comma: metres per second to the east and to the north."""

    name = "E,N"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, float]:
        """Return (east, north)."""
        try:
            east, north = (float(part) for part in (value if isinstance(value, tuple) else value.split(",")))
        except (ValueError, TypeError):
            self.fail(f"{value!r} is not two numbers with a comma, such as 0.3,-0.1", param, ctx)
        return east, north


class Limit(click.ParamType):
    """NAME=VALUE."""

    name = "NAME=VALUE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, float]:
        """Return (name, value)."""
        if isinstance(value, tuple):
            value = "=".join(map(str, value))
        name, _, number = value.partition("=")
        try:
            return name.strip(), float(number)
        except ValueError:
            self.fail(f"{value!r} is not NAME=VALUE, such as cross_track=1.5", param, ctx)


@click.command(short_help="Execute a plan in PyBullet; report and verdict.")
@takes("plan")
@writes("--report", help="Write the report as JSON.")
@writes("--rrd", help="Record the run for rerun.")
@writes("--picture", help="Draw plan, tracks and misses as a PNG.")
@writes("--snapshots", help="Draw the field of a triage plan at telling moments as PNG.")
@writes("--casualties", help="Write what became of a triage plan's casualties, GeoJSON.")
@writes("--trace", help="Write every sample of the run (NPZ).")
@writes(
    "--told", metavar="PLAN", help="Write the plan as it was told in the run (with --recover): for `report --track TRACE`."
)
@click.option("--current", type=Vector(), default="0,0", show_default=True, help="Water's motion, m/s east and north.")
@click.option("--wind", type=Vector(), default="0,0", show_default=True, help="Mean wind, m/s towards east and north.")
@click.option("--gusts", type=Real(min=0), default=0.0, show_default=True, help="Standard deviation of gusts, m/s.")
@click.option(
    "--fail",
    "faults",
    metavar="FAULT",
    multiple=True,
    help="What goes wrong: usv-2@600 (lost), gnss:usv-1@300-420, thruster:usv-3@100, comms:usv-1@50, random:3; repeatable.",
)
@click.option("--recover", is_flag=True, help="Replan in the run when a vehicle is lost, slow or back.")
@click.option("--changes", type=At(), multiple=True,
              help="Late wishes, as for `replan`, and when they are told (with --recover); repeatable.")  # fmt: skip
@click.option("--delay", type=Real(min=0), default=30.0, show_default=True,
              help="Seconds without a word before a vehicle is given up (with --recover).")  # fmt: skip
@click.option("--gnss", type=Choice(["rtk", "sbas", "single"]), help="Receivers with errors, instead of perfect ones.")
@click.option("--lidar", is_flag=True, help="Ground robots see by lidar, and steer clear of what is in their way.")
@click.option("--amcl", is_flag=True, help="Ground robots localise by their lidar on the site's map (implies --lidar).")
@click.option(
    "--field",
    type=Choice(["scaled", "paper"]),
    default="scaled",
    show_default=True,
    help="The potential field of robots with lidar: scaled by the goal's distance, or the inspection paper's.",
)
@reads("--unmapped", pipe=True, metavar="SITE", help="GeoJSON with obstacles that are there, and not in the plan.")
@reads("--world", pipe=True, metavar="SITE", help="GeoJSON with the obstacles that are there, in place of the plan's.")
@writes(
    "--map",
    "map_file",
    metavar="FILE.yaml",
    help="Write the map that the robots draw by lidar, for map_server, .yaml and .pgm (implies --lidar).",
)
@reads("--terrain", help="Ground that is not flat: GeoTIFF, ESRI ASCII grid or NPZ. See docs/simulation.md.")
@seed_option
@click.option(
    "--limit", "limits", type=Limit(), multiple=True, help="A limit of the verdict; repeatable. See docs/simulation.md."
)
@click.option("--step", type=Real(0.001, 0.1), default=0.1, show_default=True, help="Seconds a step of the world.")
@click.option("--json", "as_json", is_flag=True, help="Write the report as JSON to standard output.")
@time_limit_option
@force_option
def command(
    report: str | None,
    rrd: str | None,
    picture: str | None,
    snapshots: str | None,
    casualties: str | None,
    trace: str | None,
    told: str | None,
    as_json: bool,
    time_limit: float | None,
    force: bool,
    **options: Any,
) -> int:
    """Execute PLAN (a file, or - for standard input) with the vehicles' real dynamics, and tell whether it holds.

    Exit status 1 if the verdict fails. Ctrl-C ends the run and reports on it so far; a second one ends at once.
    """
    from quarterdeck.geo.deadline import limited

    if told and not options["recover"]:
        raise InputError("--told needs --recover: without it the plan is told as it is")
    if options["changes"] and not options["recover"]:
        raise InputError("--changes needs --recover: without it nobody replans")
    tell_compiling()
    with limited(time_limit, interruptible=tell_stopping) as limit:
        mission, run = execute(**options, casualties=bool(snapshots or casualties))
    if run.map is not None:
        from quarterdeck.geo.occupancy import write_map

        write_map(run.map, Path(options["map_file"]), force=force)
    if trace:
        emit(run.trace.to_bytes(mission.frame), trace, force=force)
    if told and run.told:
        from quarterdeck.mission.planfile import plan_text

        emit(plan_text(run.told), told, force=force)
    if report or as_json:
        from quarterdeck.physics.observed import with_state

        run = replace(run, report=with_state(mission, run, run.trace.tracks()))
    if report:
        emit(run.report.to_json(), report, force=force)
    plan = run.told or mission
    there = replace(plan, site=run.site or plan.site)
    if rrd:
        from quarterdeck.exporters.recording import recording

        emit(recording(there, run.trace, moments=run.moments), rrd, force=force)
    if picture:
        from quarterdeck.exporters.picture import picture as draw

        known = {o.id for o in plan.site.obstacles}
        strange = () if options["world"] else tuple(o for o in there.site.obstacles if o.id not in known)
        seen = draw(there, run.trace, run.report, strange=strange, moments=run.moments, followed=run.followed)
        emit(seen, picture, force=force)
    if run.triage is not None:
        from quarterdeck.exporters.casualties import casualties_geojson
        from quarterdeck.exporters.triage_picture import snapshots_png

        if snapshots:
            emit(snapshots_png(run.triage.driven), snapshots, force=force)
        if casualties:
            emit(casualties_geojson(run.triage.driven), casualties, force=force)
    if as_json:
        emit(run.report.to_json(), "-", force=force)
    print_report(mission, run.report)
    if limit.interrupted:
        return 130
    return 0 if run.report.passed else 1


def execute(
    plan: str,
    *,
    current: tuple[float, float],
    wind: tuple[float, float],
    gusts: float,
    faults: tuple[str, ...],
    recover: bool,
    delay: float,
    changes: tuple[str, ...] = (),
    gnss: str | None,
    lidar: bool,
    amcl: bool,
    field: Literal["scaled", "paper"],
    unmapped: str | None,
    world: str | None = None,
    map_file: str | None = None,
    terrain: str | None,
    seed: int,
    limits: tuple[tuple[str, float], ...],
    step: float,
    casualties: bool = False,
) -> tuple[Mission, Run]:
    """Execute a plan with the command's options; return its mission and the run, whose report tells them.

    Raises InputError if it is to tell of `casualties` and is no plan of triage.
    """
    options = {name: value for name, value in locals().items() if name != "casualties"}
    from quarterdeck.geo.files import read_bytes
    from quarterdeck.geo.geojson import opened
    from quarterdeck.geo.reader import read_obstacles
    from quarterdeck.geo.terrain import read_terrain
    from quarterdeck.mission.changes import read_changes
    from quarterdeck.mission.planfile import read_plan
    from quarterdeck.mission.recovery import recovering
    from quarterdeck.mission.triage.plan import METHOD
    from quarterdeck.physics.sensing import Sensing
    from quarterdeck.physics.simulate import simulate

    given = {name: opened(options[name]) for name in DOCUMENTS if options[name]}
    data = {name: document.data for name, document in given.items()} | ({"terrain": read_bytes(terrain)} if terrain else {})
    files = {name: sha256(content).hexdigest() for name, content in data.items()}
    mission = read_plan(given["plan"])
    if casualties and mission.method != METHOD:
        raise InputError("--snapshots and --casualties are for plans of triage; use --picture and --report")
    strange = read_obstacles(given["unmapped"], mission.frame) if unmapped else ()
    ground = read_terrain(terrain, mission.frame, mission.site.operating.bounds) if terrain else None
    there = read_obstacles(given["world"], mission.frame) if world else None
    parted = [text.rpartition("@") for text in changes]
    documents = {path: opened(path) for path, _, _ in parted}
    files |= {path: sha256(document.data).hexdigest() for path, document in documents.items()}
    wishes = [(float(moment), read_changes(documents[path], mission)) for path, _, moment in parted]
    mapping = map_file is not None
    sensing = Sensing(gnss, lidar or mapping, amcl, strange, there, mapping, field)
    with _progress(mission.name) as progress:
        run = simulate(
            mission,
            director=recovering(mission, delay=delay, tell=_replanned, changes=wishes) if recover else None,
            expected=recovering(mission, delay=delay, changes=wishes) if recover else None,
            changes=wishes,
            seed=seed,
            step=step,
            current=current,
            wind=wind,
            gusts=gusts,
            faults=faults,
            sensing=sensing,
            terrain=ground,
            limits=dict(limits),
            progress=progress,
        )
    command = {"verb": "simulate", "options": options, "files": files}
    return mission, replace(run, report=replace(run.report, command=command))


@contextmanager
def _progress(title: str) -> Iterator[Callable[[float, float], None]]:
    """Show a bar on standard error, where that is a terminal: simulated time, how many times real time, time left."""
    from time import monotonic

    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    screen = console()
    columns = [
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.fields[clock]}"),
        TimeRemainingColumn(),
    ]
    began = shown = monotonic()
    with Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal) as bar:
        task = bar.add_task(title, clock="")

        def tell(done: float, expected: float) -> None:
            nonlocal shown
            now = monotonic()
            if now - shown > 0.1:
                shown = now
                clock = f"{minutes(done)} at {done / (now - began):.0f}x"
                bar.update(task, completed=done, total=max(expected, done), clock=clock)

        yield tell


def _replanned(time: float, after: Mission) -> None:
    click.echo(one_line(f"{minutes(time)}: replanned for {', '.join(v.id for v in after.vehicles)}"), err=True)
    for reason in after.reasons:
        click.echo(f"  {one_line(str(reason))}", err=True)
