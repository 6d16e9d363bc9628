"""Where the grid lies: simulated annealing of its shift and rotation (ecdis-sa-darp, section III B, Algorithm 1).

Everything here is counted in path cells in the axes of the lattice: the area is turned and moved, not the lattice, and free
hypervertices are counted by scanline, so that an evaluation costs microseconds.
"""

from dataclasses import dataclass
from typing import Literal

import numba as nb
import numpy as np
import shapely
from shapely import MultiPolygon

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.grid import Grid, area_edges, crossings, lay_grid, turned

Method = Literal["annealed", "paper", "none"]


@dataclass(frozen=True, slots=True)
class Objective:
    """The weights of F = k1 F1 + k2 F2 - k3 F3 (eq. 7); k1 + k2 = 1 (eq. 13).

    F1 is the share of the area that free hypervertices hold, F2 how well the area fills its bounding box in the lattice's
    axes, F3 the imbalance of the margins between that box and the box of the hypervertices. The paper gives no values;
    these are those of the optimised-DARP authors.
    """

    k1: float = 0.68
    k2: float = 0.32
    k3: float = 0.25

    def __post_init__(self) -> None:
        """Check eq. 13. Raises InputError."""
        if not all(0 <= k <= 1 for k in (self.k1, self.k2, self.k3)) or abs(self.k1 + self.k2 - 1) > 1e-9:
            raise InputError(f"weights k1={self.k1:g}, k2={self.k2:g}, k3={self.k3:g} must be in 0..1, and k1 + k2 = 1")


@dataclass(frozen=True, slots=True)
class Annealing:
    """The constants of Algorithm 1: temperature `t` falls to `t_min` by factors `alpha`, `k` states at each.

    `gamma` is the chance that a neighbour lies in the negative direction. `refined`: how many of the best states met are
    refined by a pattern search (0: none, as printed).
    """

    t: float = 0.1
    t_min: float = 0.0005
    alpha: float = 0.9
    k: int = 200
    gamma: float = 0.5
    refined: int = 24

    def __post_init__(self) -> None:
        """Check that the schedule ends. Raises InputError."""
        if not (0 < self.t_min <= self.t and 0 < self.alpha < 1 and self.k >= 1 and 0 <= self.gamma <= 1):
            raise InputError("annealing needs 0 < t_min <= t, 0 < alpha < 1, k >= 1 and gamma in 0..1")


@dataclass(frozen=True, slots=True)
class Placement:
    """A placed grid, the index `f` it reached and its terms; `evaluations` is the number of states tried."""

    grid: Grid
    f: float
    f1: float
    f2: float
    f3: float
    evaluations: int


def place(
    area: MultiPolygon,
    spacing: float,
    *,
    seed: int = 0,
    objective: Objective = Objective(),
    angle: float | None = None,
    method: Method = "annealed",
    annealing: Annealing = Annealing(),
) -> Placement:
    """Place the grid over `area` (what is to be covered, obstacles taken out), tracks `spacing` metres apart.

    `annealed` is Algorithm 1 with its two misprints corrected (it maximises, and keeps the best state ever met), then
    refined; `paper` the algorithm as printed, which counts a node when its centre is inside; `none` leaves the lattice at
    the corner of the bounding box. `angle` in radians fixes the rotation. Every track of the grid returned is inside the
    area, whatever the method. Raises InputError if the area holds no hypervertex at this spacing.
    """
    if not (np.isfinite(spacing) and spacing > 0):
        raise InputError(f"spacing {spacing:g} must be a positive number of metres")
    edges = area_edges(area, spacing)
    if not len(edges):
        raise InputError(f"the area is narrower than a track everywhere at spacing {spacing:g} m; choose a smaller spacing")
    centre = edges[:, :2].mean(axis=0)
    edges = (edges - np.tile(centre, 2)) / spacing
    target = (area.area / spacing**2, objective.k1, objective.k2, objective.k3)
    fixed = np.nan if angle is None else float(angle)
    if method == "none":
        theta = 0.0 if angle is None else float(angle)
        x, y = turned(edges, theta, 1.0).reshape(-1, 2).min(axis=0) % 2.0
        states, evaluations = np.array([[x, y, theta]]), 1
    else:
        schedule = (annealing.t, annealing.t_min, annealing.alpha, annealing.k, annealing.gamma)
        rng = np.random.default_rng(seed)
        states, evaluations = _anneal(edges, target, method == "paper", fixed, schedule, rng)
        if method == "annealed" and annealing.refined:
            states, tried = _refine(edges, target, fixed, states[-annealing.refined :], rng)
            evaluations += tried
    x, y, theta = (float(v) for v in states[-1])
    f, f1, f2, f3 = index(edges, target, method == "paper", x, y, theta)
    cos, sin = np.cos(theta), np.sin(theta)
    shift = (x * spacing + cos * centre[0] + sin * centre[1], y * spacing - sin * centre[0] + cos * centre[1])
    grid = lay_grid(area, spacing, theta, shift)
    if not grid.hypervertices.any():
        raise InputError(f"the area holds no 2 x 2 path cells at spacing {spacing:g} m; choose a smaller spacing")
    _prove(grid, area)
    return Placement(grid, f, f1, f2, f3, int(evaluations))


