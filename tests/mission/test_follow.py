"""Over terrain: heights held, rates kept, ceilings told, and what a camera sees at worst."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import MultiPolygon, box

from quarterdeck.cli import main
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Scenario, Site, Vehicle
from quarterdeck.geo.sensors import fit
from quarterdeck.geo.terrain import Terrain
from quarterdeck.mission.check import check_mission
from quarterdeck.mission.follow import follow
from quarterdeck.mission.heights import levels
from quarterdeck.mission.lines import plan_lines
from quarterdeck.mission.planfile import plan_text, read_plan

DATA = Path(__file__).resolve().parents[2] / "data"
pytestmark = pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")  # affine's operators, in rasterio itself


def ground(seed, rough=30.0, cell=5.0, size=1000.0):
    """Hills of a few waves, up to about `rough` metres, over a square of `size` metres about (200, 200)."""
    rng = np.random.default_rng(seed)
    axis = np.arange(200.0 - size / 2, 200.0 + size / 2, cell)
    x, y = np.meshgrid(axis, axis)
    heights = np.full(x.shape, 500.0)
    for _ in range(4):
        kx, ky, phase = rng.uniform((-0.03, -0.03, 0.0), (0.03, 0.03, 6.0)).tolist()
        heights += rough / 4 * np.sin(kx * x + ky * y + phase)
    return Terrain((axis[0], axis[0]), cell, heights, "hills")


def survey(**figures):
    """Return the lines of two quadrotors with cameras over a field of 400 by 300 metres."""
    sensor, altitude = fit({"kind": "camera", "camera": "dji-phantom-4-pro"}, 60.0)
    model = load_model("survey-quad")
    one = {"speed": 8.0, "clearance": 5.0, "altitude": altitude, "sensor": sensor, "battery": 500.0} | figures
    fleet = tuple(Vehicle(f"uav-{i}", model, (0.0, 20.0 * i), **one) for i in (1, 2))
    field = MultiPolygon([box(0, 0, 400, 300)])
    site = Site((Area("field", field),), MultiPolygon([box(-50, -50, 450, 350)]))
    return plan_lines(Scenario("field", Frame(5.0, 50.0), site, fleet))


@pytest.fixture(scope="module")
def field():
    """The plan on flat ground."""
    return survey()


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10**6), st.floats(2.0, 12.0), st.floats(5.0, 120.0))
def test_height_is_held_along_every_leg(field, seed, tolerance, rough):
    """Straight lines between waypoints stay within the tolerance of the height that the plan on flat ground has there."""
    terrain = ground(seed, rough)
    after = follow(field, terrain, tolerance=tolerance)
    for before, route in zip(field.routes, after.routes, strict=True):
        xyz, level = route.xyz, levels(route)
        kept = [
            w for w in route.waypoints if any((w.x, w.y, w.z, w.leg) == (o.x, o.y, o.z, o.leg) for o in before.waypoints)
        ]
        assert len(kept) >= len(before.waypoints)
        for i in range(1, len(xyz)):
            part = np.linspace(0, 1, 40)[:, None]
            places, here = xyz[i - 1] + part * (xyz[i] - xyz[i - 1]), level[i - 1] + part[:, 0] * (level[i] - level[i - 1])
            above = here - terrain.height(places[:, :2])
            assert np.abs(above - places[:, 2]).max() < tolerance + 0.3  # samples lie half a cell apart
        assert np.all(np.diff([w.time for w in route.waypoints]) > -1e-9)
        assert route.duration >= before.duration - 1e-6
        speed = np.array([w.speed for w in route.waypoints[1:]])
        size = np.linalg.norm(np.diff(xyz, axis=0), axis=1)
        rate = np.diff(level) * speed / np.where(size > 0, size, np.inf)
        assert rate.max() <= 2.5 + 1e-6
        assert rate.min() >= -1.5 - 1e-6
    assert not [p for p in check_mission(after) if "climbs" in p or "descends" in p]


def test_a_plain_changes_nothing_but_the_ground(field):
    """On a plateau at 800 m there is not one waypoint more, nor a second, nor a watt-hour."""
    after = follow(field, Terrain((-500.0, -500.0), 10.0, np.full((150, 150), 800.0)))
    for before, route in zip(field.routes, after.routes, strict=True):
        flat = unground(route)
        assert np.allclose([w.time for w in flat], [w.time for w in before.waypoints], atol=1e-6)
        assert [replace(w, time=0.0, speed=0.0) for w in flat] == [
            replace(w, time=0.0, speed=0.0) for w in before.waypoints
        ]
        assert route.energy == pytest.approx(before.energy)
    assert after.figures["highest_amsl"] == pytest.approx(870.0)
    assert after.figures["worst_ground_resolution"] == pytest.approx(60.0 / 8.8 * 13.2 / 5472)
    assert after.figures["least_frontal_overlap"] == pytest.approx(0.7)


def unground(route):
    """The waypoints as they were before the ground was known."""
    return [replace(w, ground=None) for w in route.waypoints]


def test_pictures_at_worst_are_those_of_the_pinhole(field):
    """A ridge 20 m high and a ditch 10 m deep across all lines: 70 m to the ditch, 40 m to the ridge, and a half more."""
    heights = np.zeros((500, 500))
    heights[:, 200:203] = 20.0
    heights[:, 300:303] = -10.0
    after = follow(field, Terrain((-300.0, -300.0), 2.0, heights), tolerance=100.0)
    # 100 m is more than a quarter of the height, 15 m: the ridge is higher and gets waypoints, the ditch is not deeper.
    assert after.figures["terrain_waypoints"] > 0
    assert after.figures["lowest_above_ground"] >= 45.0 - 0.2
    assert after.figures["worst_ground_resolution"] >= 70.0 / 8.8 * 13.2 / 5472 - 1e-3
    spacing = field.spacing
    assert after.figures["least_side_overlap"] <= 1 - spacing / (45.0 * 13.2 / 8.8) + 1e-9


def test_ceilings_are_told():
    """Between waypoints too the height above ground counts; above the sea counts only where that is known."""
    low = follow(survey(ceiling=100.0), ground(1, 60.0), tolerance=10.0)
    assert not [r for r in low.reasons if "ceiling" in r.why]
    close = survey(ceiling=72.0)
    assert not [r for r in check_mission(close) if "ceiling" in r.why]
    over = follow(close, ground(1, 60.0), tolerance=10.0)
    assert any("uav-1: reaches" in r.why and "its ceiling is 72 m" in r.why for r in over.reasons)
    sea = follow(survey(ceiling_amsl=550.0), ground(1, 20.0))
    assert any("above mean sea level and its ceiling is 550 m" in r.why for r in sea.reasons)
    assert any("ceiling is 50 m" in r for r in check_mission(survey(ceiling=50.0)))


def test_transits_are_layered_below_the_ceiling():
    """Two vehicles at 118 m with a ceiling of 120 m transit at 119 and 120 m, not at 123 and 128."""
    routes = survey(altitude=118.0).routes
    assert [max(w.z for w in r.waypoints) for r in routes] == [119.0, 120.0]


def test_ground_is_kept_in_the_plan(field, tmp_path):
    """The PLAN gives back the ground, and what is unknown as unknown."""
    after = follow(field, ground(3))
    (tmp_path / "p.geojson").write_text(plan_text(after), encoding="utf-8")
    read = read_plan(tmp_path / "p.geojson")
    for a, b in zip(after.routes, read.routes, strict=True):
        assert np.allclose([w.ground for w in a.waypoints], [w.ground for w in b.waypoints], atol=6e-4)
    assert '"ground"' not in plan_text(field)


def test_a_void_under_a_route_and_a_tolerance_of_nothing_are_refused(field):
    """One line names the vehicle and the place."""
    terrain = ground(0)
    holed = terrain.heights.copy()
    holed[95:105, 95:105] = np.nan
    with pytest.raises(InputError, match=r"hills: not known at 50\.\d+, 5\.\d+ on the route of 'uav-"):
        follow(field, Terrain(terrain.origin, terrain.cell, holed, "hills"))
    with pytest.raises(InputError, match="above 0"):
        follow(field, terrain, tolerance=0.0)


def test_from_the_command_line(tmp_path, capsys):
    """`plan --terrain` of a GeoTIFF writes a plan that checks; a void, or nobody who flies, is one line and 2."""
    rasterio = pytest.importorskip("rasterio", reason="rasterio (the extra terrain) is not installed")
    site, dem = str(DATA / "farm_survey.geojson"), tmp_path / "dem.tif"
    transform = rasterio.transform.from_origin(5.64, 52.0, 2e-4, 2e-4)
    columns, lines = np.meshgrid(np.arange(200), np.arange(150))
    heights = 20.0 + 15.0 * np.sin(columns / 9.0) * np.cos(lines / 11.0)
    shape = {"width": 200, "height": 150, "count": 1, "dtype": "float32", "crs": "EPSG:4326", "transform": transform}
    for name, part in (("dem.tif", heights), ("holed.tif", np.where(columns == 110, -9999.0, heights))):
        with rasterio.open(tmp_path / name, "w", driver="GTiff", nodata=-9999, **shape) as file:
            file.write(part.astype("float32"), 1)
    plan = tmp_path / "plan.geojson"
    with pytest.raises(SystemExit) as stop:
        main(["plan", site, "--terrain", str(dem), "-o", str(plan), "--placement", "none"])
    said = " ".join(capsys.readouterr().err.split())
    assert stop.value.code == 0, said
    assert "waypoints for the terrain" in said
    assert "highest above sea" in said
    with pytest.raises(SystemExit) as stop:
        main(["check", str(plan)])
    assert stop.value.code == 0, capsys.readouterr().out
    sea = str(DATA / "dalian_harbour.geojson")
    capsys.readouterr()
    for where, terrain, words in (
        (site, "holed.tif", "holed.tif: has a void in the site"),
        (sea, "dem.tif", "for what flies"),
    ):
        with pytest.raises(SystemExit) as stop:
            main(["plan", where, "--terrain", str(tmp_path / terrain), "-o", str(tmp_path / "no.geojson")])
        error = capsys.readouterr().err
        assert stop.value.code == 2
        assert words in error
        assert len(error.splitlines()) == 1
    assert not (tmp_path / "no.geojson").exists()
