"""Few guards that see everything: set cover over places to stand and witnesses, refined until the exact area is zero.

Witnesses are points; covering them covers the area but for slivers. Each round looks at what is exactly left, makes
witnesses of it and covers again, as the exact methods for the art gallery problem do (de Rezende et al. 2016). Whatever a
round finds is completed and pruned by exact area, so that the best is always a proved cover.
"""

import numpy as np
import shapely
from scipy.sparse import csr_array, vstack

from quarterdeck.coverage.guards.certificate import TOLERANCE
from quarterdeck.coverage.guards.cover import small_cover
from quarterdeck.coverage.guards.space import HAIR, Space
from quarterdeck.geo.deadline import go_on, time_is_up
from quarterdeck.geo.scenario import as_multipolygon
from quarterdeck.geo.triangulation import Triangulation
from quarterdeck.geo.visibility import DISC_SIDES, visibility_polygons, visible_points

PLACES = 2200  # about so many places to stand
WITNESSES = 2500  # about so many points to see at first
ROUNDS = 60
STEPS = 6000  # exchanges a round
PATIENCE = 15  # rounds without a better cover


def fewer_guards(space: Space, mesh: Triangulation, guards: np.ndarray, reach: float, *, seed: int = 0) -> np.ndarray:
    """Return at most as many (k, 2) guards as given that see the target, within `reach` metres, as those do.

    `mesh` triangulates the space's sight. The same seed gives the same guards.
    """
    places = _places(space, guards, reach)
    views = _Views(mesh, places, reach)
    enough = 0.5 * TOLERANCE * space.target.area
    witnesses = _witnesses(space, reach)
    covers = _sees(mesh, places, witnesses, reach)
    chosen = np.empty(0, dtype=np.int64)
    best, stale = guards, 0
    for turn in range(ROUNDS):
        if time_is_up("the search for fewer guards"):
            break
        chosen = small_cover(covers, chosen, STEPS, seed=seed + turn)
        rest = as_multipolygon(space.target.difference(shapely.union_all(views.of(chosen))))
        if rest.area > enough and len(chosen) < len(best):
            more = _from(rest)
            covers = vstack([covers, _sees(mesh, places, more, reach)], format="csr")
        full = _completed(views, chosen, rest, enough)
        if full is not None and len(full) < len(best) + 12:
            kept = places[full[~needless(space.target, views.of(full))]]
            if len(kept) < len(best):
                best, stale = kept, 0
        stale += 1
        if rest.area <= enough or len(chosen) >= len(best) or stale > PATIENCE:
            break
    return best if best is not guards else guards[~needless(space.target, visibility_polygons(mesh, guards, reach))]


class _Views:
    """The exact views from places to stand, made when first asked for."""

    def __init__(self, mesh: Triangulation, places: np.ndarray, reach: float) -> None:
        self.mesh, self.places, self.reach = mesh, places, reach
        self.made = np.full(len(places), None, dtype=object)

    def of(self, indices: np.ndarray) -> np.ndarray:
        """Return the (k,) views."""
        missing = np.array([i for i in indices if self.made[i] is None], dtype=np.int64)
        if len(missing):
            self.made[missing] = visibility_polygons(self.mesh, self.places[missing], self.reach)
        return self.made[indices]


def _places(space: Space, guards: np.ndarray, reach: float) -> np.ndarray:
    """Return (n, 2) places to stand: the guards, a lattice, and beside every corner."""
    step = max(reach / 5, np.sqrt(space.reach.area / PLACES))
    inner = space.reach.buffer(-HAIR, join_style="mitre")
    corners = shapely.get_coordinates(inner if not inner.is_empty else space.reach)
    found = np.concatenate([_lattice(space.reach, step), corners[: 4 * PLACES]])
    found = space.kept(np.unique(np.round(found, 6), axis=0))
    found = found[shapely.contains_xy(space.reach, found[:, 0], found[:, 1])]
    return np.concatenate([guards, found])


