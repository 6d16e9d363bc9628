"""The timeline of a triage mission, which a commander reads: who was found, told of and treated when, and who was lost."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import ScaledTranslation

from quarterdeck.exporters.casualties import MEANING
from quarterdeck.exporters.triage_picture import HALO, looks, losses, png
from quarterdeck.geo.palette import CASUALTY
from quarterdeck.mission.triage.figures import counts_over_time
from quarterdeck.mission.triage.outcome import Outcome
from quarterdeck.mission.triage.settings import COLOURS, SORT

# Of a casualty's bar, which has the casualty's colour: from what to what, how thick, and what that says.
_STAGES = (
    ("found", "delivered", 0.12, "found, no medic told"),
    ("delivered", "reached", 0.36, "waiting for the medic"),
    ("reached", "treated", 0.74, "in treatment"),
)


def timeline_png(outcome: Outcome, *, dpi: int = 150) -> bytes:
    """Return a PNG: casualties found and treated over time by colour, and below a bar for each from found to treated."""
    n = max(len(outcome.fates), 1)
    figure = Figure(figsize=(10, 4.6 + 0.2 * n), layout="constrained")
    counts, bars = figure.subplots(2, 1, sharex=True, height_ratios=[3.2, 0.6 + 0.2 * n])
    _draw_counts(counts, outcome)
    _draw_bars(bars, outcome)
    _draw_losses(counts, bars, outcome)
    return png(figure, dpi=dpi)


def _draw_counts(ax: Axes, outcome: Outcome) -> None:
    times = np.linspace(0.0, outcome.end, 1000)
    counted = counts_over_time(outcome.fates, times)
    present = [c for c in COLOURS if any(f.colour == c for f in outcome.fates)]
    for n, colour in enumerate(present):
        # Lines of one count lie side by side, so that none hides another.
        aside = ScaledTranslation(0.0, 2.2 * (n - (len(present) - 1) / 2) / 72, ax.figure.dpi_scale_trans)
        for what, style, wide in (("found", (0, (2, 1)), 1.2), ("treated", "-", 2.0)):
            ax.step(times, counted[colour][what], where="post", color=CASUALTY[colour], lw=wide, ls=style,
                    transform=ax.transData + aside)  # fmt: skip
    handles = [Line2D([], [], color=CASUALTY[c], lw=2.2, label=f"{c} ({MEANING[c]})") for c in present]
    handles += [Line2D([], [], color="#444444", lw=1.2, ls=(0, (2, 1)), label="found")]
    handles += [Line2D([], [], color="#444444", lw=2.0, label="treated")]
    ax.legend(handles=handles, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    ax.set_ylim(-0.2, 0.3 + max((int(c["found"].max()) for c in counted.values()), default=1))
    ax.set_ylabel("casualties")
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    ax.grid(alpha=0.3)
    done = sum(f.treated is not None for f in outcome.fates)
    ax.set_title(
        f"{outcome.scenario.name}, {outcome.method}: {done} of {len(outcome.fates)} treated in {outcome.end:.0f} s",
        loc="left",
        fontsize=10,
        parse_math=False,
    )


def _draw_bars(ax: Axes, outcome: Outcome) -> None:
    order = sorted(
        outcome.fates, key=lambda f: (list(SORT).index(f.colour), f.found is None, f.found if f.found is not None else 0.0)
    )
    for row, fate in enumerate(order):
        for begin, end, thick, _ in _STAGES:
            start, stop = getattr(fate, begin), getattr(fate, end)
            if start is not None:
                ax.barh(row, (outcome.end if stop is None else stop) - start, left=start, color=CASUALTY[fate.colour],
                        height=thick)  # fmt: skip
                if stop is None:
                    break
        if fate.state != "treated":
            ax.annotate(fate.state, (1.0, row), xycoords=("axes fraction", "data"), xytext=(4, 0),
                        textcoords="offset points", va="center", fontsize=8)  # fmt: skip
    ax.set_yticks(range(len(order)), [f"{f.id}  {f.colour}" for f in order], fontsize=8)
    ax.set_ylim(len(order) - 0.4, -0.6)
    ax.set_xlim(0.0, max(outcome.end, 1.0))
    ax.set_xlabel("seconds from the mission's start")
    handles = [Line2D([], [], color="#444444", lw=12 * thick, solid_capstyle="butt", label=t) for _, _, thick, t in _STAGES]
    ax.figure.legend(handles=handles, fontsize=8, loc="outside lower right", ncols=3)
    ax.grid(axis="x", alpha=0.3)


def _draw_losses(counts: Axes, bars: Axes, outcome: Outcome) -> None:
    """Draw a line where somebody was lost, or took over the section of another, named at the top."""
    members = looks(outcome)
    told = [(time, who, f"{who} lost") for time, who in losses(outcome)]
    told += [(e.time, e.who, f"{e.who} takes over") for e in outcome.log if e.what == "takes over"]
    for time, who, words in told:
        for ax in (counts, bars):
            ax.axvline(time, color=members[who][0], lw=1.2, ls="-.")
        counts.annotate(words, (time, 1.0), xycoords=("data", "axes fraction"), xytext=(2, -3), textcoords="offset points",
                        rotation=90, va="top", fontsize=7, path_effects=HALO, parse_math=False)  # fmt: skip
