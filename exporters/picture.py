"""A map of a plan as PNG, and of a run over its plan: what an operator checks before and after."""

import io
from collections.abc import Sequence

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.map_furniture import fill, graticule, north_arrow, scale_bar
from quarterdeck.exporters.map_panel import AREA, CONTACT, MISSED, OBSTACLE, START, STRANGE, TASK, WATER, legend, table
from quarterdeck.exporters.places import file_stems, spacing_words
from quarterdeck.geo.palette import CASUALTY, SITE, colours
from quarterdeck.geo.scenario import Obstacle
from quarterdeck.mission.layers import drawn
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.routes import survey_lines
from quarterdeck.physics.report import Report
from quarterdeck.physics.swath import driven_tracks
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
    width: int = 1800,
    height: int = 1200,
) -> bytes:
    """Return a PNG of the plan, or with a `trace` of the run over the plan, `width` by `height` pixels.

    North (of the frame's centre) is up. Survey legs are thick, transits thin, starts are numbered as in the table. Of a run
    the driven tracks, what they missed of the plan's swaths, and contacts are drawn; with its `report` the table holds the
    run's figures and the caption the verdict. Of the site's obstacles, `strange` are those that the plan did not know.
    """
    figure = Figure(figsize=(width / 150, height / 150), dpi=150, facecolor="white")
    FigureCanvasAgg(figure)
    chart = figure.add_axes((0.055, 0.055, 0.615, 0.875))
    panel = figure.add_axes((0.685, 0.03, 0.30, 0.90))
    palette = colours(len(mission.routes))
    _view(chart, mission, trace, width / height)
    _site(chart, mission, strange)
    _layers(chart, mission, palette)
    _routes(chart, mission, palette, faint=trace is not None)
    if trace is not None:
        _run(chart, mission, trace, palette)
    _places(chart, mission)
    graticule(chart, mission.frame)
    scale_bar(chart)
    north_arrow(chart)
    figure.text(0.055, 0.955, mission.name, fontsize=13, weight="bold", va="center", parse_math=False)
    figure.text(0.67, 0.955, _caption(mission, report), fontsize=8, va="center", ha="right", color="#333333")
    table(panel, mission, palette, report)
    legend(panel, mission, run=trace is not None, strange=bool(strange))
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


def _site(chart: Axes, mission: Mission, strange: Sequence[Obstacle]) -> None:
    site = mission.site
    fill(
        chart, site.operating, facecolor=WATER, edgecolor=SITE["operating"], linewidth=0.8, linestyle=(0, (5, 3)), zorder=1
    )
    for area in site.areas:
        fill(chart, area.polygon, facecolor=AREA, edgecolor=SITE["area"], linewidth=0.7, zorder=2)
    for obstacle in site.obstacles:
        solid = bool(obstacle.blocks)
        if obstacle in strange:
            fill(chart, obstacle.polygon, facecolor=STRANGE, edgecolor=STRANGE, linewidth=1.0, zorder=3)
            continue
        fill(
            chart,
            obstacle.polygon,
            facecolor=OBSTACLE if solid else "none",
            edgecolor=SITE["obstacle"],
            linewidth=0.6,
            hatch=None if solid else "////",
            zorder=3,
        )


def _layers(chart: Axes, mission: Mission, palette: list[str]) -> None:
    colour_of = {route.vehicle: colour for route, colour in zip(mission.routes, palette, strict=True)}
    for layer in drawn(mission):
        for geometry, properties in zip(layer.geometries, layer.properties, strict=True):
            colour = properties.get("stroke") or colour_of.get(properties.get("vehicle", ""), "#777777")
            if isinstance(geometry, shapely.Point | shapely.MultiPoint):
                xy = shapely.get_coordinates(geometry)
                chart.plot(xy[:, 0], xy[:, 1], ".", color=colour, markersize=4, zorder=4)
            elif geometry.geom_type.endswith("Polygon"):
                fill(chart, geometry, facecolor=colour, alpha=0.16, linewidth=0, zorder=2.5)
            else:
                lines = getattr(geometry, "geoms", [geometry])
                strokes = LineCollection(
                    [shapely.get_coordinates(g) for g in lines], colors=colour, linewidths=0.7, zorder=4
                )
                chart.add_collection(strokes)


