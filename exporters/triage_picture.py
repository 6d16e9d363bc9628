"""Pictures of a triage mission: the timeline that a commander reads, and the field with everybody's way."""

import io
from collections.abc import Sequence
from itertools import pairwise

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from shapely import get_parts, get_rings

from quarterdeck.exporters.casualties import MEANING
from quarterdeck.exporters.map_furniture import fill
from quarterdeck.geo.palette import CASUALTY
from quarterdeck.mission.triage.figures import counts_over_time
from quarterdeck.mission.triage.outcome import Outcome
from quarterdeck.mission.triage.settings import COLOURS, SORT
from quarterdeck.mission.triage.sight import seen_by, track_at

_STAGES = (
    ("found", "delivered", "#cfcfcf", "found, no medic told"),
    ("delivered", "reached", "#8f8f8f", "waiting for the medic"),
)
_UGVS = ("#1f77b4", "#17becf", "#8c564b", "#e377c2", "#3f007d", "#525252")  # none that a casualty has
_MEDIC, _UAV = "#ff7f0e", "#9467bd"


def timeline_png(outcome: Outcome, *, dpi: int = 150) -> bytes:
    """Return a PNG: casualties found and treated over time by colour, and below a bar for each from found to treated."""
    n = max(len(outcome.fates), 1)
    figure = Figure(figsize=(10, 4.6 + 0.2 * n), layout="constrained")
    counts, bars = figure.subplots(2, 1, sharex=True, height_ratios=[3.2, 0.6 + 0.2 * n])
    _draw_counts(counts, outcome)
    _draw_bars(bars, outcome)
    return png(figure, dpi=dpi)


def map_png(outcome: Outcome, *, dpi: int = 150) -> bytes:
    """Return a PNG of the field with everybody's way to the end."""
    figure = Figure(figsize=(10, 6.5), layout="constrained")
    ax = figure.subplots()
    draw_field(ax, outcome)
    ax.set_xlabel("metres east")
    ax.set_ylabel("metres north")
    figure.legend(handles=field_legend(outcome), fontsize=8, loc="outside right center")
    return png(figure, dpi=dpi)


