"""`quarterdeck reproduce triage`: Table I beside ours, and Figs 6 to 9, of Weaver et al. 2025."""

from __future__ import annotations

import json
import math
import os
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    import numpy as np
    from rich.console import Console

    from quarterdeck.mission.triage.outcome import Outcome
    from quarterdeck.mission.triage.study import Variant

    Results = dict[str, dict[str, np.ndarray]]

# Table I: time s, score, UGV mean distance m, medic distance m; means of ten cases, no spread given
PUBLISHED = {
    "relay": (271.2779, 10.0, 645.0056, 218.5377),
    "no relay": (353.4441, 20.0, 671.2214, 215.1283),
    "must look": (353.4441, 20.0, 671.2214, 215.1283),
    "no priority": (504.378, 312.0, 724.6350, 158.9781),
    "constant": (278.6356, 84.0, 549.9706, 222.4308),
}
PAPERS_FOUR = {
    "time": "time s",
    "score": "score",
    "ugv_distance": "UGV m",
    "medic_distance": "medic m",
}
RESPONDERS = {
    "red_wait": "red s",
    "yellow_wait": "yellow s",
    "green_wait": "green s",
    "value_weighted_wait": "by value s",
    "medic_idle": "idle s",
    "reached_5_min": "in 5 min",
}
ASSUMPTIONS = """\
Assumed where the paper is silent: lanes 2.5 m (Table I implies 2.4: constant communication's 550 m for 1333 m2), UGV 2.5,
UAV 8, medic 1.4 m/s, treatment 10 s, UGVs and medics see 3 m, communication 2 m, 8 to 14 casualties evenly scattered,
each colour as likely; UGVs start on the southern edge, UAV and medic at (40, 25). A mission's time ends with the last
treatment or the end of the last search. At the end of its section a UGV reports in every method, with an empty list too
unless it would have to look for the medic, and waits for the receipt of what the UAV took.
"No relay": the UGVs know where the medic is; "must look": no relay, and only where he was, and his queue, when last met."""
DIFFERS = """\
Differs from Table I: relay is not the fastest; constant communication is, which has strictly more information. No priority
is not the slowest: its medic, who goes to the nearest, walks least (as in Table I) and so is done early; what would make
the shortest walk of all take 504 s, the paper does not say. The score compares orders only, so it rewards knowing little
(a medic who idles until all are known scores 0): waiting times are printed beside it. That the relay saves time is not
claimed: against UGVs who know where the medic is, it does not; against UGVs who must look for him, it does."""


@click.command(short_help="Table I and Figs 6 to 9 of the triage paper.")
@click.option(
    "--cases", type=click.IntRange(min=2), default=300, show_default=True, help="Seeded cases, each run by every method."
)
@click.option("--seed", default=0, show_default=True, type=click.IntRange(min=0), help="The first seed; the others follow.")
@click.option("--jobs", type=click.IntRange(min=1), default=os.cpu_count() or 1, help="Processes; default one a core.")
@click.option("--figures", metavar="FOLDER", help="Draw Figs 6 to 9 into a folder.")
@click.option("--ideas", is_flag=True, help="Compare team sizes and the ideas that the paper only names, instead.")
@click.option("--json", "as_json", is_flag=True, help="Print every figure's mean and interval, and the claims, as JSON.")
@click.option("--force", is_flag=True, help="Overwrite existing files.")
def command(cases: int, seed: int, jobs: int, figures: str | None, ideas: bool, as_json: bool, force: bool) -> int:
    """Run all methods on the same seeded cases and print Table I beside ours, with 95 % intervals.

    Exit status 1 if a claim does not hold on these cases.
    """
    from rich.console import Console
    from rich.progress import Progress

    from quarterdeck.geo.files import write_file
    from quarterdeck.mission.triage.settings import Settings
    from quarterdeck.mission.triage.study import Variant, run_study

    variants = (
        idea_variants()
        if ideas
        else {
            "relay": Variant("relay"),
            "no relay": Variant("no-relay"),
            "must look": Variant("no-relay", Settings(knows_medic=False)),
            "no priority": Variant("no-priority"),
            "constant": Variant("constant"),
        }
    )
    screen = Console(width=124, highlight=False)
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("cases", total=cases * len(variants))
        results = run_study(variants, range(seed, seed + cases), jobs=jobs, progress=lambda n: bar.advance(task, n))
    if ideas:
        _print_ideas(screen, results, cases) if not as_json else click.echo(json.dumps(_intervals(results), indent=2))
        return 0
    claims = check_claims(results)
    if as_json:
        click.echo(json.dumps({"cases": cases, "seed": seed, "figures": _intervals(results), "claims": claims}, indent=2))
    else:
        _print(screen, results, claims, cases)
    if figures:
        for name, picture in draw().items():
            click.echo(f"wrote {write_file(Path(figures) / name, picture, force=force)}", err=True)
    return 0 if all(c["holds"] for c in claims) else 1


