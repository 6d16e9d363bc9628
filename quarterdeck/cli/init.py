"""`quarterdeck init`: a small site to start from."""

from importlib.resources import files

import click

from quarterdeck.cli.output import emit, force_option, output_option
from quarterdeck.cli.parameters import Choice

SAMPLES = {
    "first": "first_site",
    "sea": "west_ant_island",
    "harbour": "dalian_harbour",
    "ground": "plant_yard",
    "tasks": "inspection_hall",
    "air": "farm_survey",
    "triage": "triage_drill",
}


@click.command(short_help="A small site to start from.")
@click.argument("kind", type=Choice(list(SAMPLES)), default="first")
@output_option
@force_option
def command(kind: str, output: str, force: bool) -> None:
    """Write a site as GeoJSON: change its shapes in QGIS or geojson.io, and its vehicles in any editor.

    The first one is small, and each of its features says in its description what it is for and what else it can say; the
    others are samples of each kind of work.
    """
    text = (files("quarterdeck") / "data" / f"{SAMPLES[kind]}.geojson").read_text(encoding="utf-8")
    emit(text, output, force=force)
