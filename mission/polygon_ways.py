"""Shortest ways between tasks and depots on the site's own polygons: for replanning, when a map of cells takes too long."""

from dataclasses import dataclass

import numpy as np
import shapely
from shapely import MultiPolygon

from quarterdeck.geo.geodesics import Geodesics, geodesics
from quarterdeck.geo.scenario import Scenario, Vehicle
from quarterdeck.geo.transit import without_chinks
from quarterdeck.mission.timing import turn_seconds

ASTRAY = 0.5  # m beyond its clearance: a point farther than this from where a vehicle may be has no way


@dataclass(frozen=True, slots=True)
class PolygonWays:
    """The ways between m points. `lengths` (m, m) metres, inf is none; `number` (m,) of each point in `between`, -1 for one
    that is nowhere near.
    """

    lengths: np.ndarray
    number: np.ndarray
    between: Geodesics

    @property
    def steps(self) -> np.ndarray:
        """(m, m) metres; on polygons there is no grid to go along."""
        return self.lengths

    def path(self, i: int, j: int) -> np.ndarray | None:
        """Return the (q, 2) path in metres from point i to point j, None where there is none."""
        if not np.isfinite(self.lengths[i, j]):
            return None
        way = self.between.path(int(self.number[i]), int(self.number[j]))
        apart = np.hypot(*np.diff(way, axis=0).T) > 1e-9
        return way[np.append(True, apart)] if apart.any() else way[[0, -1]]

    def turning(self, vehicle: Vehicle) -> np.ndarray:
        """Return the (m, m) seconds that a vehicle loses in the turns on the way; all ways are walked back at once."""
        nodes, before = self.between.nodes, self.between.before
        k = len(before)
        source, here = np.divmod(np.arange(k * k), k)
        lost = np.zeros(k * k)
        ahead = np.zeros((k * k, 2))  # the step that was made last, seen from the source
        left = np.flatnonzero(np.isfinite(self.between.lengths).ravel() & (source != here))
        here = here.copy()
        while len(left):
            last = before[source[left], here[left]]
            step = nodes[here[left]] - nodes[last]
            moves = np.hypot(*step.T) > 1e-9
            after = ahead[left]
            angle = np.abs(np.arctan2(_cross(step, after), (step * after).sum(axis=1)))
            lost[left] += np.where(moves & after.any(axis=1), turn_seconds(vehicle, angle), 0.0)
            ahead[left] = np.where(moves[:, None], step, after)
            here[left] = last
            left = left[last != source[left]]
        whole = np.zeros_like(self.lengths)
        known = np.flatnonzero(self.number >= 0)
        whole[np.ix_(known, known)] = lost.reshape(k, k)
        return whole


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def polygon_ways(scenario: Scenario, vehicle: Vehicle, points: np.ndarray) -> tuple[PolygonWays, np.ndarray]:
    """Return a vehicle's ways between (m, 2) points in metres, and (m,) how far each was moved to where it may be.

    Raises TriangulationError where the polygon cannot be triangulated.
    """
    free = without_chinks(scenario.site.navigable(vehicle.domain, vehicle.clearance))
    stands = _inside(free, points)
    off = np.hypot(*(stands - points).T)
    near = off <= vehicle.clearance + ASTRAY
    between = geodesics(free, stands[near])
    lengths = np.full((len(points), len(points)), np.inf)
    np.fill_diagonal(lengths, 0.0)
    lengths[np.ix_(near, near)] = between.lengths
    return PolygonWays(lengths, np.where(near, np.cumsum(near) - 1, -1), between), off


def _inside(free: MultiPolygon, points: np.ndarray) -> np.ndarray:
    """Return each (m, 2) point, or the nearest place a hair inside where it is not."""
    stands = np.array(points, dtype=float)
    outside = ~shapely.covers(free, shapely.points(stands))
    if outside.any() and free.area:
        lines = shapely.shortest_line(free.buffer(-1e-4), shapely.points(stands[outside]))
        stands[outside] = shapely.get_coordinates(lines)[::2]
    return stands
