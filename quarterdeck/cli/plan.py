"""`quarterdeck plan`: cover an area."""

import json
import math
from typing import Any

import click

from quarterdeck.cli.output import emit, force_option, output_option, print_figures, seed_option


@click.command(short_help="Cover an area.")
@click.argument("site", default="-")
@output_option
@click.option("--spacing", type=float, help="Metres between neighbouring tracks (the paper's 2 delta); default the site's.")
@click.option("--placement", type=click.Choice(["annealed", "paper", "none"]), default="annealed", show_default=True,
              help="How the grid is placed: annealed, as the paper's Algorithm 1 is printed, or not.")  # fmt: skip
@click.option("--angle", type=float, help="Fix the direction of the tracks: compass degrees.")
@click.option("--edge", type=click.Choice(["whole", "cells", "lap"]), default="cells", show_default=True,
              help="How far tracks reach: whole 2 x 2 cells, every free cell, or laps along borders too.")  # fmt: skip
@seed_option
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON on standard error instead of a table.")
@force_option
def command(site: str, output: str, angle: float | None, as_json: bool, force: bool, **options: Any) -> int:
    """Plan a mission that covers the areas of SITE, a GeoJSON file (- reads standard input), and write it as a PLAN."""
    from quarterdeck.api import plan, plan_text, read_scenario

    scenario = read_scenario(site)
    turned = None if angle is None else math.radians(90.0 - angle)
    mission = plan(scenario, angle=turned, **options)
    text = plan_text(mission)
    emit(text, output, force=force)
    if as_json:
        header = json.loads(text.split("\n", 2)[1].rstrip(","))["properties"]
        click.echo(json.dumps({k: header[k] for k in ("feasible", "reasons", "figures", "bounds")}), err=True)
    else:
        print_figures(mission)
    return 0 if mission.feasible else 1
