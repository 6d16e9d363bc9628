"""Finding somebody who moves: predict where he is, meet him there, else follow what is known of his way.

The medic's speed, treatment time and queue, shared when they last met, give his course (paper, Sec. V-B); the first
moment at which a pursuer of constant speed can be there is found leg by leg in closed form.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numba
import numpy as np
import shapely
from shapely import MultiPolygon
from shapely.ops import nearest_points

from quarterdeck.mission.triage.records import XY, Belief

LEGS = 1.4  # ranges between the legs of a square search: at its corners the diagonal counts
Ways = Callable[[XY, XY], Sequence[XY]]  # the corners of a shortest path, its end included, its start not


def straight(a: XY, b: XY) -> Sequence[XY]:  # noqa: ARG001
    """Return the way between two points where nothing is in between."""
    return (b,)


def predict(belief: Belief, ways: Ways) -> np.ndarray:
    """Return the (n, 3) seconds, x, y that a medic is believed to walk through; at the last he stays."""
    time, at = belief.time, (belief.x, belief.y)
    knots = [(time, *at)]
    if belief.busy > 0:
        time += belief.busy
        knots.append((time, *at))
    for x, y, _ in belief.stops:
        for corner in ways(at, (x, y)):
            time += ((corner[0] - at[0]) ** 2 + (corner[1] - at[1]) ** 2) ** 0.5 / belief.speed
            at = (corner[0], corner[1])
            knots.append((time, *at))
        time += belief.treat
        knots.append((time, *at))
    return np.array(knots)


def chase(knots: np.ndarray, here: XY, speed: float, now: float, ways: Ways) -> list[XY]:
    """Return the corners to drive through: to the meeting with the predicted course `knots`, then along it to its end.

    Whoever is late, or took his stops in another order, is still near it: so back along all of it and once more to its end.
    """
    place, k = _meeting(knots, here, speed, now, ways)
    corners = list(ways(here, place))
    course = [(float(x), float(y)) for x, y in knots[:, 1:]]
    for place in (*course[k:], *course[::-1], *course):
        if place != corners[-1]:
            corners.append(place)
    return corners


def expanding_square(centre: XY, area: MultiPolygon, spacing: float, ways: Ways) -> list[XY]:
    """Return the corners of the search for somebody last known at `centre`: a square spiral over all of `area`, in metres.

    Its legs are `spacing` apart (IAMSAR Manual, vol. III: expanding square search). Legs outside the area are left out, but
    for those within `spacing` of it: they run along its border, or a strip inside it would be missed.
    """
    x0, y0, x1, y1 = area.bounds
    far = max(abs(x0 - centre[0]), abs(x1 - centre[0]), abs(y0 - centre[1]), abs(y1 - centre[1])) + spacing
    turns = [centre]
    for leg in range(4 * int(far / spacing + 1.5)):
        dx, dy = ((1, 0), (0, 1), (-1, 0), (0, -1))[leg % 4]
        length = spacing * (leg // 2 + 1)
        turns.append((turns[-1][0] + dx * length, turns[-1][1] + dy * length))
    legs = shapely.linestrings(list(pairwise(turns)))
    corners = [centre]
    for leg in shapely.intersection(legs, area.buffer(spacing, join_style="mitre")):
        for piece in shapely.get_parts(leg):
            for place in shapely.points(shapely.get_coordinates(piece)):
                near = nearest_points(area, place)[0]
                corners += [c for c in ways(corners[-1], (near.x, near.y)) if c != corners[-1]]
    return corners[1:] or [centre]


def meeting_time(knots: np.ndarray, here: XY, speed: float, now: float) -> float:
    """Return when a pursuer who drives straight could meet the predicted course, in seconds."""
    x, y, _ = _meet(knots, here[0], here[1], speed, now)
    return float(now + np.hypot(x - here[0], y - here[1]) / speed)


def intercept(knots: np.ndarray, here: XY, speed: float, now: float, ways: Ways) -> list[XY]:
    """Return the corners to drive through to the meeting with the predicted course `knots`, and no further."""
    return list(ways(here, _meeting(knots, here, speed, now, ways)[0]))


def _meeting(knots: np.ndarray, here: XY, speed: float, now: float, ways: Ways) -> tuple[XY, int]:
    """Return where to meet, and the index of the knot after it: around obstacles, the first corner reached in time."""
    if ways is straight:
        x, y, k = _meet(knots, here[0], here[1], speed, now)
        return (float(x), float(y)), int(k)
    for k, (time, x, y) in enumerate(knots):
        place = (float(x), float(y))
        if time >= now or k == len(knots) - 1:
            path = np.array([here, *ways(here, place)])
            arrival = now + float(np.hypot(*np.diff(path, axis=0).T).sum()) / speed
            if arrival <= time or k == len(knots) - 1:
                return place, k + 1
    raise AssertionError("a course has at least one corner")


@numba.njit  # of several signatures: no cache of its own (see .ci/signatures)
def _meet(knots: np.ndarray, px: float, py: float, speed: float, now: float) -> tuple[float, float, int]:
    """Return the meeting's x, y and the index of the knot after it, for a pursuer at (px, py) who leaves at `now`."""
    n = len(knots)
    for k in range(n - 1):
        t0, t1 = max(knots[k, 0], now), knots[k + 1, 0]
        if t1 < now or t1 <= knots[k, 0]:
            continue
        dt = t1 - knots[k, 0]
        vx, vy = (knots[k + 1, 1] - knots[k, 1]) / dt, (knots[k + 1, 2] - knots[k, 2]) / dt
        x0, y0 = knots[k, 1] + vx * (t0 - knots[k, 0]), knots[k, 2] + vy * (t0 - knots[k, 0])
        # |d + v s| = speed (s + w): w the head start at t0
        dx, dy, w = x0 - px, y0 - py, t0 - now
        a = vx * vx + vy * vy - speed * speed
        b = dx * vx + dy * vy - speed * speed * w
        c = dx * dx + dy * dy - speed * speed * w * w
        s = np.inf
        if c <= 0.0:
            s = 0.0
        elif a == 0.0:
            s = -c / (2.0 * b) if b < 0.0 else np.inf
        else:
            root = b * b - a * c
            if root >= 0.0:
                one, other = (-b - np.sqrt(root)) / a, (-b + np.sqrt(root)) / a
                low, high = min(one, other), max(one, other)
                s = low if low >= 0.0 else (high if high >= 0.0 else np.inf)
        if t0 + s <= t1:
            return x0 + vx * s, y0 + vy * s, k + 1
    return knots[n - 1, 1], knots[n - 1, 2], n