def idea_variants() -> dict[str, Variant]:
    """Return the relay with other teams, and with the ideas that the paper names and leaves for later."""
    from quarterdeck.mission.triage.settings import Settings
    from quarterdeck.mission.triage.study import Variant

    teams = {f"{n} UGV{'s' * (n > 1)}": Variant(ugvs=n) for n in (1, 2, 4, 5, 6)}
    return {
        "3 UGVs, 1 UAV, 1 medic": Variant(),
        **teams,
        "2 UAVs": Variant(uavs=2),
        "2 medics": Variant(medics=2),
        "3 medics": Variant(medics=3),
        "moving rendezvous": Variant(settings=Settings(rendezvous="moving")),
        "round robin": Variant(settings=Settings(rendezvous="round-robin")),
        "report each red (N = 1)": Variant(settings=Settings(clusters=1)),
        "2 helpers": Variant(settings=Settings(helpers=2)),
        "tiring, 10 % in 100 m": Variant(settings=Settings(fatigue=0.1)),
        "nearest first": Variant(settings=Settings(order="nearest")),
        "first come": Variant(settings=Settings(order="first-come")),
        "1 in 5 sorted wrongly": Variant(settings=Settings(confidence=0.8)),
        "off by 2 m (1 sigma)": Variant(settings=Settings(position_error=2.0)),
    }


def check_claims(results: Results) -> list[dict[str, Any]]:
    """Return each claim with what was measured and its 95 % interval.

    `holds`: the measured value meets the claim; `shown`: so does the interval's worse end, so more cases would not undo it.
    """
    import numpy as np

    from quarterdeck.mission.triage.study import difference, share

    claims: list[dict[str, Any]] = []

    def claim(words: str, unit: str, interval: tuple[float, float, float], least: float) -> None:
        mean, low, high = interval
        verdict = {"holds": bool(mean > least or mean == least == 1.0), "shown": bool(low > least or mean == least == 1.0)}
        claims.append({"claim": words, "measured": mean, "interval": [low, high], "unit": unit} | verdict)

    relay, blind = results["relay"], results["no priority"]
    for less, more in pairwise(("constant", "relay", "no relay", "no priority")):
        gap = difference(results[more]["ugv_distance"], results[less]["ugv_distance"])
        claim(f"UGV distance: {less} < {more}", "m", gap, 0.0)
    claim("score: relay better than no priority in 90 % of cases", "cases", share(relay["score"] < blind["score"]), 0.9)
    red = np.isfinite(relay["red_wait"])
    better = relay["red_wait"][red] < blind["red_wait"][red]
    claim("red waiting: relay better than no priority in 80 % of cases with red", "cases", share(better), 0.8)
    claim(
        "time: constant < relay, as more information must", "s", difference(relay["time"], results["constant"]["time"]), 0.0
    )
    complete = np.concatenate([r["complete"] for r in results.values()])
    claim("every casualty found and treated in every case and method", "cases", share(complete == 1.0), 1.0)
    return claims


def draw() -> dict[str, bytes]:
    """Return the PNGs of Figs 6 to 9 by file name."""
    from matplotlib.figure import Figure

    from quarterdeck.exporters.triage_picture import draw_field, field_legend, png, snapshots_png
    from quarterdeck.mission.triage.scripted import laboratory_case, simulation_case

    case = simulation_case()
    relay, laboratory = case.run(), laboratory_case().run()

    def ways(panels: list[tuple[Outcome, str]], drawn: tuple[str, ...]) -> bytes:
        figure = Figure(figsize=(6.2 * len(panels), 4.6), layout="constrained")
        for ax, (outcome, words) in zip(figure.subplots(1, len(panels), squeeze=False).flat, panels, strict=True):
            draw_field(ax, outcome, ways=drawn)
            ax.set_title(f"{words}: {outcome.end:.0f} s", fontsize=9, loc="left")
        first = panels[0][0]
        figure.legend(handles=field_legend(first, [first.end]), fontsize=8, loc="outside lower center", ncols=8)
        return png(figure, dpi=110)

    others = [(case.run(m), m.replace("-", " ")) for m in ("no-priority", "no-relay", "constant")]
    return {
        "fig6.png": snapshots_png(relay, _moments_of_fig_6(relay)),
        "fig7.png": ways([(relay, "relay")], ("ugv", "uav", "medic")),
        "fig8.png": ways(others, ("medic",)),
        "fig9.png": snapshots_png(laboratory, _moments_of_fig_9(laboratory)),
    }


