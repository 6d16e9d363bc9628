"""The exact check of a trace against the site: the hull swept from sample to sample, so that nothing is missed
between.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numba import njit
from shapely import Polygon

from quarterdeck.geo.scenario import Obstacle, Site, Vehicle
from quarterdeck.physics.trace import UNKNOWN, Trace

PIECE = 50  # samples of track tested at once
EXACT = 0.001  # m


@dataclass(frozen=True, slots=True)
class Swept:
    """What a vehicle's hull came to: `clearance` metres to the nearest obstacle (0: hit; inf: none), `time` and
    `obstacle` of that, `hits` the obstacles it went through, in the order of the site.
    """

    clearance: float
    time: float
    obstacle: str
    hits: tuple[str, ...]


def sweep(
    site: Site, vehicle: Vehicle, trace: Trace, column: int, during: Mapping[str, tuple[float, float]] | None = None
) -> Swept:
    """Sweep the hull of the vehicle in `column` of the trace through the obstacles that block it.

    `during` says of obstacles, by id, from when and until when they were there, s; the others always were.

    Between two poses the hull covers the convex hull of its two rectangles, to EXACT. An aerial vehicle above an obstacle
    is clear of it. Where it is not known where the vehicle was nothing is swept.
    """
    obstacles = [o for o in site.obstacles if vehicle.domain in o.blocks]
    if not obstacles:
        return Swept(float("inf"), 0.0, "", ())
    there = {o.id: (during or {}).get(o.id, (0.0, np.inf)) for o in obstacles}
    runs = []
    for low, high in sorted(set(there.values())):
        first, last = np.searchsorted(trace.time, (low, high)).tolist()
        some = [o for o in obstacles if there[o.id] == (low, high)]
        parts = [slice(max(run.start, first), min(run.stop, last)) for run in trace.known(column)]
        runs += [_sweep(some, vehicle, trace, column, part) for part in parts if part.stop > part.start]
    nearest = min(runs, key=lambda run: run.clearance, default=Swept(float("inf"), 0.0, "", ()))
    hit = {name for run in runs for name in run.hits}
    return replace(nearest, hits=tuple(o.id for o in obstacles if o.id in hit))


def _sweep(obstacles: Sequence[Obstacle], vehicle: Vehicle, trace: Trace, column: int, run: slice) -> Swept:
    """Sweep the hull through the obstacles over one run of samples."""
    xy = np.column_stack([trace.x[run, column], trace.y[run, column]])
    heading = trace.heading[run, column]
    moved = np.r_[True, np.abs(np.diff(xy, axis=0)).max(axis=1) > 0] | np.r_[True, np.diff(heading) != 0]
    keep = np.flatnonzero(moved)
    xy, z = xy[keep], trace.z[run, column][keep]
    heading, time = heading[keep], trace.time[run][keep]
    polygons = np.array([o.polygon for o in obstacles])
    height = np.array([o.height for o in obstacles])
    reach = np.hypot(vehicle.model.length, vehicle.model.width) / 2
    firsts = np.arange(0, max(len(xy) - 1, 1), PIECE)
    track = xy if len(xy) > 1 else np.vstack([xy, xy])
    lines = np.array([shapely.LineString(track[f : f + PIECE + 1]) for f in firsts])
    low = np.array([z[f : f + PIECE + 1].min() for f in firsts])
    if vehicle.domain == "aerial" and not (low[:, None] <= height).any():
        return Swept(float("inf"), 0.0, "", ())
    tree = shapely.STRtree(polygons)
    best, hits = (float("inf"), 0.0, ""), set()
    pieces, nearest, gap = _nearest(tree, lines, polygons, low, height, 2 * reach)
    # Only pieces whose track comes within a hull of the least distance, or of an obstacle, can matter.
    limit = gap.min(initial=np.inf) + 2 * reach
    for piece, obstacle in zip(pieces[gap <= limit], nearest[gap <= limit], strict=True):
        first = firsts[piece]
        part = slice(first, first + PIECE + 1)
        away, k = _distance(xy[part], heading[part], z[part], vehicle, polygons[obstacle], height[obstacle])
        if away < best[0]:
            best = (away, float(time[part][min(k + 1, len(time[part]) - 1)]), obstacles[obstacle].id)
        if away == 0.0:
            hits.add(int(obstacle))
    return Swept(*best, tuple(obstacles[i].id for i in sorted(hits)))


def _nearest(
    tree: shapely.STRtree, lines: np.ndarray, polygons: np.ndarray, low: np.ndarray, height: np.ndarray, margin: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return pairs (piece, obstacle, distance of the track) that may hold the nearest or a hit."""
    (pieces, obstacles), gap = tree.query_nearest(lines, return_distance=True, all_matches=True)
    inside = tree.query(lines, predicate="dwithin", distance=float(gap.min()) + margin)
    pairs = np.unique(np.column_stack([np.r_[pieces, inside[0]], np.r_[obstacles, inside[1]]]), axis=0)
    pairs = pairs[low[pairs[:, 0]] <= height[pairs[:, 1]]]
    return pairs[:, 0], pairs[:, 1], shapely.distance(lines[pairs[:, 0]], polygons[pairs[:, 1]])


