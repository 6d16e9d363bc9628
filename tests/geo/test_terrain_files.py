"""Elevation models: the same ground from any file and coordinate system, and one line where there is none."""

import contextlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from pyproj import Transformer
from shapely import box

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.terrain import read_terrain, refuse_void

rasterio = pytest.importorskip("rasterio", reason="rasterio (the extra terrain) is not installed")
pytestmark = pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # affine's operators, in rasterio itself
BOUNDS = (-600.0, -500.0, 700.0, 800.0)


def hills(x, y, size):
    """Ground between 260 and 340 m, smooth over `size` of the file's own units."""
    return 300.0 + 40.0 * np.sin(x / size) * np.cos(y / size)


def write(path, crs, middle, cell, size, *, count=500, heights=None, dtype="float32", **options):
    """Write a square GeoTIFF of hills about `middle`, in the file's own units."""
    transform = rasterio.transform.from_origin(middle[0] - count * cell / 2, middle[1] + count * cell / 2, cell, cell)
    columns, rows = np.meshgrid(np.arange(count) + 0.5, np.arange(count) + 0.5)
    heights = hills(*(transform * (columns, rows)), size) if heights is None else heights
    shape = {"width": count, "height": count, "count": 1, "dtype": dtype, "transform": transform, "crs": crs}
    with rasterio.open(path, "w", driver="GTiff", **{"nodata": -9999} | shape | options) as file:
        file.write(heights.astype(dtype), 1)
    return str(path)


@pytest.mark.parametrize(
    ("lon", "lat", "crs", "cell", "size", "options"),
    [
        (5.66, 51.98, "EPSG:28992", 5.0, 300.0, {"compress": "lzw", "predictor": 3}),
        (5.66, 51.98, "EPSG:32632", 5.0, 300.0, {"compress": "deflate", "predictor": 3, "tiled": True}),
        (5.66, 51.98, "EPSG:4326", 1 / 7200, 0.005, {"compress": "zstd"}),
        (179.9995, -17.0, "EPSG:4326", 1 / 7200, 0.005, {"dtype": "float64"}),
        (-3.2, 55.9, "EPSG:27700", 5.0, 300.0, {"dtype": "float64", "BIGTIFF": "YES"}),
        (15.0, 78.0, "EPSG:3995", 8.0, 300.0, {}),
    ],
)
def test_ground_is_where_pyproj_puts_it(tmp_path, lon, lat, crs, cell, size, options):
    """At random places of the frame the height is that of the function at pyproj's place in the file's system, to 10 cm."""
    frame = Frame(lon, lat)
    into = Transformer.from_crs("EPSG:4326", crs, always_xy=True)
    path = write(tmp_path / "dem.tif", crs, into.transform(lon, lat), cell, size, **options)
    terrain = read_terrain(path, frame, BOUNDS)
    places = np.random.default_rng(0).uniform(BOUNDS[:2], BOUNDS[2:], (5000, 2))
    x, y = into.transform(*frame.to_degrees(places).T)
    if crs == "EPSG:4326" and lon > 179:
        x = np.where(x < 0, x + 360.0, x)
    assert np.abs(terrain.height(places) - hills(x, y, size)).max() < 0.1
    refuse_void(terrain, box(*BOUNDS), frame)


def test_pixels_are_those_that_pillow_reads(tmp_path):
    """In the frame's own system, node for pixel, the heights are the pixels as another reader has them."""
    frame = Frame(5.0, 50.0)
    own = "+proj=tmerc +lat_0=50.0 +lon_0=5.0 +k=1 +datum=WGS84 +units=m +no_defs"
    path = write(tmp_path / "dem.tif", own, (0.0, 0.0), 4.0, 60.0, compress="lzw")
    terrain = read_terrain(path, frame, (-50.0, -50.0, 50.0, 50.0))
    pixels = np.asarray(Image.open(path))[::-1]
    x = (np.arange(500) - 249.5) * 4.0
    xx, yy = np.meshgrid(x, x)
    near = (np.abs(xx) < 200) & (np.abs(yy) < 200)
    assert terrain.cell == pytest.approx(4.0, rel=1e-6)
    assert np.abs(terrain.height(np.column_stack([xx[near], yy[near]])) - pixels[near]).max() < 0.05


def test_feet_scales_and_declared_voids(tmp_path):
    """Heights in feet become metres, integers are scaled, what the file or the world says is no height is not known."""
    frame = Frame(5.0, 50.0)
    utm = Transformer.from_crs("EPSG:4326", "EPSG:32631", always_xy=True).transform(5.0, 50.0)
    flat = np.full((500, 500), 1000.0)
    flat[:100] = -32768.0
    path = write(tmp_path / "dem.tif", "EPSG:32631", utm, 5.0, 1.0, heights=flat, dtype="int16")
    with rasterio.open(path, "r+") as file:
        file.scales, file.units = (0.1,), ("ft",)
    terrain = read_terrain(path, frame, BOUNDS)
    assert terrain.height(np.array([0.0, 0.0])) == pytest.approx(100.0 * 0.3048)
    assert np.isnan(terrain.height(np.array([0.0, 790.0])))
    with pytest.raises(InputError, match=r"dem\.tif: has a void in the site, at 50\.00"):
        refuse_void(terrain, box(*BOUNDS), frame)


def test_mountains_in_feet_are_no_voids(tmp_path):
    """12,000 feet are 3,658 m, which the Earth has; 60,000 m it has not."""
    frame = Frame(5.0, 50.0)
    utm = Transformer.from_crs("EPSG:4326", "EPSG:32631", always_xy=True).transform(5.0, 50.0)
    heights = np.full((500, 500), 12_000.0)
    heights[:200] = 60_000.0
    path = write(tmp_path / "dem.tif", "EPSG:32631", utm, 5.0, 1.0, heights=heights)
    with rasterio.open(path, "r+") as file:
        file.units = ("ft",)
    terrain = read_terrain(path, frame, BOUNDS)
    assert terrain.height(np.array([0.0, 0.0])) == pytest.approx(3657.6)
    assert np.isnan(terrain.height(np.array([0.0, 700.0])))


