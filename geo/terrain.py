"""Ground that is not flat: heights on a square grid in metres of the frame, read from any elevation model.

GeoTIFF and what else GDAL knows is read and brought into the frame by rasterio, the extra `terrain`: it alone reads all
compressions, predictors and coordinate systems in which elevation models are sold. Two forms need nothing: an NPZ, and an
ESRI ASCII grid in metres of the frame.
"""

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from pyproj import CRS
from pyproj.exceptions import ProjError
from shapely.geometry.base import BaseGeometry

from quarterdeck.geo.arrays import load_arrays
from quarterdeck.geo.errors import InputError, UnavailableError
from quarterdeck.geo.frame import Frame

Bounds = tuple[float, float, float, float]
MOST_NODES = 16_000_000  # 128 MB
LOWEST, HIGHEST = -11_000.0, 9_000.0  # m: what is beyond is a void that the file does not declare
VOIDS = (-9999.0, -32768.0, -32767.0)
ASIDE = 200.0  # m about a site's bounds that are read too


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
    name: str = "terrain"

    def __post_init__(self) -> None:
        if self.heights.ndim != 2 or min(self.heights.shape) < 2 or np.isinf(self.heights).any():
            raise InputError("terrain: heights must be a table of at least 2 x 2 finite numbers")
        if not (np.isfinite([*self.origin, self.cell]).all() and self.cell >= 0.01):
            raise InputError(f"terrain: origin {self.origin} and cell {self.cell} must be finite, the cell at least 0.01 m")

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

    def crop(self, bounds: Bounds) -> "Terrain | None":
        """Return the cells within and across `bounds` (w, s, e, n) metres; None if there are none."""
        rows, columns = self.heights.shape
        low, high = (np.array(bounds).reshape(2, 2) - self.origin) / self.cell
        j, i = np.maximum(np.floor(low), 0).astype(int).tolist()
        k, m = np.minimum(np.ceil(high), (columns - 1, rows - 1)).astype(int).tolist()
        if k <= j or m <= i:
            return None
        x, y = self.origin
        part = self.heights[i : m + 1, j : k + 1]
        return Terrain((x + j * self.cell, y + i * self.cell), self.cell, part, self.name)

    def range(self, bounds: Bounds) -> tuple[float, float]:
        """Return the least and the greatest height known within and beside `bounds` (w, s, e, n); 0, 0 for none."""
        part = self.crop(bounds)
        known = part.heights[np.isfinite(part.heights)] if part is not None else np.zeros(0)
        return (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)


def read_terrain(path: str, frame: Frame, bounds: Bounds) -> Terrain:
    """Return the terrain in a file about `bounds` (w, s, e, n), in metres of `frame`.

    NPZ holds `origin`, `cell` and `heights`. An ESRI ASCII grid (.asc) is in metres of the frame, or in the coordinate
    system of the .prj beside it. All else is read by rasterio, of whatever system and unit of height it says it is.
    Raises InputError if it cannot be read or does not cover any of the bounds, UnavailableError without rasterio.
    """
    plain = Path(path).suffix.lower() == ".asc" and not any(Path(path).with_suffix(s).exists() for s in (".prj", ".PRJ"))
    try:
        if Path(path).suffix.lower() == ".npz":
            found = load_arrays(Path(path).read_bytes(), ("origin", "cell", "heights"))
            x, y = found["origin"]
            return Terrain((float(x), float(y)), float(found["cell"]), found["heights"], Path(path).name)
        if plain:
            return _read_ascii(Path(path).read_text(encoding="ascii"), Path(path).name)
        with Path(path).open("rb"):
            pass  # what cannot be opened is told alike for all
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
    return _read_raster(path, frame, bounds)


