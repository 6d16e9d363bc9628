"""`quarterdeck check`: every problem of a site or a plan."""

import click


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
    if any(isinstance(f, dict) and (f.get("properties") or {}).get("role") == "plan" for f in features):
        from quarterdeck.mission.check import check_mission
        from quarterdeck.mission.planfile import read_plan

        problems, status = list(check_mission(read_plan(file))), 1
    else:
        problems, status = find_problems(file), 2
        if not problems:
            vehicles = read_scenario(file).vehicles
            try:
                shares(vehicles) if vehicles else None
            except InputError as error:
                problems = [str(error)]
    for problem in problems:
        click.echo(problem)
    if not problems:
        click.echo(f"{file}: no problem found", err=True)
    return status if problems else 0