def snapshots_png(outcome: Outcome, moments: Sequence[tuple[float, str]] | None = None, *, dpi: int = 110) -> bytes:
    """Return a PNG of the field at `moments` (seconds, words), in the manner of the paper's Fig. 6.

    Default: what a reader of the log would point at. Shaded is what the UGVs have searched until then.
    """
    chosen = list(moments or telling_moments(outcome))
    columns = 2 if len(chosen) <= 4 else 3
    rows = -(-len(chosen) // columns)
    figure = Figure(figsize=(6.0 * columns, 4.1 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax, (time, words) in zip(axes, chosen, strict=False):
        draw_field(ax, outcome, until=time, searched=True)
        ax.set_title(f"t = {time:.0f} s: {words}", fontsize=9, loc="left", parse_math=False)
    for ax in axes[len(chosen) :]:
        ax.set_axis_off()
    figure.legend(handles=field_legend(outcome), fontsize=8, loc="outside lower center", ncols=10)
    return png(figure, dpi=dpi)


def telling_moments(outcome: Outcome) -> list[tuple[float, str]]:
    """Return six to nine moments to draw: the first of each kind of thing that happens, losses, the end, and between."""
    words = {
        ("handed", ""): "{who} has told {whom} of its first finds",
        ("delivered", ""): "{who} tells {whom}",
        ("state", "centre reached, urgent ones left"): "{who} looks around a red and has found another",
        ("state", "nobody there"): "{who} waits at the rendezvous",
        ("state", "patience over"): "{who} has waited in vain and looks for the medic",
        ("takes over", ""): "{who} takes over the section of {about}",
        ("treatment", ""): "{who} treats the first",
        ("undeliverable", ""): "{who} gives up telling a medic",
    }
    found: list[tuple[float, str]] = []
    seen = set()
    for entry in (e for e in outcome.log if e.time >= outcome.team.began):  # how it was before, there is no track of
        key = (entry.what, entry.whom if entry.what == "state" else "")
        if entry.what == "lost":
            found.append((entry.time, f"{entry.who} {'is lost' if entry.about == 'stop' else 'is not heard any more'}"))
        elif key in words and key not in seen:
            seen.add(key)
            later = 1.0 if entry.what == "handed" else 0.0  # then the UAV is on its way
            found.append((entry.time + later, words[key].format(who=entry.who, whom=entry.whom, about=entry.about)))
    searched = {e.about: e.time for e in outcome.log if e.what == "searched"}
    if searched.keys() >= outcome.team.ugvs.keys():
        found.append((max(searched.values()), "all that could be searched is searched"))
    end = max([outcome.end, *(time for time, _ in found)])
    apart: list[tuple[float, str]] = []
    for moment in sorted(found):
        if not apart or moment[0] - apart[-1][0] > 0.01 * end:
            apart.append(moment)
    apart.append((end, "the run was cut short" if outcome.run.reason else "the end"))
    while 1 < len(apart) < 6:
        before, after = max(pairwise([(outcome.team.began, ""), *apart]), key=lambda pair: pair[1][0] - pair[0][0])
        time = (before[0] + after[0]) / 2
        counts = [
            sum(t is not None and t <= time for t in times)
            for times in ([f.found for f in outcome.fates], [f.treated for f in outcome.fates])
        ]
        apart = sorted([*apart, (time, f"{counts[0]} found, {counts[1]} treated")])
    return [*apart[:8], apart[-1]] if len(apart) > 9 else apart


def png(figure: Figure, *, dpi: int = 150) -> bytes:
    """Return a figure's PNG bytes, the same for the same figure."""
    stream = io.BytesIO()
    with mpl.rc_context({"savefig.facecolor": "white"}):
        figure.savefig(stream, format="png", dpi=dpi, metadata={"Software": None})
    return stream.getvalue()


def draw_field(
    ax: Axes,
    outcome: Outcome,
    *,
    until: float | None = None,
    ways: tuple[str, ...] = ("ugv", "uav", "medic"),
    searched: bool = False,
) -> None:
    """Draw the field, obstacles, casualties and ways up to `until` seconds (None: to the end) on an axes, in metres.

    `ways` says whose ways are drawn; `searched` shades what UGVs have passed within their range. A casualty not found yet
    is hollow, one found and not told to a medic has no rim, a treated one is crossed out.
    """
    until = max(float(t[-1, 0]) for t in outcome.run.tracks.values()) if until is None else until
    site, team = outcome.scenario.site, outcome.team
    shapes = [(site.area, "none", "#555555"), *((o.polygon, "#c9b8a8", "#6b5a4a") for o in site.obstacles)]
    if searched:
        seen = seen_by(team, outcome.run.tracks, until).intersection(site.area)
        fill(ax, seen, facecolor="#dfe8f2", edgecolor="none", zorder=0)
    for polygons, face, edge in shapes:
        for ring in get_rings(get_parts(polygons)):
            ax.fill(*np.array(ring.coords).T, lw=0.8, fc=face, ec=edge)
    looks = {u: (_UGVS[i % len(_UGVS)], "s", "ugv") for i, u in enumerate(team.ugvs)}
    looks |= dict.fromkeys(team.uavs, (_UAV, "^", "uav")) | dict.fromkeys(team.medics, (_MEDIC, "P", "medic"))
    for name, (colour, marker, kind) in looks.items():
        track = outcome.run.tracks[name]
        here = track_at(track, np.array([until]))[0]
        if kind in ways:
            path = np.vstack([track[track[:, 0] <= until, 1:], here])
            wide = {"ugv": 1.0, "uav": 0.7, "medic": 1.8}[kind]
            ax.plot(*path.T, color=colour, lw=wide, ls=":" if kind == "uav" else "-", alpha=0.8 if kind != "uav" else 0.6)
        ax.plot(*here, marker=marker, color=colour, ms=7, mec="black", mew=0.6, zorder=5)
    for fate in outcome.fates:
        colour = CASUALTY[fate.colour]
        seen, told = (t is not None and t <= until for t in (fate.found, fate.delivered))
        ax.plot(
            fate.x,
            fate.y,
            "*",
            ms=12,
            mfc=colour if seen else "white",
            mec="black" if told else colour,
            mew=0.9,
            zorder=4,
        )
        if fate.treated is not None and fate.treated <= until:
            ax.plot(fate.x, fate.y, "x", ms=5, color="black", mew=1.3, zorder=6)
    ax.set_aspect("equal")
    ax.margins(0.03)
    ax.tick_params(labelsize=7)


def field_legend(outcome: Outcome) -> list[Line2D]:
    """Return the legend's handles of `draw_field`."""

    def mark(label: str, marker: str, **style: object) -> Line2D:
        return Line2D([], [], ls="none", marker=marker, label=label, **style)  # type: ignore[arg-type]

    handles = [mark(u, "s", color=_UGVS[i % len(_UGVS)]) for i, u in enumerate(outcome.team.ugvs)]
    handles += [mark("UAV", "^", color=_UAV)] if outcome.team.uavs else []
    handles += [mark("medic", "P", color=_MEDIC), mark("not found yet", "*", ms=10, mfc="white", mec="black")]
    handles += [
        mark("found", "*", ms=10, color="#d62728", mew=0),
        mark("a medic knows", "*", ms=10, mfc="#d62728", mec="black"),
    ]
    handles += [mark("treated", "x", color="black")]
    return handles


def _draw_counts(ax: Axes, outcome: Outcome) -> None:
    times = np.linspace(0.0, outcome.end, 1000)
    for colour, counts in counts_over_time(outcome.fates, times).items():
        ax.step(times, counts["found"], where="post", color=CASUALTY[colour], lw=1.2, ls="--")
        ax.step(times, counts["treated"], where="post", color=CASUALTY[colour], lw=2.2)
    present = [c for c in COLOURS if any(f.colour == c for f in outcome.fates)]
    handles = [Line2D([], [], color=CASUALTY[c], lw=2.2, label=f"{c} ({MEANING[c]})") for c in present]
    handles += [Line2D([], [], color="black", lw=1.2, ls="--", label="found")]
    handles += [Line2D([], [], color="black", lw=2.2, label="treated")]
    ax.legend(handles=handles, fontsize=8, ncols=2, loc="upper left")
    ax.set_ylabel("casualties")
    ax.yaxis.set_major_locator(MaxNLocator(integer=True))
    ax.grid(alpha=0.3)
    done = sum(f.treated is not None for f in outcome.fates)
    ax.set_title(
        f"{outcome.scenario.name}, {outcome.method}: {done} of {len(outcome.fates)} treated in {outcome.end:.0f} s",
        loc="left",
        fontsize=10,
    )


def _draw_bars(ax: Axes, outcome: Outcome) -> None:
    order = sorted(
        outcome.fates, key=lambda f: (list(SORT).index(f.colour), f.found is None, f.found if f.found is not None else 0.0)
    )
    for row, fate in enumerate(order):
        for begin, end, grey, _ in _STAGES:
            start = getattr(fate, begin)
            if start is not None:
                stop = getattr(fate, end)
                ax.barh(row, (outcome.end if stop is None else stop) - start, left=start, color=grey, height=0.62)
                if stop is None:
                    break
        if fate.reached is not None and fate.treated is not None:
            ax.barh(row, fate.treated - fate.reached, left=fate.reached, color=CASUALTY[fate.colour], height=0.62)
        elif fate.state != "treated":
            ax.text(outcome.end, row, f" {fate.state}", va="center", fontsize=7)
    ax.set_yticks(range(len(order)), [f.id for f in order], fontsize=7)
    for label, fate in zip(ax.get_yticklabels(), order, strict=True):
        label.set_color(CASUALTY[fate.colour])
    ax.set_ylim(len(order) - 0.4, -0.6)
    ax.set_xlim(0.0, max(outcome.end, 1.0))
    ax.set_xlabel("seconds from the mission's start")
    stages = (*((c, t) for _, _, c, t in _STAGES), (CASUALTY["red"], "in treatment"))
    handles = [Line2D([], [], color=c, lw=6, label=t) for c, t in stages]
    ax.figure.legend(handles=handles, fontsize=8, loc="outside lower right", ncols=3)
    ax.grid(axis="x", alpha=0.3)
