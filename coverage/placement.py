"""Where the grid lies: simulated annealing of its shift and rotation (ecdis-sa-darp, section III B, Algorithm 1).

Everything here is counted in path cells in the axes of the lattice: the area is turned and moved, not the lattice, and free
hypervertices are counted by scanline, so that an evaluation costs microseconds.
"""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import shapely
from shapely import MultiPolygon

from quarterdeck.geo.deadline import time_is_up
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.grid import Grid, area_edges, lay_grid, turned
from quarterdeck.geo.scanline import best_shifts, held

Method = Literal["annealed", "paper", "none"]
State = tuple[float, float, float]  # shift x, shift y in path cells, angle
Target = tuple[float, float, float, float]  # the area in path cells, k1, k2, k3

TRIES = 30  # steps of the refinement of one state
DEAR = 30_000  # path cells


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

    `gamma` is the chance that a neighbour lies in the negative direction. `refined`: how many of the temperatures' best
    states are refined (0: none, as printed). Where states are dear, on areas of more than `DEAR` path cells, `k` and
    `refined` are lessened: the border, which is what a better place wins, is a small part of such an area.
    """

    t: float = 0.1
    t_min: float = 0.0005
    alpha: float = 0.95
    k: int = 30
    gamma: float = 0.5
    refined: int = 100

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
    area, whatever the method. Raises InputError if the area holds no hypervertex at this spacing, or its
    box too many path cells to hold, as that of areas far apart.
    """
    if not (np.isfinite(spacing) and spacing > 0):
        raise InputError(f"spacing {spacing:g} must be a positive number of metres")
    if angle is not None and not np.isfinite(angle):
        raise InputError(f"angle {angle:g} must be a finite number")
    area = shapely.normalize(area)  # the same whatever vertex its rings begin at
    edges = area_edges(area, spacing)
    if not len(edges):
        raise InputError(f"the area is narrower than a track everywhere at spacing {spacing:g} m; choose a smaller spacing")
    centre = edges[:, :2].mean(axis=0)
    edges = (edges - np.tile(centre, 2)) / spacing
    if (cells := _most_cells(edges, angle)) > MAX_CELLS:
        raise InputError(
            f"the area's box has up to {cells:,} path cells at spacing {spacing:g} m, more than {MAX_CELLS:,}; "
            "choose a larger spacing, or plan what is far apart one by one"
        )
    target = (area.area / spacing**2, objective.k1, objective.k2, objective.k3)
    less = min(1.0, DEAR / target[0])
    annealing = replace(annealing, k=math.ceil(less * annealing.k), refined=math.ceil(less * annealing.refined))
    rng, literal = np.random.default_rng(seed), method == "paper"
    if method == "none":
        theta = angle or 0.0
        x, y = turned(edges, theta, 1.0).reshape(-1, 2).min(axis=0) % 2.0
        states, tried = [(float(x), float(y), float(theta))], 1
    else:
        states, tried = (_anneal_as_printed if literal else _anneal)(edges, target, angle, annealing, rng)
    if method == "annealed" and annealing.refined:
        best, more = _refine(edges, target, angle, states[-annealing.refined :], rng)
        states, tried = [best], tried + more
    x, y, theta = states[-1]
    f, f1, f2, f3 = index(edges, target, states[-1], literal=literal)
    cos, sin = np.cos(theta), np.sin(theta)
    shift = (x * spacing + cos * centre[0] + sin * centre[1], y * spacing - sin * centre[0] + cos * centre[1])
    grid = lay_grid(area, spacing, theta, shift)
    if not grid.hypervertices.any():
        raise InputError(f"the area has no room for tracks {spacing:g} m apart; choose a smaller spacing")
    _prove(grid, area)
    return Placement(grid, f, f1, f2, f3, tried)


MAX_CELLS = 56_000_000  # path cells of a lattice's box, free or not: planning holds up to 28 bytes for each


def _most_cells(edges: np.ndarray, angle: float | None) -> int:
    """Return the path cells of the area's largest box, over the directions that the lattice may have."""
    directions = np.linspace(0.0, np.pi / 2, 64) if angle is None else [angle]
    boxes = (np.ptp(turned(edges, d, 1.0).reshape(-1, 2), axis=0) for d in directions)
    return int(max(width * height for width, height in boxes))


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


