"""What tracks cover and cost: percentage of coverage by two measures, turns, length, overlap."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Geometry, LineString, MultiPolygon, STRtree

from quarterdeck.geo.grid import Grid
from quarterdeck.geo.scenario import as_multipolygon


@dataclass(frozen=True, slots=True)
class Figures:
    """What tracks come to (ecdis-sa-darp, Tables I and II).

    `poc` is the share of the area within half the spacing of a track, round at its ends: the honest measure. `cell_poc` is
    the paper's: path cells visited, each counted whole, over the area; it may exceed 1. `turns` are changes of direction,
    `length` metres, both also per 1000 m2 of the area. `overlap` is the length beyond what would cover as much without
    any overlap: length x spacing / covered - 1.
    """

    poc: float
    cell_poc: float
    turns: int
    length: float
    turns_per_1000_m2: float
    length_per_1000_m2: float
    overlap: float


def measure(tracks: Sequence[np.ndarray], area: MultiPolygon, grid: Grid) -> Figures:
    """Return the figures of `tracks`, (n, 2) polylines in metres, over `area` (obstacles taken out)."""
    spacing, total = grid.spacing, area.area
    covered = total - uncovered(tracks, area, spacing).area
    length = sum(track_length(t) for t in tracks)
    turns = sum(count_turns(t) for t in tracks)
    return Figures(
        poc=covered / total,
        cell_poc=_visited(tracks, grid) * spacing**2 / total,
        turns=turns,
        length=length,
        turns_per_1000_m2=1000.0 * turns / total,
        length_per_1000_m2=1000.0 * length / total,
        overlap=length * spacing / covered - 1.0 if covered > 0 else 0.0,
    )


def covered_fraction(tracks: Sequence[np.ndarray], area: MultiPolygon, spacing: float) -> float:
    """Return the part of `area` within half of `spacing` of a track, from 0 to 1; 0 where there is nothing to cover."""
    return 1.0 - uncovered(tracks, area, spacing).area / area.area if area.area > 0 and len(tracks) else 0.0


def uncovered(tracks: Sequence[np.ndarray], area: MultiPolygon, spacing: float) -> MultiPolygon:
    """Return the part of `area` farther than half of `spacing` from every track."""
    return as_multipolygon(shapely.difference(area, swath(tracks, spacing), grid_size=1e-6 * spacing))


def swath(tracks: Sequence[np.ndarray], spacing: float) -> Geometry:
    """Return what is within half of `spacing` of the tracks: their straight pieces buffered one by one, then united.

    Arcs are simplified by a thousandth of the spacing. A circle is a polygon of 64 sides within it, so that the area is not
    overstated. The union needs its precision grid: without one GEOS 3.14 silently loses up to a fifth of the area of plain
    lattice tours.
    """
    lines = [np.asarray(t, dtype=float).reshape(-1, 2) for t in tracks if len(t)]
    lines = [shapely.get_coordinates(shapely.simplify(LineString(t), 1e-3 * spacing)) if len(t) > 1 else t for t in lines]
    pieces = [straight_pieces(t) for t in lines]
    if not pieces:
        return MultiPolygon()
    capsules = shapely.buffer(shapely.linestrings(np.concatenate(pieces)), spacing / 2.0, quad_segs=16)
    return shapely.union_all(capsules, grid_size=1e-6 * spacing)


def straight_pieces(track: np.ndarray) -> np.ndarray:
    """Return the (m, 2, 2) straight pieces of an (n, 2) polyline, repeated points and collinear vertices left out."""
    track = np.asarray(track, dtype=float).reshape(-1, 2)
    track = track[np.append(True, (np.diff(track, axis=0) != 0).any(axis=1))[: len(track)]]
    if len(track) == 1:
        return np.stack([track, track], axis=1)
    corners = track[np.concatenate([[True], np.abs(_bends(track)) > STRAIGHT, [True]])] if len(track) else track
    return np.stack([corners[:-1], corners[1:]], axis=1)


STRAIGHT = 1e-6  # radians; a smaller change of direction is none


def _bends(track: np.ndarray) -> np.ndarray:
    """Return the (n - 2,) changes of direction at the inner vertices in radians."""
    step = np.diff(track, axis=0)
    heading = np.arctan2(step[:, 1], step[:, 0])
    return np.mod(np.diff(heading) + np.pi, 2 * np.pi) - np.pi


def count_turns(track: np.ndarray) -> int:
    """Return the changes of direction along an (n, 2) polyline; where it is closed, that at its first point too."""
    pieces = straight_pieces(track)
    if len(pieces) < 2:
        return 0
    closing = (pieces[0, 0] == pieces[-1, 1]).all() and abs(_bends(np.vstack([pieces[-1], pieces[0, 1:]]))[0]) > STRAIGHT
    return len(pieces) - 1 + int(closing)


def track_length(track: np.ndarray) -> float:
    """Return the metres along an (n, 2) polyline."""
    return float(np.linalg.norm(np.diff(np.asarray(track, dtype=float).reshape(-1, 2), axis=0), axis=1).sum())


def _visited(tracks: Sequence[np.ndarray], grid: Grid) -> int:
    """Return how many free path cells have a track through their centre."""
    pieces = [p for t in tracks for p in (straight_pieces(t),) if len(p)]
    if not pieces:
        return 0
    tree = STRtree(shapely.points(grid.centres(np.argwhere(grid.cells))))
    hits = tree.query(shapely.linestrings(np.concatenate(pieces)), predicate="dwithin", distance=1e-6 * grid.spacing)
    return len(np.unique(hits[1]))
