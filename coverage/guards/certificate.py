"""The proof that guards see everything: exact areas, by two routes that have nothing in common but shapely.

The first unites the views from triangular expansion. The second knows no triangulation: what a guard sees is its disc less
the shadow of every wall. Both take the disc as an inscribed polygon, so what they call seen is seen.
"""

from itertools import count

import numpy as np
import shapely
from shapely import MultiPolygon

from quarterdeck.coverage.guards.space import HAIR, Space
from quarterdeck.geo.deadline import go_on
from quarterdeck.geo.scenario import as_multipolygon
from quarterdeck.geo.triangulation import Triangulation
from quarterdeck.geo.visibility import DISC_SIDES, visibility_polygons

LOOK = 32  # guards, between two looks at the limit
MANY = 2048  # views: more are united box by box,
A_BOX = 128  # each with about so many guards in it
TOLERANCE = 1e-9  # of the target's area: less than this uncovered is rounding


def uncovered(space: Space, views: np.ndarray) -> MultiPolygon:
    """Return the part of the target in none of the views; empty if it is less than TOLERANCE of it."""
    if len(views) <= MANY:
        rest = as_multipolygon(space.target.difference(shapely.union_all(views)))
    else:
        rest = as_multipolygon(shapely.union_all(_left(space.target, views)))
    return MultiPolygon() if rest.area <= TOLERANCE * space.target.area else rest


def _left(target: MultiPolygon, views: np.ndarray) -> list[shapely.Geometry]:
    """Return what of the target is in none of the views, box by box: one union of thousands cannot be abandoned."""
    tree = shapely.STRtree(views)
    west, south, east, north = target.bounds
    side = int(np.ceil(np.sqrt(len(views) / A_BOX)))
    x, y = np.linspace(west, east, side + 1), np.linspace(south, north, side + 1)
    left = []
    for i in range(side):
        for j in range(side):
            go_on("the proof that guards see everything")
            box = shapely.box(x[i], y[j], x[i + 1], y[j + 1])
            near = views[np.sort(tree.query(box, predicate="intersects"))]
            left.append(target.intersection(box).difference(shapely.union_all(near)))
    return left


def mend(space: Space, mesh: Triangulation, guards: np.ndarray, reach: float) -> tuple[np.ndarray, MultiPolygon]:
    """Add guards until the target is seen; return all (k, 2) guards and what cannot be seen from where robots may be.

    Sight is mutual: where a guard may stand to see a place is what that place sees, within reach of the robots.
    """
    views = visibility_polygons(mesh, guards, reach)
    missed, within = uncovered(space, views), _within_sight(space, reach)
    rest = list(as_multipolygon(missed.intersection(within)).geoms)
    hopeless = list(as_multipolygon(missed.difference(within)).geoms)
    smallest = (reach / 64) ** 2
    inner = as_multipolygon(space.reach.buffer(-2 * HAIR))
    standing = inner if inner.area > 0.5 * space.reach.area else space.reach
    for turn in count():
        if not rest:
            break
        if turn % LOOK == LOOK - 1:
            go_on("the search for guards of what is not seen yet")
        piece = rest.pop(int(np.argmax(shapely.area(rest))))
        place = np.array(shapely.get_coordinates(shapely.point_on_surface(piece))[0])
        region = visibility_polygons(mesh, place, reach * (1 - 1e-3))[0].intersection(standing)
        if region.area > 0:
            found = space.kept(_places(region, piece))
            found = found[shapely.contains_xy(space.reach, found[:, 0], found[:, 1])]
            seen = visibility_polygons(mesh, found, reach)
            gains = shapely.area(shapely.intersection(seen, piece))
            best = int(np.argmax(gains)) if len(found) else -1
            # Every guard sees a whole piece or a fair area: else the rim of what can be seen would take ever more.
            if best >= 0 and (gains[best] > smallest or gains[best] >= piece.area * (1 - 1e-6)):
                guards = np.vstack([guards, found[best]])
                left = shapely.difference(np.array([*rest, piece], dtype=object), seen[best])
                rest = [p for g in left for p in as_multipolygon(g).geoms]
                if shapely.area(rest).sum() <= 0.5 * TOLERANCE * space.target.area:
                    break
                continue
        west, south, east, north = piece.bounds
        finest = reach / 64 if shapely.area(hopeless).sum() <= TOLERANCE * space.target.area else reach / 8  # no proof then
        if max(east - west, north - south) > finest:
            rest += _quarters(piece)
        else:
            hopeless.append(piece)
    lost = as_multipolygon(shapely.union_all(hopeless))
    return guards, MultiPolygon() if lost.area <= TOLERANCE * space.target.area else lost


