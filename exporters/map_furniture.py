"""What every map has beside its subject: graticule, scale bar, north arrow, and polygons with holes."""

import math
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from shapely.geometry.base import BaseGeometry

from quarterdeck.geo.frame import Frame

NAME_SIZE = 6.5  # points
SPECK = 30  # pixels: an area of fewer is not seen


def clock(seconds: float) -> str:
    """Return seconds as m:ss, or h:mm:ss."""
    hours, rest = divmod(round(seconds), 3600)
    return f"{hours}:{rest // 60:02d}:{rest % 60:02d}" if hours else f"{rest // 60}:{rest % 60:02d}"


def fill(chart: Axes, geometry: BaseGeometry, **style: Any) -> None:
    """Add a patch for each polygon of a geometry in metres, holes left out."""
    for polygon in getattr(geometry, "geoms", [geometry]):
        if polygon.is_empty or polygon.geom_type != "Polygon":
            continue
        rings = [np.asarray(ring.coords)[:, :2] for ring in (polygon.exterior, *polygon.interiors)]
        chart.add_patch(PathPatch(Path.make_compound_path(*[Path(ring, closed=True) for ring in rings]), **style))


def in_sight(chart: Axes, geometry: BaseGeometry) -> bool:
    """Return whether any polygon of a geometry in metres, within the chart's limits, is more than a speck on it."""
    (west, east), (south, north) = chart.get_xlim(), chart.get_ylim()
    pixel = (east - west) / chart.get_window_extent().width
    inside = shapely.clip_by_rect(geometry, west, south, east, north)
    return any(part.area >= SPECK * pixel**2 for part in getattr(inside, "geoms", [inside]))


def graticule(chart: Axes, frame: Frame) -> None:
    """Draw meridians and parallels at round minutes, named along the left and lower edges where names have room."""
    (west, east), (south, north) = chart.get_xlim(), chart.get_ylim()
    edge = np.linspace(0.0, 1.0, 20)
    corners = np.array([(x, y) for x in (west, (west + east) / 2, east) for y in (south, (south + north) / 2, north)])
    degrees = frame.to_degrees(corners)
    lons = (degrees[:, 0] - frame.lon + 180.0) % 360.0 - 180.0 + frame.lon  # on with no step at the antimeridian
    lon0, lon1, lat0, lat1 = lons.min(), lons.max(), degrees[:, 1].min(), degrees[:, 1].max()
    chart.set_xticks([])
    chart.set_yticks([])
    frame_box, dots = chart.get_window_extent(), chart.figure.dpi / 72
    for low, high, across, first in ((lon0, lon1, (lat0, lat1), 0), (lat0, lat1, (lon0, lon1), 1)):
        start, end = (west, east) if first == 0 else (south, north)
        room = (frame_box.width if first == 0 else frame_box.height) / dots  # points
        sides = "EW" if first == 0 else "NS"
        step = _round_step((high - low) / 5)
        name = 0.62 * NAME_SIZE * max(len(_angle(value, sides, step)) for value in (low, high))  # a name's length, points
        step = _round_step(max(step, 1.3 * name / room * (high - low)))
        ticks, labels = [], []
        for value in np.arange(math.ceil(low / step), math.floor(high / step) + 1) * step:
            other = across[0] + (across[1] - across[0]) * edge
            ends = [np.full(20, value), other]
            line = frame.to_metres(np.column_stack(ends if first == 0 else ends[::-1]))
            chart.add_line(Line2D(line[:, 0], line[:, 1], color="#90a4ae", linewidth=0.4, alpha=0.6, zorder=1.5))
            # Along the edge: x where the meridian meets the lower edge, y where the parallel meets the left one.
            along, edge_at = (line[:, 0], south) if first == 0 else (line[:, 1], west)
            order = np.argsort(line[:, 1 - first])
            ticks.append(float(np.interp(edge_at, line[order, 1 - first], along[order])))
            inside = abs((ticks[-1] - start) / (end - start) - 0.5) < 0.5 * (1.0 - name / room)
            labels.append(_angle(value, sides, step) if inside else "")
        axis = chart.xaxis if first == 0 else chart.yaxis
        axis.set_ticks(ticks, labels)
    chart.tick_params(labelsize=NAME_SIZE, length=2, color="#90a4ae")
    for label in chart.get_yticklabels():
        label.set(rotation=90, va="center")


def _round_step(step: float) -> float:
    """The next round angle above `step` degrees: of degrees, minutes or seconds, and tenths of these down."""
    sizes = [30.0, 20.0, 10.0, 5.0, 2.0, 1.0] + [m / 60 for m in (30, 20, 10, 5, 2, 1)]
    sizes += [s / 3600 for s in (30, 20, 10, 5, 2, 1)] + [s / 3600 for s in (0.5, 0.2, 0.1, 0.05, 0.02, 0.01)]
    return min((size for size in sizes if size >= step), default=30.0)


def _angle(value: float, sides: str, step: float) -> str:
    if sides == "EW":
        value = (value + 180.0) % 360.0 - 180.0
    side = sides[0] if value >= 0 else sides[1]
    hundredths = round(abs(value) * 360000)
    degrees, rest = divmod(hundredths, 360000)
    minutes, seconds = divmod(rest, 6000)
    if step >= 1:
        return f"{degrees}°{side}"
    if step >= 1 / 60 - 1e-12:
        return f"{degrees}°{minutes:02d}'{side}"
    decimals = 0 if step >= 1 / 3600 - 1e-12 else 2
    return f"{degrees}°{minutes:02d}'{seconds / 100:0{3 + decimals if decimals else 2}.{decimals}f}\"{side}"


def scale_bar(chart: Axes) -> None:
    """Draw a bar of a round length, about a fifth of the width."""
    (west, east), (south, north) = chart.get_xlim(), chart.get_ylim()
    wanted = (east - west) / 5
    power = 10.0 ** math.floor(math.log10(wanted))
    length = max(k * power for k in (1, 2, 5) if k * power <= wanted)
    x, y, tall = west + 0.03 * (east - west), south + 0.03 * (north - south), 0.006 * (north - south)
    white = {"facecolor": "white", "edgecolor": "#444444", "linewidth": 0.4, "alpha": 0.85}
    frame = shapely.box(x - 0.012 * (east - west), y - 2 * tall, x + length + 0.05 * (east - west), y + 6.5 * tall)
    fill(chart, frame, **white, zorder=10)
    for part in range(4):
        cell = shapely.box(x + part * length / 4, y, x + (part + 1) * length / 4, y + tall)
        fill(chart, cell, facecolor="black" if part % 2 == 0 else "white", edgecolor="black", linewidth=0.6, zorder=11)
    unit, size = ("km", length / 1000) if length >= 1000 else ("m", length)
    chart.text(x, y + 2 * tall, "0", fontsize=7, ha="center", zorder=11)
    chart.text(x + length, y + 2 * tall, f"{size:g} {unit}", fontsize=7, ha="center", zorder=11)


def north_arrow(chart: Axes) -> None:
    """Draw an arrow to the north of the frame's centre."""
    place = (0.965, 0.905)
    chart.annotate(
        "", (place[0], place[1] + 0.065), place, xycoords="axes fraction", zorder=11,
        arrowprops={"arrowstyle": "-|>", "color": "black", "linewidth": 1.4},
    )  # fmt: skip
    chart.text(*place, "N", transform=chart.transAxes, ha="center", va="top", fontsize=9, weight="bold", zorder=11)
