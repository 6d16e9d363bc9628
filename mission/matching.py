"""Which leg of its route a vehicle was on when: the likeliest run of legs, found by dynamic programming."""

from dataclasses import dataclass

import numpy as np
import shapely
from numba import njit

from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.mission import Mission, Route, unbroken
from quarterdeck.mission.track import Track, at_rest

OFF = 9.0  # what a place far off a leg costs, at the most; one as far off as the tolerance costs 1
JUMP = 10 * OFF  # what going on at any other leg costs: as much as ten places far off
AGAINST = 0.05  # what a place costs where the vehicle goes athwart the leg; twice that, against it
ALIGNED = np.cos(np.radians(30.0))  # along a line of another order is within so much of its direction
MOST = 200_000_000  # places times legs: beyond it fewer places are looked at


@dataclass(frozen=True, slots=True)
class Followed:
    """A track beside its route, (n,) each: `leg` is the number of the waypoint made for, `strayed` too far from the leg to
    survey it, `elsewhere` along another survey line, of whomever's.
    """

    leg: np.ndarray
    strayed: np.ndarray
    elsewhere: np.ndarray


def tolerance(mission: Mission, vehicle: Vehicle) -> float:
    """Return how near to a leg, metres, a vehicle is on it: a quarter of the spacing, or where there is none 2 m or its
    length.
    """
    return mission.spacing / 4.0 if mission.spacing is not None else max(2.0, vehicle.model.length)


def follow(mission: Mission, track: Track) -> Followed:
    """Return the leg of its route that a vehicle was on at each place of its track.

    It surveys on survey legs of its route, and, off its route, along survey lines of anybody's (another order).
    """
    vehicle = mission.vehicle(track.vehicle)
    route = next(r for r in mission.routes if r.vehicle == track.vehicle)
    near = tolerance(mission, vehicle)
    leg = _legs(vehicle, route, track, near)
    away = _away(route, leg, track.xy)
    elsewhere, far = np.zeros(len(leg), bool), np.flatnonzero(away > near)
    lines = [line for r in mission.routes for line in unbroken(r.xyz[:, :2], r.survey)]
    if len(far) and lines:
        elsewhere[far] = _along_any(track, far, lines, near)
    return Followed(leg, away > 2 * near, elsewhere)


def along_lines(mission: Mission, vehicle: Vehicle, track: Track) -> np.ndarray:
    """Return (n,) bool: whether a vehicle that has no route went along a survey line of anybody's."""
    lines = [line for r in mission.routes for line in unbroken(r.xyz[:, :2], r.survey)]
    everywhere = np.arange(len(track.time))
    return _along_any(track, everywhere, lines, tolerance(mission, vehicle)) if lines else np.zeros(len(everywhere), bool)


