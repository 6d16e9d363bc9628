"""A bound that no guards can beat: points of which no two can be seen from one place need a guard each."""

from contextlib import suppress

import numpy as np
import shapely
from scipy.sparse import csr_array

from quarterdeck.coverage.guards.cover import small_cover
from quarterdeck.coverage.guards.space import Space
from quarterdeck.geo.deadline import time_is_up
from quarterdeck.geo.errors import OutOfTimeError
from quarterdeck.geo.triangulation import Triangulation
from quarterdeck.geo.visibility import visibility_polygons

WITNESSES = 800
STEPS = 150_000
GAP = 1e-6  # m: views nearer than this to each other are taken to meet


def independent_witnesses(space: Space, mesh: Triangulation, reach: float, *, seed: int = 0) -> np.ndarray:
    """Return (k, 2) points of the target of which no two can be seen from one place within `reach`: k is a lower bound.

    Rigorous: what a witness can be seen from is taken as large as it could be (disc circumscribed, gap closed), and every
    pair is tested. Largest sets of independent points are small vertex covers, which are searched for.
    """
    points = _candidates(space, reach)
    views = visibility_polygons(mesh, points, reach, outer=True)
    keep = np.flatnonzero(~shapely.is_empty(views))
    order = keep[np.argsort(shapely.area(views[keep]), kind="stable")[:WITNESSES]]  # hidden corners bind most
    points, views = points[order], views[order]
    n = len(points)
    one, other = shapely.STRtree(views).query(views, predicate="dwithin", distance=GAP)
    pairs = np.column_stack([one, other])[one < other]
    rows = np.repeat(np.arange(len(pairs)), 2)
    conflicts = csr_array((np.ones(2 * len(pairs), dtype=np.int8), (rows, pairs.ravel())), shape=(len(pairs), n))
    covering = (
        small_cover(conflicts, np.empty(0, dtype=np.int64), STEPS, seed=seed) if len(pairs) else np.empty(0, dtype=int)
    )
    return points[np.setdiff1d(np.arange(n), covering)]


def guards_bound(space: Space, mesh: Triangulation, reach: float, *, seed: int = 0) -> int:
    """Return a number of guards that no cover of the target can go below: by witnesses, and by area over the disc's."""
    by_area = int(np.ceil(space.target.area / (np.pi * reach**2) - 1e-9))
    if time_is_up("the bound on guards by witnesses"):
        return max(by_area, 1)
    with suppress(OutOfTimeError):
        return max(by_area, len(independent_witnesses(space, mesh, reach, seed=seed)), 1)
    return max(by_area, 1)


def _candidates(space: Space, reach: float) -> np.ndarray:
    """Return (n, 2) points of the target: its corners, points along its edges and a lattice."""
    step = max(reach / 4, np.sqrt(space.target.area / (2 * WITNESSES)))
    rim = shapely.get_coordinates(space.target.segmentize(step))
    west, south, east, north = space.target.bounds
    x, y = (g.ravel() for g in np.meshgrid(np.arange(west, east, step), np.arange(south, north, step)))
    inner = shapely.contains_xy(space.target, x, y)
    return np.unique(np.concatenate([rim, np.column_stack([x, y])[inner]]), axis=0)
