"""Parallel lines: what survey teams with a sonar or a camera expect, within the same division of the area.

Swath, route and path are kept apart, as in Fields2Cover: swaths are the lines that survey, the route is their order
and directions, paths link the end of one with the beginning of the next.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import shapely
from scipy.ndimage import distance_transform_edt
from shapely import MultiPolygon

from quarterdeck.coverage.laps import lay_laps
from quarterdeck.coverage.line_order import alternate_order, order_from, short_order
from quarterdeck.coverage.spread import Spread, strips
from quarterdeck.geo.deadline import time_is_up
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.grid import TOLERANCE, Grid
from quarterdeck.geo.scenario import as_multipolygon
from quarterdeck.geo.transit import Roadmap, shortest_path

SHORTEST = 0.1  # of the spacing: shorter pieces of lines are not worth going to

MOST_LINES = 5_000  # across a vehicle's part: their order is searched in the square of their number


@dataclass(frozen=True, slots=True)
class Swath:
    """A straight line that surveys: from `start` to `end`, (x, y) metres. A cross-line is `cross`.

    `run_in` is where the vehicle is on the line before `start`, `run_out` until where it stays on it after `end`.
    """

    name: str
    start: tuple[float, float]
    end: tuple[float, float]
    run_in: tuple[float, float]
    run_out: tuple[float, float]
    cross: bool = False

    @property
    def length(self) -> float:
        """Metres surveyed."""
        return float(np.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1]))


@dataclass(frozen=True, slots=True)
class Lines:
    """One vehicle's swaths in the order in which they are driven, and the (n, 2) paths between them in metres.

    `laps`, (n, 2) metres, come before them. `links[i]` leads from the end of lap or swath i, run-out included, to where the
    next begins, run-in included; `angle` is the lines' direction in radians. `unreached` counts what no path leads to.
    """

    swaths: tuple[Swath, ...]
    links: tuple[np.ndarray, ...]
    angle: float
    unreached: int = 0
    laps: tuple[np.ndarray, ...] = ()

    @property
    def tracks(self) -> list[np.ndarray]:
        """The (n, 2) laps and (2, 2) lines that survey, in order."""
        return [*self.laps, *(np.array([s.start, s.end]) for s in self.swaths)]

    @property
    def driven(self) -> list[np.ndarray]:
        """The (n, 2) laps, and the (4, 2) lines with their run-ins and run-outs, in order."""
        return [*self.laps, *(np.array([s.run_in, s.start, s.end, s.run_out]) for s in self.swaths)]

    @property
    def path(self) -> np.ndarray:
        """The (n, 2) metres of all of it: laps, run-ins, swaths, run-outs and links in order."""
        parts: list[np.ndarray] = []
        for i, track in enumerate(self.driven):
            parts.append(track)
            parts += [link[1:-1] for link in self.links[i : i + 1]]
        return np.concatenate(parts) if parts else np.zeros((0, 2))


def split_area(area: MultiPolygon, grid: Grid, labels: np.ndarray, vehicles: int) -> list[MultiPolygon]:
    """Return each vehicle's part of the area in metres: what is nearest to its hypervertices, `labels` (R, C) int.

    The parts make up the area; where no vehicle has a hypervertex, there is nobody's.
    """
    labels = np.asarray(labels)
    if not (labels >= 0).any():
        return [MultiPolygon() for _ in range(vehicles)]
    rows, columns = distance_transform_edt(labels < 0, return_distances=False, return_indices=True)
    owner = labels[rows, columns]
    parts = []
    for vehicle in range(vehicles):
        change = np.diff((owner == vehicle).astype(np.int8), axis=1, prepend=0, append=0)
        (r, first), last = np.nonzero(change == 1), np.nonzero(change == -1)[1]
        corners = np.stack([[r, first], [r, last], [r + 1, last], [r + 1, first]]).transpose(2, 0, 1).reshape(-1, 2)
        squares = shapely.polygons(grid.centres(2.0 * corners - 0.5).reshape(-1, 4, 2))
        parts.append(as_multipolygon(shapely.union_all(squares, grid_size=1e-6 * grid.spacing).intersection(area)))
    return parts


def lay_lines(
    area: MultiPolygon,
    part: MultiPolygon,
    spacing: float,
    road: Roadmap,
    *,
    angle: float | None = None,
    run: float = 0.0,
    cross_every: int = 0,
    turn_cost: float | None = None,
    start: tuple[float, float] | None = None,
    entry: tuple[float, float] | None = None,
    alternate: int = 0,
    lap: MultiPolygon | None = None,
    spread: Spread | None = None,
) -> Lines:
    """Cover `part` of `area` by parallel lines at most `spacing` metres apart, and link them on `road`.

    `angle` is the lines' direction in radians counter-clockwise from east (None: the cheapest, with `turn_cost` metres for
    each line, by default the spacing). Lines reach as far as the strip does that they survey, never out of `area`.
    `run` metres are driven straight before and after each line where the road allows. `cross_every` n > 0 adds lines
    across, n spacings apart. The route begins near `start`, or with the end of a line that is nearest to `entry`.
    `alternate` n > 1 drives every nth line and the skipped ones on the way back; it begins with an outermost line.
    With a `spread` lines are as far from each other as it allows where they are, cross-lines apart.
    The boundary of `lap` that lies in the part (`coverage.laps.lap_space`) is driven before all lines.
    Raises InputError if an option is out of range.
    """
    if not (np.isfinite(spacing) and spacing > 0):
        raise InputError(f"spacing {spacing:g} must be a positive number of metres")
    if not run >= 0 or cross_every < 0:
        raise InputError(f"run {run:g} m and cross_every {cross_every} must not be negative")
    if alternate < 0 or alternate == 1:
        raise InputError(f"alternate {alternate} must be 2 or more, or 0 for lines in a short order")
    turn_cost = spacing if turn_cost is None else turn_cost
    if part.is_empty:
        return Lines((), (), angle or 0.0)
    width = float(np.hypot(part.bounds[2] - part.bounds[0], part.bounds[3] - part.bounds[1]))
    if width > MOST_LINES * spacing:
        raise InputError(
            f"spacing {spacing:g} m makes up to {width / spacing:,.0f} lines for a vehicle, more than {MOST_LINES:,}; "
            f"at least {width / MOST_LINES:.3g} m works"
        )
    if angle is None:
        angle = _best_angle(area, part, spacing, turn_cost, spread)
    pieces = _pieces(area, part, spacing, angle, spread)
    cross = _pieces(area, part, cross_every * spacing, angle + np.pi / 2) if cross_every else np.zeros((0, 2, 2))
    swaths = [*_swaths(pieces, road, run, "L", False), *_swaths(cross, road, run, "X", True)]
    lines, across = swaths[: len(pieces)], swaths[len(pieces) :]
    laps = [] if lap is None else lay_laps(lap, part, spacing, entry or start)
    if laps:
        start = (float(laps[-1][-1, 0]), float(laps[-1][-1, 1]))
    route = _routed(lines, pieces, start, entry, alternate) + _routed(across, cross, None, None, alternate)
    return _linked(laps, route, road, angle)


def _best_angle(area: MultiPolygon, part: MultiPolygon, spacing: float, turn_cost: float, spread: Spread | None) -> float:
    """Return the direction in [0, pi) with the least length of lines, `turn_cost` added for each."""
    corners, ring = shapely.get_coordinates(shapely.get_rings(shapely.get_parts(part)), return_index=True)
    step = np.diff(corners, axis=0)[ring[1:] == ring[:-1]]
    size = np.linalg.norm(step, axis=1)
    longest = np.argsort(-size, kind="stable")[:12]
    along = np.arctan2(step[longest, 1], step[longest, 0]) % np.pi
    angles = np.round(np.concatenate([along, np.arange(0, np.pi, np.pi / 18)]), 9)
    costs: dict[float, float] = {}
    for angle in dict.fromkeys(angles.tolist()):
        if costs and time_is_up("the search for the best direction of lines"):
            break
        lines = _pieces(area, part, spacing, angle, spread)
        costs[angle] = float(np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1).sum()) + turn_cost * len(lines)
    return min(costs, key=lambda angle: (costs[angle], angle))


def _pieces(
    area: MultiPolygon, part: MultiPolygon, spacing: float, angle: float, spread: Spread | None = None
) -> np.ndarray:
    """Return the (n, 2, 2) pieces of the lines at `angle` that survey `part`, line after line."""
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.array([[cos, -sin], [sin, cos]])
    least = spacing if spread is None else float(spread.widths.min())
    inner = area.buffer(-TOLERANCE * least, join_style="mitre")
    space, wanted = (shapely.transform(g, lambda xy: xy @ turn) for g in (inner, part))
    left, bottom, right, top = shapely.total_bounds([space, wanted])
    _, bottom, _, top = wanted.bounds
    if spread is None:
        count = max(1, int(np.ceil((top - bottom) / spacing - 1e-9)))
        heights = np.full(count, (top - bottom) / count)
        lows = bottom + heights[0] * np.arange(count)
    else:
        inside = shapely.contains_xy(part, *spread.places.T)
        lows, heights = strips((spread.places[inside] @ turn)[:, 1], spread.widths[inside], bottom, top)
    stripes = shapely.intersection(shapely.box(left, lows, right, lows + heights), wanted)
    shapes, strip = shapely.get_parts(stripes, return_index=True)
    bounds = shapely.bounds(shapes)
    middles = (lows + heights / 2.0)[strip]
    ways = np.stack([bounds[:, [0, 2]], np.column_stack([middles, middles])], axis=2)
    reach = shapely.linestrings(ways[bounds[:, 2] > bounds[:, 0]])  # an empty strip's bounds are no numbers
    merged = shapely.get_parts(shapely.line_merge(shapely.union_all(reach))) if len(reach) else reach
    kept = shapely.get_parts(shapely.intersection(merged, space))
    kept = kept[(shapely.get_type_id(kept) == 1) & (shapely.length(kept) >= SHORTEST * least)]
    ends = np.stack([shapely.get_coordinates(shapely.get_point(kept, n)) for n in (0, -1)], axis=1).reshape(-1, 2, 2)
    ends = np.sort(ends, axis=1)  # left to right: the two differ in x alone
    order = np.lexsort((ends[:, 0, 0], np.searchsorted(lows, ends[:, 0, 1], side="right")))
    return ends[order] @ turn.T


def _swaths(pieces: np.ndarray, road: Roadmap, run: float, letter: str, cross: bool) -> list[Swath]:
    """Return named swaths of pieces of lines, with run-in and run-out as long as the road allows."""
    if not len(pieces):
        return []
    direction = pieces[:, 1] - pieces[:, 0]
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    before, after = _run(pieces[:, 0], -direction, run, road), _run(pieces[:, 1], direction, run, road)
    digits = len(str(len(pieces)))
    return [
        Swath(f"{letter}{n + 1:0{digits}d}", tuple(a), tuple(b), tuple(i), tuple(o), cross)
        for n, ((a, b), i, o) in enumerate(zip(pieces.tolist(), before.tolist(), after.tolist(), strict=True))
    ]


def _run(points: np.ndarray, direction: np.ndarray, run: float, road: Roadmap) -> np.ndarray:
    """Return how far from `points` one gets straight in `direction`, `run` metres at most, on the road: (n, 2) metres."""
    if run == 0.0:
        return points
    rays = shapely.linestrings(np.stack([points, points + run * direction], axis=1))
    free, ray = shapely.get_parts(shapely.intersection(rays, road.polygon), return_index=True)
    touches = shapely.distance(free, shapely.points(points)[ray]) < 1e-6
    reach = np.zeros(len(points))
    np.maximum.at(reach, ray[touches], shapely.length(free[touches]))
    return points + reach[:, None] * direction


def _routed(
    swaths: list[Swath],
    pieces: np.ndarray,
    start: tuple[float, float] | None,
    entry: tuple[float, float] | None,
    alternate: int,
) -> list[Swath]:
    """Return the swaths, which survey the (n, 2, 2) `pieces`, in the order and the directions in which they are driven."""
    if not swaths:
        return []
    ends = np.array([[s.run_in, s.run_out] for s in swaths])
    begin = np.array(entry or start or swaths[0].run_in)
    if alternate:
        order, forward = alternate_order(ends, _rows(pieces), alternate, begin)
    elif entry is not None:
        order, forward = order_from(ends, pieces, begin)
    else:
        order, forward = short_order(ends, begin)
    return [swaths[i] if f else _reversed(swaths[i]) for i, f in zip(order.tolist(), forward.tolist(), strict=True)]


def _rows(pieces: np.ndarray) -> np.ndarray:
    """Return the number (n,) of the line on which each of the (n, 2, 2) pieces lies; they come line after line."""
    along = pieces[0, 1] - pieces[0, 0]
    along = along / np.linalg.norm(along)
    offset = pieces[:, 0] @ np.array([-along[1], along[0]])
    return np.append(0, np.cumsum(np.diff(offset) > 1e-6))


def _reversed(s: Swath) -> Swath:
    return replace(s, start=s.end, end=s.start, run_in=s.run_out, run_out=s.run_in)


def _linked(laps: Iterable[np.ndarray], swaths: Iterable[Swath], road: Roadmap, angle: float) -> Lines:
    """Return laps and swaths with shortest paths between them; those that no path leads to from the first are left out."""
    driven, kept = [], []  # type: list[np.ndarray], list[Swath]
    links: list[np.ndarray] = []
    unreached = 0
    here: tuple[float, float] | None = None
    ways: list[np.ndarray | Swath] = [*laps, *swaths]
    for way in ways:
        begin, end = (way.run_in, way.run_out) if isinstance(way, Swath) else (tuple(way[0]), tuple(way[-1]))
        if here is not None:
            link = shortest_path(road, here, begin)
            if link is None:
                unreached += 1
                continue
            links.append(link)
        here = end
        if isinstance(way, Swath):
            kept.append(way)
        else:
            driven.append(way)
    return Lines(tuple(kept), tuple(links), float(angle), unreached, tuple(driven))