def _read_ascii(text: str, name: str) -> Terrain:
    lines = text.split("\n")
    count = next((n for n, line in enumerate(lines) if line.strip() and not line.strip()[0].isalpha()), len(lines))
    head = {key.lower(): float(value) for key, value in (line.split() for line in lines[:count] if line.strip())}
    rows, columns, cell = int(head["nrows"]), int(head["ncols"]), head["cellsize"]
    if cell < 0.01:
        raise InputError("its cells are in degrees: put the .prj that says so beside it")
    heights = np.array(" ".join(lines[count:]).split(), float).reshape(rows, columns)[::-1]
    heights = np.where(heights == head.get("nodata_value", -9999.0), np.nan, heights)
    # A corner is the outer one of the south-western cell; the heights are those of the cells' centres.
    x, y = (head[f"{a}llcenter"] if f"{a}llcenter" in head else head[f"{a}llcorner"] + cell / 2 for a in "xy")
    return Terrain((x, y), cell, heights, name)


def _read_raster(path: str, frame: Frame, bounds: Bounds) -> Terrain:
    try:
        import rasterio
        import rasterio.warp
    except ImportError:
        raise UnavailableError(f"{path}: reading it needs rasterio: pip install 'quarterdeck[terrain]'") from None
    into = f"+proj=tmerc +lat_0={frame.lat!r} +lon_0={frame.lon!r} +k=1 +datum=WGS84 +units=m +no_defs"
    west, south, east, north = bounds[0] - ASIDE, bounds[1] - ASIDE, bounds[2] + ASIDE, bounds[3] + ASIDE
    try:
        with (
            np.errstate(all="ignore"),
            warnings.catch_warnings(),
            rasterio.Env(GDAL_PAM_ENABLED="NO"),
            _open(rasterio, path) as file,
        ):
            if file.count != 1 or np.dtype(file.dtypes[0]).kind not in "iuf":
                raise InputError(f"{path}: has {file.count} bands and is no elevation model, which has one of real numbers")
            if file.crs is None or file.transform.is_identity:
                raise InputError(f"{path}: does not say where it lies (no coordinate system); give a georeferenced one")
            cell = _cell(file, frame, bounds)
            columns, rows = (2 + int((high - low) / cell) for low, high in ((west, east), (south, north)))
            if rows * columns > MOST_NODES:
                raise InputError(
                    f"{path}: cells of {cell:.2g} m make {rows * columns:,} nodes of the site, more than {MOST_NODES:,}; "
                    "give larger cells (gdalwarp -tr)"
                )
            window = _window(file, frame, (west, south, east, north), path)
            known = np.ma.filled(file.read(1, masked=True, window=window).astype(float), np.nan)
            known[np.isin(known, VOIDS)] = np.nan
            known = (known * file.scales[0] + file.offsets[0]) * _unit(file)
            known[(known < LOWEST) | (known > HIGHEST)] = np.nan
            # Nodes lie in the middle of GDAL's pixels, whose rows run from the north.
            out = np.full((rows, columns), np.nan)
            rasterio.warp.reproject(
                known, out, src_transform=file.window_transform(window), src_crs=file.crs, dst_crs=into,
                src_nodata=np.nan, dst_nodata=np.nan,
                dst_transform=rasterio.Affine(cell, 0, west - cell / 2, 0, -cell, south + (rows - 0.5) * cell),
                resampling=rasterio.warp.Resampling.bilinear, tolerance=0.001,
            )  # fmt: skip
    except InputError:
        raise
    except (rasterio.errors.RasterioError, ProjError, ValueError, TypeError, ArithmeticError, MemoryError) as error:
        what = " ".join(str(error).split())[:120]
        raise InputError(f"{path}: is no elevation model that can be read ({what})") from None
    if np.isnan(out).all():
        raise InputError(f"{path}: is void all over the site; give an elevation model that covers it")
    return Terrain((west, south), cell, out[::-1], Path(path).name)


def _open(rasterio: Any, path: str) -> Any:
    warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)  # it is refused, in our own words
    return rasterio.open(path)


def _cell(file: Any, frame: Frame, bounds: Bounds) -> float:
    """The lesser side of a pixel in metres, at the middle of the bounds or what of the file is nearest to it."""
    middle = np.array([[(bounds[0] + bounds[2]) / 2, (bounds[1] + bounds[3]) / 2]])
    column, row = _pixels(file, frame, middle)[0]
    column, row = np.clip(column, 0, file.width), np.clip(row, 0, file.height)
    corners = _placed(file.transform, np.array([(column, row), (column + 1, row), (column, row + 1)]))
    lonlat = _transform(file.crs, CRS.from_epsg(4326), corners)
    at, right, down = frame.to_metres(lonlat)
    return float(min(np.hypot(*(right - at)), np.hypot(*(down - at))))


