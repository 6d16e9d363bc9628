"""`quarterdeck replan`: the mission from now on, from what has happened so far."""

import click

from quarterdeck.cli.output import emit, force_option, output_option, print_figures
from quarterdeck.cli.parameters import Real


@click.command(short_help="From what has happened so far: losses, additions, withdrawals.")
@click.argument("plan")
@output_option
@click.option("--at", "time", type=Real(min=0), required=True, help="Seconds since the mission's start.")
@click.option("--lost", default="", help="Ids of the vehicles that are lost, with commas; ID@SECONDS: since when.")
@click.option("--add", metavar="SITE", help="GeoJSON of what is new: obstacles, areas, tasks, vehicles that join.")
@click.option("--gone", default="", help="Ids of obstacles that are no more, with commas.")
@click.option("--withdrawn", default="", help="Ids of areas and tasks that need not be done any more, with commas.")
@click.option("--seed", type=click.IntRange(min=0), help="Seed of all that is random; default the plan's.")
@force_option
def command(
    plan: str,
    output: str,
    time: float,
    lost: str,
    add: str | None,
    gone: str,
    withdrawn: str,
    seed: int | None,
    force: bool,
) -> int:
    """Write the mission of PLAN from now on: what is done stays done, survivors go on from where they are and come home."""
    from quarterdeck.geo.errors import InputError
    from quarterdeck.geo.reader import read_additions
    from quarterdeck.mission.planfile import plan_text, read_plan
    from quarterdeck.mission.progress import planned_progress
    from quarterdeck.mission.replan import Changes, replan

    mission = read_plan(plan)
    stopped: dict[str, float] = {}
    for item in _ids(lost):
        vehicle, _, since = item.partition("@")
        try:
            stopped[vehicle] = float(since) if since else time
        except ValueError:
            raise InputError(f"--lost {item}: {since!r} is no number of seconds; write ID or ID@SECONDS") from None
    added = read_additions(add, mission.frame) if add else None
    changes = Changes(
        lost=frozenset(stopped),
        joined=added.vehicles if added else (),
        obstacles=added.site.obstacles if added else (),
        areas=added.site.areas if added else (),
        tasks=added.tasks if added else (),
        gone=frozenset(_ids(gone)),
        withdrawn=frozenset(_ids(withdrawn)),
    )
    after = replan(mission, planned_progress(mission, time, stopped=stopped), changes, seed=seed)
    emit(plan_text(after), output, force=force)
    print_figures(after)
    return 0 if after.feasible else 1


def _ids(text: str) -> list[str]:
    return [item.strip() for item in text.split(",") if item.strip()]
