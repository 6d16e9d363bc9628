"""The column beside a map: a row of figures for each vehicle, what happened, and the legend."""

from collections.abc import Mapping, Sequence
from textwrap import wrap

import numpy as np
from matplotlib.axes import Axes

from quarterdeck.exporters.map_furniture import clock
from quarterdeck.exporters.map_site import Sign
from quarterdeck.mission.mission import Mission, Route
from quarterdeck.physics.report import Report

_COLUMNS = (0.0, 0.075, 0.105, 0.56, 0.67, 0.85, 1.0)  # colour, number, name, length, survey, time, energy
_ROWS_FULL_SIZE = 26  # rows of the table that stand in the usual type; more are set smaller


def table(panel: Axes, mission: Mission, palette: Mapping[str, str], report: Report | None = None) -> float:
    """Set one row a vehicle, and their sum: number, name, length, survey part (of a run: off it), time, energy.

    Return where it ends, as a part of the panel.
    """
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
    for number, row in enumerate(rows[:-1], 1):
        y -= pitch
        panel.plot([_COLUMNS[0], 0.035], [y, y], color=palette[row[0]], linewidth=2.5 if count <= _ROWS_FULL_SIZE else 1.8)
        name = row[0] if len(row[0]) <= 22 else row[0][:21] + "…"
        _row(panel, y, size, (str(number), name, *row[1:]))
    _row(panel, y - pitch, size, ("", *rows[-1]), weight="bold")
    return y - 1.5 * pitch


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
        (v.id, *_figures(v.length, _short(v.legs.p95), v.time, v.energy)) for v in report.vehicles
    ]
    whole = [sum(v.length for v in report.vehicles), sum(v.energy for v in report.vehicles)]
    worst = max((v.legs.p95 for v in report.vehicles), default=0.0)
    longest = max((v.time for v in report.vehicles), default=0.0)
    rows.append(("all (off, time: worst)", *_figures(whole[0], _short(worst), longest, whole[1])))
    return rows


def _surveyed(route: Route) -> float:
    return float(np.linalg.norm(np.diff(route.xyz, axis=0), axis=1)[route.survey[1:]].sum())


def _percent(part: float, whole: float) -> str:
    return f"{100 * part / whole:.0f} %" if whole > 0 else "-"


def _figures(length: float, middle: str, duration: float, energy: float) -> tuple[str, str, str, str]:
    return _short(length / 1000), middle, clock(duration), f"{energy:.0f}"


def _short(value: float) -> str:
    """Return a figure of at most two decimals, and of four digits: columns have room for no more."""
    return next((text for n in (2, 1) if len(text := f"{value:.{n}f}") <= 5), f"{value:.0f}")


def _row(panel: Axes, y: float, size: float, texts: tuple[str, ...], *, weight: str = "normal") -> None:
    for x, text, side in zip(_COLUMNS[1:], texts, ("right", "left", "right", "right", "right", "right"), strict=True):
        panel.text(x, y, text, fontsize=size, ha=side, va="center", weight=weight, parse_math=False)


def legend(panel: Axes, signs: Sequence[Sign]) -> float:
    """Say what the map's lines, signs and fills are: of those that it has alone. Return its top, as a part of the panel."""
    for columns in (2, 1):
        shown = panel.legend(handles=list(signs), loc="lower left", ncols=columns, fontsize=7, frameon=False,
                             borderaxespad=0.0, columnspacing=1.2, handletextpad=0.6)  # fmt: skip
        (left, _), (right, top) = panel.transAxes.inverted().transform(shown.get_window_extent())
        if right - left <= 1.0:
            break
    return float(top)


def happenings(panel: Axes, lines: Sequence[tuple[str, str]], low: float, high: float) -> None:
    """Set lines, each a time or a head and what is said, between two heights of the panel; what has no room is counted."""
    pitch, width = 0.022, 54
    room = int((high - low) / pitch) - 1
    rows = [(head if n == 0 else "", text) for head, words in lines for n, text in enumerate(wrap(words, width) or [""])]
    if len(rows) > room:
        rows = [*rows[: max(room - 1, 0)], ("", f"and {len(rows) - max(room - 1, 0)} lines more: see the report")]
    for n, (head, text) in enumerate(rows[: max(room, 0)]):
        y = high - (n + 1) * pitch
        panel.text(0.0, y, head, fontsize=7, va="center", weight="bold", parse_math=False)
        panel.text(0.17, y, text, fontsize=7, va="center", parse_math=False)
