"""`quarterdeck replan`: the mission from now on, from what has happened so far."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import click

from quarterdeck.cli.files import reads, takes
from quarterdeck.cli.output import (
    console,
    emit,
    force_option,
    output_option,
    print_figures,
    print_reason,
    tell_compiling,
    tell_stopping,
    time_limit_option,
)
from quarterdeck.cli.parameters import Real

if TYPE_CHECKING:
    from collections.abc import Mapping

    from quarterdeck.mission.changes import Changes
    from quarterdeck.mission.mission import Mission
    from quarterdeck.mission.progress import Progress


@click.command(short_help="From what has happened so far: losses, changes, additions, withdrawals.")
@takes("plan")
@output_option
@click.option("--at", "time", type=Real(min=0), help="Seconds since the mission's start; default: as far as the logs go.")
@click.option("--track", "tracks", type=click.Path(), metavar="[VEHICLE=]FILE", multiple=True,
              help="A log of what really happened, as for `report`; repeatable. Without: all went as planned.")  # fmt: skip
@click.option("--start", metavar="TIME", help="When the mission began, as 2026-06-01T12:00:00Z; default: by the logs.")
@reads("--state", pipe=True, metavar="REPORT", help="A report of `simulate` or `report` instead of logs.")
@reads("--changes", "--add", "changed", pipe=True, multiple=True, metavar="GEOJSON",
       help="What is different, a feature a change (docs/replan.md), or new: a site; repeatable.")  # fmt: skip
@click.option("--lost", default="", help="Short for a change: ids of vehicles that are lost; ID@SECONDS: since when.")
@click.option("--gone", default="", help="Short for a change: ids of obstacles that are no more, with commas.")
@click.option("--withdrawn", default="", help="Short for a change: ids of areas and tasks that need not be done any more.")
@click.option("--seed", type=click.IntRange(min=0), help="Seed of all that is random; default the plan's.")
@time_limit_option
@force_option
def command(
    plan: str,
    output: str,
    time: float | None,
    changed: tuple[str, ...],
    tracks: tuple[str, ...],
    start: str | None,
    state: str | None,
    lost: str,
    gone: str,
    withdrawn: str,
    seed: int | None,
    time_limit: float | None,
    force: bool,
) -> int:
    """Write the mission of PLAN from now on: what is done stays done, survivors go on from where they are and come home.

    Ctrl-C ends the searches and writes what there is; a second one ends at once, with nothing.
    """
    from quarterdeck.api import within
    from quarterdeck.cli.advice import print_notes, refused
    from quarterdeck.geo.deadline import limited
    from quarterdeck.mission.changes import Changes, check_changes, read_changes
    from quarterdeck.mission.planfile import plan_text, read_plan
    from quarterdeck.mission.replan import replan
    from quarterdeck.mission.survey_recovery import without_corners
    from quarterdeck.mission.waits import parted
    from quarterdeck.mission.wrecks import with_wrecks

    tell_compiling()
    mission = read_plan(plan)
    changes = _removed(lost, gone, withdrawn)
    for source in changed:
        changes |= read_changes(source, mission)
    check_changes(mission, changes)
    stopped = {v: changes.since.get(v, math.inf) for v in changes.lost}
    so_far = _progress(mission, time, tracks, start, state, stopped)
    for vehicle in sorted(so_far.lost & {v.id for v in mission.vehicles} - changes.lost - changes.back.keys()):
        print_reason(console(), "note", f"{vehicle} was lost, by the report: others do what is left of its part")
        changes |= Changes(lost=frozenset({vehicle}))
    changes = with_wrecks(mission, so_far, changes)
    _tell_wrecks(mission, changes)
    with limited(interruptible=tell_stopping) as limit:
        after = within(time_limit, lambda: replan(mission, so_far, changes, seed=seed))
    if changes and after.spacing is not None:
        after = parted(without_corners(after))
        if any(v.share is not None for v in mission.vehicles):
            print_reason(
                console(), "note", "what is left is shared out by time, all to be done at once, not by the shares given"
            )
    emit(plan_text(after), output, force=force)
    print_figures(after)
    print_notes(refused(after))
    if limit.interrupted:
        return 130
    return 0 if after.feasible else 1


def _removed(lost: str, gone: str, withdrawn: str) -> Changes:
    """Return the changes that the short forms stand for: ids with commas."""
    from quarterdeck.geo.errors import InputError
    from quarterdeck.mission.changes import Changes

    ids, since = set[str](), dict[str, float]()
    for item in _ids(lost):
        vehicle, at, moment = item.partition("@")
        ids.add(vehicle)
        try:
            since |= {vehicle: float(moment)} if at else {}
        except ValueError:
            raise InputError(f"--lost {item}: {moment!r} is no number of seconds; write ID or ID@SECONDS") from None
    return Changes(lost=frozenset(ids), since=since, gone=frozenset(_ids(gone)), withdrawn=frozenset(_ids(withdrawn)))


def _tell_wrecks(mission: Mission, changes: Changes) -> None:
    """Print where who is lost is taken to lie."""
    import numpy as np

    from quarterdeck.mission.changes import wreck_name

    wrecks = {wreck_name(v): v for v in changes.lost}
    for obstacle in changes.obstacles:
        if vehicle := wrecks.get(obstacle.id):
            middle = obstacle.polygon.centroid
            lon, lat = mission.frame.to_degrees(np.array([[middle.x, middle.y]]))[0]
            print_reason(
                console(),
                "note",
                f"{vehicle} is taken to lie at {lon:.6f}, {lat:.6f}, in the others' way; when it has been taken away: "
                f'replan with --gone "{obstacle.id}"',
            )


def _progress(
    mission: Mission,
    time: float | None,
    tracks: tuple[str, ...],
    start: str | None,
    state: str | None,
    stopped: Mapping[str, float],
) -> Progress:
    """Return what has happened so far: by logs, by a report, or by the plan."""
    from quarterdeck.geo.errors import InputError
    from quarterdeck.geo.logs import read_time
    from quarterdeck.mission.progress import planned_progress
    from quarterdeck.mission.recorded import read_state, recorded_progress
    from quarterdeck.mission.tracks import read_tracks
    from quarterdeck.mission.triage.carry_on import planned_stand
    from quarterdeck.mission.triage.plan import METHOD

    if tracks and state:
        raise InputError("--track and --state both say what happened; give one of them")
    if start and not tracks:
        raise InputError("--start says when the logs' mission began; it needs --track")
    if tracks and mission.method == METHOD:
        raise InputError("--track: logs do not tell who was found, told of and treated; give --at, or --state REPORT")
    if state:
        progress = read_state(mission, state, lost=frozenset(stopped))
        if time is not None and time < progress.time - 1.0:
            raise InputError(f"--at {time:g}: {state} is of {progress.time:.0f} s; leave --at out, or give --track")
        if any(math.isfinite(since) for since in stopped.values()):
            raise InputError("--lost ID@SECONDS needs --track: a report does not tell what was done when; write --lost ID")
        if time is not None and mission.method == METHOD and time > progress.time + 1.0:
            raise InputError(f"--at {time:g}: {state} is of {progress.time:.0f} s, and what came after is not known")
        return progress if time is None or mission.method == METHOD else replace(progress, time=time)
    if tracks:
        record = read_tracks(mission, tracks, start=read_time(start) if start else None)
        wrong = [r for r in record.reasons if not (r.kind == "track" and r.about in stopped)]
        if wrong:
            raise InputError(str(wrong[0]))
        now = max(float(t.time[-1]) for t in record.tracks) if time is None else time
        progress, notes = recorded_progress(mission, record.tracks, now, stopped=stopped, lost=record.lost)
        for note in (*record.notes, *notes):
            print_reason(console(), "note", note)
        return progress
    if time is None:
        raise InputError("--at is missing: seconds since the mission's start; or give --track or --state")
    if mission.method == METHOD:
        return planned_stand(mission, time, stopped=stopped)
    return planned_progress(mission, time, stopped=stopped)


def _ids(text: str) -> list[str]:
    return [item.strip() for item in text.split(",") if item.strip()]
