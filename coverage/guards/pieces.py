"""Guards as fault-tolerant-cdt places them: trapezoids, halved until one disc covers each piece (section II-A)."""

import numpy as np
import shapely
from numba import njit
from shapely import MultiPolygon, Polygon

from quarterdeck.coverage.guards.space import HAIR, Space
from quarterdeck.geo.deadline import go_on
from quarterdeck.geo.visibility import DISC_SIDES

SNAP = 1e-12  # of the extent: the grid on which trapezoids are cut
LOOK = 256  # trapezoids, between two looks at the limit
SMALLEST = 1 / 64  # of the range: a piece of this size that robots cannot enter is left to be seen from elsewhere


def paper_guards(space: Space, reach: float) -> np.ndarray:
    """Return (k, 2) guards, one a piece, that see the target within `reach` metres from where robots may be.

    With a clearance there may be pieces that no robot can enter: they get no guard here (`certificate.mend` follows).
    """
    radius = reach * np.cos(np.pi / DISC_SIDES)  # what the inscribed polygon of a view surely holds
    everywhere = space.reach.equals(space.target)
    shapely.prepare(space.reach)
    guards = []
    for i, trapezoid in enumerate(trapezoids(space.target)):
        if i % LOOK == LOOK - 1:
            go_on("the placing of guards")
        stack = [trapezoid]
        while stack:
            piece = stack.pop()
            guard = _guard(piece, space, radius, everywhere)
            if guard is not None:
                guards.append(guard)
            elif np.ptp(piece, axis=0).max() > SMALLEST * reach and space.reach.intersects(Polygon(piece)):
                stack.extend(_halves(piece))
    return space.kept(np.array(guards, dtype=float))


def trapezoids(polygon: Polygon | MultiPolygon) -> list[np.ndarray]:
    """Return the trapezoidal decomposition of a polygon: convex pieces, each (n, 2) metres, counter-clockwise.

    Every vertex sends a vertical up and down to the next edge.
    """
    west, south, east, north = polygon.bounds
    extent = max(east - west, north - south)
    hair = 1e-9 * extent
    ends = _verticals(polygon, hair)
    cuts = shapely.linestrings(ends + np.array([[0.0, -hair], [0.0, hair]]))
    noded = shapely.union_all([polygon.boundary, *cuts], grid_size=2.0 ** np.ceil(np.log2(SNAP * extent)))
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))
    faces = faces[shapely.contains(polygon, shapely.point_on_surface(faces))]
    faces = shapely.orient_polygons(faces)
    return [shapely.get_coordinates(face)[:-1] for face in faces[np.lexsort(shapely.bounds(faces).T)]]


def _verticals(polygon: Polygon | MultiPolygon, hair: float) -> np.ndarray:
    """Return the (n, 2, 2) verticals in a polygon from each corner to the nearest edges, and its upright edges."""
    places, ring = shapely.get_coordinates(shapely.get_parts(polygon.boundary), return_index=True)
    edges = np.hstack([places[:-1], places[1:]])[ring[:-1] == ring[1:]]
    edges = np.where((edges[:, 0] <= edges[:, 2])[:, None], edges, edges[:, [2, 3, 0, 1]])
    edges = edges[np.argsort(edges[:, 0], kind="stable")]
    corners = np.unique(places, axis=0)
    below, above = _nearest(edges, corners, hair)
    x, y = np.concatenate([corners, corners]).T
    other = np.concatenate([below, above])
    shapely.prepare(polygon)
    inside = np.isfinite(other)
    inside[inside] = shapely.contains_xy(polygon, x[inside], (y[inside] + other[inside]) / 2)
    upright = edges[edges[:, 0] == edges[:, 2]]
    x, y, other = (
        np.concatenate(p) for p in zip((x[inside], y[inside], other[inside]), upright[:, [0, 1, 3]].T, strict=True)
    )
    return np.stack([np.column_stack([x, np.minimum(y, other)]), np.column_stack([x, np.maximum(y, other)])], axis=1)


