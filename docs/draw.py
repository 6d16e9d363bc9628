"""Draw the pictures of the pages: `python docs/draw.py` draws all into docs/pictures, or those that are named.

Most are what a command prints; the commands stand in COMMANDS. Those of the placement and the division are drawn here.
"""

import contextlib
import io
import json
import shlex
import tempfile
from collections.abc import Callable
from pathlib import Path

import click
import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from PIL import Image
from shapely.plotting import plot_polygon

from quarterdeck.cli import main as quarterdeck
from quarterdeck.coverage.edge import Edge, lay_tracks
from quarterdeck.coverage.metrics import measure, uncovered
from quarterdeck.coverage.parts import connected_parts
from quarterdeck.coverage.placement import Method, place
from quarterdeck.coverage.tour import tour
from quarterdeck.geo.palette import SITE, colours
from quarterdeck.geo.reader import read_scenario
from quarterdeck.mission.cover import cover
from quarterdeck.mission.mission import unbroken

HERE = Path(__file__).parent
DATA = HERE.parent / "data"
PANELS: tuple[tuple[str, Method, Edge], ...] = (
    ("not placed, whole hypervertices", "none", "whole"),
    ("annealed, whole hypervertices", "annealed", "whole"),
    ("annealed, --edge cells", "annealed", "cells"),
    ("annealed, --edge lap", "annealed", "lap"),
)
# picture: the commands that make it, in a folder of its own with the samples in data/; the last file is the picture
COMMANDS = {
    "lines": [
        "plan data/farm_survey.geojson --method lines -o plan.geojson",
        "export plan.geojson --to png -o .",
        "Farm_survey.png",
    ],
    "guards": ["reproduce guards -o guards.png", "guards.png"],
    "assignment": ["reproduce inspection -o .", "inspection_precedence.png"],
    "export": [
        "init air -o farm.geojson",
        "plan farm.geojson -o plan.geojson",
        "export plan.geojson --to png -o .",
        "Farm_survey.png",
    ],
    "run": [
        "plan data/west_ant_island.geojson -o plan.geojson",
        "simulate plan.geojson --picture run.png",
        "run.png",
    ],
    "survey": [
        "plan harbour.geojson -o plan.geojson",
        "simulate plan.geojson --current 0.2,0.1 --wind 3,-2 --gusts 1 --picture run.png",
        "run.png",
    ],
    "inspect": [
        "init ground -o yard.geojson",
        "plan yard.geojson --method guards --range 20 -o guards.geojson",
        "export guards.geojson --to png -o .",
        "Plant_yard.png",
    ],
    "drill": [
        "init triage -o drill.geojson",
        "triage drill.geojson -o casualties.geojson --timeline timeline.png",
        "timeline.png",
    ],
    "triage": ["reproduce triage --cases 2 --figures .", "fig6.png"],
    "replan": [
        "plan data/plant_yard.geojson -o plan.geojson",
        "replan plan.geojson --at 900 --lost ugv-2 -o after.geojson",
        "simulate after.geojson --picture replan.png",
        "replan.png",
    ],
    "sensing": [
        "plan data/plant_yard.geojson --method lines --spacing 8 -o plan.geojson",
        "simulate plan.geojson --lidar --unmapped trucks.geojson --picture sensing.png",
        "sensing.png",
    ],
}
TRUCKS = {  # middles, with metres along the yard and across
    (8.54183302, 47.37705425): (2, 14),
    (8.54218647, 47.37712326): (8, 8),
    (8.5418151, 47.37661845): (2, 18),
    (8.5419467, 47.37668102): (12, 4),
}


@click.command()
@click.argument("names", nargs=-1)
def main(names: tuple[str, ...]) -> None:
    """Draw the pictures NAMES (default: all)."""
    drawn: dict[str, Callable[[], bytes]] = {"placement": placement, "division": division}
    for name in names or (*drawn, *COMMANDS):
        data = drawn[name]() if name in drawn else by_commands(COMMANDS[name])
        data = _small(data)
        (HERE / "pictures" / f"{name}.png").write_bytes(data)
        click.echo(f"docs/pictures/{name}.png: {len(data) / 1000:.0f} kB")


def by_commands(commands: list[str]) -> bytes:
    """Run commands of quarterdeck in a temporary folder and return the file that the last names."""
    *lines, picture = commands
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        Path("data").symlink_to(DATA)
        Path("trucks.geojson").write_text(json.dumps(trucks()), encoding="utf-8")
        Path("harbour.geojson").write_text(harbour(), encoding="utf-8")
        for line in lines:
            with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
                quarterdeck(shlex.split(line))
        return Path(picture).read_bytes()