def test_damaged_files_are_read_or_refused(tmp_path):
    """A GeoTIFF with bytes changed, or cut, is read or refused, whatever GDAL meets in it."""
    frame = Frame(5.0, 50.0)
    utm = Transformer.from_crs("EPSG:4326", "EPSG:32631", always_xy=True).transform(5.0, 50.0)
    whole = bytearray(
        Path(write(tmp_path / "dem.tif", "EPSG:32631", utm, 20.0, 300.0, count=120, compress="lzw")).read_bytes()
    )
    rng = np.random.default_rng(0)
    for n in range(60):
        data = bytearray(whole)
        for at in rng.integers(0, len(data) if n % 2 else 600, 4):
            data[at] = rng.integers(256)
        (tmp_path / "bad.tif").write_bytes(data[: len(data) if n % 3 else int(rng.integers(8, len(data)))])
        with contextlib.suppress(InputError):
            read_terrain(str(tmp_path / "bad.tif"), frame, BOUNDS)


def test_ascii_grid_with_its_system_beside_it(tmp_path):
    """An ESRI grid in UTM is read by its .prj; one in degrees without it is refused."""
    frame = Frame(5.0, 50.0)
    x, y = Transformer.from_crs("EPSG:4326", "EPSG:32631", always_xy=True).transform(5.0, 50.0)
    rows = "\n".join(" ".join(str(100 + c) for c in range(300)) for _ in range(300))
    head = f"ncols 300\nnrows 300\nxllcorner {x - 1500}\nyllcorner {y - 1500}\ncellsize 10\nNODATA_value -9999\n"
    (tmp_path / "g.asc").write_text(head + rows, encoding="ascii")
    (tmp_path / "g.prj").write_text(rasterio.crs.CRS.from_epsg(32631).to_wkt(version="WKT1_ESRI"), encoding="ascii")
    terrain = read_terrain(str(tmp_path / "g.asc"), frame, BOUNDS)
    assert terrain.height(np.array([5.0, 0.0])) == pytest.approx(250.0, abs=0.5)
    assert not list(tmp_path.glob("*.aux.xml"))
    (tmp_path / "d.asc").write_text(head.replace("cellsize 10", "cellsize 0.0001") + rows, encoding="ascii")
    with pytest.raises(InputError, match=r"in degrees: put the \.prj"):
        read_terrain(str(tmp_path / "d.asc"), frame, BOUNDS)


def test_what_is_no_elevation_model_of_the_site_is_one_line(tmp_path):
    """A picture, a file without a place, one of elsewhere, one void, a text and one too fine are refused by name."""
    frame = Frame(5.0, 50.0)
    utm = Transformer.from_crs("EPSG:4326", "EPSG:32631", always_xy=True).transform(5.0, 50.0)
    write(tmp_path / "elsewhere.tif", "EPSG:32631", (utm[0] + 90_000, utm[1]), 5.0, 300.0)
    write(tmp_path / "void.tif", "EPSG:32631", utm, 5.0, 300.0, heights=np.full((500, 500), -9999.0))
    write(tmp_path / "fine.tif", "EPSG:32631", utm, 0.1, 300.0)
    write(tmp_path / "short.tif", "EPSG:32631", utm, 2.0, 300.0)
    Image.fromarray(np.zeros((9, 9, 3), np.uint8)).save(tmp_path / "picture.tif")
    Image.fromarray(np.zeros((9, 9), np.float32)).save(tmp_path / "nowhere.tif")
    (tmp_path / "text.tif").write_text("heights")
    for name, words in (
        ("elsewhere", "does not cover the site, which is about 50"),
        ("void", "void all over the site"),
        ("fine", "give larger cells"),
        ("picture", "has 3 bands"),
        ("nowhere", "does not say where it lies"),
        ("text", "no elevation model"),
        ("none", "cannot be read"),
    ):
        with pytest.raises(InputError, match=words) as refused:
            read_terrain(str(tmp_path / f"{name}.tif"), frame, BOUNDS)
        assert f"{name}.tif" in str(refused.value)
        assert "\n" not in str(refused.value)
    with pytest.raises(InputError, match=r"has a void in the site|does not reach"):
        refuse_void(read_terrain(str(tmp_path / "short.tif"), frame, BOUNDS), box(*BOUNDS), frame)


def test_esri_ascii_and_npz_are_read_alike(tmp_path):
    """Rows from the north, corners half a cell outside the first node, no data as not known."""
    (tmp_path / "t.asc").write_text(
        "ncols 3\nnrows 2\nxllcorner 9\nyllcorner 19\ncellsize 2\nNODATA_value -1\n4 5 6\n1 2 -1\n", encoding="ascii"
    )
    heights = np.array([[1.0, 2.0, np.nan], [4.0, 5.0, 6.0]])
    np.savez(tmp_path / "t.npz", origin=(10.0, 20.0), cell=2.0, heights=heights)
    for name in ("t.asc", "t.npz"):
        terrain = read_terrain(str(tmp_path / name), Frame(5.0, 50.0), (9.0, 19.0, 15.0, 23.0))
        assert (terrain.origin, terrain.cell) == ((10.0, 20.0), 2.0)
        assert np.array_equal(terrain.heights, heights, equal_nan=True)
    assert terrain.height(np.array([10.0, 22.0])) == 4.0
