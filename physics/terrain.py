"""Ground that is not flat: a grid of heights, read from a file, and how rovers stand on it."""

import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from quarterdeck.geo.errors import InputError
from quarterdeck.mission.mission import Mission

MOST_BYTES = 200_000_000  # of an NPZ unpacked


@dataclass(frozen=True, slots=True)
class Terrain:
    """Heights at the nodes of a square grid: `heights` (r, c) metres, row 0 southernmost, NaN where not known; `origin`
    x, y of heights[0, 0] in the plan's frame and `cell` between nodes, metres.

    Between nodes each cell is two triangles, parted from its north-west to its south-east corner, as PyBullet parts
    them. Raises InputError for what is no such grid.
    """

    origin: tuple[float, float]
    cell: float
    heights: np.ndarray

    def __post_init__(self) -> None:
        if self.heights.ndim != 2 or min(self.heights.shape) < 2 or np.isinf(self.heights).any():
            raise InputError("terrain: heights must be a table of at least 2 x 2 finite numbers")
        if not (np.isfinite([*self.origin, self.cell]).all() and self.cell > 0):
            raise InputError(f"terrain: origin {self.origin} and cell {self.cell} must be finite, the cell above 0")

    def height(self, xy: np.ndarray) -> np.ndarray:
        """Return (...) metres at (..., 2) places; NaN where the terrain is not known."""
        at = (np.asarray(xy, float) - self.origin) / self.cell
        last = np.array(self.heights.shape[::-1]) - 2
        corner = np.clip(np.nan_to_num(np.floor(at)), 0, last).astype(int)
        j, i = corner[..., 0], corner[..., 1]
        u, v = np.moveaxis(at - corner, -1, 0)
        h = self.heights
        se, nw = h[i, j + 1], h[i + 1, j]
        low = h[i, j] + u * (se - h[i, j]) + v * (nw - h[i, j])
        high = h[i + 1, j + 1] + (1 - u) * (nw - h[i + 1, j + 1]) + (1 - v) * (se - h[i + 1, j + 1])
        inside = (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
        return np.where(inside, np.where(u + v <= 1, low, high), np.nan)

    def crop(self, bounds: tuple[float, float, float, float]) -> "Terrain | None":
        """Return the cells within and across `bounds` (w, s, e, n) metres; None if there are none."""
        rows, columns = self.heights.shape
        low, high = (np.array(bounds).reshape(2, 2) - self.origin) / self.cell
        j, i = np.maximum(np.floor(low), 0).astype(int).tolist()
        k, m = np.minimum(np.ceil(high), (columns - 1, rows - 1)).astype(int).tolist()
        if k <= j or m <= i:
            return None
        x, y = self.origin
        return Terrain((x + j * self.cell, y + i * self.cell), self.cell, self.heights[i : m + 1, j : k + 1])

    def range(self, bounds: tuple[float, float, float, float]) -> tuple[float, float]:
        """Return the least and the greatest height known within and beside `bounds` (w, s, e, n); 0, 0 for none."""
        part = self.crop(bounds)
        known = part.heights[np.isfinite(part.heights)] if part is not None else np.zeros(0)
        return (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)


def stand(
    terrain: Terrain, xy: np.ndarray, heading: np.ndarray, length: np.ndarray, width: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the height (k,) metres, pitch (k,) and roll (k,) radians of vehicles at (k, 2) that rest on the ground at the
    middle of their four sides; nose up and port side up are positive. NaN where the terrain is not known.
    """
    ahead = np.column_stack([np.cos(heading), np.sin(heading)])
    aport = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    half, side = length[:, None] / 2 * ahead, width[:, None] / 2 * aport
    nose, tail, port, star = (terrain.height(xy + d) for d in (half, -half, side, -side))
    return (nose + tail) / 2, np.arctan2(nose - tail, length), np.arctan2(port - star, width)


def steepness(pitch: np.ndarray, roll: np.ndarray) -> np.ndarray:
    """Return (k,) radians: how steep the ground is, whichever way it falls."""
    return np.arctan(np.hypot(np.tan(pitch), np.tan(roll)))


def read_terrain(path: str) -> Terrain:
    """Read a terrain: NPZ with `origin`, `cell` and `heights`, or an ESRI ASCII grid (its rows run from the north), in
    metres of the plan's frame. Raises InputError.
    """
    try:
        if Path(path).suffix.lower() == ".npz":
            (x, y), cell, heights = _load(path)
            return Terrain((float(x), float(y)), float(cell), heights)
        return _read_ascii(Path(path).read_text(encoding="ascii"))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror or error})") from None
    except KeyError as error:
        what = str(error.args[0]).split()[0]
        raise InputError(f"{path}: has no {what!r}; give an NPZ of origin, cell, heights or an ESRI ASCII grid") from None
    except (ValueError, TypeError, ArithmeticError, MemoryError) as error:
        what = " ".join(str(error).split())[:120]
        raise InputError(f"{path}: is neither NPZ of origin, cell, heights nor an ESRI ASCII grid ({what})") from None


def _load(path: str) -> list[np.ndarray]:
    """Return origin, cell and heights of an NPZ file. Raises ValueError if it is damaged, or unpacks to a flood."""
    try:
        with zipfile.ZipFile(path) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
        if unpacked > MOST_BYTES:
            raise ValueError(f"it unpacks to more than {MOST_BYTES // 1_000_000} MB")
        with np.load(path) as file:
            return [file[name].astype(float, casting="safe") for name in ("origin", "cell", "heights")]
    except (OSError, KeyError, ValueError, TypeError, MemoryError):
        raise
    except Exception as error:  # zipfile's, zlib's and the tokenizer's: whatever they meet in a damaged file
        raise ValueError(str(error)) from None


def _read_ascii(text: str) -> Terrain:
    lines = text.split("\n")
    count = next((n for n, line in enumerate(lines) if line.strip() and not line.strip()[0].isalpha()), len(lines))
    head = {key.lower(): float(value) for key, value in (line.split() for line in lines[:count] if line.strip())}
    rows, columns, cell = int(head["nrows"]), int(head["ncols"]), head["cellsize"]
    heights = np.array(" ".join(lines[count:]).split(), float).reshape(rows, columns)[::-1]
    heights = np.where(heights == head.get("nodata_value", -9999.0), np.nan, heights)
    # A corner is the outer one of the south-western cell; the heights are those of the cells' centres.
    x, y = (head[f"{a}llcenter"] if f"{a}llcenter" in head else head[f"{a}llcorner"] + cell / 2 for a in "xy")
    return Terrain((x, y), cell, heights)


def check_terrain(terrain: Terrain, mission: Mission) -> None:
    """Raise InputError if a ground vehicle's route leaves the terrain."""
    for route in mission.routes:
        vehicle = mission.vehicle(route.vehicle)
        if vehicle.domain != "ground" or not len(route.waypoints):
            continue
        xy = route.xyz[:, :2]
        steps = np.maximum(1, np.ceil(np.hypot(*np.diff(xy, axis=0).T) / terrain.cell)).astype(int)
        legs = zip(xy[:-1], xy[1:], steps, strict=True)
        places = np.concatenate([xy[:1], *(np.linspace(a, b, n + 1)[1:] for a, b, n in legs)])
        off = np.flatnonzero(np.isnan(terrain.height(places)))
        if len(off):
            x, y = places[off[0]]
            raise InputError(
                f"terrain: not known at x {x:.1f} m, y {y:.1f} m on the route of {vehicle.id!r}; "
                "give one that covers it, in metres of the plan's frame"
            )
