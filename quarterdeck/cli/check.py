"""`quarterdeck check`: every problem of a site or a plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from quarterdeck.cli.files import takes

if TYPE_CHECKING:
    from quarterdeck.geo.geojson import Document


@click.command(short_help="Every problem of a site or a plan.")
@takes("file")
def command(file: str) -> int:
    """List every problem of FILE, a site or a PLAN, one a line.

    For a site also what `plan` and `assign` would refuse. For a plan: clear of obstacles, inside the fence, separated in
    time, energy with a reserve. Exit status 0 if there is none, 2 if a site cannot be planned as it is, 1 if a plan should
    not be flown. Notes, on standard error, are no problems: what another use of the site will ask for, and what may not be
    meant.
    """
    from quarterdeck.geo.errors import one_line
    from quarterdeck.geo.geojson import opened
    from quarterdeck.mission.planfile import is_plan

    document = opened(file)
    problems, status = (_of_plan(document), 1) if is_plan(document) else (_of_site(document), 2)
    for problem in problems:
        click.echo(one_line(problem))
    if not problems:
        click.echo(f"{document.name}: no problem found", err=True)
    return status if problems else 0


def _of_plan(document: Document) -> list[str]:
    from quarterdeck.mission.check import check_mission
    from quarterdeck.mission.planfile import read_plan

    return list(check_mission(read_plan(document)))


def _of_site(document: Document) -> list[str]:
    from quarterdeck.cli.advice import lacks, notes, print_notes
    from quarterdeck.geo.reader import examine

    scenario, problems = examine(document)
    if scenario is None:
        return problems
    lacking = lacks(scenario, document)
    print_notes(notes(scenario, document, lacking))
    return list(dict.fromkeys(why for whys in lacking.values() for why in whys)) if all(lacking.values()) else []
