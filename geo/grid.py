"""The grid: path cells of side `spacing` and hypervertices of two by two of them, laid over an area at any angle."""

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching
from shapely import MultiPolygon

from quarterdeck.geo.scanline import inside

TOLERANCE = 1e-6  # of the spacing: tracks keep this far inside, so that exact predicates agree in every frame


@dataclass(frozen=True, slots=True)
class Grid:
    """A lattice over an area. Row = along the lattice's y axis, column = along its x axis.

    `spacing` is the side of a path cell in metres, `angle` the direction of the lattice's x axis in radians
    counter-clockwise from east, `origin` the (x, y) metres of its corner. `cells` (2R, 2C) bool: the path cell's centre is
    inside. `hypervertices` (R, C) bool: complete ones, whose four centres and the four moves between them are inside; cell
    (i, j) is of hypervertex (i // 2, j // 2). `right` and `up` (2R, 2C) bool: the move from the cell's centre to that of
    the next column, the next row, is inside. Between two adjacent complete hypervertices both moves are inside.
    """

    spacing: float
    angle: float
    origin: tuple[float, float]
    cells: np.ndarray
    hypervertices: np.ndarray
    right: np.ndarray
    up: np.ndarray

    def centres(self, cells: np.ndarray) -> np.ndarray:
        """Return the (n, 2) metres of the centres of (n, 2) path cells (row, column), which may be fractions."""
        cells = np.asarray(cells, dtype=float).reshape(-1, 2)
        return (cells[:, ::-1] + 0.5) * self.spacing @ _rotation(self.angle).T + np.array(self.origin)

    def cells_at(self, xy: np.ndarray) -> np.ndarray:
        """Return the (n, 2) path cells (row, column) that hold (n, 2) metres; outside the lattice they are out of range."""
        local = (np.asarray(xy, dtype=float).reshape(-1, 2) - np.array(self.origin)) @ _rotation(self.angle)
        return np.floor(local / self.spacing).astype(np.int64)[:, ::-1]


def lay_grid(area: MultiPolygon, spacing: float, angle: float, shift: tuple[float, float]) -> Grid:
    """Lay a lattice at `angle` over `area`, a corner at `shift` (x, y) metres in its own axes, modulo 2 `spacing`.

    Where a sliver lies between two adjacent hypervertices, the fewest are dropped that leave no such pair (a minimum
    vertex cover, which in a bipartite graph follows from a maximum matching: König's theorem).
    """
    edges = turned(area_edges(area, spacing), angle, spacing) - np.tile(shift, 2) / spacing
    corners = edges.reshape(-1, 2) if len(edges) else np.ones((1, 2))
    low, high = 2.0 * np.floor(corners.min(axis=0) / 2.0), 2.0 * np.ceil(corners.max(axis=0) / 2.0)
    edges -= np.tile(low, 2)
    columns, rows = (high - low).astype(int)
    cells, right = inside(edges, rows, columns)
    cells_by_column, up = inside(np.ascontiguousarray(edges[:, [1, 0, 3, 2]]), columns, rows)
    cells &= cells_by_column.T
    up = up.T.copy()
    corner = _rotation(angle) @ (low * spacing + np.array(shift))
    return Grid(
        spacing=float(spacing),
        angle=float(angle),
        origin=(float(corner[0]), float(corner[1])),
        cells=cells,
        hypervertices=_hypervertices(cells, right, up),
        right=right,
        up=up,
    )


def area_edges(area: MultiPolygon, spacing: float) -> np.ndarray:
    """Return the (n, 4) edges x0, y0, x1, y1 in metres of all rings of the area, drawn in by a hair (`TOLERANCE`)."""
    rings = shapely.get_rings(shapely.get_parts(area.buffer(-TOLERANCE * spacing, join_style="mitre")))
    coordinates, ring = shapely.get_coordinates(rings, return_index=True)
    return np.hstack([coordinates[:-1], coordinates[1:]])[ring[1:] == ring[:-1]]


def turned(edges: np.ndarray, angle: float, spacing: float) -> np.ndarray:
    """Return edges in the axes of a lattice at `angle`, in path cells instead of metres."""
    return (edges.reshape(-1, 2) @ _rotation(angle) / spacing).reshape(-1, 4)


def _rotation(angle: float) -> np.ndarray:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin], [sin, cos]])


def _hypervertices(cells: np.ndarray, right: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Return the (R, C) complete hypervertices, no two of which are adjacent without both moves between them."""
    free = cells[::2, ::2] & right[::2, ::2] & right[1::2, ::2] & up[::2, ::2] & up[::2, 1::2]
    beside = free[:, :-1] & free[:, 1:] & ~(right[::2, 1:-1:2] & right[1::2, 1:-1:2])
    above = free[:-1] & free[1:] & ~(up[1:-1:2, ::2] & up[1:-1:2, 1::2])
    index = np.arange(free.size).reshape(free.shape)
    one = np.concatenate([index[:, :-1][beside], index[:-1][above]])
    other = np.concatenate([index[:, 1:][beside], index[1:][above]])
    if one.size:
        free.ravel()[_cover(one, other, index.shape[1])] = False
    return free


def _cover(one: np.ndarray, other: np.ndarray, columns: int) -> np.ndarray:
    """Return a smallest set of grid indices that touches every pair (one[i], other[i]) of adjacent cells."""
    white = (one // columns + one % columns) % 2 == 0
    left, right = np.where(white, one, other), np.where(white, other, one)
    names_left, left = np.unique(left, return_inverse=True)
    names_right, right = np.unique(right, return_inverse=True)
    graph = csr_array((np.ones(len(left)), (left, right)), shape=(len(names_left), len(names_right)))
    mate_of_left = maximum_bipartite_matching(graph, perm_type="column")
    mate_of_right = np.full(len(names_right), -1)
    mate_of_right[mate_of_left[mate_of_left >= 0]] = np.flatnonzero(mate_of_left >= 0)
    # König: what alternating paths reach from the unmatched on the left; the cover is the left without, the right within
    reached_left, reached_right = mate_of_left < 0, np.zeros(len(names_right), dtype=bool)
    while True:
        fresh = np.zeros(len(names_right), dtype=bool)
        fresh[right[reached_left[left]]] = True
        fresh &= ~reached_right
        if not fresh.any():
            break
        reached_right |= fresh
        reached_left[mate_of_right[fresh]] = True
    return np.concatenate([names_left[~reached_left], names_right[reached_right]])
