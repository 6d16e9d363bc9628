"""Measure grid placement and the edge on regions: one JSON object a region, or the table of several.

    python benchmarks/placement.py REGION.geojson --spacing 40 --edge whole --json
    python benchmarks/placement.py ../shared/data/regions/*.geojson

A region is a site, or a single GeoJSON Feature or geometry with a Polygon. One vehicle covers all of it; a part that the
others do not touch gets a tour of its own. Seconds are of CPU: the median of 5 warm runs of the placement.
"""

import json
import time
from pathlib import Path
from statistics import mean, median
from typing import Any

import click
import numpy as np
import shapely
from rich.console import Console
from rich.table import Table
from shapely import MultiPolygon

from quarterdeck.coverage.edge import lay_tracks
from quarterdeck.coverage.metrics import measure
from quarterdeck.coverage.parts import connected_parts
from quarterdeck.coverage.placement import index, place
from quarterdeck.coverage.tour import tour
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.grid import area_edges
from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.scenario import as_multipolygon

EDGES = ("whole", "cells", "lap")
PUBLISHED = {13: 59, 16: 342}  # hypervertices of the published tours where `mega_nodes` is an artefact


@click.command()
@click.argument("regions", nargs=-1, required=True, type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--spacing", default=40.0, show_default=True, help="Metres between tracks.")
@click.option("--edge", type=click.Choice(EDGES), help="What is done at the edge; default: each, as a table.")
@click.option("--angle", type=float, help="Fix the lattice's direction: degrees counter-clockwise from east.")
@click.option("--seed", default=0, show_default=True)
@click.option("--exhaustive", is_flag=True, help="Compare F with a full search of 90 angles x 32 x 32 shifts.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON, one object a region and edge.")
def main(
    regions: tuple[Path, ...],
    spacing: float,
    edge: str | None,
    angle: float | None,
    seed: int,
    exhaustive: bool,
    as_json: bool,
) -> None:
    """Place the grid on each region and lay the tracks."""
    edges = (edge,) if edge else EDGES
    results = [measured(path, spacing, edges, angle, seed, exhaustive) for path in regions]
    if as_json:
        for rows in results:
            for row in rows:
                print(json.dumps(row))
    else:
        _print_table(results, edges)


def measured(
    path: Path, spacing: float, edges: tuple[str, ...], angle: float | None, seed: int, exhaustive: bool
) -> list[dict[str, Any]]:
    """Return a row of figures for each edge of a region."""
    area, properties = read_region(path)
    turned = None if angle is None else np.radians(angle)
    runs = [_timed(lambda: place(area, spacing, seed=seed, angle=turned)) for _ in range(6)]
    placement = runs[-1][0]
    grid = placement.grid
    numbers, count = connected_parts(grid.hypervertices)
    walks = [tour(numbers == n, np.argwhere(numbers == n)[0]) for n in range(count)]
    common: dict[str, Any] = {
        "region": path.stem,
        "spacing": spacing,
        "hypervertices": int(grid.hypervertices.sum()),
        "published": PUBLISHED.get(properties.get("roi", 0), properties.get("mega_nodes")),
        "F": placement.f,
        "F1": placement.f1,
        "F2": placement.f2,
        "F3": placement.f3,
        "angle_deg": float(np.degrees(grid.angle)),
        "seconds": median(seconds for _, seconds in runs[1:]),
    }
    if exhaustive:
        common["F_of_exhaustive"] = placement.f / _exhaustive(area, spacing)
    base = measure(lay_tracks(area, grid, walks, edge="whole"), area, grid)
    rows = []
    for edge in edges:
        laid = [_timed(lambda edge=edge: lay_tracks(area, grid, walks, edge=edge)) for _ in range(2)]
        figures = measure(laid[-1][0], area, grid)
        outside = sum(shapely.difference(shapely.linestrings(t), area).length for t in laid[-1][0])
        rows.append(
            common
            | {
                "edge": edge,
                "coverage": figures.poc,
                "cell_coverage": figures.cell_poc,
                "overlap": figures.overlap,
                "turns": figures.turns,
                "length": figures.length,
                "length_per_covered_to_whole": figures.length / figures.poc / (base.length / base.poc),
                "metres_outside": outside,
                "edge_seconds": laid[-1][1],
            }
        )
    return rows


def read_region(path: Path) -> tuple[MultiPolygon, dict[str, Any]]:
    """Return what is to be covered in metres, and the file's properties."""
    document = json.loads(path.read_text(encoding="utf-8"))
    if document["type"] == "FeatureCollection":
        return read_scenario(path).site.coverable, {}
    polygon = shapely.from_geojson(json.dumps(document.get("geometry", document)))
    centre = polygon.envelope.centroid
    return as_multipolygon(shapely.transform(polygon, Frame(centre.x, centre.y).to_metres)), document.get("properties", {})


def _timed(call: Any) -> tuple[Any, float]:
    start = time.process_time()
    result = call()
    return result, time.process_time() - start


def _exhaustive(area: MultiPolygon, spacing: float) -> float:
    edges = area_edges(area, spacing)
    edges = (edges - np.tile(edges[:, :2].mean(axis=0), 2)) / spacing
    target = (area.area / spacing**2, 0.68, 0.32, 0.25)
    shifts = np.arange(32) / 16.0
    angles = np.arange(90) * np.pi / 180
    return max(index(edges, target, (x, y, angle))[0] for angle in angles for x in shifts for y in shifts)


def _print_table(results: list[list[dict[str, Any]]], edges: tuple[str, ...]) -> None:
    table = Table(title="Grid placement and the edge; ratio: length per square metre covered, to whole cells")
    for name in ("region", "hypervertices", "published", "F", "seconds"):
        table.add_column(name, justify="right")
    for edge in edges:
        table.add_column(f"{edge}: coverage %", justify="right")
        table.add_column("ratio", justify="right")
        table.add_column("turns", justify="right")
    for rows in results:
        first = rows[0]
        published = "" if first["published"] is None else f"{first['published']:.0f}"
        cells = [first["region"], str(first["hypervertices"]), published, f"{first['F']:.4f}", f"{first['seconds']:.3f}"]
        for row in rows:
            cells += [f"{100 * row['coverage']:.2f}", f"{row['length_per_covered_to_whole']:.3f}", str(row["turns"])]
        table.add_row(*cells)
    if len(results) > 1:
        table.add_section()
        for name, pick in (("mean", mean), ("least", min), ("most", max)):
            cells = [name, "", "", "", f"{pick(rows[0]['seconds'] for rows in results):.3f}"]
            for n in range(len(edges)):
                column = [rows[n] for rows in results]
                cells += [f"{100 * pick(r['coverage'] for r in column):.2f}"]
                cells += [f"{pick(r['length_per_covered_to_whole'] for r in column):.3f}"]
                cells += [f"{pick(r['turns'] for r in column):.0f}"]
            table.add_row(*cells)
    Console(width=140).print(table)


if __name__ == "__main__":
    main()