def off_legs(route: Route, leg: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return metres along the legs (n,), the legs' lengths (n,), and the (n, d) offsets of (n, d) places from them.

    `d` is 2 or 3. Offsets are from the line through a leg, beyond its ends too.
    """
    points = route.xyz[:, : places.shape[1]]
    start, end = points[np.maximum(leg - 1, 0)], points[leg]
    span = end - start
    length = np.linalg.norm(span, axis=1)
    along = np.einsum("ij,ij->i", places - start, span) / np.maximum(length, 1e-9)
    return along, length, places - start - (along / np.maximum(length, 1e-9))[:, None] * span


def planned_time(vehicle: Vehicle, route: Route, track: Track, followed: Followed) -> float:
    """Return when, by the plan, the vehicle would be where its track ends: how far along its route it is, in seconds."""
    if not route.waypoints:
        return 0.0
    last = followed.leg[-1:]
    along, length, _ = off_legs(route, last, _places(vehicle, track)[-1:])
    number = int(last[0])
    a, b = route.waypoints[max(number - 1, 0)], route.waypoints[number]
    part = float(np.clip(along[0] / max(length[0], 1e-9), 0.0, 1.0)) if length[0] > 0 else 1.0
    for corner, w in ((part * length[0], a), ((1.0 - part) * length[0], b)):
        apart = np.hypot(track.x - w.x, track.y - w.y) > HERE
        if w.hold > 0 and corner <= HERE and not apart[-1]:  # it waits: for how long already is told by the track
            first = len(apart) - int(np.argmax(apart[::-1])) if apart.any() else 0
            return float(w.time) + min(w.hold, float(track.time[-1]) - at_rest(track, slice(first, len(apart)), last=False))
    left = a.time + a.hold
    return float(left + part * (b.time - left))


HERE = 2.0  # m: at a waypoint


def _legs(vehicle: Vehicle, route: Route, track: Track, near: float) -> np.ndarray:
    """Return (n,) waypoint numbers; 0 everywhere for a route without legs."""
    places = _places(vehicle, track)
    points = route.xyz[:, : places.shape[1]]
    if len(points) < 2:
        return np.zeros(len(places), np.int64)
    length = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    stride = max(0.5 * vehicle.speed, length * len(points) / MOST)
    kept = _thinned(places, stride)
    picked = places[kept]
    step = np.diff(picked, axis=0, append=picked[-1:])
    step /= np.maximum(np.linalg.norm(step, axis=1), 1e-9)[:, None]
    found = _likeliest(picked, step, np.ascontiguousarray(points), near, stride)
    latest = np.searchsorted(kept, np.arange(len(places)), side="right") - 1
    leg, coming = found[latest] + 1, found[np.minimum(latest + 1, len(kept) - 1)] + 1
    return np.where(_away(route, coming, places) < _away(route, leg, places), coming, leg)


def _places(vehicle: Vehicle, track: Track) -> np.ndarray:
    """Return (n, 3) places of an aerial vehicle whose height is known, else (n, 2)."""
    aerial = vehicle.domain == "aerial" and bool(np.isfinite(track.z).all())
    return np.column_stack([track.x, track.y, track.z]) if aerial else track.xy


def _away(route: Route, leg: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the (n,) distances of (n, d) places from the legs, from one end to the other."""
    along, length, off = off_legs(route, leg, places)
    return np.hypot(np.linalg.norm(off, axis=1), np.maximum(np.maximum(-along, along - length), 0.0))


@njit(cache=True)
def _thinned(places: np.ndarray, stride: float) -> np.ndarray:
    """Return the indices of (n, d) places that are each `stride` metres from the one kept before; the first is."""
    kept = np.empty(len(places), np.int64)
    kept[0] = last = 0
    count = 1
    for i in range(1, len(places)):
        square = 0.0
        for d in range(places.shape[1]):
            square += (places[i, d] - places[last, d]) ** 2
        if square >= stride * stride:
            kept[count] = last = i
            count += 1
    return kept[:count]


@njit(cache=True)
def _likeliest(places: np.ndarray, step: np.ndarray, points: np.ndarray, near: float, stride: float) -> np.ndarray:
    """Return the (n,) legs, from 0, of the cheapest run: off the leg and against it costs, and passing legs by, and jumps.

    `places` (n, d), `step` their (n, d) directions, `points` (m, d) the route's. A leg may be stayed on, the next begun,
    legs passed by for twice their length over `stride`, or any leg jumped to for JUMP (Viterbi 1967).
    """
    count, legs, size = len(places), len(points) - 1, places.shape[1]
    came = np.empty((count, legs), np.uint8)  # 0 stayed, 1 from the leg before at the same place, 2 jumped
    source = np.zeros(count, np.int64)
    span = points[1:] - points[:-1]
    length = np.sqrt((span**2).sum(axis=1))
    passing = np.minimum(2.0 * length / stride, JUMP)
    cost = np.full(legs, np.inf)
    for i in range(count):
        if i == 0:
            cost[0] = 0.0
        cheapest = int(np.argmin(cost))
        jump, source[i] = cost[cheapest] + JUMP, cheapest
        for j in range(legs):
            came[i, j] = 0
            if jump < cost[j]:
                cost[j], came[i, j] = jump, 2
        for j in range(1, legs):
            if cost[j - 1] + (passing[j - 1] if came[i, j - 1] == 1 else 0.0) < cost[j]:
                cost[j] = cost[j - 1] + (passing[j - 1] if came[i, j - 1] == 1 else 0.0)
                came[i, j] = 1
        for j in range(legs):
            along = 0.0
            for d in range(size):
                along += (places[i, d] - points[j, d]) * span[j, d]
            part = min(max(along / max(length[j] ** 2, 1e-18), 0.0), 1.0)
            square, ahead = 0.0, 0.0
            for d in range(size):
                square += (places[i, d] - points[j, d] - part * span[j, d]) ** 2
                ahead += step[i, d] * span[j, d]
            cost[j] += min(square / (near * near), OFF) + AGAINST * (1.0 - ahead / max(length[j], 1e-9))
    found = np.empty(count, np.int64)
    j = int(np.argmin(cost))
    for i in range(count - 1, -1, -1):
        found[i] = j
        while came[i, j] == 1:
            j -= 1
        if came[i, j] == 2:
            j = int(source[i])
    return found


def _along_any(track: Track, chosen: np.ndarray, lines: list[np.ndarray], near: float) -> np.ndarray:
    """Return (c,) bool: whether the track went along a survey line, of anybody's, at the `chosen` (c,) places."""
    pieces = np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in lines])
    tree = shapely.STRtree(shapely.linestrings(pieces))
    before, after = np.maximum(chosen - 1, 0), np.minimum(chosen + 1, len(track.time) - 1)
    going = track.xy[after] - track.xy[before]
    going /= np.maximum(np.linalg.norm(going, axis=1), 1e-9)[:, None]
    place, piece = tree.query(shapely.points(track.xy[chosen]), predicate="dwithin", distance=near)
    span = pieces[piece, 1] - pieces[piece, 0]
    span /= np.maximum(np.linalg.norm(span, axis=1), 1e-9)[:, None]
    along = np.abs(np.einsum("ij,ij->i", going[place], span)) >= ALIGNED
    found = np.zeros(len(chosen), bool)
    found[place[along]] = True
    return found
