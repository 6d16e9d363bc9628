"""The counterparts of Figs 1 to 5 of fault-tolerant-cdt, in one picture."""

from io import BytesIO
from typing import Any

import numpy as np
import shapely
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from shapely import MultiPolygon

from quarterdeck.coverage.cst import constrained_tour
from quarterdeck.coverage.forest import ABSENT, Forest
from quarterdeck.coverage.guards.pieces import trapezoids
from quarterdeck.coverage.recovery import recover
from quarterdeck.geo.palette import colours
from quarterdeck.reproduce.guard_maps import paper_network, scenario_on

COLOURS = colours(10)


def figures(room: MultiPolygon, reach: float, robots: int) -> bytes:
    """Return the PNG: trapezoids and guards, CDT, Reduced-CDT, trees, tours, and the trees when the first robot is lost."""
    starts = scenario_on(room, robots).starts
    net = paper_network(room, reach, starts)
    points, guards = net.cdt.points, net.cdt.points[net.guards]
    west, south, east, north = room.bounds
    tall = 5.0 * (north - south) / (east - west) + 0.5
    figure = Figure(figsize=(15, 2 * tall), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 3).ravel()
    titles = (
        f"Fig. 1: trapezoids and {len(guards)} guards, range {reach:g} m",
        f"Fig. 2b: CDT, {len(net.cdt.edges)} edges",
        f"Fig. 2c: Reduced-CDT, {net.reduced.weight:.0f} m",
        "Fig. 3: trees; black: where Lemma 1 has no bridge",
        "Fig. 4d: constrained spanning tours",
        "Fig. 5: trees when robot 1 is lost",
    )
    for axis, title in zip(axes, titles, strict=True):
        _walls(axis, room)
        axis.set_title(title, fontsize=11)
        axis.set_aspect("equal")
        axis.set_axis_off()
    axes[0].add_collection(LineCollection(_rings(room), colors="#bbbbbb", linewidths=0.7))
    axes[1].add_collection(LineCollection(points[net.cdt.edges], colors="#888888", linewidths=0.6))
    axes[2].add_collection(LineCollection(points[net.reduced.edges], colors="#333333", linewidths=1.3))
    for axis in axes[:3]:
        axis.plot(*guards.T, "o", color="#444444", markersize=3)
    _trees(axes[3], net, net.forest, starts)
    _gaps(axes[3], net)
    for robot in range(robots):
        tour = constrained_tour(net.forest.parents[robot], net.forest.chosen[robot], net.cdt)
        line = np.vstack([net.access[robot][:-1], points[tour], net.access[robot][::-1][1:]])
        axes[4].plot(*line.T, color=COLOURS[robot], linewidth=1.6)
        axes[4].plot(*points[net.forest.chosen[robot]].T, "o", color=COLOURS[robot], markersize=3)
        axes[4].plot(*starts[robot], "s", color=COLOURS[robot], markersize=8, markeredgecolor="black", clip_on=False)
    lost = np.arange(robots) == 0
    nothing = np.zeros(len(points), dtype=np.bool_)
    _trees(axes[5], net, recover(net.reduced, net.guards, net.forest, seen=nothing, lost=lost).forest, starts)
    axes[5].plot(*starts[0], "x", color="black", markersize=11, markeredgewidth=2.5, clip_on=False)
    data = BytesIO()
    figure.savefig(data, format="png", dpi=110, metadata={"Software": None})
    return data.getvalue()


def _rings(room: MultiPolygon) -> list[np.ndarray]:
    return [np.vstack([piece, piece[:1]]) for piece in trapezoids(room)]


def _walls(axis: Any, room: MultiPolygon) -> None:
    west, south, east, north = room.bounds
    axis.set_xlim(west - 1.5, east + 1.5)
    axis.set_ylim(south - 1.5, north + 1.5)
    for polygon in room.geoms:
        axis.plot(*shapely.get_coordinates(polygon.exterior).T, color="black", linewidth=1.5)
        for hole in polygon.interiors:
            axis.fill(*shapely.get_coordinates(hole).T, facecolor="#d9b38c", edgecolor="black", linewidth=1.0)


def _trees(axis: Any, net: Any, forest: Forest, starts: np.ndarray) -> None:
    """Draw each robot's tree; where two overlap, the later one dashed."""
    points = net.cdt.points
    for robot in range(len(starts)):
        if not len(forest.chosen[robot]):
            continue
        style = "solid" if robot == 0 else (3.0 * robot, (6.0, 3.0))
        lines = points[forest.edges(robot)]
        axis.add_collection(LineCollection(lines, colors=COLOURS[robot], linewidths=2.0, linestyles=[style]))
        axis.plot(*points[forest.chosen[robot]].T, "o", color=COLOURS[robot], markersize=4)
        axis.plot(*net.access[robot].T, ":", color=COLOURS[robot], linewidth=1.5)
        axis.plot(*starts[robot], "s", color=COLOURS[robot], markersize=8, markeredgecolor="black", clip_on=False)


def _gaps(axis: Any, net: Any) -> None:
    """Draw the links of the reduced graph that run through vertices of no tree: no bridges as Definition 1 is printed."""
    owned = (net.forest.parents != ABSENT).any(axis=0)
    edges = net.reduced.edges
    loose = edges[~owned[edges].all(axis=1)]
    axis.add_collection(LineCollection(net.cdt.points[loose], colors="black", linewidths=2.5, linestyles=":", zorder=5))
    ends = np.unique(loose[~owned[loose]])
    axis.plot(*net.cdt.points[ends].T, "s", color="black", markersize=5, zorder=6)
