"""Where the UGVs search: the field divided between them, a spanning tree tour for each, and what the tours leave out.

Division and tours are those of coverage (paper, Sec. V-A: DARP). A tour keeps to whole hypervertices, so strips along
borders and nooks are left; of these, what no sensor on the tours passes is visited from the nearest place of a tour.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import shapely
from shapely import MultiPolygon, Point
from shapely.ops import nearest_points

from quarterdeck.coverage.division import distinct_entries, divide
from quarterdeck.coverage.parts import connected_parts
from quarterdeck.coverage.tour import tours
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.grid import lay_grid
from quarterdeck.geo.scenario import as_multipolygon
from quarterdeck.mission.triage.chase import Ways
from quarterdeck.mission.triage.records import XY

MOST_CELLS = 500_000  # of the field's box: what sensors see along so long a path is still worked out in seconds
_SEEN = 0.99  # of the sensing range counts: round ends of a track's swath are drawn with corners
_ROUNDS = 4  # of visiting what is still missed; three times as many in what is left of a field
_SPECK = 1e-3  # of the sensing range's square: nobody lies hidden in less


@dataclass(frozen=True, slots=True)
class Search:
    """The search of each UGV: `paths` (n, 2) corners in metres; `missed` m2 of the field that no sensor passes."""

    paths: tuple[np.ndarray, ...]
    missed: float


@lru_cache(maxsize=64)
def search_paths(
    field: MultiPolygon,
    free: MultiPolygon,
    starts: tuple[XY, ...],
    spacing: float,
    sees: float,
    ways: Ways,
    *,
    rest: bool = False,
) -> Search:
    """Divide the field between UGVs at `starts` and return the path of each, from its start on.

    Of a field that is the `rest` of one, crumbs and strips are looked at in passing, from outside where need be.

    `free` is where their reference points may be; lanes are `spacing` metres apart, sensors reach `sees` metres. Raises
    InputError if no UGV can search any of it.
    """
    room = as_multipolygon(free.intersection(field))
    paths = _tours(room, starts, spacing) if not room.is_empty else None
    if paths is not None:  # to where a tour begins, around what is in between
        entries = [ways(start, (float(p[0, 0]), float(p[0, 1])))[:-1] for start, p in zip(starts, paths, strict=True)]
        paths = tuple(np.array([*entry, *path]) for entry, path in zip(entries, paths, strict=True))
    if paths is None and rest:
        paths = tuple(np.array([start]) for start in starts)
    if paths is None:
        raise InputError("the UGVs can enter no part of the field; check the obstacles and the vehicles' clearance")
    missed = _missed(field, paths, starts, sees)
    speck = max(1e-6 * field.area, _SPECK * sees**2)
    least, best = missed.area, paths
    for _ in range(3 * _ROUNDS if rest else _ROUNDS):
        if least < speck:
            break
        paths = _with_visits(paths, _places(missed, free if rest else room, sees), ways)
        missed = _missed(field, paths, starts, sees)  # it may grow at first: a detour leaves the leg that it is put into
        if missed.area < least:
            least, best = missed.area, paths
    return Search(best, float(least) if least >= speck else 0.0)


def _tours(room: MultiPolygon, starts: tuple[XY, ...], spacing: float) -> tuple[np.ndarray, ...] | None:
    """Return a tour for each UGV over the largest connected part of the room; the lanes halve until it has enough."""
    box = (room.bounds[2] - room.bounds[0]) * (room.bounds[3] - room.bounds[1])
    if box > MOST_CELLS * spacing**2:
        raise InputError(
            f"spacing {spacing:g} m makes {box / spacing**2:,.0f} cells of the field, more than {MOST_CELLS:,}; "
            f"at least {(box / MOST_CELLS) ** 0.5:.3g} m works"
        )
    for finer in range(5):
        step = spacing / 2**finer
        if box > MOST_CELLS * step**2:
            break
        grid = lay_grid(room, step, 0.0, (room.bounds[0], room.bounds[1]))
        parts, count = connected_parts(grid.hypervertices)
        sizes = [int((parts == p).sum()) for p in range(count)]
        if max(sizes, default=0) >= len(starts):
            free = parts == int(np.argmax(sizes))
            # in hypervertices; a start on the border is a hair outside it
            at = (np.array(starts) - np.array(grid.origin))[:, ::-1] / (2.0 * step)
            entries = distinct_entries(free, at)
            walks = tours(divide(free, entries).labels, entries)
            return tuple(_corners(grid.centres(w)) for w in walks)
    return None


def _missed(field: MultiPolygon, paths: tuple[np.ndarray, ...], starts: tuple[XY, ...], sees: float) -> MultiPolygon:
    """Return what of the field no sensor passes."""
    lines = [shapely.LineString(np.vstack([start, path])) for start, path in zip(starts, paths, strict=True)]
    swaths = [line.buffer(_SEEN * sees, quad_segs=16) for line in lines]
    return as_multipolygon(field.difference(shapely.union_all(swaths)))


def _places(missed: MultiPolygon, room: MultiPolygon, sees: float) -> list[XY]:
    """Return places in the room to see what was missed from: a lattice over each piece, and a point of it."""
    places = []
    for piece in missed.geoms:
        x0, y0, x1, y1 = piece.bounds
        gx, gy = np.meshgrid(np.arange(x0 + sees / 2, x1, sees), np.arange(y0 + sees / 2, y1, sees))
        lattice = np.column_stack([gx.ravel(), gy.ravel()])
        inside = lattice[shapely.contains_xy(piece, *lattice.T)] if len(lattice) else lattice
        seen_from = piece.representative_point()
        for x, y in [*inside.tolist(), (seen_from.x, seen_from.y)]:
            near = nearest_points(room, Point(x, y))[0]
            places.append((float(near.x), float(near.y)))
    return list(dict.fromkeys(places))


def _with_visits(paths: tuple[np.ndarray, ...], places: list[XY], ways: Ways) -> tuple[np.ndarray, ...]:
    """Return the paths with each place put in where it lengthens them least; what cannot be reached is left out."""
    routes = [[(float(x), float(y)) for x, y in path] for path in paths]
    for place in places:
        best = (np.inf, 0, 0)
        for i, route in enumerate(routes):
            xy = np.array(route)
            apart = np.hypot(*(xy - place).T)
            detour = np.append(apart[:-1] + apart[1:] - np.hypot(*np.diff(xy, axis=0).T), apart[-1])
            k = int(detour.argmin())
            best = min(best, (float(detour[k]), i, k))
        _, i, k = best
        try:
            around = [*ways(routes[i][k], place)]
            if k + 1 < len(routes[i]):
                around += ways(place, routes[i][k + 1])[:-1]
        except InputError:
            continue
        routes[i][k + 1 : k + 1] = around
    return tuple(_corners(np.array(r)) for r in routes)


def _corners(path: np.ndarray) -> np.ndarray:
    """Leave out the points of a path at which it goes straight on, or stays."""
    moves = np.hypot(*np.diff(path, axis=0).T) > 1e-9
    path = path[np.concatenate([[True], moves])]
    if len(path) < 3:
        return path
    d = np.diff(path, axis=0)
    turn = np.abs(d[:-1, 0] * d[1:, 1] - d[:-1, 1] * d[1:, 0]) > 1e-9
    back = (d[:-1] * d[1:]).sum(axis=1) < 0
    return path[np.concatenate([[True], turn | back, [True]])]
