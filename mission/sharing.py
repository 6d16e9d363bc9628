"""Sharing survey lines out among vehicles that are under way, so that all are done at about the same time."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely
from shapely import LineString
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring

from quarterdeck.geo.scenario import Vehicle

SPECK = 1e-3  # m: a shorter line is a rounding error
ROUNDS = 24  # of bisection: the level is found to a ten-millionth of the first guess


def remaining_parts(line: np.ndarray, done: BaseGeometry, reach: BaseGeometry | None = None) -> list[np.ndarray]:
    """Return the parts of an (n, 2) line outside `done` and, where given, inside `reach`, in the order of the line.

    Worked out leg by leg: a line may cross itself, and run out and back on itself.
    """
    legs = shapely.difference(shapely.linestrings(np.stack([line[:-1], line[1:]], axis=1)), done)
    legs = legs if reach is None else shapely.intersection(legs, reach)
    parts: list[list[np.ndarray]] = []
    for (a, b), leg in zip(pairwise(line), legs, strict=True):
        pieces = [
            np.array(g.coords) for g in getattr(leg, "geoms", [leg]) if g.geom_type == "LineString" and not g.is_empty
        ]
        pieces = [p if np.dot(p[-1] - p[0], b - a) >= 0 else p[::-1] for p in pieces]
        for piece in sorted(pieces, key=lambda p: float(np.dot(p[0] - a, b - a))):
            if parts and np.allclose(parts[-1][-1], piece[0], atol=1e-6):
                parts[-1].extend(piece[1:])
            else:
                parts.append(list(piece))
    return [np.array(p) for p in parts]


def share_out(
    vehicles: Sequence[Vehicle], own: Sequence[Sequence[np.ndarray]], released: Sequence[np.ndarray], *, crumb: float
) -> list[list[np.ndarray]]:
    """Return each vehicle's (n, 2) lines in metres: its own in order, less what it gives away, then what it takes over.

    The least level of finishing times is sought, by bisection, at which what those above it give away, and the released
    lines, fit into the time of those below it. No piece is cut shorter than `crumb` metres.
    """
    least = float(crumb)
    if not any(len(o) for o in own) and not released:
        return [[] for _ in vehicles]
    slowest = min(v.speed for v in vehicles)
    everything = [*released, *(line for lines in own for line in lines)]
    reach = shapely.total_bounds([LineString(line) for line in everything] + [shapely.Point(v.start) for v in vehicles])
    across = float(np.hypot(reach[2] - reach[0], reach[3] - reach[1]))
    high = (sum(_length(line) for line in everything) + (len(everything) + 2) * across) / slowest
    low, best = 0.0, None
    for _ in range(ROUNDS):
        level = (low + high) / 2 if best is not None else high
        shared = _shared_at(level, vehicles, own, released, least)
        if shared is None:
            low, high = level, high if best is not None else 2 * high
        else:
            high, best = level, shared
    if best is None:
        raise RuntimeError("survey lines could not be shared out")
    return best


def _shared_at(
    level: float,
    vehicles: Sequence[Vehicle],
    own: Sequence[Sequence[np.ndarray]],
    released: Sequence[np.ndarray],
    least: float,
) -> list[list[np.ndarray]] | None:
    """Return the lines if all can be done within `level` seconds, or None."""
    lines, pool = [list(o) for o in own], list(released)
    for vehicle, mine in zip(vehicles, lines, strict=True):
        pool += _given_away(vehicle, mine, level, least)
    for i in sorted(range(len(vehicles)), key=lambda i: _time(vehicles[i], lines[i])):
        _take(vehicles[i], lines[i], pool, level, least)
    return lines if not pool else None


def _given_away(vehicle: Vehicle, mine: list[np.ndarray], level: float, least: float) -> list[np.ndarray]:
    """Cut from the end of a vehicle's lines what it cannot do within `level`; return it."""
    given = []
    while mine and (excess := (_time(vehicle, mine) - level) * vehicle.speed) > 0:
        line = LineString(mine[-1])
        if line.length - excess < least:
            given.append(mine.pop())
        else:
            cut = min(line.length - excess, line.length - least)
            if cut < least:
                given.append(mine.pop())
                continue
            given.append(_part(line, cut, line.length))
            mine[-1] = _part(line, 0.0, cut)
            break
    return given


def _take(vehicle: Vehicle, mine: list[np.ndarray], pool: list[np.ndarray], level: float, least: float) -> None:
    """Move from the pool to a vehicle's lines, nearest end first, what it can do within `level`."""
    while pool:
        here = mine[-1][-1] if mine else np.array(vehicle.start)
        ends = np.array([[np.hypot(*(p[0] - here)), np.hypot(*(p[-1] - here))] for p in pool])
        chosen, end = np.unravel_index(int(ends.argmin()), ends.shape)
        piece = pool[chosen] if end == 0 else pool[chosen][::-1]
        room = level * vehicle.speed
        whole = _time(vehicle, [*mine, piece]) * vehicle.speed
        line = LineString(piece)
        if whole <= room:
            mine.append(piece)
            pool.pop(chosen)
            continue
        cut = line.length - (whole - room) / 2  # what is not driven there is not driven back from either, at the most
        while cut >= least and _time(vehicle, [*mine, _part(line, 0.0, cut)]) * vehicle.speed > room:
            cut -= max(least / 2, 0.05 * line.length)
        if cut < least or line.length - cut < least:
            return
        mine.append(_part(line, 0.0, cut))
        pool[chosen] = _part(line, cut, line.length)
        return


def _time(vehicle: Vehicle, lines: Sequence[np.ndarray]) -> float:
    """Return the seconds along straight ways over the lines and home: what the balance goes by."""
    here, metres = np.array(vehicle.start), 0.0
    for line in lines:
        metres += float(np.hypot(*(line[0] - here))) + _length(line)
        here = line[-1]
    home = float(np.hypot(*(np.array(vehicle.home) - here))) if vehicle.returns else 0.0
    return (metres + home) / vehicle.speed


def _length(line: np.ndarray) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def _part(line: LineString, start: float, end: float) -> np.ndarray:
    return np.array(substring(line, start, end).coords)