def _distance(
    xy: np.ndarray, heading: np.ndarray, z: np.ndarray, vehicle: Vehicle, polygon: Polygon, height: float
) -> tuple[float, int]:
    """Return the least distance of the swept hull to a polygon of a height, and the interval of it.

    The convex hull of a hull and of itself turned by d reaches length * d / 4 too far amidships: where that could matter,
    the interval is cut up until it reaches no further than EXACT.
    """
    length, width = vehicle.model.length, vehicle.model.width
    away = shapely.distance(_hulls(xy, heading, length, width), polygon)
    away[(np.minimum(z[:-1], z[1:]) if len(z) > 1 else z) > height] = np.inf
    turned = np.unwrap(heading)
    slack = length / 4 * np.abs(np.diff(turned)) if len(xy) > 1 else np.zeros(1)
    for k in np.flatnonzero((away <= (away + slack).min()) & (slack > EXACT)):
        at = np.linspace(0, 1, min(int(np.ceil(slack[k] / EXACT)), 100) + 1)
        places = xy[k] + at[:, None] * (xy[k + 1] - xy[k])
        hulls = _hulls(places, turned[k] + at * (turned[k + 1] - turned[k]), length, width)
        away[k] = shapely.distance(hulls, polygon).min()
    nearest = int(np.argmin(away))
    return float(away[nearest]), nearest


def _hulls(xy: np.ndarray, heading: np.ndarray, length: float, width: float) -> np.ndarray:
    """Return the (n - 1,) areas swept between n poses (n of 1: the hull itself)."""
    corners = np.array([(length, width), (-length, width), (-length, -width), (length, -width)]) / 2
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    x = xy[:, :1] + cos * corners[:, 0] - sin * corners[:, 1]
    y = xy[:, 1:] + sin * corners[:, 0] + cos * corners[:, 1]
    points = np.dstack([x, y])
    pairs = np.concatenate([points[:-1], points[1:]], axis=1) if len(points) > 1 else points
    return shapely.convex_hull(shapely.multipoints(pairs))


def excursion(site: Site, trace: Trace, column: int) -> float:
    """Return how far the track of the vehicle in `column` left the operating area, metres; 0 if never."""
    track = np.column_stack([trace.x[:, column], trace.y[:, column]])[trace.kind[:, column] != UNKNOWN]
    shapely.prepare(site.operating)
    outside = ~shapely.intersects_xy(site.operating, track[:, 0], track[:, 1])
    if not outside.any():
        return 0.0
    return float(shapely.distance(shapely.points(track[outside]), site.operating).max())


@njit(cache=True)
def closest_approaches(
    x: np.ndarray, y: np.ndarray, z: np.ndarray, present: np.ndarray, size: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return for each vehicle the least distance to another, less both half `size`s, the other's column and the sample.

    `x`, `y`, `z`, `present` are (t, k); only vehicles present at the time count. inf, -1, -1 where never two were.
    """
    count = x.shape[1]
    best, other, when = np.full(count, np.inf), np.full(count, -1), np.full(count, -1)
    for s in range(len(x)):
        for i in range(count):
            if not present[s, i]:
                continue
            for j in range(i + 1, count):
                if not present[s, j]:
                    continue
                dx, dy, dz = x[s, i] - x[s, j], y[s, i] - y[s, j], z[s, i] - z[s, j]
                away = max(np.sqrt(dx * dx + dy * dy + dz * dz) - (size[i] + size[j]) / 2, 0.0)
                if away < best[i]:
                    best[i], other[i], when[i] = away, j, s
                if away < best[j]:
                    best[j], other[j], when[j] = away, i, s
    return best, other, when
