"""A map of 1500 x 1500 cells: loaded, inflated, and the ways between seven points found. One JSON object, CPU seconds.

`python benchmarks/occupancy.py`: 120 random walls, cells of 0.02 m, radius 0.45 m; compilation apart.
"""

import json
import tempfile
import time
from pathlib import Path

import numpy as np

from quarterdeck.geo.gridpath import HEURISTICS, find_ways
from quarterdeck.geo.occupancy import OCCUPIED, Occupancy, read_map, write_map


def main() -> None:
    """Measure and print."""
    rng = np.random.default_rng(0)
    cells = np.zeros((1500, 1500), np.int8)
    for row, column, height, width in zip(*rng.integers(0, 1400, (2, 120)), *rng.integers(5, 120, (2, 120)), strict=True):
        cells[row : row + height, column : column + width] = OCCUPIED
    with tempfile.TemporaryDirectory() as folder:
        path = write_map(Occupancy(cells, 0.02), Path(folder) / "map.yaml")
        began = time.process_time()
        map_ = read_map(path)
        free = map_.free(0.45)
        figures = {"load_and_inflate": round(time.process_time() - began, 3)}
    where = np.argwhere(free)
    points = map_.to_metres(where[rng.integers(0, len(where), 7)] + 0.5)
    for heuristic in HEURISTICS:
        find_ways(map_, free, points[:2], heuristic)  # compiles
        began = time.process_time()
        ways = find_ways(map_, free, points, heuristic)
        seconds = round(time.process_time() - began, 3)
        metres = round(float(ways.steps[np.isfinite(ways.steps)].sum()), 2)
        figures[heuristic] = {"seconds": seconds, "cells": ways.expanded, "metres": metres}  # type: ignore[assignment]
    print(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
