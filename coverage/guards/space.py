"""The three polygons of limited-visibility coverage: what is to be seen, what sight passes through, where robots may be."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import MultiPolygon

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.scenario import Scenario, Vehicle, as_multipolygon

HAIR = 1e-3  # m that a guard keeps from every edge: nearer ones vanish from triangulations, and PLAN files keep 0.1 mm
BAND = 0.02  # m of the area beside an edge that are seen where the edge is inspected
DECIMALS = 9  # of a degree, as a PLAN file writes positions


@dataclass(frozen=True, slots=True)
class Space:
    """What is to be seen (`target`), what sight passes through (`sight`) and where robots may be (`reach`).

    All in metres; `sight` holds the target. `frame`, where given, rounds guards to positions that a PLAN
    file keeps exactly.
    """

    target: MultiPolygon
    sight: MultiPolygon
    reach: MultiPolygon
    frame: Frame | None = None

    def kept(self, points: np.ndarray) -> np.ndarray:
        """Return (k, 2) points as a PLAN file will hold them."""
        points = np.asarray(points, dtype=float).reshape(-1, 2)
        return points if self.frame is None else self.frame.to_metres(np.round(self.frame.to_degrees(points), DECIMALS))


def space_of(scenario: Scenario) -> Space:
    """Return the space of a scenario whose vehicles stand in for each other: reach is where all of them may be.

    Raises InputError if there is nothing to see or nowhere to be.
    """
    site = scenario.site
    if not scenario.vehicles:
        raise InputError("there is no vehicle; add a Point with the role vehicle")
    if site.coverable.is_empty:
        raise InputError("there is nothing to see; add a polygon with the role area that obstacles do not cover")
    blocking = [o.polygon for o in site.obstacles if any(v.domain in o.blocks for v in scenario.vehicles)]
    sight = as_multipolygon(shapely.union(site.area, site.operating).difference(shapely.union_all(blocking)))
    reach = _common(scenario.vehicles, scenario)
    if reach.is_empty:
        raise InputError("obstacles and clearance leave the vehicles nowhere to be; give them less clearance")
    return Space(site.coverable, sight, reach, scenario.frame)


def border_of(target: MultiPolygon) -> MultiPolygon:
    """Return the target's rim, a band of BAND metres along the area's border and every obstacle: seen, so is the border."""
    return as_multipolygon(target.difference(target.buffer(-BAND, join_style="mitre", mitre_limit=2.0)))


def _common(vehicles: Sequence[Vehicle], scenario: Scenario) -> MultiPolygon:
    kinds = sorted({(v.domain, v.clearance) for v in vehicles})
    reach = shapely.intersection_all([scenario.site.navigable(domain, clearance) for domain, clearance in kinds])
    clearance = kinds[-1][1]
    # Arcs of 16 chords a quarter make needless vertices: a tenth of the clearance more straightens most of them.
    smooth = reach if clearance <= 0 else reach.buffer(-0.1 * clearance).simplify(0.09 * clearance)
    return as_multipolygon(smooth)
