"""Shortest paths of bounded curvature: Dubins curves, and lines whose corners are rounded to arcs."""

import math

import numpy as np

CHORD = math.radians(10.0)  # of an arc, between neighbouring points: 0.4 % of the radius off the true arc


def dubins_paths(
    start: tuple[float, float, float], goal: tuple[float, float, float], radius: float, chord: float = CHORD
) -> list[np.ndarray]:
    """Return the (m, 2) points of paths from `start` to `goal`, (x, y, heading), turning at `radius` metres.

    They are those of all words of Dubins (1957) that exist, lengths after Shkel & Lumelsky (2001), shortest first: where
    the shortest has no room, another may have. Neighbouring points of an arc are `chord` radians apart.
    """
    dx, dy = goal[0] - start[0], goal[1] - start[1]
    distance, theta = math.hypot(dx, dy) / radius, math.atan2(dy, dx)
    alpha, beta = (start[2] - theta) % math.tau, (goal[2] - theta) % math.tau
    found = [(sum(lengths), word, lengths) for word in WORDS if (lengths := _lengths(word, alpha, beta, distance))]
    found.sort(key=lambda f: (f[0], f[1]))
    return [_sampled(start, word, lengths, radius, goal, chord) for _, word, lengths in found]


WORDS = ("LSL", "RSR", "LSR", "RSL", "RLR", "LRL")


def _lengths(word: str, alpha: float, beta: float, d: float) -> tuple[float, float, float] | None:
    """Return the three segments of a word in units of the radius, or None where it does not exist."""
    sa, sb, ca, cb, cab = math.sin(alpha), math.sin(beta), math.cos(alpha), math.cos(beta), math.cos(alpha - beta)
    if word in ("LSL", "RSR"):
        side = 1 if word == "LSL" else -1
        square = 2 + d * d - 2 * cab + 2 * side * d * (sa - sb)
        if square < -1e-9:
            return None
        if square < 1e-12:  # both arcs lie on one circle
            return _turn(side * (beta - alpha)), 0.0, 0.0
        phi = math.atan2(side * (cb - ca), d + side * (sa - sb))
        return _turn(side * (phi - alpha)), math.sqrt(max(0.0, square)), _turn(side * (beta - phi))
    if word in ("LSR", "RSL"):
        side = 1 if word == "LSR" else -1
        square = d * d - 2 + 2 * cab + 2 * side * d * (sa + sb)
        if square < -1e-9:
            return None
        p = math.sqrt(max(0.0, square))
        phi = math.atan2(-side * (ca + cb), d + side * (sa + sb)) - math.atan2(-2.0 * side, p)
        return (side * (phi - alpha)) % math.tau, p, (side * (phi - beta)) % math.tau
    side = 1 if word == "RLR" else -1
    cosine = (6 - d * d + 2 * cab + 2 * side * d * (sa - sb)) / 8
    if abs(cosine) > 1:
        return None
    p = (math.tau - math.acos(cosine)) % math.tau
    t = _turn(side * (alpha - math.atan2(side * (ca - cb), d - side * (sa - sb))) + p / 2)
    return t, p, _turn(side * (alpha - beta) - t + p)


def _turn(angle: float) -> float:
    """Return an angle in [0, 2 pi); a full turn but for rounding is none."""
    angle %= math.tau
    return 0.0 if math.tau - angle < 1e-9 else angle


def _sampled(
    start: tuple[float, float, float],
    word: str,
    lengths: tuple[float, float, float],
    radius: float,
    goal: tuple[float, float, float],
    chord: float,
) -> np.ndarray:
    x, y, heading = start
    points = [(x, y)]
    for letter, length in zip(word, lengths, strict=True):
        if length < 1e-9:  # a segment of none would repeat its point
            continue
        if letter == "S":
            x, y = x + length * radius * math.cos(heading), y + length * radius * math.sin(heading)
            points.append((x, y))
            continue
        side = 1 if letter == "L" else -1
        cx, cy = x - side * radius * math.sin(heading), y + side * radius * math.cos(heading)
        steps = max(1, math.ceil(length / chord))
        for k in range(1, steps + 1):
            h = heading + side * length * k / steps
            points.append((cx + side * radius * math.sin(h), cy - side * radius * math.cos(h)))
        x, y = points[-1]
        heading += side * length
    points[max(1, len(points) - 1) :] = [goal[:2]]  # rounding apart, it is there; where there is no way, two points
    return np.array(points)