@njit(cache=True)
def _nearest(edges: np.ndarray, corners: np.ndarray, hair: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (n,) y of the nearest edge below each of (n, 2) corners, and above it, but for those within `hair`; infinite
    for none. A line sweeps over corners and edges (m, 4), both by x, past the edges that it crosses.
    """
    below, above = np.full(len(corners), -np.inf), np.full(len(corners), np.inf)
    crossed = np.empty(len(edges), dtype=np.int64)
    n = ahead = 0
    for i in range(len(corners)):
        x, y = corners[i]
        while ahead < len(edges) and edges[ahead, 0] <= x:
            crossed[n] = ahead
            n += 1
            ahead += 1
        kept = 0
        for j in range(n):
            ax, ay, bx, by = edges[crossed[j]]
            if bx < x:
                continue
            crossed[kept] = crossed[j]
            kept += 1
            for end in range(2 if ax == bx else 1):  # an upright edge has both ends here
                at = (
                    (by if end else ay) if ax == bx or x == ax else by if x == bx else ay + (x - ax) / (bx - ax) * (by - ay)
                )
                if at < y - hair:
                    below[i] = max(below[i], at)
                elif at > y + hair:
                    above[i] = min(above[i], at)
        n = kept
    return below, above


def _guard(piece: np.ndarray, space: Space, radius: float, everywhere: bool) -> np.ndarray | None:
    """Return a place in the convex piece, and where robots may be, that has all of it within the radius."""
    shape = shapely.Polygon(piece)
    circle = shapely.minimum_bounding_radius(shape)
    if circle > radius:
        return None
    centre = shapely.get_coordinates(shapely.centroid(shapely.minimum_bounding_circle(shape)))[0]
    heart = piece.mean(axis=0)
    size = max(float(np.linalg.norm(piece - heart, axis=1).max()), 1e-12)
    places = [centre + (heart - centre) * step for step in (0.0, min(1.0, 2 * HAIR / size), 0.01, 0.1, 0.3, 1.0)]
    if not everywhere:
        inner = shape.intersection(space.reach)
        if inner.is_empty or inner.area == 0:
            return None
        places += [shapely.get_coordinates(p)[0] for p in (shapely.centroid(inner), shapely.point_on_surface(inner))]
    best, deepest = None, 0.0
    for place in places:
        point = shapely.Point(place)
        if np.linalg.norm(piece - place, axis=1).max() > radius or not space.reach.contains(point):
            continue
        depth = min(HAIR, _inside(piece, place))
        if depth > deepest:
            best, deepest = place, depth
    return best


def _inside(piece: np.ndarray, place: np.ndarray) -> float:
    """Return the distance of a place in a convex piece from its edges, negative outside."""
    along = np.roll(piece, -1, axis=0) - piece
    to = place - piece
    length = np.linalg.norm(along, axis=1)
    used = length > 0
    return float(((along[:, 0] * to[:, 1] - along[:, 1] * to[:, 0])[used] / length[used]).min())


def _halves(piece: np.ndarray) -> list[np.ndarray]:
    """Cut a convex piece across its longest direction, through the middle."""
    centred = piece - piece.mean(axis=0)
    direction = np.linalg.svd(centred, full_matrices=False)[2][0]
    along = piece @ direction
    middle = (along.min() + along.max()) / 2
    halves = []
    for side in (along - middle, middle - along):
        after = np.roll(side, -1)
        crosses = (side > 0) != (after > 0)
        share = np.where(crosses, side / np.where(crosses, side - after, 1.0), 0.0)
        cut = piece + share[:, None] * (np.roll(piece, -1, axis=0) - piece)
        points = np.stack([piece, cut], axis=1).reshape(-1, 2)
        halves.append(points[np.stack([side >= 0, crosses], axis=1).reshape(-1)])
    return halves