def _routes(chart: Axes, mission: Mission, palette: list[str], *, faint: bool) -> None:
    pixels = chart.get_window_extent().width
    metres = np.ptp(chart.get_xlim()) / pixels
    # Survey tracks must not run into one another: a line is at most a third of the spacing, seen at this scale.
    thick = 1.5 if mission.spacing is None else float(np.clip(mission.spacing / metres / 3 * 72 / 150, 0.35, 1.8))
    for route, colour in zip(mission.routes, palette, strict=True):
        xy = route.xyz[:, :2]
        legs = np.stack([xy[:-1], xy[1:]], axis=1)
        survey = route.survey[1:]
        alpha = 0.35 if faint else 1.0
        chart.add_collection(LineCollection(list(legs[survey]), colors=colour, linewidths=thick, alpha=alpha, zorder=5))
        chart.add_collection(
            LineCollection(list(legs[~survey]), colors=colour, linewidths=thick * 0.6, alpha=0.75 * alpha, zorder=5)
        )


def _run(chart: Axes, mission: Mission, trace: Trace, palette: list[str]) -> None:
    """Draw the driven tracks, where anything was touched, and what of the plan's swaths was missed."""
    for i, colour in enumerate(palette[: len(trace.vehicles)]):
        runs = [np.column_stack([trace.x[run, i], trace.y[run, i]]) for run in trace.known(i)]
        chart.add_collection(LineCollection(runs, colors=colour, linewidths=0.7, zorder=6))
        touched = trace.contact[:, i]
        chart.plot(trace.x[touched, i], trace.y[touched, i], **CONTACT, zorder=9)
    if mission.spacing is None:
        return
    planned, driven = (
        shapely.union_all(
            [shapely.buffer(shapely.linestrings(track), mission.spacing / 2, quad_segs=8) for track in tracks]
        )
        for tracks in (survey_lines(mission.routes), driven_tracks(trace))
    )
    missed = planned.intersection(mission.site.coverable).difference(driven)
    # Slivers along every track's edge, which no eye resolves, would colour the whole map.
    missed = missed.buffer(-0.02 * mission.spacing).buffer(0.02 * mission.spacing)
    fill(chart, missed, facecolor=MISSED, linewidth=0, zorder=5.5)


def _places(chart: Axes, mission: Mission) -> None:
    many = len(mission.vehicles) > 12
    shared: dict[tuple[float, float], list[int]] = {}
    for number, vehicle in enumerate(mission.vehicles, 1):
        shared.setdefault((round(vehicle.start[0], 1), round(vehicle.start[1], 1)), []).append(number)
    for (x, y), numbers in shared.items():
        chart.plot(x, y, **START, markersize=3 if many else 4, zorder=8)
        chart.annotate(
            _numbers(numbers),
            (x, y),
            xytext=(4, 4),
            textcoords="offset points",
            fontsize=5.5 if many else 7,
            weight="bold",
            zorder=9,
            bbox={"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none", "alpha": 0.75},
            annotation_clip=True,
        )
    for task in mission.tasks:
        chart.plot(*task.position, **TASK, zorder=7)
        if len(mission.tasks) <= 60:
            chart.annotate(
                task.id, task.position, xytext=(4, -7), textcoords="offset points", fontsize=5.5, zorder=7, parse_math=False
            )
    for casualty in mission.casualties:
        chart.plot(
            *casualty.position, "P", color=CASUALTY[casualty.colour], markeredgecolor="black", markersize=6, zorder=7
        )


def _numbers(numbers: list[int]) -> str:
    if len(numbers) > 2 and numbers == list(range(numbers[0], numbers[-1] + 1)):
        return f"{numbers[0]}-{numbers[-1]}"
    return ",".join(map(str, numbers))


def _caption(mission: Mission, report: Report | None) -> str:
    parts = [mission.method]
    parts += [spacing_words(mission)] if mission.spacing is not None else []
    parts += [f"seed {mission.seed}", "feasible" if mission.feasible else "INFEASIBLE"]
    if report is not None:
        parts.append("run: PASSED" if report.passed else "run: FAILED")
    return "  |  ".join(parts)
