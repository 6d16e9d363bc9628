"""The edge of the area: what complete hypervertices leave uncovered along borders and obstacles.

`whole` leaves it. `cells` hangs every free path cell that can be reached on the tours, and runs on to the border where
cheap. `lap` adds laps along borders and obstacles and grows the tracks into what strips remain, on a budget of length.
Inside, all is in the axes of the lattice, in path cells: the centre of cell (i, j) is the point (j, i).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numba as nb
import numpy as np
import shapely
from shapely import LineString, MultiPolygon, STRtree

from quarterdeck.coverage.metrics import count_turns, track_length, uncovered
from quarterdeck.coverage.strips import grow, polished
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.grid import TOLERANCE, Grid

Edge = Literal["whole", "cells", "lap"]

CHEAP = 0.15  # `cells` runs on where it covers this many cells' area per cell of length; a whole tour covers 1
TURN = 0.2  # the length that one turn less is worth, where the caller does not say
DEAR = 0.03  # `lap` goes on down to this
ALLOWANCE = 0.198  # `lap` may drive this much more per square metre covered than `whole`: 0.2, less what sampling errs
RING_PAYS = 0.15  # a lap is considered when it covers this many cells' area per cell of length
ENOUGH = 0.995  # of the area: where that is covered, tracks stay on the lattice, with spurs, bulges and laps
PRICES = (0.5, 0.3, 0.2)  # the area that a length is worth when tracks are polished, from coarse to fine
BEND = 0.05  # the length that one turn less is worth then
ONE_VEHICLE = 0.9  # and when this much of it is nearest to one vehicle's tracks


def lay_tracks(
    area: MultiPolygon,
    grid: Grid,
    tours: Sequence[np.ndarray],
    *,
    edge: Edge = "cells",
    target: MultiPolygon | None = None,
    turn_cost: float | None = None,
) -> list[np.ndarray]:
    """Return the closed track of each tour, (n, 2) metres with the first point repeated at the end, all inside `area`.

    `area` is what the grid was placed on; `target` what is to be covered, where that is more (None: the same). `tours` are
    (n, 2) path cells in order (`coverage.tour`); a track begins at the first cell of its tour. `turn_cost` is the length
    in metres that is worth one turn less (None: a fifth of the spacing). Raises InputError if `edge` is not known.
    """
    if edge not in get_args(Edge):
        raise InputError(f"edge {edge!r} is not one of {', '.join(get_args(Edge))}")
    if edge == "cells":
        tours = hang(grid, tours)
    paths = [np.asarray(t)[:, ::-1].astype(float) for t in tours]
    if edge != "whole" and paths:
        space = _to_lattice(shapely.normalize(area), grid)
        wanted = space if target is None else _to_lattice(shapely.normalize(target), grid)
        turn = TURN if turn_cost is None else turn_cost / grid.spacing
        if edge == "cells":
            paths = grow(paths, space, wanted, least=CHEAP, turn_cost=turn)
        else:
            paths = _lap(paths, space, wanted, turn)
    return [grid.centres(_trimmed(np.vstack([p, p[:1]]))[:, ::-1]) for p in paths]


def _to_lattice(area: MultiPolygon, grid: Grid) -> MultiPolygon:
    """Return the area in the axes of the lattice, in path cells, so that the centre of cell (i, j) is (j, i)."""
    cos, sin = np.cos(grid.angle), np.sin(grid.angle)
    turn = np.array([[cos, -sin], [sin, cos]])
    return shapely.transform(area, lambda xy: (xy - np.array(grid.origin)) @ turn / grid.spacing - 0.5)


def _trimmed(path: np.ndarray) -> np.ndarray:
    """Return a path without the vertices at which it goes straight on."""
    step = np.diff(path, axis=0)
    turn = step[:-1, 0] * step[1:, 1] - step[:-1, 1] * step[1:, 0]
    on = (np.abs(turn) < 1e-9) & ((step[:-1] * step[1:]).sum(axis=1) > 0)
    return path[np.concatenate([[True], ~on, [True]])]


def _lap(paths: list[np.ndarray], space: MultiPolygon, wanted: MultiPolygon, turn_cost: float) -> list[np.ndarray]:
    """Return the paths with laps and growth, or growth alone, whichever costs less for what it covers.

    Where neither covers `ENOUGH`, as on small and narrow areas, vertices are moved too.
    """
    whole = sum(track_length(np.vstack([p, p[:1]])) for p in paths)
    limit = (1 + ALLOWANCE) * whole / _covered(paths, wanted)
    starts = [p for p in (paths, _with_rings(paths, space, wanted, limit)) if p is not None]
    reach = {"least": DEAR, "turn_cost": turn_cost, "most_per_area": limit}
    plans = [_Plan.of(grow(p, space, wanted, **reach), wanted, turn_cost) for p in starts]
    if max(p.covered for p in plans) < ENOUGH * wanted.area:
        plans += [_Plan.of(q, wanted, turn_cost) for p in plans for q in _smoothed(p.paths, space, wanted, reach)]
    most = max(p.covered for p in plans)
    return min((p for p in plans if p.covered >= most - 0.002 * wanted.area), key=lambda p: p.cost).paths


def _smoothed(
    paths: list[np.ndarray], space: MultiPolygon, wanted: MultiPolygon, reach: dict[str, float]
) -> list[list[np.ndarray]]:
    """Return what polishing and growing in turn make of the paths, within the limit; they bend more than others."""
    stages = [paths]
    for price in PRICES:
        smooth = polished(stages[-1], space, wanted, price=price, turn_cost=BEND)
        stages.append(grow(smooth, space, wanted, **reach))
    return [
        p
        for p in stages[1:]
        if sum(track_length(np.vstack([q, q[:1]])) for q in p) <= reach["most_per_area"] * _covered(p, wanted)
    ]


@dataclass(frozen=True, slots=True)
class _Plan:
    paths: list[np.ndarray]
    covered: float
    cost: float

    @classmethod
    def of(cls, paths: list[np.ndarray], wanted: MultiPolygon, turn_cost: float) -> "_Plan":
        closed = [np.vstack([p, p[:1]]) for p in paths]
        cost = sum(track_length(t) + turn_cost * count_turns(t) for t in closed)
        return cls(paths, _covered(paths, wanted), cost)


def _covered(paths: list[np.ndarray], wanted: MultiPolygon) -> float:
    closed = [np.vstack([p, p[:1]]) for p in paths]
    return float(wanted.area - uncovered(closed, wanted, 1.0).area)


def _with_rings(
    paths: list[np.ndarray], space: MultiPolygon, wanted: MultiPolygon, limit: float
) -> list[np.ndarray] | None:
    """Return the paths with a lap half a spacing inside each border that pays, best first, or None if none does."""
    inner = space.buffer(-TOLERANCE, join_style="mitre")
    shapely.prepare(inner)
    inset = shapely.intersection(wanted.buffer(-0.5, join_style="mitre", mitre_limit=3.0), inner.buffer(-1e-3))
    inset = shapely.simplify(inset, 5e-4)
    rings = [np.array(r.coords) for r in shapely.get_rings(shapely.get_parts(inset))]
    rest = uncovered([np.vstack([p, p[:1]]) for p in paths], wanted, 1.0)
    gains = [rest.area - uncovered([r], rest, 1.0).area for r in rings]
    paths, changed = list(paths), False
    for n in sorted(range(len(rings)), key=lambda n: -gains[n] / track_length(rings[n])):
        left = uncovered([rings[n]], rest, 1.0)
        spliced = _spliced(paths, rings[n], inner) if rest.area - left.area >= RING_PAYS * track_length(rings[n]) else None
        if spliced is not None:
            longer = sum(track_length(np.vstack([p, p[:1]])) for p in spliced)
            if longer <= limit * (wanted.area - left.area):
                paths, rest, changed = spliced, left, True
    return paths if changed else None


def _spliced(paths: list[np.ndarray], ring: np.ndarray, inner: MultiPolygon) -> list[np.ndarray] | None:
    """Return the paths with a ring in the nearest vehicle's, or None if it is several vehicles' or cut off."""
    pieces = [np.stack([p, np.roll(p, -1, axis=0)], axis=1) for p in paths]
    owner = np.repeat(np.arange(len(paths)), [len(p) for p in paths])
    lines = shapely.linestrings(np.concatenate(pieces))
    line = LineString(ring)
    spots = shapely.line_interpolate_point(
        line, np.linspace(0.0, line.length, max(8, int(2 * line.length)), endpoint=False)
    )
    nearest = owner[STRtree(lines).nearest(spots)]
    votes = np.bincount(nearest, minlength=len(paths)) / len(nearest)
    vehicle = int(np.argmax(votes))
    if votes[vehicle] < ONE_VEHICLE:
        return None
    own = np.flatnonzero(owner == vehicle)
    link = shapely.shortest_line(lines[own], line)
    order = np.argsort(shapely.length(link), kind="stable")[:50]
    good = order[shapely.covers(inner, link[order])]
    if not len(good):
        return None
    piece = int(good[0])
    (a, b), path = np.array(link[piece].coords), paths[vehicle]
    along = float(shapely.line_locate_point(line, shapely.points(b)))
    cut = np.searchsorted(np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))]), along)
    loop = np.vstack([a, b, ring[cut:-1], ring[:cut], b, a])
    spliced = list(paths)
    spliced[vehicle] = _without_repeats(np.vstack([path[: piece + 1], loop, path[piece + 1 :]]))
    return spliced


def _without_repeats(path: np.ndarray) -> np.ndarray:
    return path[np.append(True, (np.abs(np.diff(path, axis=0)) > 1e-9).any(axis=1))]


def hang(grid: Grid, tours: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the tours, (n, 2) path cells, with every free path cell hung on that moves can reach from them.

    Two cells beside each other become a detour of a move of the tour, for 2 moves; one alone a leaf, for 2. A cell that
    several tours could reach goes to the shortest of them. Cells hung on carry further ones.
    """
    rows, columns = grid.cells.shape
    sizes = np.array([len(t) for t in tours])
    cell = [int(c) for t in tours for c in np.asarray(t)[:, 0] * columns + np.asarray(t)[:, 1]]
    begin = np.concatenate([[0], np.cumsum(sizes)])
    after = np.arange(1, begin[-1] + 1)
    after[begin[1:] - 1] = begin[:-1]
    before = np.empty_like(after)
    before[after] = np.arange(begin[-1])
    after, before = after.tolist(), before.tolist()
    owner = np.repeat(np.arange(len(tours)), sizes).tolist()
    lengths = sizes.tolist()
    nodes: dict[int, list[int]] = {}
    for n, c in enumerate(cell):
        nodes.setdefault(c, []).append(n)
    visited = np.zeros(rows * columns, dtype=bool)
    visited[cell] = True
    right, up = grid.right.ravel(), grid.up.ravel()
    sides = (
        (1, right, 0),
        (-1, right, -1),
        (columns, up, 0),
        (-columns, up, -columns),
    )  # step, moves, where the move is kept

    def neighbours(c: int) -> list[tuple[int, int]]:
        return [(c + step, step) for step, moves, kept in sides if 0 <= c + step < visited.size and moves[c + kept]]

    def insert(n: int, new: list[int]) -> None:
        end = after[n]
        for c in new:
            cell.append(c)
            owner.append(owner[n])
            nodes.setdefault(c, []).append(len(cell) - 1)
            after.append(end)
            before.append(n)
            after[n] = before[end] = n = len(cell) - 1
            visited[c] = True
        lengths[owner[n]] += len(new)

    free = grid.cells.ravel()
    fresh = np.flatnonzero(free & ~visited).tolist()
    while fresh:
        hung = False
        for x in fresh:
            if visited[x]:
                continue
            for y, across in neighbours(x):
                if visited[y]:
                    continue
                ends = [(u, u + across) for u, _ in neighbours(x) if visited[u]]
                spots = [
                    (n, [x, y] if after_is else [y, x])
                    for u, w in ends
                    if 0 <= w < visited.size and visited[w] and (w, w - y) in neighbours(y)
                    for n, after_is in [(n, True) for n in nodes[u] if cell[after[n]] == w]
                    + [(before[n], False) for n in nodes[u] if cell[before[n]] == w]
                ]
                if spots:
                    insert(*min(spots, key=lambda s: (lengths[owner[s[0]]], s[0])))
                    hung = True
                    break
        leaves = [x for x in fresh if not visited[x] and any(visited[u] for u, _ in neighbours(x))]
        for x in leaves if not hung else []:
            n = min((n for u, _ in neighbours(x) if visited[u] for n in nodes[u]), key=lambda n: (lengths[owner[n]], n))
            insert(n, [x, cell[n]])
            hung = True
        if not hung:
            break
        fresh = [x for x in fresh if not visited[x]]
    walks = [_walk(np.array(after), start) for start in begin[:-1]]
    index = np.array(cell)
    return [np.column_stack([index[w] // columns, index[w] % columns]) for w in walks]


@nb.njit(cache=True)
def _walk(after: np.ndarray, start: int) -> np.ndarray:
    """Return the nodes of a ring of successors from `start`."""
    walk = np.empty(len(after), np.int64)
    count, n = 0, start
    while True:
        walk[count] = n
        count += 1
        n = after[n]
        if n == start:
            return walk[:count]
