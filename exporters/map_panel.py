"""The column beside a map: a row of figures for each vehicle, and the legend."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from quarterdeck.geo.palette import SITE
from quarterdeck.mission.layers import drawn
from quarterdeck.mission.mission import Layer, Mission, Route
from quarterdeck.physics.report import Report

WATER, AREA, OBSTACLE, MISSED, STRANGE = "#f4f7fa", "#dcebf5", "#8c8c8c", "#d7191c", "#111111"
TASK: dict[str, Any] = {"marker": "s", "color": "black", "markerfacecolor": "#ffffb2", "markersize": 4, "linestyle": "none"}
START: dict[str, Any] = {"marker": "o", "color": "white", "markeredgecolor": "black", "linestyle": "none"}
CONTACT: dict[str, Any] = {
    "marker": "X",
    "color": "#d7191c",
    "markeredgecolor": "white",
    "markersize": 8,
    "linestyle": "none",
}
_COLUMNS = (0.0, 0.075, 0.105, 0.58, 0.70, 0.88, 1.0)  # colour, number, name, length, survey, time, energy
_ROWS_FULL_SIZE = 26  # rows of the table that stand in the usual type; more are set smaller


def table(panel: Axes, mission: Mission, palette: list[str], report: Report | None = None) -> None:
    """Set one row a vehicle, and their sum: number, name, length, survey part (of a run: off it), time, energy."""
    panel.set_axis_off()
    panel.set_xlim(0, 1)
    panel.set_ylim(0, 1)
    count = len(mission.routes) + 2
    pitch = min(0.03, 0.80 / count)
    size = 7.5 if count <= _ROWS_FULL_SIZE else max(4.0, 7.5 * pitch / 0.03 + 0.4)
    y = 0.985
    for x, text in zip(_COLUMNS[3:], ("km", "survey" if report is None else "off, m", "time", "Wh"), strict=True):
        panel.text(x, y, text, fontsize=size, ha="right", va="center", color="#555555")
    rows = _planned(mission) if report is None else _run(report)
    for number, (row, colour) in enumerate(zip(rows, palette, strict=False), 1):
        y -= pitch
        panel.plot([_COLUMNS[0], 0.035], [y, y], color=colour, linewidth=2.5 if count <= _ROWS_FULL_SIZE else 1.8)
        name = row[0] if len(row[0]) <= 22 else row[0][:21] + "…"
        _row(panel, y, size, (str(number), name, *row[1:]))
    _row(panel, y - pitch, size, ("", *rows[-1]), weight="bold")


def _planned(mission: Mission) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    total = np.zeros(3)
    for route in mission.routes:
        surveyed = _surveyed(route)
        total += (route.length, surveyed, route.energy)
        rows.append(
            (route.vehicle, *_figures(route.length, _percent(surveyed, route.length), route.duration, route.energy))
        )
    longest = max((route.duration for route in mission.routes), default=0.0)
    rows.append(("all (time: longest)", *_figures(total[0], _percent(total[1], total[0]), longest, total[2])))
    return rows


def _run(report: Report) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [
        (v.id, *_figures(v.length, f"{v.legs.p95:.2f}", v.time, v.energy)) for v in report.vehicles
    ]
    whole = [sum(v.length for v in report.vehicles), sum(v.energy for v in report.vehicles)]
    worst = max((v.legs.p95 for v in report.vehicles), default=0.0)
    longest = max((v.time for v in report.vehicles), default=0.0)
    rows.append(("all (off, time: worst)", *_figures(whole[0], f"{worst:.2f}", longest, whole[1])))
    return rows


def _surveyed(route: Route) -> float:
    return float(np.linalg.norm(np.diff(route.xyz, axis=0), axis=1)[route.survey[1:]].sum())


def _percent(part: float, whole: float) -> str:
    return f"{100 * part / whole:.0f} %" if whole > 0 else "-"


def _figures(length: float, middle: str, duration: float, energy: float) -> tuple[str, str, str, str]:
    hours, rest = divmod(round(duration), 3600)
    time = f"{hours}:{rest // 60:02d}:{rest % 60:02d}" if hours else f"{rest // 60}:{rest % 60:02d}"
    return f"{length / 1000:.2f}", middle, time, f"{energy:.0f}"


def _row(panel: Axes, y: float, size: float, texts: tuple[str, ...], *, weight: str = "normal") -> None:
    for x, text, side in zip(_COLUMNS[1:], texts, ("right", "left", "right", "right", "right", "right"), strict=True):
        panel.text(x, y, text, fontsize=size, ha=side, va="center", weight=weight, parse_math=False)


def legend(panel: Axes, mission: Mission, *, run: bool = False, strange: bool = False) -> None:
    """Say what the map's lines and fills are."""
    handles: list[Any] = [
        Line2D([], [], color="#333333", linewidth=1.8, label="survey"),
        Line2D([], [], color="#333333", linewidth=0.9, alpha=0.75, label="transit, turn"),
        Line2D([], [], **START, markersize=4, label="start"),
        Patch(facecolor=AREA, edgecolor=SITE["area"], label="area"),
        Patch(facecolor=WATER, edgecolor=SITE["operating"], linestyle="--", label="operating area"),
    ]
    if mission.site.obstacles:
        handles.append(Patch(facecolor=OBSTACLE, edgecolor=SITE["obstacle"], label="obstacle"))
    if strange:
        handles.append(Patch(facecolor=STRANGE, edgecolor=STRANGE, label="obstacle that the plan did not know"))
    if mission.tasks:
        handles.append(Line2D([], [], **TASK, label="task"))
    handles += [_key(layer) for layer in drawn(mission) if any("stroke" in p for p in layer.properties)]
    if run:
        handles[0:2] = [
            Line2D([], [], color="#333333", linewidth=1.2, label="driven"),
            Line2D([], [], color="#333333", linewidth=1.2, alpha=0.3, label="planned"),
        ]
        handles += [
            Patch(facecolor=MISSED, label="missed of the plan's swaths"),
            Line2D([], [], **CONTACT, label="contact"),
        ]
    panel.legend(handles=handles, loc="lower left", ncols=2, fontsize=7, frameon=False, borderaxespad=0.0)


def _key(layer: Layer) -> Patch | Line2D:
    """The sign of a layer that has a colour of its own: what was surveyed before, what is undone, a triangulation."""
    colour = next(p["stroke"] for p in layer.properties if "stroke" in p)
    if all(geometry.geom_type.endswith("Polygon") for geometry in layer.geometries):
        return Patch(facecolor=colour, alpha=0.16, label=layer.name)
    return Line2D([], [], color=colour, linewidth=0.9, label=layer.name)