def _prove(grid: Grid, area: MultiPolygon) -> None:
    """Check with exact predicates that every move of the grid is inside the area. Raises RuntimeError, a defect of ours."""
    shapely.prepare(area)
    for moves, axis in ((grid.right, 1), (grid.up, 0)):
        change = np.diff(moves.astype(np.int8), axis=axis, prepend=0, append=0)
        order = [0, 1] if axis else [1, 0]
        starts, ends = (np.argwhere((change == d).transpose(order))[:, order] for d in (1, -1))
        lines = np.stack([grid.centres(starts), grid.centres(ends)], axis=1)
        if not shapely.covers(area, shapely.linestrings(lines)).all():
            raise RuntimeError(f"a track at spacing {grid.spacing:g} m leaves the area")


@nb.njit(cache=True)
def index(edges, target, literal, x, y, angle):  # type: ignore[no-untyped-def]
    """Return F, F1, F2, F3 (eqs 7-12) of a lattice with a corner at (x, y) of its own axes, turned by `angle`.

    `edges` (n, 4) are the area's in path cells, `target` its size in path cells and k1, k2, k3. `literal` counts
    hypervertices by their centre alone.
    """
    cells, k1, k2, k3 = target
    cos, sin = np.cos(angle), np.sin(angle)
    turned = np.empty_like(edges)
    for e in range(len(edges)):
        turned[e, 0] = cos * edges[e, 0] + sin * edges[e, 1] - x
        turned[e, 1] = cos * edges[e, 1] - sin * edges[e, 0] - y
        turned[e, 2] = cos * edges[e, 2] + sin * edges[e, 3] - x
        turned[e, 3] = cos * edges[e, 3] - sin * edges[e, 2] - y
    left, right = turned[:, 0].min(), turned[:, 0].max()
    bottom, top = turned[:, 1].min(), turned[:, 1].max()
    column, row = np.floor(left / 2.0), np.floor(bottom / 2.0)
    for e in range(len(edges)):
        turned[e, 0] -= 2.0 * column
        turned[e, 1] -= 2.0 * row
        turned[e, 2] -= 2.0 * column
        turned[e, 3] -= 2.0 * row
    columns, rows = int(np.ceil(right / 2.0) - column), int(np.ceil(top / 2.0) - row)
    free, conflicts = _by_centre(turned, rows, columns) if literal else _by_tracks(turned, rows, columns)
    count, first_row, last_row, first_column, last_column = -conflicts, rows, -1, columns, -1
    for r in range(rows):
        for c in range(columns):
            if free[r, c]:
                count += 1
                first_row, last_row = min(first_row, r), r
                first_column, last_column = min(first_column, c), max(last_column, c)
    f1, f2, f3 = 4.0 * count / cells, cells / ((right - left) * (top - bottom)), 1.0
    if last_row >= 0:
        margin_x = (right - 2.0 * (column + last_column + 1)) - (2.0 * (column + first_column) - left)
        margin_y = (top - 2.0 * (row + last_row + 1)) - (2.0 * (row + first_row) - bottom)
        f3 = abs(margin_x) / (2.0 * (right - left)) + abs(margin_y) / (2.0 * (top - bottom))
    return k1 * f1 + k2 * f2 - k3 * f3, f1, f2, f3


