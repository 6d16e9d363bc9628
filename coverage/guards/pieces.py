"""Guards as fault-tolerant-cdt places them: trapezoids, halved until one disc covers each piece (section II-A)."""

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from quarterdeck.coverage.guards.space import HAIR, Space
from quarterdeck.geo.visibility import DISC_SIDES

SNAP = 1e-12  # of the extent: the grid on which trapezoids are cut
SMALLEST = 1 / 64  # of the range: a piece of this size that robots cannot enter is left to be seen from elsewhere


def paper_guards(space: Space, reach: float) -> np.ndarray:
    """Return (k, 2) guards, one a piece, that see the target within `reach` metres from where robots may be.

    With a clearance there may be pieces that no robot can enter: they get no guard here (`certificate.mend` follows).
    """
    radius = reach * np.cos(np.pi / DISC_SIDES)  # what the inscribed polygon of a view surely holds
    everywhere = space.reach.equals(space.target)
    shapely.prepare(space.reach)
    guards = []
    for trapezoid in trapezoids(space.target):
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
    corners = np.unique(shapely.get_coordinates(polygon), axis=0)
    top, bottom = np.full(len(corners), north + extent), np.full(len(corners), south - extent)
    x = corners[:, 0]
    verticals = shapely.linestrings(np.stack([np.column_stack([x, bottom]), np.column_stack([x, top])], axis=1))
    shapely.prepare(polygon)
    chords, of = shapely.get_parts(shapely.intersection(verticals, polygon), return_index=True)
    lines = shapely.get_dimensions(chords) == 1
    touching = shapely.distance(chords, shapely.points(corners[of])) <= 1e-9 * extent
    ends = shapely.bounds(chords[lines & touching])
    longer = np.column_stack([ends[:, 0], ends[:, 1] - 1e-9 * extent, ends[:, 2], ends[:, 3] + 1e-9 * extent])
    cuts = shapely.linestrings(longer.reshape(-1, 2, 2))
    noded = shapely.union_all([polygon.boundary, *cuts], grid_size=2.0 ** np.ceil(np.log2(SNAP * extent)))
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))
    faces = faces[shapely.contains(polygon, shapely.point_on_surface(faces))]
    faces = shapely.orient_polygons(faces)
    return [shapely.get_coordinates(face)[:-1] for face in faces[np.lexsort(shapely.bounds(faces).T)]]


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
