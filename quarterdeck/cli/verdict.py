"""What `quarterdeck simulate` and `quarterdeck report` print of a report: its figures, then the verdict."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from quarterdeck.cli.output import console, covered_before, minutes, print_reason

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rich.console import Console
    from rich.table import Table

    from quarterdeck.mission.mission import Mission
    from quarterdeck.physics.report import Report
    from quarterdeck.physics.task_report import TaskReport


SHORT_NAME = 16  # characters: names of so few are never folded
# The fast world, in plain words: of triage, and of what has a plan's paces.
POINTS = "points that turn at once and give way to nobody"
PACED = "points that keep the plan's paces and give way to nobody"


def print_report(mission: Mission, report: Report, *, how: str = "simulated") -> None:
    """Print the verdict and its figures on standard error."""
    screen = console()
    roomy = screen.options.update(max_width=1000)
    tables = [_vehicles(mission, report, how, between) for between in (" ", "\n")]
    screen.print(next((t for t in tables if screen.measure(t, options=roomy).maximum <= screen.width), tables[-1]))
    if report.tasks:
        _print_tasks(screen, report.tasks)
    figures = report.figures
    words = [f"off track {figures['legs_p95']:.2f} m (95 %, straight legs)"]
    if figures["coverage_planned"] is not None:
        words.append(f"coverage {figures['coverage_driven']:.2%} driven of {figures['coverage_planned']:.2%} planned")
    if figures["tasks_planned"]:
        words.append(f"tasks {figures['tasks_served']} of {figures['tasks_planned']} served")
    words.append(f"collisions {figures['collisions']}")
    words.append(f"finished {figures['finished']} of {len(report.vehicles)}")
    if figures["lost"]:
        words.append(f"lost {figures['lost']}")
    if figures["localisation_p95"] is not None:
        words.append(f"localised to {figures['localisation_p95']:.2f} m (95 %, worst vehicle)")
    if figures.get("map_known") is not None:
        words.append(
            f"map: {figures['map_known']:.1%} of the free ground known, {figures['map_free_iou']:.1%} of it right (IoU), "
            f"{figures['map_walls_right']:.1%} of the walls"
        )
    screen.print("; ".join(words))
    if before := covered_before(mission):
        print_reason(screen, "covered before", f"{before:.2%}, which does not count here: the plan goes on from there")
    if (fast := figures.get("time_fast")) is not None:
        _print_beside(screen, report, fast)
    for note in report.notes:
        print_reason(screen, "note", note)
    if report.triage is not None:
        _print_triage(screen, report.triage)
        most = report.limits["delay"]
        screen.print(f"as points: if all were {POINTS}; the run may take {most:g} times as long (--limit delay=...)")
    for reason in report.reasons:
        print_reason(screen, "failed", reason)
    if report.passed:
        screen.print("passed", style="bold")


def _vehicles(mission: Mission, report: Report, how: str, between: str) -> Table:
    """Return the table of the vehicles' figures, with `between` each and how far it is from the plan's."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(title=f"{mission.name}: {how}", title_justify="left", box=SIMPLE_HEAD)
    longest = max((len(v.id) for v in report.vehicles), default=0)
    table.add_column("vehicle", overflow="fold", min_width=min(max(longest, len("vehicle")), SHORT_NAME))
    for column in ("time", "energy", "off track", "to obstacle", "to vehicle"):
        table.add_column(column.replace(" ", "\n"), justify="right", no_wrap=True)
    for v in report.vehicles[:60]:
        table.add_row(
            v.id,
            f"{minutes(v.time)}{between}{_change(v.time, v.time_planned)}",
            f"{v.energy:,.{0 if v.energy >= 10 else 2}f} Wh{between}{_change(v.energy, v.energy_planned)}",
            f"{v.legs.p95:.2f} m",
            "hit" if v.hits else _metres(v.clearance),
            _metres(v.separation),
        )
    return table


def _print_beside(screen: Console, report: Report, fast: float) -> None:
    """Print what the run came to beside what it would be in the fast world."""
    figures = report.figures
    words = [f"time {minutes(figures['time'] or 0.0)} ({minutes(fast)})"]
    if figures["coverage_fast"] is not None and figures["coverage_driven"] is not None:
        words.append(f"coverage {figures['coverage_driven']:.2%} ({figures['coverage_fast']:.2%})")
    if report.tasks:
        words.append(f"tasks {sum(t.driven is not None for t in report.tasks)} ({figures['tasks_served_fast']})")
    words.append(f"finished {figures['finished']} ({figures['finished_fast']})")
    words.append(f"energy {figures['energy']:,.1f} Wh ({figures['energy_fast']:,.1f} Wh)")
    screen.print(f"{', '.join(words)}; in brackets, if all were {PACED}")


def _print_triage(screen: Console, triage: Mapping[str, Any]) -> None:
    """Print what became of the casualties, as reckoned with points beside the run's."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    from quarterdeck.cli.triage import ROWS

    table = Table(title=f"triage, {triage['method']}", title_justify="left", box=SIMPLE_HEAD)
    for column in ("", "as points", "this run"):
        table.add_column(column, justify="right" if column else "left")
    for name, (label, form) in ROWS.items():
        table.add_row(label, *("-" if value is None else form.format(value) for value in triage["figures"][name]))
    screen.print(table)


def _print_tasks(screen: Console, tasks: Sequence[TaskReport]) -> None:
    """Print when tasks were to be done and when they were."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(title="tasks, as planned in brackets", title_justify="left", box=SIMPLE_HEAD)
    for column in ("task", "vehicle", "came", "began", "left", "waited"):
        table.add_column(column, justify="left" if column in ("task", "vehicle") else "right", no_wrap=True)
    for task in tasks[:60]:
        plan, drive = task.planned, task.driven
        who = drive.vehicle if drive else "-"
        pairs = [
            f"{minutes(getattr(drive, name)).removeprefix('0:') if drive else '-'} "
            f"({minutes(getattr(plan, name)).removeprefix('0:') if plan else '-'})"
            for name in ("arrival", "begin", "leave")
        ]
        waits = f"{drive.waited:.0f} s" if drive else "-"
        table.add_row(task.id, who if plan and who == plan.vehicle else f"{who} ({plan.vehicle if plan else '-'})", *pairs,
                      f"{waits} ({f'{plan.waited:.0f} s' if plan else '-'})")  # fmt: skip
    screen.print(table)


def _metres(distance: float | None) -> str:
    return "" if distance is None else f"{distance:.1f} m"


def _change(driven: float, planned: float) -> str:
    return f"{(driven / planned - 1) * 100:+.1f} %" if planned > 0 else ""
