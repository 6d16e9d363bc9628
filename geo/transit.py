"""Shortest paths for a point vehicle inside a polygon with holes, by a visibility graph on its reflex vertices."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numba import njit
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from shapely import LineString, MultiPolygon, Point
from shapely.ops import nearest_points

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import as_multipolygon
from quarterdeck.geo.triangulation import triangulate
from quarterdeck.geo.visibility import visible_vertices

MANY = 2_000  # corners: above it not every pair is looked at, which would take minutes and gigabytes
BATCH = 256  # corners whose views are held at once
MOST_LINKS = 8_000_000  # pairs of corners, of which a gigabyte becomes in the search for paths
TOUCH = 1e-6  # m: how far a path may stray over an edge that it runs along


@dataclass(frozen=True, slots=True)
class Roadmap:
    """A polygon to move in, ready for many shortest paths.

    `nodes` are its reflex vertices (n, 2), `edges` its boundary segments (m, 4), `links` the pairs of nodes that see each
    other (l, 2); all in metres. `grown` is the polygon widened by `TOUCH`, prepared.
    """

    polygon: MultiPolygon
    grown: MultiPolygon
    nodes: np.ndarray
    edges: np.ndarray
    links: np.ndarray


def roadmap(polygon: MultiPolygon) -> Roadmap:
    """Return the roadmap of a polygon, such as `Site.navigable`; only a reflex vertex can be a shortest path's corner.

    Raises InputError if too many of them see each other to be held.
    """
    polygon = without_chinks(polygon)
    rings = [shapely.get_coordinates(r) for p in shapely.orient_polygons(polygon).geoms for r in (p.exterior, *p.interiors)]
    nodes, beside, edges = [], [], []
    for ring in rings:
        here = ring[:-1]
        before, after = np.roll(here, 1, axis=0), np.roll(here, -1, axis=0)
        (ax, ay), (bx, by) = (here - before).T, (after - here).T
        reflex = ax * by - ay * bx < 0  # interior on the left: a right turn is
        nodes.append(here[reflex])
        beside.append(np.stack([before[reflex], after[reflex]]))
        edges.append(np.hstack([here, after]))
    corners = np.concatenate(nodes) if nodes else np.empty((0, 2))
    segments = np.concatenate(edges) if edges else np.empty((0, 4))
    grown = polygon.buffer(TOUCH)
    shapely.prepare(grown)
    links = _pairs(corners, segments) if len(corners) <= MANY else _views(polygon, corners, np.concatenate(beside, axis=1))
    return Roadmap(polygon, grown, corners, segments, links)


def _pairs(corners: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return the (l, 2) pairs of corners that see each other: every pair is looked at, past every edge."""
    first, second = np.triu_indices(len(corners), 1)
    seen = _clear(corners[first], corners[second], edges)
    return np.column_stack([first[seen], second[seen]])


def _views(polygon: MultiPolygon, corners: np.ndarray, beside: np.ndarray) -> np.ndarray:
    """Return those of the pairs that shortest paths may use, by looking from each corner from triangle to triangle.

    A path turns around a corner, so its links are tangents there: both neighbours on the ring, `beside` (2, n, 2), are on
    one side. Raises InputError if there are too many.
    """
    mesh = triangulate(polygon.buffer(TOUCH, join_style="mitre"), corners)  # wider, for what one sees along walls
    number = np.full(len(mesh.vertices), -1)
    number[mesh.points] = np.arange(len(corners))
    links, count = [], 0
    for begin in range(0, len(corners), BATCH):
        starts, seen = visible_vertices(mesh, corners[begin : begin + BATCH])
        first, second = np.repeat(np.arange(begin, begin + len(starts) - 1), np.diff(starts)), number[seen]
        kept = (second >= 0) & (second != first)
        first, second = first[kept], second[kept]
        way = corners[second] - corners[first]
        tangent = _one_side(way, beside[:, first] - corners[first]) & _one_side(way, beside[:, second] - corners[second])
        links.append(np.sort(np.column_stack([first[tangent], second[tangent]]), axis=1))
        count += len(links[-1])
        if count > 2 * MOST_LINKS:
            raise InputError(
                f"obstacles and borders have {len(corners):,} corners, between which too many ways are straight "
                f"(more than {MOST_LINKS:,}); simplify their outlines, or plan what is far apart one by one"
            )
    return np.unique(np.concatenate(links), axis=0)


def _one_side(way: np.ndarray, beside: np.ndarray) -> np.ndarray:
    """Return (n,) bool: of (2, n, 2) `beside` both are on one side of (n, 2) `way`, but for rounding as in `_clear`."""
    (a, b) = way[:, 0] * beside[:, :, 1] - way[:, 1] * beside[:, :, 0]
    return np.asarray(~((a > 1e-6) & (b < -1e-6) | (a < -1e-6) & (b > 1e-6)))


def without_chinks(polygon: MultiPolygon) -> MultiPolygon:
    """Return a polygon to move in without passages of no width, where two obstacles touch: a hair is shaved off it."""
    hair = {"join_style": "mitre", "mitre_limit": 10.0}
    return as_multipolygon(polygon.buffer(-10 * TOUCH, **hair).buffer(8 * TOUCH, **hair))