def _within_sight(space: Space, reach: float) -> MultiPolygon:
    """Return what might be seen: no farther than `reach` from where robots may be, in a part of sight that has them."""
    parts = shapely.get_parts(space.sight)
    near = shapely.union_all(parts[shapely.intersects(parts, space.reach)])
    return as_multipolygon(near.intersection(space.reach.buffer(1.01 * reach)))


def _quarters(piece: shapely.Polygon) -> list[shapely.Polygon]:
    west, south, east, north = piece.bounds
    x, y = (west + east) / 2, (south + north) / 2
    boxes = [shapely.box(*b) for b in ((west, south, x, y), (x, south, east, y), (west, y, x, north), (x, y, east, north))]
    return [p for box in boxes for p in as_multipolygon(piece.intersection(box)).geoms]


def _places(region: shapely.Geometry, piece: shapely.Polygon) -> np.ndarray:
    """Return places to stand: the region's heart, and the ones nearest to the piece and between."""
    heart = shapely.get_coordinates(shapely.point_on_surface(region))[0]
    near = shapely.get_coordinates(shapely.shortest_line(region, piece.centroid))[0]
    places = [heart, near]
    corners = shapely.get_coordinates(region)
    places += [
        heart + (corner - heart) * share for corner in corners[:: max(1, len(corners) // 8)] for share in (0.5, 0.98)
    ]
    return np.array(places)


def uncovered_by_shadows(target: MultiPolygon, sight: MultiPolygon, guards: np.ndarray, ranges: np.ndarray) -> MultiPolygon:
    """Return what of the target (k, 2) guards with (k,) ranges do not see, without any triangulation."""
    rings = [r for p in sight.geoms for r in (p.exterior, *p.interiors)]
    corners = [shapely.get_coordinates(r) for r in rings]
    walls = np.concatenate([np.stack([c[:-1], c[1:]], axis=1) for c in corners])
    tree = shapely.STRtree(shapely.linestrings(walls))
    views = []
    for guard, reach in zip(guards, ranges, strict=True):
        angle = np.linspace(0.0, 2 * np.pi, DISC_SIDES, endpoint=False)
        disc = shapely.Polygon(guard + reach * np.column_stack([np.cos(angle), np.sin(angle)]))
        near = tree.query(shapely.Point(guard), predicate="dwithin", distance=reach)
        views.append(disc.difference(shapely.union_all(_shadows(guard, walls[np.sort(near)], reach))))
    return as_multipolygon(target.difference(shapely.union_all(views)))


def _shadows(guard: np.ndarray, walls: np.ndarray, reach: float) -> np.ndarray:
    """Return the polygons that walls (n, 2, 2) hide from a guard, at least as far as its range."""
    along = walls[:, 1] - walls[:, 0]
    foot = np.clip(((guard - walls[:, 0]) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
    middle = walls[:, 0] + foot[:, None] * along  # cut there, no half is seen under more than a right angle
    halves = np.concatenate([np.stack([walls[:, 0], middle], axis=1), np.stack([middle, walls[:, 1]], axis=1)])
    halves = halves[(halves[:, 0] != halves[:, 1]).any(axis=1)]
    away = halves - guard
    far = guard + away * np.maximum(1.0, 3 * reach / np.linalg.norm(away, axis=2, keepdims=True))
    return shapely.make_valid(shapely.polygons(np.concatenate([halves, far[:, ::-1]], axis=1)))