def _small(data: bytes) -> bytes:
    """Return a PNG in 256 colours, a third of the size; so chosen that a mark of a rare colour keeps it."""
    stream = io.BytesIO()
    image = Image.open(io.BytesIO(data)).convert("RGB")
    few = image.quantize(256, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    few.save(stream, "png", optimize=True)
    return stream.getvalue()


def harbour() -> str:
    """Return the site of the tutorial of a survey, as it stands there."""
    return (HERE / "tutorials" / "survey.md").read_text(encoding="utf-8").split("```json\n")[1].split("```")[0]


def trucks() -> dict[str, object]:
    """Return trucks that stand on the yard and in no plan, as GeoJSON."""
    features = []
    for i, ((lon, lat), (length, width)) in enumerate(TRUCKS.items()):
        ring = [
            [lon + 0.65e-5 * length * a, lat + 0.45e-5 * width * b]
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
        ]
        properties = {"role": "obstacle", "id": f"truck-{i + 1}"}
        features.append(
            {"type": "Feature", "properties": properties, "geometry": {"type": "Polygon", "coordinates": [ring]}}
        )
    return {"type": "FeatureCollection", "features": features}


def placement() -> bytes:
    """Return the harbour's grid not placed and placed, and what is done at its edge."""
    _, axes = plt.subplots(1, 4, figsize=(18, 5.4), layout="constrained")
    for panel, (title, method, edge) in zip(axes, PANELS, strict=True):
        _draw_placement(panel, title, method, edge)
    return _png()


def _png() -> bytes:
    stream = io.BytesIO()
    plt.savefig(stream, format="png", dpi=80, bbox_inches="tight", metadata={"Software": None})
    plt.close()
    return stream.getvalue()


def _draw_placement(panel: Axes, title: str, method: Method, edge: Edge) -> None:
    area = read_scenario(DATA / "dalian_harbour.geojson").site.coverable
    grid = place(area, 40.0, method=method).grid
    numbers, count = connected_parts(grid.hypervertices)
    walks = [tour(numbers == n, np.argwhere(numbers == n)[0]) for n in range(count)]
    tracks = lay_tracks(area, grid, walks, edge=edge)
    figures = measure(tracks, area, grid)
    plot_polygon(area, ax=panel, add_points=False, facecolor="#e8f1f8", edgecolor=SITE["area"], linewidth=1.5)
    missed = uncovered(tracks, area, grid.spacing)
    if not missed.is_empty:
        plot_polygon(missed, ax=panel, add_points=False, facecolor="#d55e00", edgecolor="none")
    corners = np.argwhere(grid.hypervertices)
    for r, c in corners:
        ring = grid.centres(
            np.array([[2 * r, 2 * c], [2 * r, 2 * c + 2], [2 * r + 2, 2 * c + 2], [2 * r + 2, 2 * c]]) - 0.5
        )
        panel.plot(*np.vstack([ring, ring[:1]]).T, color="#b9c7d3", linewidth=0.7)
    for track in tracks:
        panel.plot(*track.T, color="#0072b2", linewidth=1.3)
    share = f"{100 * figures.poc:.1f} % covered"
    panel.set_title(f"{title}\n{share}, {figures.turns} turns, {figures.length / 1000:.2f} km", fontsize=11)
    _frame(panel, area, 100)


def division() -> bytes:
    """Return the sea by West Ant Island divided among its five vessels by their shares, and their tours."""
    scenario = read_scenario(DATA / "west_ant_island.geojson")
    mission, area = cover(scenario, edge="whole"), scenario.site.coverable
    _, panel = plt.subplots(figsize=(10, 9), layout="constrained")
    plot_polygon(area, ax=panel, add_points=False, facecolor="none", edgecolor=SITE["area"], linewidth=1.2)
    handles = []
    for i, (route, colour) in enumerate(zip(mission.routes, colours(len(mission.routes)), strict=True)):
        region = mission.layers[0].geometries[i]
        plot_polygon(region, ax=panel, add_points=False, facecolor=colour, edgecolor="none", alpha=0.25)
        for line in unbroken(route.xyz[:, :2], route.survey):
            panel.plot(*line.T, color=colour, linewidth=1.0)
        panel.plot(*mission.vehicles[i].start, "s", color=colour, markeredgecolor="black", markersize=8)
        share = f"{route.vehicle}: {100 * mission.figures['shares'][i]:.1f} %"
        handles.append(Patch(facecolor=colour, alpha=0.6, label=share))
    panel.legend(handles=handles, loc="upper center", ncols=5, bbox_to_anchor=(0.5, 0.0), frameon=False, fontsize=11)
    cells, turns = mission.figures["hypervertices"], mission.figures["turns"]
    panel.set_title(f"{cells} hypervertices of 200 m, whole ones alone: {turns} turns", fontsize=12)
    _frame(panel, area, 1000)
    return _png()


def _frame(panel: Axes, area: shapely.Geometry, scale: int) -> None:
    """Draw a scale bar of so many metres below the area, and no axes."""
    left, bottom, right, top = shapely.total_bounds(area)
    panel.set_aspect("equal")
    panel.set_axis_off()
    panel.set_xlim(left - 0.15 * scale, right + 0.15 * scale)
    panel.set_ylim(bottom - 0.75 * scale, top + 0.25 * scale)
    panel.plot([left, left + scale], [bottom - 0.4 * scale] * 2, color="black", linewidth=2)
    panel.text(left + scale / 2, bottom - 0.48 * scale, f"{scale:,} m", ha="center", va="top", fontsize=9)


if __name__ == "__main__":
    main()
