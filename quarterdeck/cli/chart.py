"""`quarterdeck chart`: ENC cells as a site."""

import click

from quarterdeck.cli.files import takes
from quarterdeck.cli.output import emit, force_option, output_option
from quarterdeck.cli.parameters import Numbers, Real
from quarterdeck.geo.errors import one_line


@click.command(short_help="ENC cells as a site.")
@takes("cells", pipe=False, nargs=-1, required=True)
@click.option("--draught", type=Real(min=0), required=True, help="Metres that the vessels go down.")
@click.option("--clearance", type=Real(min=0), default=0.5, show_default=True, help="Metres below the keel.")
@click.option(
    "--tide", type=Real(), default=0.0, show_default=True, help="Metres of water above chart datum, at the lowest."
)
@click.option("--margin", type=Real(min=0), default=10.0, show_default=True, help="Metres kept from dangers.")
@click.option("--avoid", default="", help="Classes not to be entered, parted by commas, such as RESARE,TSSLPT.")
@click.option("--bounds", type=Numbers("W,S,E,N", 4), help="Degrees to cut the chart to.")
@click.option("--start", "starts", type=Numbers("LON,LAT", 2), multiple=True, help="Where a vessel starts; repeatable.")
@click.option("--spacing", type=Real(min=0, min_open=True), help="Metres between tracks, kept in the site.")
@output_option
@force_option
def command(
    cells: tuple[str, ...],
    draught: float,
    clearance: float,
    tide: float,
    margin: float,
    avoid: str,
    bounds: tuple[float, float, float, float] | None,
    starts: tuple[tuple[float, float], ...],
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

    vehicles = [(f"usv-{i}", *lonlat) for i, lonlat in enumerate(starts, 1)]
    scenario, notes = chart_site(
        [read_cell(path) for path in cells],
        depth=draught + clearance - tide,
        margin=margin,
        avoid=tuple(name.strip().upper() for name in avoid.split(",") if name.strip()),
        bounds=bounds,
        vehicles=vehicles,
    )
    emit(site_text(replace(scenario, spacing=spacing)), output, force=force)
    for note in (*notes, "not for navigation"):
        click.echo(one_line(note), err=True)