def _moments_of_fig_6(outcome: Outcome) -> list[tuple[float, str]]:
    """Return the four moments that the paper shows, found in our log."""
    log, fates = outcome.log, {f.id: f for f in outcome.fates}
    first = next(e for e in log if e.what == "delivered")
    on_way = next(e.time for e in log if e.what == "handed") + 0.5
    gathered = next(e for e in log if e.whom == "centre reached, urgent ones left")
    waiting = next(e for e in log if e.whom == "nobody there")
    moments = [
        (min(on_way, first.time), "the first red is on its way to the medic"),
        (gathered.time, f"{gathered.who} looks around the red it found and has a second"),
        (waiting.time + 0.5, f"{waiting.who} waits at the rendezvous for the UAV"),
        (float(fates["r1"].delivered or 0.0), "the red at (10, 15) reaches the medic, after the yellow at (55, 12)"),
    ]
    return sorted(moments)


def _moments_of_fig_9(outcome: Outcome) -> list[tuple[float, str]]:
    fates = {f.id: f for f in outcome.fates}
    first, left, right = fates["r1"], fates["r2"], fates["r3"]
    return [
        (float(first.found or 0.0), "UGV1 finds a red and turns to the rendezvous"),
        (float(first.reported or 0.0) + 1.0, "UGV1 returns to its path, the UAV flies to the medic"),
        (float(left.delivered or 0.0), "the medic learns of the red in the upper left"),
        (float(right.found or 0.0) + 2.0, "the medic walks there; UGV2 has found a red in the upper right"),
    ]


def _intervals(results: Results) -> dict[str, dict[str, list[float | None]]]:
    from quarterdeck.mission.triage.study import mean_interval

    def plain(values: np.ndarray) -> list[float | None]:
        return [v if math.isfinite(v) else None for v in mean_interval(values)]

    return {name: {k: plain(v) for k, v in figures.items() if k != "seed"} for name, figures in results.items()}


def _print(screen: Console, results: Results, claims: list[dict[str, Any]], cases: int) -> None:
    """Print the paper's table beside ours, the responders', the claims, the assumptions and what differs."""
    from rich.table import Table

    from quarterdeck.mission.triage.study import mean_interval

    table = Table(title=f"Table I: the paper's (10 cases), ours ({cases} cases), 95 % interval", title_justify="left")
    other = Table(
        title="Seconds until care, medic idle; reached in 5 min: ours, 95 % interval",
        title_justify="left",
    )
    for t, columns in ((table, PAPERS_FOUR), (other, RESPONDERS)):
        t.add_column("method")
        for label in columns.values():
            t.add_column(label, justify="right", no_wrap=True)
    for name, figures in results.items():
        cells = [
            f"{published:,.0f}  {_cell(*mean_interval(figures[k]))}"
            for k, published in zip(PAPERS_FOUR, PUBLISHED[name], strict=True)
        ]
        table.add_row(name, *cells)
        other.add_row(name, *(_cell(*mean_interval(figures[k])) for k in RESPONDERS))
    screen.print(table, other)
    for c in claims:
        scale, unit = (100.0, "%") if c["unit"] == "cases" else (1.0, c["unit"])
        middle, low, high = (f"{scale * v:.1f}" for v in (c["measured"], *c["interval"]))
        verdict = "holds" if c["shown"] else "holds here, not shown" if c["holds"] else "DOES NOT HOLD"
        screen.print(f"{verdict}: {c['claim']}: {middle} {unit} ({low} to {high})", soft_wrap=True)
    screen.print(ASSUMPTIONS, DIFFERS, sep="\n", soft_wrap=True)


def _print_ideas(screen: Console, results: Results, cases: int) -> None:
    """Print each variant's figures and, pair by pair, how they differ from the first's."""
    from rich.table import Table

    from quarterdeck.mission.triage.study import difference, mean_interval

    columns = {k: RESPONDERS[k] for k in ("red_wait", "value_weighted_wait")} | {
        k: PAPERS_FOUR[k] for k in ("time", "score", "ugv_distance")
    }
    base, *others = results
    table = Table(
        title=f"{base}, and what changes with other teams and ideas: {cases} paired cases, 95 %", title_justify="left"
    )
    table.add_column("relay with", no_wrap=True)
    for label in columns.values():
        table.add_column(label, justify="right", no_wrap=True)
    table.add_row(base, *(_cell(*mean_interval(results[base][k])) for k in columns))
    for name in others:
        gaps = (difference(results[name][k], results[base][k]) for k in columns)
        table.add_row(name, *(f"{m:+,.0f}\n({low:+,.0f} to {high:+,.0f})" for m, low, high in gaps))
    screen.print(table)


def _cell(mean: float, low: float, high: float) -> str:
    digits = 0 if mean >= 20 else 1
    return f"{mean:,.{digits}f}\n({low:,.{digits}f}-{high:,.{digits}f})"