def shortest_paths(
    road: Roadmap, sources: np.ndarray, targets: np.ndarray
) -> tuple[np.ndarray, list[list[np.ndarray | None]]]:
    """Return (a, b) lengths in metres and the (m, 2) paths between (a, 2) sources and (b, 2) targets.

    No way: infinity and None. A point outside the polygon, such as a berth nearer to the quay than the clearance, first
    goes straight to the nearest place inside.
    """
    sources, targets = (np.asarray(p, dtype=float).reshape(-1, 2) for p in (sources, targets))
    lengths = np.full((len(sources), len(targets)), np.inf)
    paths: list[list[np.ndarray | None]] = [[None] * len(targets) for _ in sources]
    if road.polygon.is_empty or not lengths.size:
        return lengths, paths
    inside = np.array([_enter(road, p) for p in np.concatenate([sources, targets])])
    points = np.concatenate([road.nodes, inside])
    links = np.concatenate([road.links, _sight(points, len(road.nodes), road.edges)])
    weights = np.maximum(np.linalg.norm(points[links[:, 0]] - points[links[:, 1]], axis=1), 1e-12)  # 0 would be no link
    first_source, first_target = len(road.nodes), len(road.nodes) + len(sources)
    pending = [(i, j) for i in range(len(sources)) for j in range(len(targets))]
    while pending:  # a link that only grazes corners is checked exactly when a path first wants it
        graph = coo_array((weights, links.T), shape=(len(points),) * 2).tocsr()
        rows = sorted({i for i, _ in pending})
        distance, before = dijkstra(
            graph, directed=False, indices=[first_source + i for i in rows], return_predecessors=True
        )
        again, wrong = [], set()
        for i, j in pending:
            row = rows.index(i)
            if not np.isfinite(distance[row, first_target + j]):
                continue
            chain = _walk_back(before[row], first_target + j)
            bad = {(min(u, v), max(u, v)) for u, v in pairwise(chain) if not road.grown.covers(LineString(points[[u, v]]))}
            if bad:
                wrong |= bad
                again.append((i, j))
                continue
            path = _with_ends(points[chain], sources[i], targets[j])
            paths[i][j] = path
            lengths[i, j] = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
        if wrong:
            low, high = np.array(sorted(wrong)).T
            keep = ~np.isin(links.min(axis=1) * len(points) + links.max(axis=1), low * len(points) + high)
            links, weights = links[keep], weights[keep]
        pending = again
    return lengths, paths


def straight(road: Roadmap, sources: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Return (n,) bool: the straight way from each of (n, 2) sources to its target is clear, and so the shortest."""
    return np.asarray(shapely.covers(road.grown, shapely.linestrings(np.stack([sources, targets], axis=1))))


def _enter(road: Roadmap, point: np.ndarray) -> tuple[float, float]:
    """Return the point, or the nearest one inside."""
    if road.grown.covers(Point(point)):
        return float(point[0]), float(point[1])
    near = nearest_points(road.polygon, Point(point))[0]
    return near.x, near.y


def _sight(points: np.ndarray, first: int, edges: np.ndarray) -> np.ndarray:
    """Return (l, 2) links of each point from index `first` on with all points before it that it sees."""
    later, earlier = (g.ravel() for g in np.meshgrid(np.arange(first, len(points)), np.arange(len(points)), indexing="ij"))
    later, earlier = later[earlier < later], earlier[earlier < later]
    seen = _clear(points[later], points[earlier], edges)
    return np.column_stack([earlier[seen], later[seen]])


def _walk_back(before: np.ndarray, goal: int) -> list[int]:
    """Return the points of a shortest path, first to last."""
    chain = [goal]
    while before[chain[-1]] >= 0:
        chain.append(int(before[chain[-1]]))
    return chain[::-1]


def _with_ends(path: np.ndarray, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Begin and end where it was asked, with a leg into the polygon where that is not the same."""
    head = path[1:] if np.linalg.norm(path[0] - source) < 100 * TOUCH else path
    tail = head[:-1] if len(head) and np.linalg.norm(head[-1] - target) < 100 * TOUCH else head
    return np.vstack([source, tail, target])


def shortest_path(road: Roadmap, source: tuple[float, float], target: tuple[float, float]) -> np.ndarray | None:
    """Return the (m, 2) shortest path in metres between two points, or None where there is none."""
    return shortest_paths(road, np.array([source]), np.array([target]))[1][0][0]


@njit(cache=True)
def _clear(starts: np.ndarray, ends: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return (n,) bool: the segment crosses no edge properly. Touching is left to the exact check."""
    clear = np.ones(len(starts), dtype=np.bool_)
    for i in range(len(starts)):
        ax, ay = starts[i]
        bx, by = ends[i]
        for j in range(len(edges)):
            cx, cy, dx, dy = edges[j]
            if (
                max(ax, bx) < min(cx, dx)
                or min(ax, bx) > max(cx, dx)
                or max(ay, by) < min(cy, dy)
                or min(ay, by) > max(cy, dy)
            ):
                continue
            side_c = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
            side_d = (bx - ax) * (dy - ay) - (by - ay) * (dx - ax)
            side_a = (dx - cx) * (ay - cy) - (dy - cy) * (ax - cx)
            side_b = (dx - cx) * (by - cy) - (dy - cy) * (bx - cx)
            # Coordinates reach 1e5 m, so an area below a millionth of a square metre is rounding.
            if ((side_c > 1e-6 and side_d < -1e-6) or (side_c < -1e-6 and side_d > 1e-6)) and (
                (side_a > 1e-6 and side_b < -1e-6) or (side_a < -1e-6 and side_b > 1e-6)
            ):
                clear[i] = False
                break
    return clear
