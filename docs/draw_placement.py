"""Draw docs/placement.png: the grid on a sample site not placed and placed, and what is done at its edge.

python docs/draw_placement.py [-o FILE.png]
"""

from pathlib import Path

import click
import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import shapely
from matplotlib.axes import Axes
from shapely.plotting import plot_polygon

from quarterdeck.coverage.edge import Edge, lay_tracks
from quarterdeck.coverage.metrics import measure, uncovered
from quarterdeck.coverage.parts import connected_parts
from quarterdeck.coverage.placement import Method, place
from quarterdeck.coverage.tour import tour
from quarterdeck.geo.reader import read_scenario

HERE = Path(__file__).parent
PANELS: tuple[tuple[str, Method, Edge], ...] = (
    ("not placed, whole hypervertices", "none", "whole"),
    ("annealed, whole hypervertices", "annealed", "whole"),
    ("annealed, --edge cells", "annealed", "cells"),
    ("annealed, --edge lap", "annealed", "lap"),
)


@click.command()
@click.option("-o", "--output", default=HERE / "placement.png", type=click.Path(path_type=Path), show_default=True)
def main(output: Path) -> None:
    """Draw the four panels."""
    figure, axes = plt.subplots(1, 4, figsize=(18, 5.4), layout="constrained")
    for panel, (title, method, edge) in zip(axes, PANELS, strict=True):
        _draw(panel, title, method, edge)
    figure.savefig(output, dpi=80, metadata={"Software": None})


def _draw(panel: Axes, title: str, method: Method, edge: Edge) -> None:
    area = read_scenario(HERE.parent / "data" / "dalian_harbour.geojson").site.coverable
    grid = place(area, 40.0, method=method).grid
    numbers, count = connected_parts(grid.hypervertices)
    walks = [tour(numbers == n, np.argwhere(numbers == n)[0]) for n in range(count)]
    tracks = lay_tracks(area, grid, walks, edge=edge)
    figures = measure(tracks, area, grid)
    plot_polygon(area, ax=panel, add_points=False, facecolor="#e8f1f8", edgecolor="#40576b", linewidth=1.5)
    missed = uncovered(tracks, area, grid.spacing)
    if not missed.is_empty:
        plot_polygon(missed, ax=panel, add_points=False, facecolor="#d9534f", edgecolor="none")
    corners = np.argwhere(grid.hypervertices)
    for r, c in corners:
        ring = grid.centres(
            np.array([[2 * r, 2 * c], [2 * r, 2 * c + 2], [2 * r + 2, 2 * c + 2], [2 * r + 2, 2 * c]]) - 0.5
        )
        panel.plot(*np.vstack([ring, ring[:1]]).T, color="#b9c7d3", linewidth=0.7)
    for track in tracks:
        panel.plot(*track.T, color="#0b3d91", linewidth=1.3)
    share = f"{100 * figures.poc:.1f} % covered"
    panel.set_title(f"{title}\n{share}, {figures.turns} turns, {figures.length / 1000:.2f} km", fontsize=11)
    panel.set_aspect("equal")
    panel.set_axis_off()
    left, bottom, right, top = shapely.total_bounds(area)
    panel.set_xlim(left - 15, right + 15)
    panel.set_ylim(bottom - 75, top + 25)
    panel.plot([left, left + 100], [bottom - 40, bottom - 40], color="black", linewidth=2)
    panel.text(left + 50, bottom - 48, "100 m", ha="center", va="top", fontsize=9)


if __name__ == "__main__":
    main()
