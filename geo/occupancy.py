"""Occupancy maps: the digital twin as a grid, from a site or a ROS map_server .yaml and image, and written as such.

The format is that of ROS map_server and nav2_map_server: https://docs.ros.org/en/noetic/api/map_server (trinary and scale).
"""

import io
import math
import struct
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from PIL import Image
from scipy.ndimage import distance_transform_edt
from shapely import get_coordinates

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.files import write_files
from quarterdeck.geo.scanline import inside
from quarterdeck.geo.scenario import Site

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
MAX_CELLS = 16_000_000
IMAGE = {FREE: 254, OCCUPIED: 0, UNKNOWN: 205}  # grey levels that map_saver writes


@dataclass(frozen=True, slots=True)
class Occupancy:
    """A grid of cells of side `resolution` metres. `cells` (rows, cols) int8: FREE, OCCUPIED or UNKNOWN.

    `origin` is the (x, y) metres of the outer corner of cell (0, 0), `yaw` the radians by which the grid is turned about
    it, counter-clockwise; columns run along its x axis, rows along its y axis (upwards: unlike a picture's). `place` is
    the (lon, lat) degrees of (0, 0) metres, where that is known.
    """

    cells: np.ndarray
    resolution: float
    origin: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0
    place: tuple[float, float] | None = None

    def to_cells(self, xy: np.ndarray) -> np.ndarray:
        """Return (n, 2) rows and columns, as real numbers, of (n, 2) metres; cell (i, j) spans i..i + 1 and j..j + 1."""
        x, y = (np.asarray(xy, dtype=float).reshape(-1, 2) - self.origin).T
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.column_stack([c * y - s * x, c * x + s * y]) / self.resolution

    def to_metres(self, cells: np.ndarray) -> np.ndarray:
        """Return (n, 2) metres of (n, 2) rows and columns as `to_cells` gives them."""
        v, u = np.asarray(cells, dtype=float).reshape(-1, 2).T * self.resolution
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.column_stack([self.origin[0] + c * u - s * v, self.origin[1] + s * u + c * v])

    def free(self, radius: float = 0.0) -> np.ndarray:
        """Return (rows, cols) bool: a robot of `radius` metres may have its centre in the cell. Unknown is not free.

        Free is a cell whose centre is at least `radius` from the centre of every cell that is not; the map's edge is open.
        """
        free = self.cells == FREE
        if radius <= 0 or free.all():
            return free
        return np.asarray(distance_transform_edt(free) * self.resolution >= radius) & free

    def shifted(self, dx: float, dy: float) -> "Occupancy":
        """Return the map moved by metres."""
        return replace(self, origin=(self.origin[0] + dx, self.origin[1] + dy))


def site_occupancy(site: Site, domain: str, resolution: float, margin: float = 0.0) -> Occupancy:
    """Return the occupancy of a site for a domain: FREE is a cell whose centre is in the operating area, off its obstacles.

    `margin` metres are kept from obstacles. Raises InputError where that would take more than `MAX_CELLS` cells.
    """
    if not (math.isfinite(resolution) and resolution > 0):
        raise InputError(f"resolution {resolution:g} m must be a positive number of metres")
    space = site.navigable(domain, margin)
    x0, y0, x1, y1 = site.operating.bounds
    columns, rows = math.ceil((x1 - x0) / resolution) + 2, math.ceil((y1 - y0) / resolution) + 2
    if rows * columns > MAX_CELLS:
        least = math.sqrt((x1 - x0) * (y1 - y0) / MAX_CELLS)
        raise InputError(f"resolution {resolution:g} m makes {rows * columns:,} cells; at least {least:.3g} m works")
    origin = (x0 - resolution, y0 - resolution)
    rings = [get_coordinates(ring) for part in space.geoms for ring in (part.exterior, *part.interiors)]
    edges = np.concatenate([np.hstack([r[:-1], r[1:]]) for r in rings]) if rings else np.empty((0, 4))
    free = inside((edges - np.tile(origin, 2)) / resolution, rows, columns)[0]
    return Occupancy(np.where(free, FREE, OCCUPIED).astype(np.int8), resolution, origin)


