"""`quarterdeck report`: measure a real mission from its logs, as `simulate` measures a virtual one."""

from __future__ import annotations

from dataclasses import replace
from hashlib import sha256
from typing import TYPE_CHECKING, Any

import click

from quarterdeck.cli.files import takes, writes
from quarterdeck.cli.output import console, emit, force_option, print_reason
from quarterdeck.cli.simulate import Limit
from quarterdeck.cli.verdict import print_report

if TYPE_CHECKING:
    from quarterdeck.mission.mission import Mission
    from quarterdeck.physics.simulate import Run


@click.command(short_help="Measure a real mission from its logs.")
@takes("plan")
@click.option("--track", "tracks", type=click.Path(), metavar="[VEHICLE=]FILE", multiple=True, required=True,
              help="A log: .bin, .tlog, .gpx, .csv, or a trace of simulate; repeatable. See docs/logs.md.")  # fmt: skip
@click.option("--start", metavar="TIME", help="When the mission began, such as 2026-06-01T12:00:00Z; default: by the logs.")
@writes("--report", help="Write the report as JSON.")
@writes("--gaps", help="Write what was left uncovered as a site to plan (GeoJSON).")
@writes("--rrd", help="Record the mission for rerun.")
@writes("--picture", help="Draw plan, tracks and misses as a PNG.")
@click.option(
    "--limit", "limits", type=Limit(), multiple=True, help="A limit of the verdict; repeatable. See docs/simulation.md."
)
@click.option("--json", "as_json", is_flag=True, help="Write the report as JSON to standard output.")
@force_option
def command(
    report: str | None,
    gaps: str | None,
    rrd: str | None,
    picture: str | None,
    as_json: bool,
    force: bool,
    **options: Any,
) -> int:
    """Measure what really happened of PLAN (a file, or - for standard input), by the logs of its vehicles.

    Exit status 1 if the verdict fails, or a log is not of this plan.
    """
    mission, run = execute(**options)
    if report:
        emit(run.report.to_json(), report, force=force)
    if rrd:
        from quarterdeck.exporters.recording import recording

        emit(recording(mission, run.trace), rrd, force=force)
    if picture:
        from quarterdeck.exporters.picture import picture as draw

        emit(draw(mission, run.trace, run.report), picture, force=force)
    if as_json:
        emit(run.report.to_json(), "-", force=force)
    print_report(mission, run.report, how="as driven")
    if gaps:
        _write_gaps(mission, run, gaps, force)
    return 0 if run.report.passed else 1


def execute(
    plan: str, *, tracks: tuple[str, ...], start: str | None, limits: tuple[tuple[str, float], ...]
) -> tuple[Mission, Run]:
    """Measure logs with the command's options; return the plan's mission and the run, whose report tells them."""
    options = dict(locals())
    from datetime import UTC, datetime

    from quarterdeck.geo.files import read_bytes
    from quarterdeck.geo.geojson import opened
    from quarterdeck.geo.logs import read_time
    from quarterdeck.mission.planfile import read_plan
    from quarterdeck.mission.tracks import read_tracks, track_file
    from quarterdeck.physics.observed import report_tracks, with_state

    document = opened(plan)
    mission = read_plan(document)
    record = read_tracks(mission, tracks, start=read_time(start) if start else None)
    began = None if record.start is None else datetime.fromtimestamp(record.start, UTC).isoformat()
    run = report_tracks(mission, record, limits=dict(limits), settings={"tracks": list(tracks), "start": began})
    logs = dict.fromkeys(track_file([v.id for v in (*mission.vehicles, *mission.lost)], given)[1] for given in tracks)
    data = {"plan": document.data} | {path: read_bytes(path) for path in logs}
    files = {name: sha256(content).hexdigest() for name, content in data.items()}
    report = with_state(mission, run, record.tracks)
    return mission, replace(run, report=replace(report, command={"verb": "report", "options": options, "files": files}))


def _write_gaps(mission: Mission, run: Run, gaps: str, force: bool) -> None:
    """Write what was left uncovered, and tell what of it is not worth a track; a site has no area where nothing was."""
    from quarterdeck.geo.writer import site_text
    from quarterdeck.mission.gaps import SLIVER, gap_site
    from quarterdeck.physics.observed import missed

    site, slivers = gap_site(mission, missed(mission, run.trace))
    screen = console()
    emit(site_text(site), gaps, force=force)
    if site.site.areas:
        area = sum(a.polygon.area for a in site.site.areas)
        print_reason(screen, "gaps", f"{len(site.site.areas)} of {area:,.0f} m2 in all: {gaps}")
    else:
        print_reason(screen, "gaps", f"none: nothing is left to plan, {gaps} has no area")
    if slivers.area > 0:
        narrow = f"{SLIVER:g} of the {'spacing' if mission.spacing else 'range'}"
        print_reason(screen, "gaps", f"{slivers.area:,.0f} m2 in slivers narrower than {narrow} are left out")
