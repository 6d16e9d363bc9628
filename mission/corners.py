"""Corners that a vehicle can drive: arcs of its turn radius where they fit, Dubins curves where they do not."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely import LineString, MultiPolygon

from quarterdeck.geo.dubins import CHORD, dubins_paths
from quarterdeck.mission.mission import Leg

COARSE = math.radians(30.0)  # between the waypoints of a curve: 3.4 % of the radius off it, and autopilots hold few
PACES = (1.0, 0.5, 0.25)  # parts of full speed at which a curve is tried
BACKS = (0.0, 1.0, 2.0, 3.0)  # radii before the corner at which a curve may begin
REVERSAL = math.radians(150.0)  # a sharper bend is driven past, and come back to on a curve


@dataclass(frozen=True, slots=True)
class Driven:
    """A path with its turns: (n, 2) metres, the kind of each leg, its speed as a part of the vehicle's (a tighter curve is
    driven slower), and `stops` (n,) bool, the corners for which no curve has room: there it turns on the spot.
    """

    points: np.ndarray
    legs: list[Leg]
    pace: np.ndarray
    stops: np.ndarray


def with_turns(points: np.ndarray, legs: Sequence[Leg], radius: float, space: MultiPolygon) -> Driven:
    """Put a Dubins curve, of legs `turn`, wherever an arc of `radius` metres does not fit between two legs.

    `points` (n, 2) metres, `legs[i]` ends at point i; curves stay inside `space`. Where one at full speed has no room, one
    at half or a quarter of it, and of the radius, may. Corners that an arc rounds need nothing: the vehicle cuts them. Of
    two corners that are too near to each other, one curve makes both.
    """
    points = np.asarray(points, dtype=float)
    if radius <= 0 or len(points) < 3:
        return Driven(points, list(legs), np.ones(len(points)), np.zeros(len(points), dtype=bool))
    heading, bend, length = bends(points)
    reversal = np.abs(bend) > REVERSAL
    tangent = np.where(reversal, 0.0, radius * np.tan(np.abs(bend) / 2))
    crowded = tangent[:-1] + tangent[1:] > length + 1e-9
    shapely.prepare(space)
    out, kinds, pace, stops = [points[0]], [legs[0]], [1.0], [False]
    i = 1
    while i < len(points):
        out.append(points[i])
        kinds.append(legs[i])
        pace.append(1.0)
        stops.append(False)
        last = i == len(points) - 1
        if last or not (reversal[i] or crowded[i - 1] or crowded[i]) or abs(bend[i]) < 1e-6:
            i += 1
            continue
        j = i + 1 if crowded[i] and not reversal[i] and i + 2 < len(points) and abs(bend[i + 1]) > 1e-6 else i
        part, curve = _curve(points, heading, length, i, j, radius, space)
        if curve is None:
            stops[-1] = True
            i += 1
            continue
        out[-1] = curve[0]
        out += list(curve[1:])
        kinds.extend(["turn"] * (len(curve) - 1))
        pace += [part] * (len(curve) - 1)
        stops += [False] * (len(curve) - 1)
        i = j + 1
    return Driven(np.array(out), kinds, np.array(pace), np.array(stops))


def _curve(
    points: np.ndarray, heading: np.ndarray, length: np.ndarray, i: int, j: int, radius: float, space: MultiPolygon
) -> tuple[float, np.ndarray | None]:
    """Return the pace and the (m, 2) points of a curve inside `space` from the leg before corner i to that after corner j.

    It begins at the corner or, where there is no room beyond it, some radii before, and ends as far after.
    """
    into, out_of = (np.array([math.cos(h), math.sin(h)]) for h in (heading[i - 1], heading[j]))
    for part in PACES:
        for back in BACKS:
            off = back * part * radius
            if off > 0.8 * min(length[i - 1], length[j]):
                break
            start, goal = points[i] - off * into, points[j] + off * out_of
            for curve in dubins_paths((*start, heading[i - 1]), (*goal, heading[j]), part * radius, COARSE):
                if space.covers(LineString(curve)):
                    return part, curve
    return 1.0, None


def entered(path: Driven, heading: float, radius: float, space: MultiPolygon) -> Driven:
    """Return the path begun with a curve, where one has room, from `heading` radians at its first point into its first leg.

    `radius` metres and `space` as in `with_turns`.
    """
    if radius <= 0 or len(path.points) < 2:
        return path
    start, step = path.points[0], path.points[1] - path.points[0]
    length, course = float(np.hypot(*step)), math.atan2(step[1], step[0])
    if length == 0 or abs((course - heading + math.pi) % math.tau - math.pi) < COARSE:
        return path
    for part in PACES:
        for off in (*(n * part * radius for n in (4, 3, 2, 1)), length):
            goal = start + min(off, length) / length * step
            for curve in dubins_paths((*start, heading), (*goal, course), part * radius, COARSE):
                if space.covers(LineString(curve)):
                    new = len(curve) - 1
                    return Driven(
                        np.concatenate([path.points[:1], curve[1:], path.points[1:]]),
                        [path.legs[0], *["turn"] * new, *path.legs[1:]],  # type: ignore[list-item]
                        np.concatenate([path.pace[:1], np.full(new, part), path.pace[1:]]),
                        np.concatenate([path.stops[:1], np.zeros(new, dtype=bool), path.stops[1:]]),
                    )
    return path


def driven(points: np.ndarray, radius: float) -> np.ndarray:
    """Return the (m, 2) polyline with the corners of (n, 2) `points` rounded to arcs of `radius` metres where they fit."""
    points = np.asarray(points, dtype=float)
    if radius <= 0 or len(points) < 3:
        return points
    heading, bend, length = bends(points)
    tangent = np.where(np.abs(bend) > REVERSAL, 0.0, radius * np.tan(np.abs(bend) / 2))
    fits = np.abs(bend) <= REVERSAL
    fits[:-1] &= tangent[:-1] + tangent[1:] <= length + 1e-9
    fits[1:] &= tangent[:-1] + tangent[1:] <= length + 1e-9
    out = [points[:1]]
    for i in range(1, len(points) - 1):
        if not fits[i] or abs(bend[i]) < CHORD:
            out.append(points[i : i + 1])
            continue
        side = math.copysign(1.0, bend[i])
        first = points[i] - tangent[i] * np.array([math.cos(heading[i - 1]), math.sin(heading[i - 1])])
        angles = heading[i - 1] + np.linspace(0.0, bend[i], 1 + math.ceil(abs(bend[i]) / CHORD))
        centre = first + side * radius * np.array([-math.sin(heading[i - 1]), math.cos(heading[i - 1])])
        out.append(centre + side * radius * np.column_stack([np.sin(angles), -np.cos(angles)]))
    line = np.concatenate([*out, points[-1:]])
    apart = np.hypot(*np.diff(line, axis=0).T) > 1e-6  # arcs that touch meet in one point
    return line[np.append(True, apart)]


def bends(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (n - 1,) headings of the legs, (n,) turns at the points (0 at the ends), (n - 1,) lengths."""
    step = np.diff(points, axis=0)
    heading = np.arctan2(step[:, 1], step[:, 0])
    bend = np.zeros(len(points))
    bend[1:-1] = (np.diff(heading) + math.pi) % math.tau - math.pi
    return heading, bend, np.hypot(*step.T)
