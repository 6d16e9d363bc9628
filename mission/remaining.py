"""What is left of survey lines: the parts that no track has run along, and that can still be driven."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely
from shapely import MultiPolygon, STRtree

SPECK = 1e-6  # m: a shorter piece is a rounding error
ALONG = np.cos(np.pi / 4)  # a track at a wider angle to a line has crossed it, not run along it


def remaining_parts(lines: Sequence[np.ndarray], tracks: Sequence[np.ndarray], within: float) -> list[list[np.ndarray]]:
    """Return the parts of each (n, 2) line that no (m, 2) track has run along nearer than `within`, in the line's order.

    All in metres. Parts shorter than `within` are none. Worked out leg by leg: a line may cross itself, and run out and
    back on itself.
    """
    legs, owner = _legs(lines)
    parts: list[list[list[np.ndarray]]] = [[] for _ in lines]
    for (a, b), line, gaps in zip(legs, owner.tolist(), _gaps(legs, _legs(tracks)[0], within), strict=True):
        length = float(np.hypot(*(b - a)))
        for low, high in gaps:
            begin, end = (a + (b - a) * (s / length) if 0.0 < s < length else (a if s == 0.0 else b) for s in (low, high))
            mine = parts[line]
            if mine and low == 0.0 and np.array_equal(mine[-1][-1], a):
                mine[-1].append(end)
            else:
                mine.append([begin, end])
    left = [[np.array(part) for part in mine] for mine in parts]
    return [[part for part in mine if np.hypot(*np.diff(part, axis=0).T).sum() >= within] for mine in left]


def _legs(lines: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the (l, 2, 2) legs of polylines that are longer than a speck, and (l,) whose they are."""
    legs = [np.stack([line[:-1], line[1:]], axis=1) for line in lines]
    owner = np.repeat(np.arange(len(lines)), [len(x) for x in legs])
    stacked = np.concatenate([np.empty((0, 2, 2)), *legs])
    long = np.hypot(*(stacked[:, 1] - stacked[:, 0]).T) > SPECK
    return stacked[long], owner[long]


def _gaps(legs: np.ndarray, done: np.ndarray, within: float) -> list[list[tuple[float, float]]]:
    """Return for each leg the stretches, from and to in metres along it, that no done leg has run along."""
    a, step = legs[:, 0], legs[:, 1] - legs[:, 0]
    length = np.hypot(*step.T)
    near = STRtree(shapely.linestrings(done)).query(shapely.linestrings(legs), predicate="dwithin", distance=within)
    mine, other = near if len(done) and len(legs) else np.empty((2, 0), dtype=np.int64)
    u = step / length[:, None]
    v = done[:, 1] - done[:, 0]
    v /= np.hypot(*v.T)[:, None]
    alike = np.abs((u[mine] * v[other]).sum(axis=1)) >= ALONG
    mine, other = mine[alike], other[alike]
    low, high = _inside_capsule(a[mine], u[mine], done[other, 0], done[other, 1], v[other], within)
    low, high = np.maximum(low, 0.0), np.minimum(high, length[mine])
    some = high > low
    mine, low, high = mine[some], low[some], high[some]
    order = np.lexsort((low, mine))
    mine, low, high = mine[order], low[order], high[order]
    first = np.searchsorted(mine, np.arange(len(legs) + 1))
    gaps = []
    for i, whole in enumerate(length.tolist()):
        at, found = 0.0, []
        for begin, end in zip(low[first[i] : first[i + 1]].tolist(), high[first[i] : first[i + 1]].tolist(), strict=True):
            if begin > at + SPECK:
                found.append((at, begin))
            at = max(at, end)
        if at < whole - SPECK:
            found.append((at, whole))
        gaps.append(found)
    return gaps


def _inside_capsule(
    a: np.ndarray, u: np.ndarray, c: np.ndarray, d: np.ndarray, v: np.ndarray, radius: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return from where to where (n,) the lines from `a` along `u` are within `radius` of the segments from `c` to `d`.

    `v` is the segments' direction; all (n, 2). What is so near is convex: two discs and the strip between them.
    """
    low, high = np.full(len(a), np.inf), np.full(len(a), -np.inf)
    for centre in (c, d):
        along = ((centre - a) * u).sum(axis=1)
        over = radius**2 - ((centre - a - along[:, None] * u) ** 2).sum(axis=1)
        half = np.sqrt(np.maximum(over, 0.0))
        low = np.where(over >= 0, np.minimum(low, along - half), low)
        high = np.where(over >= 0, np.maximum(high, along + half), high)
    # The strip: 0 <= (a + s u - c) . v <= |d - c| and |(a + s u - c) . n| <= radius; u . v is never near 0 here.
    uv, wv = (u * v).sum(axis=1), ((a - c) * v).sum(axis=1)
    span = np.stack([-wv / uv, (((d - c) * v).sum(axis=1) - wv) / uv])
    n = np.stack([-v[:, 1], v[:, 0]], axis=1)
    un, wn = (u * n).sum(axis=1), ((a - c) * n).sum(axis=1)
    level = np.abs(un) < 1e-12
    tilt = np.where(level, 1.0, un)
    across = np.stack([(-radius - wn) / tilt, (radius - wn) / tilt])
    begin = np.maximum(span.min(axis=0), np.where(level, -np.inf, across.min(axis=0)))
    end = np.minimum(span.max(axis=0), np.where(level, np.inf, across.max(axis=0)))
    strip = (begin <= end) & (~level | (np.abs(wn) <= radius))
    return np.where(strip, np.minimum(low, begin), low), np.where(strip, np.maximum(high, end), high)


def clipped(parts: Sequence[np.ndarray], reach: MultiPolygon, shortest: float) -> list[np.ndarray]:
    """Return the pieces of (n, 2) lines that lie in `reach`, in order; shorter ones than `shortest` metres are none."""
    if not parts:
        return []
    shapely.prepare(reach)
    numbers = np.repeat(np.arange(len(parts)), [len(p) for p in parts])
    whole = shapely.covers(reach, shapely.linestrings(np.concatenate(parts), indices=numbers))
    inside: list[np.ndarray] = []
    for part, stays in zip(parts, whole.tolist(), strict=True):
        inside += [part] if stays else _pieces(part, reach)
    return [part for part in inside if np.hypot(*np.diff(part, axis=0).T).sum() >= shortest]


def _pieces(part: np.ndarray, reach: MultiPolygon) -> list[np.ndarray]:
    found: list[list[np.ndarray]] = []
    legs = shapely.intersection(shapely.linestrings(np.stack([part[:-1], part[1:]], axis=1)), reach)
    for (a, b), leg in zip(pairwise(part), legs, strict=True):
        pieces = [np.array(g.coords) for g in shapely.get_parts(leg) if g.geom_type == "LineString" and not g.is_empty]
        pieces = [p if np.dot(p[-1] - p[0], b - a) >= 0 else p[::-1] for p in pieces]
        for piece in sorted(pieces, key=lambda p: float(np.dot(p[0] - a, b - a))):
            if found and np.allclose(found[-1][-1], piece[0], atol=SPECK, rtol=0.0):
                found[-1].extend(piece[1:])
            else:
                found.append(list(piece))
    return [np.array(p) for p in found]
