"""Pictures of a triage mission's field: everybody's way and the casualties, at the end or at telling moments."""

import io
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from shapely import get_parts, get_rings

from quarterdeck.exporters.casualties import MEANING
from quarterdeck.exporters.map_furniture import fill
from quarterdeck.exporters.map_site import OBSTACLE
from quarterdeck.geo.palette import CASUALTY, SITE, colours_of
from quarterdeck.mission.triage.outcome import Outcome
from quarterdeck.mission.triage.settings import COLOURS
from quarterdeck.mission.triage.sight import seen_by, track_at

_KINDS = {"ugv": ("s", 1.0, "-"), "uav": ("^", 0.8, ":"), "medic": ("P", 1.8, "-")}  # marker, points of the way, its style
_STATES = {"face": "#9ecae1", "ring": "#222222"}  # of the legend's casualties: a colour that none has
_SEARCHED, HALO = "#dfe8f2", [withStroke(linewidth=2.5, foreground="white")]
_LOST: dict[str, Any] = {"marker": "8", "markeredgecolor": "black", "markeredgewidth": 1.4, "linestyle": "none"}


def map_png(outcome: Outcome, *, dpi: int = 150) -> bytes:
    """Return a PNG of the field with everybody's way to the end; casualties have the names that the timeline has."""
    west, south, east, north = outcome.scenario.site.area.bounds
    figure = Figure(figsize=(10, min(max(7.6 * (north - south) / (east - west), 3.6), 11.0) + 0.9), layout="compressed")
    ax = figure.subplots()
    draw_field(ax, outcome, names=True)
    done = sum(fate.treated is not None for fate in outcome.fates)
    words = f"{outcome.scenario.name}, {outcome.method}: {done} of {len(outcome.fates)} treated in {outcome.end:.0f} s"
    ax.set_title(words, fontsize=10, loc="left", parse_math=False)
    figure.legend(handles=field_legend(outcome, [outcome.end]), fontsize=8, loc="outside right center")
    return png(figure, dpi=dpi)


