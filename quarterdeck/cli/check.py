"""`quarterdeck check`: every problem of a site or a plan."""

import click

from quarterdeck.cli.output import put_back


@click.command(short_help="Every problem of a site or a plan.")
@click.argument("file")
def command(file: str) -> int:
    """List every problem of FILE, a site or a PLAN, one a line.

    For a plan: clear of obstacles, inside the fence, separated in time, energy with a reserve. Exit status 0 if there is
    none, 2 if a site cannot be planned, 1 if a plan should not be flown.
    """
    from quarterdeck.coverage.shares import shares
    from quarterdeck.geo.errors import InputError
    from quarterdeck.geo.geojson import parse
    from quarterdeck.geo.reader import find_problems, read_bytes, read_scenario

    data = read_bytes(file)
    features = parse(data)["features"]
    properties = [f.get("properties") for f in features if isinstance(f, dict)]
    if any(isinstance(p, dict) and p.get("role") == "plan" for p in properties):
        from quarterdeck.mission.check import check_mission
        from quarterdeck.mission.planfile import read_plan

        problems, status = list(check_mission(read_plan(put_back(file, data)))), 1
    else:
        problems, status = find_problems(put_back(file, data)), 2
        if not problems:
            vehicles = read_scenario(put_back(file, data)).vehicles
            try:
                shares(vehicles) if vehicles else None
            except InputError as error:
                problems = [str(error)]
    for problem in problems:
        click.echo(problem)
    if not problems:
        click.echo(f"{file}: no problem found", err=True)
    return status if problems else 0
