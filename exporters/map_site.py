"""What a map shows of a plan but its routes: site, tasks, casualties, starts, and what its planner drew.

Each function draws one kind of thing and returns the legend's signs of what it drew: what is not there is not told.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from scipy.sparse.csgraph import connected_components

from quarterdeck.exporters.casualties import MEANING
from quarterdeck.exporters.map_furniture import fill, in_sight
from quarterdeck.geo.palette import CASUALTY, SITE
from quarterdeck.geo.scenario import Obstacle
from quarterdeck.mission.layers import drawn
from quarterdeck.mission.mission import Layer, Mission

Sign = Line2D | Patch
WATER, AREA, OBSTACLE, STRANGE = "#f4f7fa", "#dcebf5", "#8c8c8c", "#111111"
TASK: dict[str, Any] = {"marker": "s", "color": "black", "markerfacecolor": "#ffffb2", "markersize": 4, "linestyle": "none"}
START: dict[str, Any] = {"marker": "o", "markeredgecolor": "black", "linestyle": "none"}
HALO: dict[str, Any] = {"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}
LINES = ("line", "tours")  # layers that the routes show
WORKINGS = ("triangulation", "reduced graph", "trees")  # layers that show how a plan was made, and nothing of a run
TOGETHER = 6.0  # points: starts that are nearer to one another have one name


def site(chart: Axes, mission: Mission, strange: Sequence[Obstacle] = ()) -> list[Sign]:
    """Draw the operating area, the areas, with names where there are several or priorities, and the obstacles.

    Hatched are those that none of the vehicles need keep out of; black, `strange`, those that the plan did not know.
    """
    there = mission.site
    look: dict[str, Any] = {"facecolor": WATER, "edgecolor": SITE["operating"], "linestyle": (0, (5, 3))}
    fill(chart, there.operating, **look, linewidth=0.8, zorder=1)
    signs: list[Sign] = [Patch(**look, label="operating area")]
    named = len(there.areas) > 1 or any(area.priority for area in there.areas)
    look = {"facecolor": AREA, "edgecolor": SITE["area"]}
    for area in there.areas:
        fill(chart, area.polygon, **look, linewidth=0.7, zorder=2)
        if named:
            place = area.polygon.representative_point()
            words = area.id + (f", priority {area.priority}" if area.priority else "")
            chart.text(place.x, place.y, words, fontsize=6.5, style="italic", ha="center", va="center", color="#24465e",
                       zorder=7.5, bbox=HALO, parse_math=False, clip_on=True)  # fmt: skip
    signs += [Patch(**look, label="area, its name" if named else "area")] if there.areas else []
    domains = {vehicle.domain for vehicle in (*mission.vehicles, *mission.lost)}
    kinds: dict[str, dict[str, Any]] = {
        "obstacle": {"facecolor": OBSTACLE, "edgecolor": SITE["obstacle"]},
        "not covered, may be crossed": {"facecolor": "none", "edgecolor": SITE["obstacle"], "hatch": "////"},
        "obstacle not in the plan": {"facecolor": STRANGE, "edgecolor": STRANGE},
    }
    seen = set()
    for obstacle in there.obstacles:
        names = list(kinds)
        name = names[2] if obstacle in strange else names[0] if obstacle.blocks & domains else names[1]
        seen.add(name)
        fill(chart, obstacle.polygon, **kinds[name], linewidth=0.6, zorder=3)
    return signs + [Patch(**kinds[name], label=name) for name in kinds if name in seen]


def layers(chart: Axes, mission: Mission, palette: Mapping[str, str], *, run: bool) -> list[Sign]:
    """Draw what the planner drew: regions, guards, what was surveyed before, what is left out; of a plan its graphs too.

    Left out are regions where another plan was told in a run, for they are of the first, and of a run guards to which
    nobody goes.
    """
    without = (*LINES, *(WORKINGS if run else ()), *(("region",) if mission.parameters.get("told_at") else ()))
    shown = [layer for layer in drawn(mission) if layer.name not in without]
    signs = [_layer(chart, _visited(layer) if run and layer.name == "guards" else layer, palette) for layer in shown]
    return [sign for sign in signs if sign is not None]


def _visited(layer: Layer) -> Layer:
    kept = [i for i, p in enumerate(layer.properties) if p["vehicle"] is not None or p["seen"]]
    return replace(
        layer, geometries=tuple(layer.geometries[i] for i in kept), properties=tuple(layer.properties[i] for i in kept)
    )


def _layer(chart: Axes, layer: Layer, palette: Mapping[str, str]) -> Sign | None:
    """Draw a layer and return its sign, None where nothing of it can be seen."""
    own = next((p["stroke"] for p in layer.properties if "stroke" in p), None)
    theirs = own is None and any(p.get("vehicle") in palette for p in layer.properties)
    name, sign = layer.name + (", by vehicle" if theirs else ""), own or "#777777"
    shapes: set[str] = set()
    for geometry, properties in zip(layer.geometries, layer.properties, strict=True):
        colour = properties.get("stroke") or palette.get(properties.get("vehicle", ""), "#777777")
        if isinstance(geometry, shapely.Point | shapely.MultiPoint):
            shapes.add("point")
            xy = shapely.get_coordinates(geometry)
            chart.plot(xy[:, 0], xy[:, 1], "o", color=colour, markeredgecolor="white", markeredgewidth=0.5, markersize=4.5,
                       zorder=6.5)  # fmt: skip
        elif geometry.geom_type.endswith("Polygon"):
            shapes.add("area")
            fill(chart, geometry, facecolor=colour, alpha=0.16, linewidth=0, zorder=2.5)
        else:
            shapes.add("line")
            lines = [shapely.get_coordinates(g) for g in getattr(geometry, "geoms", [geometry])]
            chart.add_collection(LineCollection(lines, colors=colour, linewidths=0.7, zorder=4))
    if not shapes or (shapes == {"area"} and not any(in_sight(chart, g) for g in layer.geometries)):
        return None
    if shapes == {"area"}:
        return Patch(facecolor=sign, alpha=0.25, label=name)
    if shapes == {"point"}:
        return Line2D([], [], marker="o", color=sign, markersize=4.5, linestyle="none", label=name)
    return Line2D([], [], color=sign, linewidth=0.9, label=name)


def places(chart: Axes, mission: Mission, palette: Mapping[str, str]) -> list[Sign]:
    """Draw starts, with the vehicles' numbers in the table, tasks, casualties, and where who was given up was last."""
    signs: list[Sign] = []
    many = len(mission.vehicles) > 12
    for vehicle in reversed(mission.vehicles):  # of those at one place the first is seen
        chart.plot(*vehicle.start, **START, color=palette[vehicle.id], markersize=4 if many else 5, zorder=8)
    for (x, y), numbers in _together(chart, mission):
        chart.annotate(_numbers(numbers), (x, y), xytext=(4, 4), textcoords="offset points", fontsize=5.5 if many else 7,
                       weight="bold", zorder=9, bbox=HALO, annotation_clip=True)  # fmt: skip
    signs += [Line2D([], [], **START, color="white", markersize=5, label="start")] if mission.vehicles else []
    for task in mission.tasks:
        chart.plot(*task.position, **TASK, zorder=7)
        if len(mission.tasks) <= 60:
            chart.annotate(task.id, task.position, xytext=(4, -7), textcoords="offset points", fontsize=6.5, zorder=7.6,
                           bbox=HALO, parse_math=False)  # fmt: skip
    signs += [Line2D([], [], **TASK, label="task")] if mission.tasks else []
    star: dict[str, Any] = {"marker": "*", "markeredgecolor": "black", "markeredgewidth": 0.7, "linestyle": "none"}
    for casualty in mission.casualties:
        chart.plot(*casualty.position, **star, color=CASUALTY[casualty.colour], markersize=9, zorder=7)
    there = {casualty.colour for casualty in mission.casualties}
    for colour, meaning in MEANING.items():
        if colour in there:
            label = f"casualty: {colour} ({meaning})"
            signs.append(Line2D([], [], **star, color=CASUALTY[colour], markersize=8, label=label))
    return signs


def _together(chart: Axes, mission: Mission) -> list[tuple[tuple[float, float], list[int]]]:
    """Return the starts with their vehicles' numbers, those that names would cover one another at as one."""
    dot = chart.figure.dpi / 72
    starts = [vehicle.start for vehicle in mission.vehicles]
    if not starts:
        return []
    pixels = chart.transData.transform(np.array(starts).reshape(-1, 2))
    near = np.hypot(*(pixels[:, None] - pixels).transpose(2, 0, 1)) < TOGETHER * dot
    count, groups = connected_components(near, directed=False)
    members = [np.flatnonzero(groups == group) for group in range(count)]
    return [(starts[own[0]], (own + 1).tolist()) for own in members]


def _numbers(numbers: list[int]) -> str:
    if len(numbers) > 2 and numbers == list(range(numbers[0], numbers[-1] + 1)):
        return f"{numbers[0]}-{numbers[-1]}"
    return ",".join(map(str, numbers))