def _lattice(polygon: shapely.MultiPolygon, step: float) -> np.ndarray:
    """Return the points of a triangular lattice in a polygon."""
    west, south, east, north = polygon.bounds
    x, y = np.meshgrid(np.arange(west + step / 2, east, step), np.arange(south + step / 2, north, step * np.sqrt(3) / 2))
    x[1::2] += step / 2
    points = np.column_stack([x.ravel(), y.ravel()])
    return points[shapely.contains_xy(polygon, points[:, 0], points[:, 1])]


def _witnesses(space: Space, reach: float) -> np.ndarray:
    """Return (n, 2) points to see: a lattice, beside every corner, and along the edges."""
    inner = space.target.buffer(-HAIR, join_style="mitre")
    rim = inner if not inner.is_empty else space.target
    step = max(reach / 6, np.sqrt(space.target.area / WITNESSES))
    return np.concatenate([_lattice(space.target, step), shapely.get_coordinates(rim.segmentize(step))])


def _sees(mesh: Triangulation, places: np.ndarray, witnesses: np.ndarray, reach: float) -> csr_array:
    """Return the (witnesses, places) matrix of what surely sees what: within the inscribed polygon's own circle."""
    starts, seen = visible_points(mesh, witnesses, reach * np.cos(np.pi / DISC_SIDES), places)
    return csr_array((np.ones(len(seen), dtype=np.int8), seen, starts), shape=(len(witnesses), len(places)))


def _from(rest: shapely.MultiPolygon) -> np.ndarray:
    """Return witnesses in what is left: the heart of each piece, and of large ones the corners too."""
    pieces = np.array(rest.geoms)
    pieces = pieces[np.argsort(-shapely.area(pieces), kind="stable")[:150]]
    hearts = shapely.get_coordinates(shapely.point_on_surface(pieces))
    corners, of = shapely.get_coordinates(pieces[:30], return_index=True)
    return np.concatenate([hearts, corners + 0.02 * (hearts[of] - corners)])


def _completed(views: _Views, chosen: np.ndarray, rest: shapely.MultiPolygon, enough: float) -> np.ndarray | None:
    """Return the chosen places and, greedily, those that see what is left; None if that takes too many."""
    full = list(chosen)
    while rest.area > enough:
        if len(full) > len(chosen) + 12:
            return None
        piece = max(rest.geoms, key=lambda g: g.area)
        heart = shapely.get_coordinates(shapely.point_on_surface(piece))
        _, near = visible_points(views.mesh, heart, views.reach, views.places)
        if not len(near):
            return None
        away = np.linalg.norm(views.places[near] - heart, axis=1)
        near = near[np.argsort(away, kind="stable")[:: max(1, len(near) // 25)]]
        gains = shapely.area(shapely.intersection(views.of(near), rest))
        if gains.max() <= 0:
            return None
        full.append(near[np.argmax(gains)])
        rest = as_multipolygon(rest.difference(views.made[full[-1]]))
    return np.array(full, dtype=np.int64)


def needless(target: shapely.MultiPolygon, views: np.ndarray) -> np.ndarray:
    """Return (k,) bool: views that can go together and nothing of the target is lost; those that see least alone first."""
    seen = shapely.intersection(views, target)
    tree = shapely.STRtree(views)
    present = np.ones(len(views), dtype=np.bool_)

    def alone(i: int) -> float:
        go_on("the search for guards that are not needed")
        near = tree.query(views[i], predicate="intersects")
        others = np.sort(near[present[near] & (near != i)])
        return float(seen[i].difference(shapely.union_all(views[others])).area)

    spent = 0.0
    for i in np.argsort([alone(i) for i in range(len(views))], kind="stable"):
        lost = alone(i)
        if spent + lost <= 0.1 * TOLERANCE * target.area:
            present[i] = False
            spent += lost
    return ~present
