"""One lap along the border of the area and around what stands in it, before its lines."""

import numpy as np
import shapely
from shapely import LineString, MultiPolygon, Point
from shapely.ops import substring

from quarterdeck.coverage.metrics import straight_pieces
from quarterdeck.geo.grid import TOLERANCE
from quarterdeck.geo.scenario import as_multipolygon


def lap_space(target: MultiPolygon, area: MultiPolygon, spacing: float) -> MultiPolygon:
    """Return the space in metres whose boundary is driven: half of `spacing` inside `target`, where `area` allows.

    `target` is what is to be covered, `area` is where tracks may lie: where a clearance keeps them farther off than half of
    the spacing, the lap runs along it.
    """
    inner = target.buffer(-spacing / 2.0, join_style="mitre", mitre_limit=2.0)
    return as_multipolygon(inner.intersection(area.buffer(-TOLERANCE * spacing, join_style="mitre")))


def lay_laps(
    space: MultiPolygon, part: MultiPolygon, spacing: float, start: tuple[float, float] | None = None
) -> list[np.ndarray]:
    """Return the (n, 2) metres of each lap, or piece of one, along the boundary of `space` that lies in `part`.

    The nearest to `start` comes first, then the nearest to where that ends; a closed lap is entered, and left, where it is
    nearest. Pieces shorter than half of `spacing` are left out.
    """
    pieces = shapely.get_parts(shapely.intersection(shapely.boundary(space), part))
    pieces = pieces[(shapely.get_type_id(pieces) == 1) & (shapely.length(pieces) > 0)]
    merged = shapely.get_parts(shapely.line_merge(shapely.multilinestrings(pieces))) if len(pieces) else pieces
    left = [line for line in merged if line.length >= spacing / 2.0]
    laps: list[np.ndarray] = []
    if not left:
        return []
    here = Point(left[0].coords[0] if start is None else start)
    while left:
        nearest = int(np.argmin([_way_to(line, here) for line in left]))
        laps.append(_entered(left.pop(nearest), here))
        here = Point(laps[-1][-1])
    return laps


def _way_to(line: LineString, here: Point) -> float:
    """Return the metres to where a lap can be entered: anywhere if it is closed, else at its ends."""
    return float(here.distance(line if line.is_closed else line.boundary))


def _entered(line: LineString, here: Point) -> np.ndarray:
    points = shapely.get_coordinates(line)
    if line.is_closed:
        along = line.line_locate_point(here)
        halves = [substring(line, along, line.length), substring(line, 0.0, along)]
        points = np.concatenate([shapely.get_coordinates(half) for half in halves])
    elif Point(points[-1]).distance(here) < Point(points[0]).distance(here):
        points = points[::-1]
    straight = straight_pieces(points)
    return np.concatenate([straight[:, 0], straight[-1:, 1]])