def snapshots_png(outcome: Outcome, moments: Sequence[tuple[float, str]] | None = None, *, dpi: int = 110) -> bytes:
    """Return a PNG of the field at `moments` (seconds, words), in the manner of the paper's Fig. 6.

    Default: what a reader of the log would point at. Shaded is what the UGVs have searched until then.
    """
    chosen = list(moments or telling_moments(outcome))
    columns = 2 if len(chosen) <= 4 else 3
    rows = -(-len(chosen) // columns)
    figure = Figure(figsize=(6.0 * columns, 4.1 * rows), layout="compressed")
    axes = figure.subplots(rows, columns, squeeze=False, gridspec_kw={"hspace": 0.07}).ravel()
    for ax, (time, words) in zip(axes, chosen, strict=False):
        draw_field(ax, outcome, until=time, searched=True)
        ax.set_title(f"t = {time:.0f} s: {words}", fontsize=9, loc="left", parse_math=False)
    for ax in axes[len(chosen) :]:
        ax.set_axis_off()
    signs = field_legend(outcome, [time for time, _ in chosen], searched=True)
    figure.legend(handles=signs, fontsize=8, loc="outside lower center", ncols=4 * columns)
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
        # The layout does not see all that stands beside an axes of a given aspect; tight, nothing is cut.
        figure.savefig(stream, format="png", dpi=dpi, bbox_inches="tight", metadata={"Software": None})
    return stream.getvalue()


def draw_field(
    ax: Axes,
    outcome: Outcome,
    *,
    until: float | None = None,
    ways: tuple[str, ...] = ("ugv", "uav", "medic"),
    searched: bool = False,
    names: bool = False,
) -> None:
    """Draw the field, obstacles, casualties and ways up to `until` seconds (None: to the end) on an axes, in metres.

    `ways` says whose ways are drawn; `searched` shades what UGVs have passed within their range; `names` writes the
    casualties' names. One not found yet is hollow, one that a medic knows of has a ring, a treated one is crossed out.
    """
    until = max(float(t[-1, 0]) for t in outcome.run.tracks.values()) if until is None else until
    site, team = outcome.scenario.site, outcome.team
    if searched:
        seen = seen_by(team, outcome.run.tracks, until).intersection(site.area)
        fill(ax, seen, facecolor=_SEARCHED, edgecolor="none", zorder=0)
    for ring in get_rings(get_parts(site.area)):
        ax.plot(*np.array(ring.coords).T, lw=0.8, color=SITE["area"])
    for obstacle in site.obstacles:
        fill(ax, obstacle.polygon, facecolor=OBSTACLE, edgecolor=SITE["obstacle"], linewidth=0.8, zorder=1.5)
    lost = {who: time for time, who in losses(outcome) if time <= until}
    for name, (colour, kind) in looks(outcome).items():
        marker, wide, style = _KINDS[kind]
        track = outcome.run.tracks[name]
        here = track_at(track, np.array([until]))[0]
        if kind in ways:
            path = np.vstack([track[track[:, 0] <= until, 1:], here])
            ax.plot(*path.T, color=colour, lw=wide, ls=style, alpha=0.85)
        look: dict[str, Any] = _LOST | {"markersize": 10} if name in lost else {"marker": marker, "ms": 7, "mec": "black"}
        ax.plot(*here, color=colour, zorder=5, **look)
        if name in lost:
            _name(ax, here, f"{name} lost at {lost[name]:.0f} s")
    for fate in outcome.fates:
        found, told, treated = (t is not None and t <= until for t in (fate.found, fate.delivered, fate.treated))
        colour = CASUALTY[fate.colour]
        ax.plot(fate.x, fate.y, "*", ms=14, mfc=colour if found else "white", mec="#222222" if found else colour, mew=0.7,
                zorder=4)  # fmt: skip
        if told:
            ax.plot(fate.x, fate.y, "o", ms=17, mfc="none", mec=_STATES["ring"], mew=1.1, zorder=4)
        if treated:
            ax.plot(fate.x, fate.y, "x", ms=5, color="white" if fate.colour == "black" else "black", mew=1.3, zorder=6)
        if names:
            _name(ax, np.array([fate.x, fate.y]), fate.id)
    ax.set_aspect("equal")
    ax.margins(0.03)
    ax.tick_params(labelsize=7)
    ax.set_xlabel("metres east", fontsize=8)
    ax.set_ylabel("metres north", fontsize=8)


def _name(ax: Axes, place: np.ndarray, words: str) -> None:
    ax.annotate(words, (place[0], place[1]), xytext=(7, 5), textcoords="offset points", fontsize=7, zorder=7,
                path_effects=HALO, parse_math=False)  # fmt: skip


def looks(outcome: Outcome) -> dict[str, tuple[str, str]]:
    """Return each member's colour, as all files and pictures have it, and kind."""
    team = outcome.team
    kinds = dict.fromkeys(team.ugvs, "ugv") | dict.fromkeys(team.uavs, "uav") | dict.fromkeys(team.medics, "medic")
    palette = colours_of([*kinds, *(v.id for v in outcome.scenario.vehicles)], casualties=True)
    return {name: (palette[name], kind) for name, kind in kinds.items()}


def losses(outcome: Outcome) -> list[tuple[float, str]]:
    """Return when who stopped for ever."""
    return [(e.time, e.who) for e in outcome.log if e.what == "lost" and e.about == "stop"]


def field_legend(outcome: Outcome, moments: Sequence[float], *, searched: bool = False) -> list[Line2D | Patch]:
    """Return the legend's signs of what `draw_field` draws at these moments."""

    def mark(label: str, **style: Any) -> Line2D:
        return Line2D([], [], ls="none", label=label, **style)

    handles: list[Line2D | Patch] = []
    for name, (colour, kind) in looks(outcome).items():
        handles.append(mark(name, marker=_KINDS[kind][0], color=colour, mec="black"))
    if any(time <= max(moments) for time, _ in losses(outcome)):
        handles.append(Line2D([], [], **_LOST, color="white", markersize=9, label="lost"))
    handles += [
        mark(f"{colour} ({MEANING[colour]})", marker="*", ms=11, color=CASUALTY[colour], mec="#222222")
        for colour in COLOURS
        if any(fate.colour == colour for fate in outcome.fates)
    ]
    stages = {
        "not found yet": ("found", False, {"marker": "*", "ms": 11, "mfc": "white", "mec": "#222222"}),
        "found": ("found", True, {"marker": "*", "ms": 11, "mfc": _STATES["face"], "mec": "#222222"}),
        "a medic knows": ("delivered", True, {"marker": "o", "ms": 11, "mfc": "none", "mec": _STATES["ring"]}),
        "treated": ("treated", True, {"marker": "x", "color": "black", "mew": 1.4}),
    }
    for label, (what, there, style) in stages.items():
        if any(((when := getattr(f, what)) is not None and when <= t) == there for f in outcome.fates for t in moments):
            handles.append(mark(label, **style))
    handles += [Patch(facecolor=_SEARCHED, label="searched")] if searched else []
    return handles + ([Patch(facecolor=OBSTACLE, label="obstacle")] if outcome.scenario.site.obstacles else [])
