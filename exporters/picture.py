"""A map of a plan as PNG, and of a run over its plan: what an operator checks before and after."""

import io
from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.map_furniture import clock, graticule, north_arrow, scale_bar
from quarterdeck.exporters.map_panel import happenings, legend, table
from quarterdeck.exporters.map_run import found, lost, run
from quarterdeck.exporters.map_site import Sign, layers, places, site
from quarterdeck.exporters.places import file_stems, spacing_words
from quarterdeck.geo.scenario import Obstacle
from quarterdeck.mission.layers import fleet_colours, left_undone
from quarterdeck.mission.mission import Mission
from quarterdeck.physics.moments import WORDS, Moment
from quarterdeck.physics.report import Report
from quarterdeck.physics.trace import Trace


def files(mission: Mission, settings: Settings) -> dict[str, bytes]:  # noqa: ARG001 - no autopilot reads it
    """Return `<mission>.png`, the map of the plan."""
    return {f"{file_stems(mission)[0]}.png": picture(mission)}


def picture(
    mission: Mission,
    trace: Trace | None = None,
    report: Report | None = None,
    *,
    strange: Sequence[Obstacle] = (),
    moments: Sequence[Moment] = (),
    followed: Mission | None = None,
    width: int = 1800,
    height: int = 1200,
) -> bytes:
    """Return a PNG of the plan, or with a `trace` of the run over the plan, `width` by `height` pixels.

    North (of the frame's centre) is up. Survey legs are thick, transits thin, starts are numbered as in the table. Of a run
    the driven tracks, what they missed of the plan's swaths, and contacts are drawn; with its `report` the table holds the
    run's figures and the caption the verdict, with the reasons below. Of the site's obstacles, `strange` are those that the
    plan did not know. `moments` tell who was lost or told a new route, where and when; of `followed`, the last plan made in
    the run, what it left undone and what it kept clear of are drawn. The legend has what is drawn and nothing else.
    """
    figure = Figure(figsize=(width / 150, height / 150), dpi=150, facecolor="white")
    FigureCanvasAgg(figure)
    chart = figure.add_axes((0.055, 0.055, 0.615, 0.875))
    panel = figure.add_axes((0.685, 0.03, 0.30, 0.90))
    palette = fleet_colours(mission)
    _view(chart, mission, trace, width / height)
    signs = site(chart, mission, strange)
    signs += layers(chart, mission, palette, run=trace is not None)
    if followed is not None:
        signs += found(chart, mission.site, followed)
        told = {sign.get_label() for sign in signs}  # the plan may have left something undone too
        signs += [s for s in layers(chart, left_undone(followed), palette, run=True) if s.get_label() not in told]
    signs[:0] = _routes(chart, mission, palette, faint=trace is not None)
    if trace is not None:
        signs[:0] = run(chart, mission, trace, palette)
    signs += places(chart, mission, palette)
    signs += lost(chart, mission, moments, palette)
    graticule(chart, mission.frame)
    scale_bar(chart)
    north_arrow(chart)
    name = min(13.0, 13.0 * 40 / max(len(mission.name), 1))  # points: a long name leaves room for the caption
    figure.text(0.055, 0.955, mission.name, fontsize=name, weight="bold", va="center", parse_math=False)
    figure.text(0.67, 0.955, _caption(mission, report), fontsize=8, va="center", ha="right", color="#333333")
    high = table(panel, mission, palette, report)
    happenings(panel, _told(mission, moments, report), legend(panel, signs), high)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def _view(chart: Axes, mission: Mission, trace: Trace | None, aspect: float) -> None:
    """Set the limits: all routes, tracks and areas, with a margin, filling the frame; far parts of the site are cut.

    The lower margin has room for the scale bar: it hides no track.
    """
    points = [route.xyz[:, :2] for route in mission.routes]
    points += [np.column_stack([trace.x.ravel(), trace.y.ravel()])] if trace is not None else []
    points += [shapely.get_coordinates(area.polygon) for area in mission.site.areas]
    points += [np.array([task.position for task in mission.tasks]).reshape(-1, 2)]
    if not any(len(p) for p in points):
        points = [shapely.get_coordinates(mission.site.operating)]
    every = np.vstack(points)
    low, high = every.min(axis=0), every.max(axis=0)
    centre, size = (low + high) / 2, np.maximum(high - low, 10.0)
    centre, size = centre - (0.0, 0.02 * size[1]), size * (1.10, 1.14)
    box = chart.get_position()
    shape = box.width / box.height * aspect
    size = np.array([max(size[0], size[1] * shape), max(size[1], size[0] / shape)])
    chart.set_xlim(centre[0] - size[0] / 2, centre[0] + size[0] / 2)
    chart.set_ylim(centre[1] - size[1] / 2, centre[1] + size[1] / 2)
    chart.set_aspect("equal", adjustable="box")
    chart.set_facecolor("#e9ecef")


def _routes(chart: Axes, mission: Mission, palette: Mapping[str, str], *, faint: bool) -> list[Sign]:
    pixels = chart.get_window_extent().width
    metres = np.ptp(chart.get_xlim()) / pixels
    # Survey tracks must not run into one another: a line is at most a third of the spacing, seen at this scale.
    thick = 1.5 if mission.spacing is None else float(np.clip(mission.spacing / metres / 3 * 72 / 150, 0.35, 1.8))
    kinds = set()
    for route in mission.routes:
        xy, colour = route.xyz[:, :2], palette[route.vehicle]
        legs = np.stack([xy[:-1], xy[1:]], axis=1)
        survey = route.survey[1:]
        kinds |= set(survey.tolist())
        alpha = 0.35 if faint else 1.0
        chart.add_collection(LineCollection(list(legs[survey]), colors=colour, linewidths=thick, alpha=alpha, zorder=5))
        chart.add_collection(
            LineCollection(list(legs[~survey]), colors=colour, linewidths=thick * 0.6, alpha=0.75 * alpha, zorder=5)
        )
    if faint:
        return [Line2D([], [], color="#333333", linewidth=1.2, alpha=0.3, label="planned")]
    signs: dict[bool, Sign] = {
        True: Line2D([], [], color="#333333", linewidth=1.8, label="survey"),
        False: Line2D([], [], color="#333333", linewidth=0.9, alpha=0.75, label="transit, turn"),
    }
    return [sign for kind, sign in signs.items() if kind in kinds]


def _told(mission: Mission, moments: Sequence[Moment], report: Report | None) -> list[tuple[str, str]]:
    """Return the lines below the table: what happened by the clock, why the plan cannot hold, why the run failed, notes."""
    lines = []
    for (time, what), same in groupby(moments, key=lambda m: (m.time, m.what)):
        lines.append((clock(time), f"{', '.join(m.vehicle for m in same)} {WORDS[what]}"))
    lines += [("infeasible", str(reason)) for reason in mission.reasons]
    lines += [("failed", reason) for reason in (report.reasons if report else ())]
    return lines + [("note", note) for note in (report.notes if report else ())]


def _caption(mission: Mission, report: Report | None) -> str:
    parts = [mission.method]
    parts += [spacing_words(mission)] if mission.spacing is not None else []
    parts += [f"seed {mission.seed}", "feasible" if mission.feasible else "INFEASIBLE"]
    if report is not None:
        parts.append("run: PASSED" if report.passed else "run: FAILED")
    return "  |  ".join(parts)
