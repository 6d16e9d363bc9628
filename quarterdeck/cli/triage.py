"""`quarterdeck triage`: search, relay, treat; make cases; compare the four methods."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from quarterdeck.cli.files import takes, writes
from quarterdeck.cli.output import (
    console,
    emit,
    force_option,
    output_option,
    print_reason,
    seed_option,
    tell_compiling,
    tell_stopping,
    time_limit_option,
)
from quarterdeck.cli.parameters import Choice, Real

if TYPE_CHECKING:
    from quarterdeck.geo.scenario import Scenario
    from quarterdeck.mission.triage.outcome import Outcome
    from quarterdeck.mission.triage.settings import Settings

METHODS = ("relay", "no-relay", "no-priority", "constant")
COLOURS = ("red", "yellow", "green", "grey", "black")


class AtTime(click.ParamType):
    """ID@SECONDS."""

    name = "ID@SECONDS"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, float]:
        """Return (id, seconds)."""
        if isinstance(value, tuple):
            return value
        who, _, when = value.rpartition("@")
        try:
            seconds = float(when)
        except ValueError:
            seconds = math.nan
        if not who or not 0 <= seconds < math.inf:
            self.fail(f"{value!r} is not ID@SECONDS, such as uav1@60", param, ctx)
        return who, seconds


class Treat(click.ParamType):
    """SECONDS or COLOUR=SECONDS."""

    name = "[COLOUR=]SECONDS"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> dict[str, float]:
        """Return seconds by colour, those given."""
        if isinstance(value, dict):
            return value
        colour, _, seconds = value.rpartition("=")
        try:
            number = float(seconds)
        except ValueError:
            number = math.nan
        if colour not in ("", *COLOURS) or not 0 <= number < math.inf:
            self.fail(f"{value!r} is neither seconds nor COLOUR=SECONDS with {', '.join(COLOURS)}", param, ctx)
        return {colour: number} if colour else dict.fromkeys(COLOURS, number)


_AMOUNT = Real(min=0, min_open=True, max=1e9)
_FROM_ZERO = Real(min=0, max=1e9)


@click.command(short_help="Search, relay, treat; the four methods.")
@takes("site", required=False)
@click.option("--method", type=Choice(METHODS), default="relay", show_default=True, help="Who tells the medic, how.")
@click.option("--compare", is_flag=True, help="Run all four methods and print their figures side by side.")
@output_option
@writes("--casualty-csv", help="Write a row a casualty.")
@writes("--log-csv", help="Write a row an event.")
@writes("--cot", help="Write Cursor-on-Target events; needs --start.")
@click.option("--start", metavar="TIME", help="When the mission began, such as 2026-05-01T09:00:00Z, for --cot.")
@writes("--timeline", help="Draw the timeline as PNG.")
@writes("--map", "field_map", help="Draw the field with everybody's way as PNG.")
@writes("--snapshots", help="Draw the field at telling moments as PNG (Fig. 6).")
@writes("--plan", help="Write the PLAN that `simulate` executes in PyBullet.")
@click.option("--fail", "fails", type=AtTime(), multiple=True, help="A robot, or a medic's device, fails; repeatable.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON on standard error instead of a table.")
@click.option(
    "--generate",
    metavar="N",
    type=click.IntRange(min=1),
    help="Make N cases instead, from SITE or the paper's field: into the folder -o, or one as the file -o ....geojson.",
)
@click.option("--casualties", nargs=2, type=click.IntRange(min=0), default=(8, 14), show_default=True,
              help="Fewest and most of a generated case.")  # fmt: skip
@click.option("--clustered", is_flag=True, help="Gather a generated case's casualties in clusters.")
@click.option(
    "--field",
    nargs=2,
    type=Real(min=0, min_open=True, max=200_000),
    default=(80.0, 50.0),
    show_default=True,
    help="Width and height without SITE, m.",
)
@click.option("--team", nargs=3, type=click.IntRange(min=0), default=(3, 1, 1), show_default=True,
              help="UGVs, UAVs and medics without SITE.")  # fmt: skip
@seed_option
@time_limit_option
@click.option(
    "--order", type=Choice(["priority", "nearest", "first-come"]), help="How medics choose; default the method's."
)
@click.option("--rendezvous", type=Choice(["fixed", "moving", "round-robin"]), default="fixed", show_default=True,
              help="Where UAVs are met: at a point, in the UGVs' middle, or they visit each UGV in turn.")  # fmt: skip
@click.option(
    "--medic-unknown", is_flag=True, help="Without a relay, UGVs do not know where the medics are and look for them."
)
@click.option("--treat", type=Treat(), multiple=True, help="Seconds of treatment, of all or of a colour; default 10.")
@click.option("--talk", type=_AMOUNT, default=2.0, show_default=True, help="Communication range, m.")
@click.option("--medic-speed", type=_AMOUNT, default=1.4, show_default=True, help="m/s.")
@click.option(
    "--medic-sees", type=_FROM_ZERO, default=3.0, show_default=True, help="Metres at which a medic sees a casualty."
)
@click.option("--ugv-sees", type=_AMOUNT, default=3.0, show_default=True, help="Metres, where a UGV has no range.")
@click.option(
    "--spacing", type=_AMOUNT, default=2.5, show_default=True, help="Metres between search lanes, if SITE has none."
)
@click.option(
    "--clusters", type=click.IntRange(min=1), default=5, show_default=True, help="N urgent casualties, then report."
)
@click.option("--helpers", type=click.IntRange(min=0), default=0, show_default=True,
              help="Green casualties recruited after treatment; each shortens the next ones by a quarter.")  # fmt: skip
@click.option("--fatigue", type=_FROM_ZERO, default=0.0, show_default=True, help="Part of a medic's speed lost in 100 m.")
@click.option("--confidence", type=Real(0, 1), default=1.0, show_default=True, help="That a robot sorts right.")
@click.option("--position-error", type=_FROM_ZERO, default=0.0, show_default=True, help="Of a robot's word, 1 sigma, m.")
@force_option
def command(site: str | None, generate: int | None, output: str, force: bool, seed: int, **options: Any) -> int:
    """Run a triage mission on SITE, a GeoJSON file (- reads standard input), and write what became of the casualties.

    UGVs search for casualties, a UAV carries their reports to a medic, the medic treats the most urgent first.
    """
    tell_compiling()
    scenario = _scenario(site, options)
    if generate is not None:
        return _generate(scenario, generate, seed, output, force, options)
    if site is None:
        raise click.UsageError("give a SITE, or --generate N to make cases")
    if options["cot"] and not options["start"]:
        raise click.UsageError("--cot needs --start TIME: its events carry the time of day")
    return _run(scenario, _settings(options), seed, output, force, options)


def _run(scenario: Scenario, settings: Settings, seed: int, output: str, force: bool, options: dict[str, Any]) -> int:
    from quarterdeck.exporters.casualties import casualties_csv, casualties_geojson, cursor_on_target, log_csv
    from quarterdeck.geo.deadline import limited
    from quarterdeck.mission.planfile import plan_text
    from quarterdeck.mission.triage.outcome import run_triage
    from quarterdeck.mission.triage.plan import plan_triage
    from quarterdeck.mission.world import Fault

    faults = [Fault(who, when) for who, when in options["fails"]]
    methods = METHODS if options["compare"] else (options["method"],)
    with limited(options["time_limit"], interruptible=tell_stopping) as limit:
        outcomes = {m: run_triage(scenario, m, settings, seed=seed, faults=faults) for m in methods}
    outcome = outcomes[options["method"]]
    files: list[tuple[str | None, Any]] = [
        (options["casualty_csv"], lambda: casualties_csv(outcome)),
        (options["log_csv"], lambda: log_csv(outcome)),
        (options["cot"], lambda: cursor_on_target(outcome, options["start"])),
        (options["timeline"], lambda: _timeline(outcome)),
        (options["field_map"], lambda: _map(outcome)),
        (options["snapshots"], lambda: _snapshots(outcome)),
        (options["plan"], lambda: plan_text(plan_triage(scenario, options["method"], settings, seed=seed))),
    ]
    made = [(path, make()) for path, make in files if path]
    emit(casualties_geojson(outcome), output, force=force)
    for path, content in made:
        emit(content, path, force=force)
    if options["as_json"]:
        click.echo(json.dumps({m: _plain(o) for m, o in outcomes.items()}), err=True)
    else:
        _print(outcomes)
    if limit.interrupted:
        return 130
    return 1 if outcome.reasons else 0


def _generate(scenario: Scenario, count: int, seed: int, output: str, force: bool, options: dict[str, Any]) -> int:
    """Write cases of consecutive seeds into the folder that the output names; one case also to the output itself, where
    that is standard output or named as GeoJSON is.
    """
    from quarterdeck.geo.files import safe_names, write_files
    from quarterdeck.geo.writer import site_text
    from quarterdeck.mission.triage.generate import generate

    there = Path(output).exists() and not Path(output).is_dir()
    alone = output == "-" or there or Path(output).suffix in (".geojson", ".json")
    if count > 1 and alone:
        raise click.UsageError(f"--generate {count} writes {count} files; name their folder with -o")
    made = {
        s: site_text(generate(scenario, s, casualties=options["casualties"], clustered=options["clustered"]))
        for s in range(seed, seed + count)
    }
    if alone:
        emit(made[seed], output, force=force)
        return 0
    name = safe_names([scenario.name])[scenario.name]
    write_files({Path(output) / f"{name}-{s:06d}.geojson": text for s, text in made.items()}, force=force)
    told = "1 case, seed" if count == 1 else f"{count} cases, seeds {seed} to"
    console().print(f"{told} {seed + count - 1}, in {output}", soft_wrap=True)
    return 0


def _scenario(site: str | None, options: dict[str, Any]) -> Scenario:
    from quarterdeck.geo.reader import read_scenario
    from quarterdeck.mission.triage.generate import paper_team

    if site is not None:
        return read_scenario(site)
    ugvs, uavs, medics = options["team"]
    return paper_team(ugvs=ugvs, uavs=uavs, medics=medics, size=options["field"])


def _settings(options: dict[str, Any]) -> Settings:
    from quarterdeck.mission.triage.settings import Settings

    names = ("order", "rendezvous", "talk", "medic_speed", "medic_sees", "ugv_sees", "spacing", "clusters", "helpers",
             "fatigue", "confidence", "position_error")  # fmt: skip
    treat = dict.fromkeys(COLOURS, 10.0)
    for given in options["treat"]:
        treat |= given
    return Settings(treat=treat, knows_medic=not options["medic_unknown"], **{n: options[n] for n in names})


def _timeline(outcome: Outcome) -> bytes:
    from quarterdeck.exporters.triage_timeline import timeline_png

    return timeline_png(outcome)


def _map(outcome: Outcome) -> bytes:
    from quarterdeck.exporters.triage_picture import map_png

    return map_png(outcome)


def _snapshots(outcome: Outcome) -> bytes:
    from quarterdeck.exporters.triage_picture import snapshots_png

    return snapshots_png(outcome)


def _plain(outcome: Outcome) -> dict[str, Any]:
    from quarterdeck.mission.triage.figures import figures

    numbers = {k: v if math.isfinite(v) else None for k, v in figures(outcome).items()}
    return {"figures": numbers, "reasons": list(outcome.reasons)}


ROWS = {
    "time": ("mission time", "{:,.0f} s"),
    "score": ("score (0: by priority)", "{:,.0f}"),
    "ugv_distance": ("UGV mean distance", "{:,.0f} m"),
    "medic_distance": ("medic distance", "{:,.0f} m"),
    "red_wait": ("red, mean wait for care", "{:,.0f} s"),
    "red_wait_95": ("red, 95 % cared for within", "{:,.0f} s"),
    "yellow_wait": ("yellow, mean wait for care", "{:,.0f} s"),
    "green_wait": ("green, mean wait for care", "{:,.0f} s"),
    "value_weighted_wait": ("value-weighted wait", "{:,.0f} s"),
    "medic_idle": ("medic idle", "{:,.0f} s"),
    "reached_5_min": ("reached within 5 min", "{:,.0f}"),
    "reached_10_min": ("reached within 10 min", "{:,.0f}"),
    "reached_30_min": ("reached within 30 min", "{:,.0f}"),
    "found": ("found", "{:,.0f}"),
    "treated": ("treated", "{:,.0f}"),
    "undeliverable": ("undeliverable", "{:,.0f}"),
}


def _print(outcomes: dict[str, Outcome]) -> None:
    """Print the figures of each method in a column, then what could not be done."""
    from rich.table import Table

    from quarterdeck.mission.triage.figures import figures

    first = next(iter(outcomes.values()))
    screen = console()
    table = Table(title=f"{first.scenario.name}: {len(first.fates)} casualties", title_justify="left")
    table.add_column("")
    numbers = {m: figures(o) for m, o in outcomes.items()}
    for method in numbers:
        table.add_column(method, justify="right")
    for name, (label, form) in ROWS.items():
        table.add_row(label, *(form.format(f[name]) if math.isfinite(f[name]) else "-" for f in numbers.values()))
    screen.print(table)
    for method, outcome in outcomes.items():
        for reason in outcome.reasons:
            print_reason(screen, method, reason)
