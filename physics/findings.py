"""What robots with lidar find that the map of their plan does not have.

All robots that are in contact put what they see into one map; one that nobody hears goes on with its own copy, and what it
saw counts when it is heard again.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from scipy.ndimage import binary_dilation
from shapely import MultiPolygon

from quarterdeck.geo.occupancy import FREE, Occupancy, site_occupancy
from quarterdeck.geo.scenario import Site, Vehicle, as_multipolygon
from quarterdeck.physics.mapping import WALL, Evidence, fuse, no_evidence

CELL = 0.1  # m
KNOWN = 0.3  # m: echoes so near to what the map has are of that: walls are not quite where a robot believes them
OTHERS = 0.5  # m about the hull of another robot in contact, whose echoes are no obstacle


class Findings:
    """The maps of the robots `lidars` (n,), places among `vehicles`, on the `site` that their plan knows.

    Nobody has `looked` yet as long as there is no more to know than the plan does.
    """

    def __init__(self, site: Site, vehicles: Sequence[Vehicle], lidars: np.ndarray) -> None:
        self.site, self.vehicles, self.lidars = site, vehicles, lidars
        self.shared = no_evidence(site, CELL)
        self.apart: dict[int, Evidence] = {}  # the maps of robots that are not heard
        self.strange = {-1: np.zeros((0, 0), bool)}  # of the common map (-1), and of those of robots that are not heard
        self.free: dict[float, np.ndarray] = {}
        self.looked = False

    def look(
        self,
        believed: np.ndarray,
        sure: np.ndarray,
        angles: np.ndarray,
        ranges: np.ndarray,
        reach: float,
        mute: np.ndarray,
        present: np.ndarray,
    ) -> None:
        """Put the scans (n, b) of robots at `believed` (k, 3) on their maps.

        Those that are not `sure` (k,) of their place add nothing. Echoes of robots that are `present` and not `mute` (k,)
        are of no obstacle.
        """
        self.looked = True
        for i in [i for i in self.apart if not mute[i]]:
            seen = self.apart.pop(i).values
            stronger = np.abs(seen) > np.abs(self.shared.values)
            self.shared.values[stronger] = seen[stronger]
        for i in np.intersect1d(np.flatnonzero(mute), self.lidars).tolist():
            if i not in self.apart:
                self.apart[i] = replace(self.shared, values=self.shared.values.copy())
        size = np.array([np.hypot(v.model.length, v.model.width) / 2 + OTHERS for v in self.vehicles])
        for n, i in enumerate(self.lidars.tolist()):
            if not (sure[i] and present[i]):
                continue
            others = np.flatnonzero(present & ~mute)
            others = others[others != i]
            bearing, told = believed[i, 2] + angles, ranges[n].copy()
            ends = believed[i, :2] + np.where(np.isfinite(told), told, 0.0)[:, None] * np.column_stack(
                [np.cos(bearing), np.sin(bearing)]
            )
            away = np.hypot(*(ends[:, None] - believed[others, :2]).transpose(2, 0, 1))
            told[(away < size[others]).any(axis=1)] = np.nan
            fuse(self.map_of(i), believed[i], angles, told, reach)
        self.strange = {-1: self._strange(self.shared), **{i: self._strange(e) for i, e in self.apart.items()}}

    def _strange(self, evidence: Evidence) -> np.ndarray:
        """Return (rows, cols) bool: the cell is of something that the plan's map does not have, or beside it."""
        found = self._unknown(evidence)
        return binary_dilation(found, iterations=2) if found.any() else found

    def mapped(self, believed: np.ndarray, angles: np.ndarray, ranges: np.ndarray) -> np.ndarray:
        """Return the scans (n, b) without the echoes of what was found: a filter that believes the map had better not try
        to explain them.
        """
        if not any(s.any() for s in self.strange.values()):
            return ranges
        out = ranges.copy()
        for n, i in enumerate(self.lidars.tolist()):
            strange, heard = self.strange.get(i, self.strange[-1]), np.flatnonzero(np.isfinite(ranges[n]))
            bearing = believed[i, 2] + angles[heard]
            ends = believed[i, :2] + ranges[n, heard, None] * np.column_stack([np.cos(bearing), np.sin(bearing)])
            cells = np.floor(self.grid(i).to_cells(ends)).astype(int)
            on = ((cells >= 0) & (cells < strange.shape)).all(axis=1)
            hit = heard[on][strange[cells[on, 0], cells[on, 1]]]
            out[n, hit] = np.inf
        return out

    def map_of(self, i: int) -> Evidence:
        """Return the evidence that robot `i` has."""
        return self.apart.get(i, self.shared)

    def found(self, i: int) -> np.ndarray:
        """Return (m, 2) metres: the centres of the cells where robot `i` knows of something that its map does not have."""
        if not self.looked:
            return np.zeros((0, 2))
        cells = np.argwhere(self._unknown(self.map_of(i)))
        return self.grid(i).to_metres(cells + 0.5)

    def obstacles(self, i: int) -> MultiPolygon:
        """Return what robot `i` has found as polygons in metres."""
        half, at = 0.5 * self.shared.cell, self.found(i)
        cells = shapely.box(at[:, 0] - half, at[:, 1] - half, at[:, 0] + half, at[:, 1] + half)
        return as_multipolygon(shapely.union_all(cells).buffer(half, join_style="mitre").simplify(half))

    def clear_of(self, margin: float) -> np.ndarray:
        """Return (rows, cols) bool: the cell keeps `margin` metres from what the plan's map has."""
        if margin not in self.free:
            made = site_occupancy(self.site, "ground", self.shared.cell, margin)
            self.free[margin] = made.cells == FREE
        return self.free[margin]

    def grid(self, i: int) -> Occupancy:
        """Return the map that robot `i` has, as a grid of evidence."""
        evidence = self.map_of(i)
        return Occupancy(evidence.values, evidence.cell, evidence.origin)

    def _unknown(self, evidence: Evidence) -> np.ndarray:
        """Return (rows, cols) bool: the cell is of something that the plan's map does not have."""
        return (evidence.values > WALL) & self.clear_of(KNOWN)
