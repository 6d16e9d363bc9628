"""`quarterdeck chart`: ENC cells as a site."""

import click

from quarterdeck.cli.output import emit, force_option, output_option


@click.command(short_help="ENC cells as a site.")
@click.argument("cells", nargs=-1, required=True)
@click.option("--draught", type=click.FloatRange(min=0), required=True, help="Metres that the vessels go down.")
@click.option("--clearance", type=click.FloatRange(min=0), default=0.5, show_default=True, help="Metres below the keel.")
@click.option(
    "--tide", type=float, default=0.0, show_default=True, help="Metres of water above chart datum, at the lowest."
)
@click.option("--margin", type=click.FloatRange(min=0), default=10.0, show_default=True, help="Metres kept from dangers.")
@click.option("--avoid", default="", help="Classes not to be entered, parted by commas, such as RESARE,TSSLPT.")
@click.option("--bounds", default="", metavar="W,S,E,N", help="Degrees to cut the chart to.")
@click.option("--start", "starts", multiple=True, metavar="LON,LAT", help="Where a vessel starts; repeatable.")
@click.option("--spacing", type=click.FloatRange(min=0, min_open=True), help="Metres between tracks, kept in the site.")
@output_option
@force_option
def command(
    cells: tuple[str, ...],
    draught: float,
    clearance: float,
    tide: float,
    margin: float,
    avoid: str,
    bounds: str,
    starts: tuple[str, ...],
    spacing: float | None,
    output: str,
    force: bool,
) -> None:
    """Write the water of CELLS (.000 files; updates beside them are applied) that is surely deep enough, as a site.

    What was used and what was ignored is told. Not for navigation.
    """
    from dataclasses import replace

    from quarterdeck.geo.charts import chart_site, read_cell
    from quarterdeck.geo.writer import site_text

    vehicles = [(f"usv-{i}", *_numbers(text, 2, "--start")) for i, text in enumerate(starts, 1)]
    scenario, notes = chart_site(
        [read_cell(path) for path in cells],
        depth=draught + clearance - tide,
        margin=margin,
        avoid=tuple(name.strip().upper() for name in avoid.split(",") if name.strip()),
        bounds=_numbers(bounds, 4, "--bounds") if bounds else None,
        vehicles=vehicles,
    )
    emit(site_text(replace(scenario, spacing=spacing)), output, force=force)
    for note in (*notes, "not for navigation"):
        click.echo(note, err=True)


def _numbers(text: str, count: int, option: str) -> tuple:
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count:
        raise click.BadParameter(f"{text!r} is not {count} numbers with commas", param_hint=option)
    return numbers
