"""Making a map from scans: log-odds evidence in a grid (Moravec & Elfes 1985; Thrun, Burgard & Fox 2005, chapter 9)."""

import math
from dataclasses import dataclass

import numpy as np
import shapely
from numba import njit

from quarterdeck.geo.occupancy import FREE, OCCUPIED, UNKNOWN, Occupancy
from quarterdeck.geo.scenario import Site

HIT, MISS = 0.9, -0.35  # log-odds that a beam's end, and its passage, add to a cell
CERTAIN = 4.0  # log-odds at most, so that what goes or comes is noticed
WALL, CLEAR = math.log(0.65 / 0.35), math.log(0.196 / 0.804)  # map_server's thresholds as log-odds
MOST_CELLS = 4_000_000


@dataclass(frozen=True, slots=True)
class Evidence:
    """`values` (rows, cols) float32: log-odds that a cell of side `cell` metres is occupied, 0 where nothing is known.
    `origin` is the (x, y) of the outer corner of cell (0, 0).
    """

    values: np.ndarray
    cell: float
    origin: tuple[float, float]

    def occupancy(self) -> Occupancy:
        """Return the map: OCCUPIED and FREE beyond map_server's usual thresholds, else UNKNOWN."""
        cells = np.full(self.values.shape, UNKNOWN, np.int8)
        cells[self.values > WALL], cells[self.values < CLEAR] = OCCUPIED, FREE
        return Occupancy(cells, self.cell, self.origin)


def no_evidence(site: Site, cell: float, aside: float = 0.0) -> Evidence:
    """Return a grid about the operating area and `aside` metres around it, of which nothing is known yet.

    Its cells are larger than `cell` metres where there would be more than MOST_CELLS.
    """
    x0, y0, x1, y1 = site.operating.buffer(aside).bounds
    cell = max(cell, math.sqrt((x1 - x0) * (y1 - y0) / MOST_CELLS))
    rows, columns = math.ceil((y1 - y0) / cell) + 2, math.ceil((x1 - x0) / cell) + 2
    return Evidence(np.zeros((rows, columns), np.float32), cell, (x0 - cell, y0 - cell))


def fuse(evidence: Evidence, pose: np.ndarray, angles: np.ndarray, ranges: np.ndarray, reach: float) -> None:
    """Add a scan of (b,) `ranges` at `angles`, made at `pose` (3,), to the evidence, in place.

    A cell is told of once a scan: where a beam ends in it, others that graze it do not count. A beam without an echo
    clears its way up to `reach` metres if its neighbours have none either: else the echo may have been lost.
    """
    silent = ~np.isfinite(ranges)
    open_ = silent & np.roll(silent, 1) & np.roll(silent, -1)
    told = np.where(open_, -reach, np.where(silent, np.nan, ranges))
    x, y = pose[0] - evidence.origin[0], pose[1] - evidence.origin[1]
    _fuse(evidence.values, evidence.cell, x, y, pose[2] + angles, told)


def agreement(made: Occupancy, site: Site) -> dict[str, float]:
    """Return how well a map tells of a site's ground, in the operating area.

    `map_known`: the part of the free cells of which the map knows; `map_free_iou`: of those that it knows, cells free in
    both over cells free in either; `map_walls_right`: the part of its occupied cells that lie within a cell and a half of
    an obstacle's edge.
    """
    centres = made.to_metres(np.indices(made.cells.shape).reshape(2, -1).T + 0.5)
    shapely.prepare(site.operating)
    on = shapely.contains_xy(site.operating, *centres.T)
    centres, ours = centres[on], made.cells.ravel()[on]
    solid = shapely.union_all([o.polygon for o in site.obstacles if "ground" in o.blocks])
    shapely.prepare(solid)
    real = ~shapely.contains_xy(solid, *centres.T)
    known, walls = ours != UNKNOWN, shapely.points(centres[ours == OCCUPIED])
    both, either = np.count_nonzero((ours == FREE) & real), np.count_nonzero(known & ((ours == FREE) | real))
    right = shapely.dwithin(walls, solid.boundary, 1.5 * made.resolution)
    return {
        "map_free_iou": both / either if either else 0.0,
        "map_walls_right": float(right.mean()) if len(walls) else 1.0,
        "map_known": float(known[real].mean()) if real.any() else 1.0,
    }


@njit(cache=True)
def _fuse(values: np.ndarray, cell: float, x: float, y: float, bearings: np.ndarray, told: np.ndarray) -> None:
    """Add a scan; `told` (b,) metres: a beam's echo; negative: none so far; nan: nothing told."""
    rows, columns = values.shape
    ends = np.full(len(told), -1)
    for b in range(len(told)):
        if told[b] >= 0:
            i = int(np.floor((y + told[b] * np.sin(bearings[b])) / cell))
            j = int(np.floor((x + told[b] * np.cos(bearings[b])) / cell))
            if 0 <= i < rows and 0 <= j < columns:
                ends[b] = i * columns + j
    flat = values.reshape(-1)
    hit = np.unique(ends[ends >= 0])
    before = flat[hit]
    passed = set()
    for b in range(len(told)):
        if np.isnan(told[b]):
            continue
        length = abs(told[b])
        dx, dy = np.cos(bearings[b]), np.sin(bearings[b])
        for n in range(int(length / (0.5 * cell))):  # half a cell a step: passes each cell that it crosses for long
            i, j = int(np.floor((y + n * 0.5 * cell * dy) / cell)), int(np.floor((x + n * 0.5 * cell * dx) / cell))
            if i < 0 or j < 0 or i >= rows or j >= columns:
                break
            passed.add(i * columns + j)
    for c in passed:
        flat[c] = max(flat[c] + MISS, -CERTAIN)
    for n in range(len(hit)):
        flat[hit[n]] = min(before[n] + HIT, CERTAIN)