@nb.njit(cache=True)
def _by_tracks(edges, rows, columns):  # type: ignore[no-untyped-def]
    """Return the (rows, columns) hypervertices with all four moves inside, and how many adjacent pairs are parted."""
    first, x = crossings(edges, 2 * rows)
    free = np.zeros((rows, columns), np.uint8)
    beside = np.zeros((rows, columns), np.uint8)  # a gap lies between this one and the next column's
    above = np.zeros((rows, columns), np.uint8)
    for r in range(rows):
        a, b, last = first[2 * r], first[2 * r + 1], -2
        while a + 1 < first[2 * r + 1] and b + 1 < first[2 * r + 2]:
            start = int(np.ceil((max(x[a], x[b]) - 0.5) / 2.0))
            stop = int(np.floor((min(x[a + 1], x[b + 1]) - 1.5) / 2.0)) + 1
            if start < stop:
                for c in range(start, stop):
                    free[r, c] = 1
                if start == last + 1:
                    beside[r, last] = 1
                last = stop - 1
            if x[a + 1] < x[b + 1]:
                a += 2
            else:
                b += 2
    for e in range(len(edges)):
        x0, y0, x1, y1 = edges[e]
        if x0 == x1:
            continue
        slope = (y1 - y0) / (x1 - x0)
        for j in range(int(np.ceil(min(x0, x1) - 0.5)), int(np.floor(max(x0, x1) - 0.5)) + 1):
            line = int(np.floor(y0 + (j + 0.5 - x0) * slope - 0.5))  # the move up from this line is crossed
            if line % 2 == 0:
                free[line // 2, j // 2] = 0
            elif line > 0:
                above[line // 2, j // 2] = 1
    conflicts = 0
    for r in range(rows):
        for c in range(columns):
            if free[r, c]:
                conflicts += beside[r, c] and free[r, c + 1]
                conflicts += above[r, c] and r + 1 < rows and free[r + 1, c]
    return free, conflicts


@nb.njit(cache=True)
def _by_centre(edges, rows, columns):  # type: ignore[no-untyped-def]
    """Return the (rows, columns) hypervertices whose centre is inside, and 0."""
    first, x = crossings(edges / 2.0, rows)
    free = np.zeros((rows, columns), np.uint8)
    for r in range(rows):
        for at in range(first[r], first[r + 1] - 1, 2):
            for c in range(int(np.ceil(x[at] - 0.5)), int(np.ceil(x[at + 1] - 0.5))):
                free[r, c] = 1
    return free, 0


@nb.njit(cache=True)
def _anneal(edges, target, literal, fixed, schedule, rng):  # type: ignore[no-untyped-def]
    """Algorithm 1. Return (n, 3) states x, y, angle, the one to be returned last, and how many were tried.

    As meant, they are the best of each temperature in rising order of F; `literal`, the one that the printed one returns.
    """
    t, t_min, alpha, k, gamma = schedule
    x, y, angle = 0.5, 0.5, 0.0 if np.isnan(fixed) else fixed
    current = index(edges, target, literal, x, y, angle)[0]
    rounds = 1 + max(0, int(np.ceil(np.log(t_min / t) / np.log(alpha))))
    states, scores = np.empty((rounds, 3)), np.full(rounds, -np.inf)
    best, returned, tried = -np.inf, (x, y, angle), 1
    for n in range(rounds):
        for i in range(k):
            if current > scores[n]:
                scores[n] = current
                states[n] = (x, y, angle)
            if current > best:
                best, returned = current, (x, y, angle)
            if i == k - 1:
                step_x, step_y, step_angle = rng.random() * 2.0, rng.random() * 2.0, rng.random() * np.pi / 2
            else:
                step_x = rng.random() / 8.0 * (1.0 if rng.random() > gamma else -1.0)
                step_y = rng.random() / 8.0 * (1.0 if rng.random() > gamma else -1.0)
                step_angle = rng.random() * np.pi / 4 * (1.0 if rng.random() > gamma else -1.0)
            new_x, new_y = (x + step_x) % 2.0, (y + step_y) % 2.0
            new_angle = (angle + step_angle) % (np.pi / 2) if np.isnan(fixed) else fixed
            new = index(edges, target, literal, new_x, new_y, new_angle)[0]
            tried += 1
            gain = current - new if literal else new - current
            if gain >= 0 or np.exp(gain / t) > rng.random():
                x, y, angle, current = new_x, new_y, new_angle, new
                if literal:  # misprint: any accepted state overwrites the best
                    best, returned = new, (x, y, angle)
        t *= alpha
    if literal:
        states[0] = returned
        return states[:1], tried
    return states[np.argsort(scores)], tried


@nb.njit(cache=True)
def _refine(edges, target, fixed, states, rng):  # type: ignore[no-untyped-def]
    """Refine states by random pattern search of shrinking steps. Return the best as (1, 3), and how many were tried."""
    best, winner, tried = -np.inf, np.empty((1, 3)), 0
    for n in range(len(states)):
        x, y, angle = states[n]
        current = index(edges, target, False, x, y, angle)[0]
        size = 1.0
        for _ in range(80):
            new_x, new_y = (x + size * rng.normal(0.0, 0.3)) % 2.0, (y + size * rng.normal(0.0, 0.3)) % 2.0
            new_angle = (angle + size * rng.normal(0.0, 0.06)) % (np.pi / 2) if np.isnan(fixed) else fixed
            new = index(edges, target, False, new_x, new_y, new_angle)[0]
            tried += 1
            if new >= current:
                x, y, angle, current = new_x, new_y, new_angle, new
            else:
                size *= 0.95
        if current > best:
            best = current
            winner[0] = (x, y, angle)
    return winner, tried
