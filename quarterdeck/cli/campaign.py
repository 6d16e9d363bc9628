"""`quarterdeck campaign`: many runs of one plan, or of triage, and what they prove."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from quarterdeck.cli.files import takes
from quarterdeck.cli.output import console, force_option, print_reason, time_limit_option
from quarterdeck.cli.parameters import Real

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.table import Table

    from quarterdeck.campaign.kind import Case
    from quarterdeck.campaign.study import Study

MOST_MEANS = 12  # combinations whose means are printed; those of more are in summary.json


@click.command(short_help="Many runs of one plan, or of triage, on this machine or a cluster.")
@takes("study", pipe=False)
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), help="Folder for the results (default: STUDY.runs beside it)."
)
@click.option("--jobs", type=click.IntRange(min=1), help="Processes at work (default: as many as there are processors).")
@click.option("--scheduler", metavar="ADDRESS", help="Run on the Dask cluster of this scheduler, such as tcp://host:8786.")
@click.option(
    "--worst", type=click.IntRange(min=0), default=5, show_default=True, help="How many of the worst runs to tell."
)
@click.option("--least", type=Real(0, 1), help="Exit with 1 if the probability of success may be less (95 % confidence).")
@time_limit_option
@click.option("--json", "as_json", is_flag=True, help="Write the summary as JSON to standard output.")
@force_option
def command(
    study: str,
    output: Path | None,
    jobs: int | None,
    scheduler: str | None,
    worst: int,
    least: float | None,
    time_limit: float | None,
    as_json: bool,
    force: bool,
) -> int:
    """Run what STUDY, a TOML file, asks for (see docs/campaign.md), and tell the probability of success.

    What is done is kept in the results' folder: called again after an interruption or its time limit, it goes on from
    there. --force starts anew.
    """
    from quarterdeck.campaign.execute import over_cluster, over_processes
    from quarterdeck.campaign.journal import Journal
    from quarterdeck.campaign.study import cases, read_study
    from quarterdeck.campaign.summary import as_csv, as_parquet, summarise
    from quarterdeck.geo.deadline import limited
    from quarterdeck.geo.files import write_file

    if scheduler and jobs:
        raise click.UsageError("--jobs is for this machine; on a cluster its workers decide")
    asked = read_study(Path(study))
    every = list(cases(asked))
    folder = output or Path(study).with_suffix(".runs")
    with limited(time_limit), Journal(folder, asked.hash, force=force) as journal:
        todo = [case for case in every if case.number not in journal.rows]
        limits = dict(asked.limits)
        rows = (
            over_cluster(asked.text, todo, limits, scheduler)
            if scheduler
            else over_processes(asked.text, todo, limits, min(jobs or os.cpu_count() or 1, max(len(todo), 1)))
        )
        for row in _shown(asked, every, todo, rows):
            journal.add(row)
        summary = summarise(asked, every, journal.rows, worst)
        write_file(folder / "runs.csv", as_csv(journal.rows), force=True)
        parquet = as_parquet(journal.rows)
        if parquet is not None:
            write_file(folder / "runs.parquet", parquet, force=True)
        text = json.dumps(summary, indent=2) + "\n"
        write_file(folder / "summary.json", text, force=True)
    if as_json:
        click.echo(text, nl=False)
    _print(summary, folder, parquet is not None)
    if len(journal.rows) < len(every):
        done = f"{len(journal.rows):,} of {len(every):,} runs are done; the same command goes on from there"
        print_reason(console(), "cut short by --time-limit", done)
    return 1 if least is not None and summary["low"] < least else 0


def _shown(study: Study, every: list[Case], todo: list[Case], rows: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Pass rows on under a progress bar on standard error, where that is a terminal."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    screen = console()
    if len(todo) < len(every):
        screen.print(f"{len(every) - len(todo):,} of {len(every):,} runs are done already")
    layout = [
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[failed]}"),
    ]
    with Progress(*layout, TimeRemainingColumn(), console=screen, transient=True, disable=not screen.is_terminal) as bar:
        task = bar.add_task(study.name, total=len(every), completed=len(every) - len(todo), failed="")
        failed = 0
        for row in rows:
            failed += not row["passed"]
            bar.update(task, advance=1, failed=f"{failed} failed" if failed else "")
            yield row


def _print(summary: dict[str, Any], folder: Path, parquet: bool) -> None:
    from rich.table import Table

    screen = console()
    table = Table(title=f"{summary['mission']}: {summary['runs']:,} runs", title_justify="left")
    names = list(dict.fromkeys(n for level in summary["levels"] for n in level["levels"]))
    for name in (*names, "runs", "passed", "probability", "95 % from", "to"):
        table.add_column(name, justify="right")
    for level in [*summary["levels"], summary]:
        values = level.get("levels")
        told = (
            [_word(values.get(n)) for n in names]
            if isinstance(values, dict)
            else ["all", *[""] * (len(names) - 1)][: len(names)]
        )
        p = level["probability"]
        table.add_row(
            *told, f"{level['runs']:,}", f"{level['passed']:,}", "" if p is None else f"{p:.1%}",
            f"{level['low']:.1%}", f"{level['high']:.1%}",
        )  # fmt: skip
    screen.print(table)
    if len(summary["levels"]) <= MOST_MEANS:
        screen.print(_means(summary["levels"] or [{"levels": {}, "means": summary["means"]}], names))
    for reason, count in summary["reasons"].items():
        screen.print(f"{count:>6,} runs: {reason}", soft_wrap=True)
    for run in summary["worst"]:
        if not run["passed"]:
            print_reason(screen, f"run {run['number']}", run["reasons"])
            screen.print(f"    {run['replay']}", soft_wrap=True)
    files = "runs.csv, runs.parquet, summary.json" if parquet else "runs.csv, summary.json"
    screen.print(f"{folder}: {files}", soft_wrap=True)
    if not parquet:
        screen.print("runs.parquet needs pyarrow: pip install 'quarterdeck[campaign]'")


def _means(levels: list[dict[str, Any]], names: list[str]) -> Table:
    """Return the table of means, a row for each figure and combination."""
    from rich.table import Table

    def cells(interval: list[float | None] | None) -> list[str]:
        return [""] * 3 if interval is None else ["" if v is None else f"{v:,.4g}" for v in interval]

    table = Table(title="means; differences from the first, run by run of the same seed", title_justify="left")
    for name in ("figure", *names):
        table.add_column(name)
    for name in ("mean", "95 % from", "to", "difference", "95 % from", "to"):
        table.add_column(name, justify="right")
    for figure in dict.fromkeys(n for level in levels for n in level["means"]):
        for i, level in enumerate(levels):
            told = [_word(level["levels"][n]) for n in names]
            mean, difference = level["means"].get(figure), level.get("differences", {}).get(figure)
            last = i == len(levels) - 1
            table.add_row("" if i else figure, *told, *cells(mean), *cells(difference), end_section=last)
    return table


def _word(value: Any) -> str:
    return (" ".join(map(str, value)) or "none") if isinstance(value, list) else "" if value is None else f"{value}"