def read_map(source: str | Path) -> Occupancy:
    """Return the map in a map_server .yaml file and its image (.pgm, .png), in metres of the map's own frame.

    Cells at or between the thresholds are UNKNOWN. Its place is that of `geo_origin`, a key of ours that map_server passes
    over. Raises InputError if either file cannot be read or a figure is missing.
    """
    path = Path(source)
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, TypeError, RecursionError, yaml.YAMLError) as error:
        raise InputError(f"{path}: cannot be read ({_one_line(error)}); give the .yaml of a map_server map") from None
    if not isinstance(document, dict) or not isinstance(document.get("image"), str):
        raise InputError(f'{path}: is no map_server map; it must say "image", "resolution" and "origin"')
    resolution = _number(path, document, "resolution")
    occupied = _number(path, document, "occupied_thresh", 0.65)
    free = _number(path, document, "free_thresh", 0.196)
    negate = document.get("negate", 0)
    origin = document.get("origin", [0.0, 0.0, 0.0])
    if not resolution > 0:
        raise InputError(f"{path}: resolution {resolution:g} must be above 0")
    if not 0 <= free <= occupied <= 1:
        raise InputError(f"{path}: free_thresh {free:g} and occupied_thresh {occupied:g} must rise from 0 to 1")
    if negate not in (0, 1):
        raise InputError(f"{path}: negate must be 0 or 1, not {_short(negate)}")
    if not (isinstance(origin, list) and len(origin) == 3 and all(_is_number(v) for v in origin)):
        raise InputError(f"{path}: origin must be [x, y, yaw], not {_short(origin)}")
    if document.get("mode", "trinary") not in ("trinary", "scale"):
        raise InputError(f"{path}: mode {_short(document['mode'])} is not known; use trinary or scale")
    place = document.get("geo_origin")
    if place is not None and not (isinstance(place, list) and len(place) == 2 and all(_is_number(v) for v in place)):
        raise InputError(f"{path}: geo_origin must be [longitude, latitude], not {_short(place)}")
    picture = path.parent / document["image"]
    try:
        with warnings.catch_warnings(action="ignore"), Image.open(picture) as image:
            if image.width * image.height > MAX_CELLS:
                raise InputError(f"{picture}: has {image.width:,} x {image.height:,} cells, more than {MAX_CELLS:,}")
            grey = np.asarray(image.convert("L"), dtype=float)
    except InputError:
        raise
    except (OSError, ValueError, SyntaxError, struct.error, ArithmeticError, Image.DecompressionBombError) as error:
        raise InputError(f"{picture}: cannot be read as an image ({_one_line(error)})") from None
    darkness = (grey if negate else 255.0 - grey) / 255.0
    cells = np.full(grey.shape, UNKNOWN, np.int8)
    cells[darkness > occupied] = OCCUPIED
    cells[darkness < free] = FREE
    at = None if place is None else (float(place[0]), float(place[1]))
    return Occupancy(cells[::-1].copy(), resolution, (float(origin[0]), float(origin[1])), float(origin[2]), at)


def write_map(occupancy: Occupancy, path: Path, *, force: bool = False) -> Path:
    """Write a map as map_server's .yaml and, beside it, .pgm; return the .yaml's path.

    Raises InputError if either exists and not `force`, or cannot be written.
    """
    picture = path.with_suffix(".pgm")
    if path.suffix not in (".yaml", ".yml"):
        raise InputError(f"{path}: a map is written as .yaml and .pgm; give a name that ends in .yaml")
    grey = np.zeros(occupancy.cells.shape, np.uint8)
    for state, level in IMAGE.items():
        grey[occupancy.cells == state] = level
    buffer = io.BytesIO()
    Image.fromarray(grey[::-1]).save(buffer, format="PPM")
    x, y = occupancy.origin
    document = {
        "image": picture.name,
        "resolution": float(occupancy.resolution),
        "origin": [float(x), float(y), float(occupancy.yaw)],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    if occupancy.place is not None:
        document["geo_origin"] = [float(v) for v in occupancy.place]
    # PyYAML's own numbers: 1e-12 would be read back as a text, 1.0e-12 is not.
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None)
    write_files({picture: buffer.getvalue(), path: text}, force=force)
    return path


def _number(path: Path, document: dict[str, Any], key: str, default: float | None = None) -> float:
    value = document.get(key, default)
    if not _is_number(value):
        raise InputError(f"{path}: {key} must be a number, not {_short(value)}")
    return float(value)  # type: ignore[arg-type]


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e12


def _short(value: object) -> str:
    """Return a few words for a value: lists whose items are one another can be endless when written out."""
    return f"a {type(value).__name__} of {len(value)}" if isinstance(value, list | dict) else repr(value)[:40]


def _one_line(error: Exception) -> str:
    return " ".join(str(getattr(error, "strerror", None) or error).split())
