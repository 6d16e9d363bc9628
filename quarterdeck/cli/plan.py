"""`quarterdeck plan`: cover an area."""

import json
import math
from typing import TYPE_CHECKING, Any

import click

from quarterdeck.cli.files import takes
from quarterdeck.cli.output import (
    emit,
    force_option,
    output_option,
    print_figures,
    seed_option,
    tell_compiling,
    tell_stopping,
    terrain_option,
    time_limit_option,
    tolerance_option,
)
from quarterdeck.cli.parameters import Choice, Numbers, Real
from quarterdeck.geo.addons import METHODS, addon_names

if TYPE_CHECKING:
    from quarterdeck.geo.frame import Frame
    from quarterdeck.geo.scenario import Scenario
    from quarterdeck.geo.terrain import Terrain

OPTIONS = {
    "stc": ("spacing", "placement", "angle", "edge"),
    "lines": ("spacing", "angle", "run", "cross_every", "entry", "alternate", "lap"),
    "guards": ("range", "mode", "inspect"),
}


@click.command(short_help="Cover an area.")
@takes("site", default="-")
@output_option
@click.option("--method", type=Choice([*OPTIONS, *addon_names(METHODS)]),
              help="stc: spanning trees; lines: parallel lines (default where a vehicle has a sensor); "
              "guards: all seen from within a range.")  # fmt: skip
@click.option("--spacing", type=Real(), help="stc, lines: metres between neighbouring tracks (the paper's 2 delta).")
@click.option("--placement", type=Choice(["annealed", "paper", "none"]),
              help="stc: how the grid is placed: annealed (default), as Algorithm 1 is printed, or not.")  # fmt: skip
@click.option("--angle", type=Real(), help="stc, lines: fix the tracks' direction: compass degrees.")
@click.option("--edge", type=Choice(["whole", "cells", "lap"]),
              help="stc: how far tracks reach: whole 2 x 2 cells, every free cell (default), or laps too.")  # fmt: skip
@click.option("--run", type=Real(), help="lines: metres driven straight before and after each line.")
@click.option("--cross-every", type=int, help="lines: add lines across, so many spacings apart (1: a crosshatch).")
@click.option("--entry", type=Numbers("LON,LAT", 2), help="lines: begin at the end of a line nearest to this point.")
@click.option("--alternate", type=click.IntRange(min=2), metavar="N",
              help="lines: drive every Nth line first, the skipped ones on the way back: room for wide turns.")  # fmt: skip
@click.option("--lap", is_flag=True, default=None,
              help="lines: first one lap along the border and around obstacles, half a spacing in.")  # fmt: skip
@click.option("--range", type=Real(), help="guards: metres that vehicles see which have no range of their own.")
@click.option("--mode", type=Choice(["optimised", "paper"]), help="guards: as the paper, or better (default).")
@click.option("--inspect", type=Choice(["area", "border"]), help="guards: see all of the area (default), or all edges.")
@terrain_option
@tolerance_option
@seed_option
@time_limit_option
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON on standard error instead of a table.")
@force_option
def command(
    site: str,
    output: str,
    method: str | None,
    terrain: str | None,
    tolerance: float,
    seed: int,
    time_limit: float | None,
    as_json: bool,
    force: bool,
    **options: Any,
) -> int:
    """Plan a mission that covers the areas of SITE, a GeoJSON file (- reads standard input), and write it as a PLAN.

    Ctrl-C ends the searches and writes what there is; a second one ends at once, with nothing.
    """
    from quarterdeck.api import default_method, plan, plan_text, read_scenario
    from quarterdeck.cli.advice import far_off, print_notes, refused
    from quarterdeck.geo.deadline import limited
    from quarterdeck.geo.geojson import opened
    from quarterdeck.mission.planfile import plan_outcome

    tell_compiling()
    given = {name: value for name, value in options.items() if value is not None}
    document = opened(site)
    scenario = read_scenario(document)
    if not as_json:
        print_notes(far_off(scenario, document))
    method = method or default_method(scenario)
    for name in given:
        if name not in OPTIONS.get(method, given):
            raise click.UsageError(f"--{name.replace('_', '-')} does not belong to --method {method}")
    if "angle" in given:
        given["angle"] = math.radians(90.0 - given["angle"])
    if "entry" in given:
        given["entry"] = _entry(given["entry"], scenario.frame)
    ground = _terrain(terrain, scenario) if terrain else None
    with limited(interruptible=tell_stopping) as limit:
        mission = plan(
            scenario, method=method, seed=seed, terrain=ground, tolerance=tolerance, time_limit=time_limit, **given
        )
    emit(plan_text(mission), output, force=force)
    if as_json:
        click.echo(json.dumps(plan_outcome(mission)), err=True)
    else:
        print_figures(mission)
        print_notes(refused(mission))
    if limit.interrupted:
        return 130
    return 0 if mission.feasible else 1


def _terrain(path: str, scenario: "Scenario") -> "Terrain":
    """Return the terrain about the site. Raises InputError if nothing flies, or it is not known all over the areas."""
    from quarterdeck.geo.errors import InputError
    from quarterdeck.geo.terrain import read_terrain, refuse_void

    if not any(v.domain == "aerial" for v in scenario.vehicles):
        raise InputError("--terrain is for what flies, and no vehicle of this site does; `simulate` has it for rovers")
    terrain = read_terrain(path, scenario.frame, scenario.site.operating.bounds)
    refuse_void(terrain, scenario.site.area, scenario.frame)
    return terrain


def _entry(lonlat: tuple[float, float], frame: "Frame") -> tuple[float, float]:
    """Return the point in metres. Raises InputError if it is no place near the site."""
    import numpy as np

    from quarterdeck.geo.errors import InputError
    from quarterdeck.geo.frame import MAX_RADIUS
    from quarterdeck.geo.geojson import position_problem

    if problem := position_problem(list(lonlat)):
        raise InputError(f"--entry: {problem}")
    x, y = frame.to_metres(np.array(lonlat))[0]
    if not math.hypot(x, y) <= MAX_RADIUS:
        raise InputError(f"--entry: is more than {MAX_RADIUS / 1000:.0f} km from the site's centre; give LON,LAT near it")
    return float(x), float(y)