def _window(file: Any, frame: Frame, bounds: Bounds, path: str) -> Any:
    """The part of the file that the bounds need. Raises InputError where they have nothing in common."""
    from rasterio.windows import Window

    edge = shapely.get_coordinates(shapely.segmentize(shapely.box(*bounds), max(bounds[2] - bounds[0], 1.0) / 16))
    pixels = _pixels(file, frame, edge)
    low = np.maximum(np.floor(pixels.min(axis=0)) - 2, 0).astype(int)
    high = np.minimum(np.ceil(pixels.max(axis=0)) + 2, (file.width, file.height)).astype(int)
    if (high - low < 2).any():
        lonlat = frame.to_degrees(np.array([[(bounds[0] + bounds[2]) / 2, (bounds[1] + bounds[3]) / 2]]))[0]
        raise InputError(f"{path}: does not cover the site, which is about {lonlat[1]:.5f}, {lonlat[0]:.5f}")
    return Window(int(low[0]), int(low[1]), *(high - low).tolist())


def _pixels(file: Any, frame: Frame, xy: np.ndarray) -> np.ndarray:
    """(n, 2) columns and rows of (n, 2) metres; longitudes are taken on the side of the file."""
    crs = CRS.from_wkt(file.crs.to_wkt())
    at = _transform(CRS.from_epsg(4326), crs, frame.to_degrees(xy))
    if crs.is_geographic:
        middle = (file.bounds.left + file.bounds.right) / 2
        at[:, 0] = (at[:, 0] - middle + 180.0) % 360.0 - 180.0 + middle
    return _placed(~file.transform, at)


def _placed(affine: Any, places: np.ndarray) -> np.ndarray:
    """(n, 2) places under an affine transform, without its operators, which are changing."""
    return places @ np.array([[affine.a, affine.d], [affine.b, affine.e]]) + (affine.c, affine.f)


def _transform(source: Any, target: Any, places: np.ndarray) -> np.ndarray:
    from pyproj import Transformer

    one, two = (CRS.from_wkt(c.to_wkt()) for c in (source, target))
    return np.column_stack(Transformer.from_crs(one, two, always_xy=True).transform(places[:, 0], places[:, 1]))


def _unit(file: Any) -> float:
    """Metres of the file's unit of height: what the band says, else the vertical system, else metres."""
    feet = {
        "ft": 0.3048,
        "foot": 0.3048,
        "feet": 0.3048,
        "us survey foot": 1200 / 3937,
        "us-ft": 1200 / 3937,
        "ftus": 1200 / 3937,
    }
    said = (file.units[0] or "").lower()
    if said in feet:
        return feet[said]
    axes = CRS.from_wkt(file.crs.to_wkt()).axis_info
    return float(axes[2].unit_conversion_factor) if len(axes) > 2 and not said else 1.0


def refuse_void(terrain: Terrain, area: BaseGeometry, frame: Frame) -> None:
    """Raise InputError if the terrain has a void in `area` (metres), or does not reach over all of it."""
    (x, y), (rows, columns) = terrain.origin, terrain.heights.shape
    reach = shapely.box(x, y, x + (columns - 1) * terrain.cell, y + (rows - 1) * terrain.cell)
    beyond = shapely.get_coordinates(area.difference(reach))
    holes = np.argwhere(np.isnan(terrain.heights))[:, ::-1] * terrain.cell + terrain.origin
    holes = holes[shapely.contains_xy(area, holes[:, 0], holes[:, 1])] if len(holes) else holes
    for places, what in ((beyond, "does not reach over the site: it ends before"), (holes, "has a void in the site, at")):
        if len(places):
            lon, lat = frame.to_degrees(places[:1])[0]
            raise InputError(f"{terrain.name}: {what} {lat:.6f}, {lon:.6f}; give one that covers it")
