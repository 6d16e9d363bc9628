"""`quarterdeck replan`: the mission from now on, from what has happened so far."""

import click

from quarterdeck.cli.output import emit, force_option, output_option, print_figures, time_limit_option
from quarterdeck.cli.parameters import Real


@click.command(short_help="From what has happened so far: losses, changes, additions, withdrawals.")
@click.argument("plan")
@output_option
@click.option("--at", "time", type=Real(min=0), required=True, help="Seconds since the mission's start.")
@click.option("--changes", "changed", metavar="GEOJSON", help="All that is different, a feature a change: docs/replan.md.")
@click.option("--lost", default="", help="Ids of the vehicles that are lost, with commas; ID@SECONDS: since when.")
@click.option("--add", metavar="SITE", help="GeoJSON of what is new: obstacles, areas, tasks, vehicles that join.")
@click.option("--gone", default="", help="Ids of obstacles that are no more, with commas.")
@click.option("--withdrawn", default="", help="Ids of areas and tasks that need not be done any more, with commas.")
@click.option("--seed", type=click.IntRange(min=0), help="Seed of all that is random; default the plan's.")
@time_limit_option
@force_option
def command(
    plan: str,
    output: str,
    time: float,
    changed: str | None,
    lost: str,
    add: str | None,
    gone: str,
    withdrawn: str,
    seed: int | None,
    time_limit: float | None,
    force: bool,
) -> int:
    """Write the mission of PLAN from now on: what is done stays done, survivors go on from where they are and come home."""
    from quarterdeck.api import within
    from quarterdeck.geo.errors import InputError
    from quarterdeck.mission.changes import Changes, read_changes
    from quarterdeck.mission.planfile import plan_text, read_plan
    from quarterdeck.mission.progress import planned_progress
    from quarterdeck.mission.replan import replan

    mission = read_plan(plan)
    since: dict[str, float] = {}
    for item in _ids(lost):
        vehicle, _, moment = item.partition("@")
        try:
            since[vehicle] = float(moment) if moment else time
        except ValueError:
            raise InputError(f"--lost {item}: {moment!r} is no number of seconds; write ID or ID@SECONDS") from None
    gone_ids, withdrawn_ids = frozenset(_ids(gone)), frozenset(_ids(withdrawn))
    changes = Changes(lost=frozenset(since), since=since, gone=gone_ids, withdrawn=withdrawn_ids)
    for source in (add, changed):
        changes |= read_changes(source, mission) if source else Changes()
    stopped = {v: changes.since.get(v, time) for v in changes.lost}
    so_far = planned_progress(mission, time, stopped=stopped)
    after = within(time_limit, lambda: replan(mission, so_far, changes, seed=seed))
    emit(plan_text(after), output, force=force)
    print_figures(after)
    return 0 if after.feasible else 1


def _ids(text: str) -> list[str]:
    return [item.strip() for item in text.split(",") if item.strip()]
