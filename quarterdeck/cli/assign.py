"""`quarterdeck assign`: visit tasks with priority, time and precedence."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from quarterdeck.cli.files import reads, takes, writes
from quarterdeck.cli.output import (
    console,
    emit,
    force_option,
    minutes,
    output_option,
    print_cut,
    print_reason,
    seed_option,
    tell_compiling,
    time_limit_option,
)
from quarterdeck.cli.parameters import Choice, Numbers, Real

if TYPE_CHECKING:
    from quarterdeck.geo.scenario import Scenario
    from quarterdeck.mission.mission import Mission


class PriorityFunction(click.ParamType):
    """linear, power:SCALE,EXPONENT or logistic:MIDPOINT,WIDTH."""

    name = "FUNCTION"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, tuple[float, float] | None]:
        """Return the function's name and its two parameters, None where they are the defaults."""
        if isinstance(value, tuple):
            return value
        name, _, given = value.partition(":")
        if name not in ("linear", "power", "logistic"):
            self.fail(f"{name!r} is not one of linear, power, logistic", param, ctx)
        if not given:
            return name, None
        if name == "linear":
            self.fail("linear takes no parameters", param, ctx)
        a, b = Numbers("two numbers above 0", 2).convert(given, param, ctx)
        if a <= 0 or b <= 0:
            self.fail(f"{given!r} is not two numbers above 0", param, ctx)
        return name, (a, b)


@click.command(short_help="Visit tasks with priority, time and precedence.")
@takes("site", default="-")
@output_option
@click.option("--objective", type=Choice(["operator", "paper"]), default="operator", show_default=True,
              help="Makespan and urgency in seconds; or eq. 4-6 of the paper and its own genetic algorithm.")  # fmt: skip
@click.option("--weights", type=Numbers("W0,W1,W2,W3", 4), default="0,0.1,0.3,1", show_default=True,
              help="What a second until a task starts costs, by priority, in seconds of makespan.")  # fmt: skip
@click.option("--priority-function", type=PriorityFunction(), default="linear", show_default=True,
              help="How cost grows with time: linear, power:SCALE,EXPONENT or logistic:MIDPOINT,WIDTH (s).")  # fmt: skip
@click.option("--tiers", is_flag=True, help="No vehicle does a task of lower priority before one of higher.")
@reads("--map", "map_file", metavar="FILE.yaml", help="Drive on this ROS map_server map, not on the site's polygons.")
@click.option(
    "--map-origin",
    type=Numbers("LON,LAT", 2),
    help="Where the map's (0, 0) lies; default what the map says, else the site's centre.",
)
@writes("--write-map", metavar="FILE.yaml", help="Write the site's ground map for map_server, .yaml and .pgm.")
@click.option("--resolution", type=Real(min=0, min_open=True), help="Side of the map's cells, m.")
@click.option("--heuristic", type=Choice(["none", "octile", "manhattan"]), default="none", show_default=True,
              help="Dijkstra; A*; or A* with the paper's heuristic, inadmissible: ways may be longer.")  # fmt: skip
@click.option("--iterations", type=click.IntRange(min=1), default=100, show_default=True, help="Generations of the search.")
@time_limit_option
@seed_option
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON on standard error instead of a table.")
@force_option
def command(
    site: str,
    output: str,
    priority_function: tuple[str, tuple[float, float] | None],
    map_file: str | None,
    map_origin: tuple[float, float] | None,
    write_map: str | None,
    as_json: bool,
    force: bool,
    **options: Any,
) -> int:
    """Allot the tasks of SITE, a GeoJSON file (- reads standard input), to its vehicles, and write the PLAN.

    Ctrl-C ends the search and writes the best plan so far.
    """
    from rich.progress import Progress, TextColumn, TimeElapsedColumn

    from quarterdeck.api import assign, plan_text, read_scenario
    from quarterdeck.cli.advice import far_off, print_notes
    from quarterdeck.geo.geojson import opened
    from quarterdeck.mission.planfile import plan_outcome
    from quarterdeck.mission.twin import map_scenario

    tell_compiling()
    document = opened(site)
    scenario = read_scenario(document)
    if not as_json:
        print_notes(far_off(scenario, document))
    twin = None
    if map_file is not None:
        scenario, twin = map_scenario(scenario, map_file, map_origin)
    elif map_origin is not None:
        raise click.UsageError("--map-origin needs --map")
    shape, parameters = priority_function
    columns = (TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=console(), transient=True, disable=not console().is_terminal) as bar:
        line = bar.add_task("ways between tasks")

        def progress(done: int, best: float, bound: float) -> None:
            gap = f", at most {100 * (best / bound - 1):.1f} % above the best possible" if bound > 0 else ""
            bar.update(line, description=f"generation {done}: {best:,.1f}{gap}")

        mission = assign(scenario, twin=twin, shape=shape, shape_parameters=parameters, progress=progress, **options)
    if write_map is not None:
        _write_map(scenario, Path(write_map), options["resolution"], force=force)
    emit(plan_text(mission), output, force=force)
    if as_json:
        click.echo(json.dumps(plan_outcome(mission)), err=True)
    else:
        _print(mission)
    if mission.figures["stopped"] == "interrupted":
        return 130
    return 0 if mission.feasible else 1


def _write_map(scenario: Scenario, path: Path, resolution: float | None, *, force: bool) -> None:
    from quarterdeck.geo.occupancy import site_occupancy, write_map
    from quarterdeck.mission.travel import default_resolution

    made = site_occupancy(scenario.site, "ground", resolution or default_resolution(scenario))
    write_map(replace(made, place=(scenario.frame.lon, scenario.frame.lat)), path, force=force)


def _print(mission: Mission) -> None:
    from rich.table import Table

    screen, figures = console(), mission.figures
    table = Table(title=f"{mission.name}: {len(mission.tasks)} tasks", title_justify="left")
    for column in ("vehicle", "tasks in order", "length", "home at", "energy"):
        table.add_column(column, justify="left" if column in ("vehicle", "tasks in order") else "right")
    for route in mission.routes:
        tasks = " ".join(w.task for w in route.waypoints if w.task is not None)
        length, energy = f"{route.length:,.0f} m", f"{route.energy:,.0f} Wh"
        table.add_row(route.vehicle, tasks or "-", length, minutes(route.duration), energy)
    screen.print(table)
    bound = mission.bounds["objective"]
    above = figures["objective"] / bound - 1 if bound else None
    proof = "" if above is None else f" (the bound is {bound:,.1f})" if above > 1e-9 else " (the best possible)"
    screen.print(
        f"makespan {figures['makespan']:,.1f} s; objective {figures['objective']:,.1f}{proof}; "
        f"waiting {figures['waiting']:,.1f} s; stopped by {figures['stopped']} after {figures['iterations']} generations",
        soft_wrap=True,
    )
    for level, start in figures["latest_start_by_priority"].items():
        if level != "0":
            screen.print(f"the last task of priority {level} begins at {start:,.0f} s")
    for name, metres in figures["served_from_metres_off"].items():
        screen.print(f"task {name!r} is served from {metres:.2f} m off: clearance keeps the vehicle away", soft_wrap=True)
    print_cut(mission)
    for reason in mission.reasons:
        print_reason(screen, "infeasible", reason)