def index(
    edges: np.ndarray, target: Target, state: tuple[float, float, float], *, literal: bool = False
) -> tuple[float, float, float, float]:
    """Return F, F1, F2, F3 (eqs 7-12) of a lattice with a corner at x, y of its own axes, turned by an angle: the `state`.

    `edges` (n, 4) are the area's in path cells, `target` its size in path cells and k1, k2, k3. `literal` counts
    hypervertices by their centre alone. F1 may exceed 1, against eq. 8: complete hypervertices reach up to half a path cell
    over the border.
    """
    cells, k1, k2, k3 = target
    count, width, height, margin_x, margin_y = held(edges, *state, literal)
    f1, f2 = 4.0 * count / cells, cells / (width * height)
    f3 = abs(margin_x) / (2.0 * width) + abs(margin_y) / (2.0 * height) if margin_x == margin_x else 1.0
    return k1 * f1 + k2 * f2 - k3 * f3, f1, f2, f3


def _anneal(
    edges: np.ndarray, target: Target, fixed: float | None, annealing: Annealing, rng: np.random.Generator
) -> tuple[list[State], int]:
    """Algorithm 1 as it is meant. Return the best state of each temperature, best last, and how many were tried."""
    state: State = (0.5, 0.5, 0.0 if fixed is None else fixed)
    current = index(edges, target, state)[0]
    met: list[tuple[float, State]] = []
    t, tried = annealing.t, 1
    while t > annealing.t_min:
        best, best_state = current, state
        for i in range(annealing.k):
            new_state = _moved(state, fixed, i == annealing.k - 1, annealing.gamma, rng)
            new = index(edges, target, new_state)[0]
            tried += 1
            if new >= current or math.exp((new - current) / t) > rng.random():
                state, current = new_state, new
                if current > best:
                    best, best_state = current, state
        met.append((best, best_state))
        t *= annealing.alpha
        if time_is_up("the placement of the grid"):
            break
    return [state for _, state in sorted(met)], tried


def _anneal_as_printed(
    edges: np.ndarray, target: Target, fixed: float | None, annealing: Annealing, rng: np.random.Generator
) -> tuple[list[State], int]:
    """Algorithm 1 to the letter: it accepts like a minimiser, and any accepted state overwrites the best."""
    state: State = (0.5, 0.5, 0.0 if fixed is None else fixed)
    best, best_state, t, tried = 0.0, state, annealing.t, 0
    while t > annealing.t_min:
        for i in range(annealing.k):
            current = index(edges, target, state, literal=True)[0]
            if current > best:
                best, best_state = current, state
            new_state = _moved(state, fixed, i == annealing.k - 1, annealing.gamma, rng)
            new = index(edges, target, new_state, literal=True)[0]
            tried += 1
            if math.exp(min(0.0, (current - new) / t)) > rng.random():
                best, best_state, state = new, new_state, new_state
        t *= annealing.alpha
        if time_is_up("the placement of the grid"):
            break
    return [best_state], tried


def _moved(state: State, fixed: float | None, restart: bool, gamma: float, rng: np.random.Generator) -> State:
    """Return a new state anywhere, or a neighbour: up to delta / 4 and 45 degrees away; delta is half a path cell."""
    step = rng.random(3) * ((2.0, 2.0, math.pi / 2) if restart else (0.125, 0.125, math.pi / 4))
    if not restart:
        step *= np.where(rng.random(3) > gamma, 1.0, -1.0)
    return _wrapped(state[0] + step[0], state[1] + step[1], state[2] + step[2], fixed)


def _wrapped(x: float, y: float, angle: float, fixed: float | None) -> State:
    return float(x % 2.0), float(y % 2.0), float(angle % (math.pi / 2)) if fixed is None else fixed


def _refine(
    edges: np.ndarray, target: Target, fixed: float | None, states: list[State], rng: np.random.Generator
) -> tuple[State, int]:
    """Refine each state by random steps that shrink, each followed by the best shifts along either axis.

    Returns the best state of all, and how many were tried.
    """
    results: list[tuple[float, State]] = []
    tried = 0
    for state in states:
        current, size = index(edges, target, state)[0], 1.0
        for dx, dy, turn in rng.normal(0.0, (0.3, 0.3, 0.06), (TRIES, 3)):
            if time_is_up("the placement of the grid"):
                return max([*results, (current, state), (index(edges, target, states[-1])[0], states[-1])])[1], tried
            x, y, angle = _wrapped(state[0] + size * dx, state[1] + size * dy, state[2] + size * turn, fixed)
            near = [(x, y, angle), *((float(v), y, angle) for v in best_shifts(edges, y, angle, 2))]
            tries = [(index(edges, target, s)[0], s) for s in near]
            x = max(tries)[1][0]
            near = [(x, float(v), angle) for v in best_shifts(edges, -x % 2.0, angle + math.pi / 2, 2)]
            tries += [(index(edges, target, s)[0], s) for s in near]
            new, new_state = max(tries)
            tried += len(tries)
            if new >= current:
                state, current = new_state, new
            else:
                size *= 0.95
        results.append((current, state))
    best = max(results)[1]
    return best, tried
