"""Charts: made in memory for the rules, real cells for the reading."""

import json
import math
import subprocess
import sys
from pathlib import Path

import pytest
import shapely
from shapely import LineString, MultiPolygon, Point, box

from quarterdeck.cli import main
from quarterdeck.geo.charts import Cell, chart_site, read_cell
from quarterdeck.geo.errors import InputError

S57 = Path(__file__).resolve().parents[2].parent / "shared" / "formats" / "s57"
NAN = math.nan


def cell(name="A", scale=10_000.0, **objects):
    """Return a cell that covers 10.00 to 10.02 east, 54.00 to 54.01 north, deep in its eastern half."""
    whole = {
        "M_COVR": ((box(10.0, 54.0, 10.02, 54.01), 1.0),),
        "DEPARE": ((box(10.0, 54.0, 10.01, 54.01), 0.0), (box(10.01, 54.0, 10.02, 54.01), 5.0)),
    }
    return Cell(name, scale, "1", "0", whole | objects)


def degrees(scenario):
    """Return the water that is left, in degrees."""
    free = scenario.site.operating.difference(shapely.union_all([o.polygon for o in scenario.site.obstacles]))
    return shapely.transform(free, scenario.frame.to_degrees)


def test_only_water_known_to_be_deep_is_navigable():
    """The shallow half, and a depth area without a depth, are not; outside the coverage nothing is."""
    unknown = cell(DEPARE=((box(10.01, 54.0, 10.02, 54.01), 5.0), (box(10.0, 54.0, 10.01, 54.01), NAN)))
    beyond = cell(DEPARE=((box(10.01, 54.0, 10.08, 54.01), 5.0),))
    for chart in (cell(), unknown, beyond):
        scenario, _ = chart_site([chart], depth=2.0)
        half = shapely.transform(box(10.01, 54.0, 10.02, 54.01), scenario.frame.to_metres)
        # Parallels are curves in metres: the same edge, cut at other places, differs by a decimetre.
        assert scenario.site.operating.symmetric_difference(half).area < 200.0


@pytest.mark.parametrize("layer", ["OBSTRN", "WRECKS", "UWTROC", "SOUNDG"])
@pytest.mark.parametrize(("known", "dangerous"), [(1.0, True), (2.0, False), (30.0, False), (NAN, True), (-1.0, True)])
def test_dangers_without_depth_or_too_shoal_are_kept_clear(layer, known, dangerous):
    """A danger is an obstacle with the margin around it unless it is known to be deep enough."""
    scenario, notes = chart_site([cell(**{layer: ((Point(10.015, 54.005), known),)})], depth=2.0, margin=10.0)
    assert (not degrees(scenario).contains(Point(10.015, 54.005))) == dangerous
    assert sum(o.polygon.area for o in scenario.site.obstacles) == pytest.approx(dangerous * math.pi * 100, rel=0.05)
    assert any((f"1 {layer}" in line) and line.startswith("used" if dangerous else "ignored") for line in notes)


def test_land_walls_marks_and_what_the_user_avoids():
    """Land is cut out; islets, walls and beacons stand in the water; a restricted area only where asked."""
    chart = cell(
        LNDARE=((box(10.012, 54.002, 10.013, 54.003), NAN), (Point(10.018, 54.008), NAN)),
        SLCONS=((LineString([(10.015, 54.0), (10.015, 54.004)]), NAN),),
        BCNLAT=((Point(10.011, 54.009), NAN),),
        RESARE=((box(10.016, 54.002, 10.017, 54.004), NAN),),
        LIGHTS=((Point(10.019, 54.001), NAN),),
    )
    free = degrees(chart_site([chart], depth=2.0)[0])
    for lon, lat in ((10.0125, 54.0025), (10.018, 54.008), (10.015, 54.002), (10.011, 54.009)):
        assert not free.contains(Point(lon, lat))
    for lon, lat in ((10.0165, 54.003), (10.019, 54.001)):
        assert free.contains(Point(lon, lat))
    assert not degrees(chart_site([chart], depth=2.0, avoid=["RESARE"])[0]).contains(Point(10.0165, 54.003))
    assert (
        "avoided: there is no RESAR in the chart; did you mean RESARE?"
        in chart_site([chart], depth=2.0, avoid=["RESAR"])[1]
    )


def test_the_larger_scale_wins_where_cells_overlap():
    """A harbour cell's shallow depth hides the coast cell's deep one, in whatever order they are given."""
    coast = cell("coast", 90_000.0, DEPARE=((box(10.0, 54.0, 10.02, 54.01), 20.0),))
    harbour = Cell(
        "harbour", 5_000.0, "1", "3",
        {"M_COVR": ((box(10.0, 54.0, 10.005, 54.01), 1.0),), "DEPARE": ((box(10.0, 54.0, 10.005, 54.01), 1.0),)},
    )  # fmt: skip
    for cells in ([coast, harbour], [harbour, coast]):
        free = degrees(chart_site(cells, depth=2.0)[0])
        assert free.contains(Point(10.01, 54.005))
        assert not free.contains(Point(10.0025, 54.005))


def test_vehicles_keep_the_water_that_they_reach():
    """Without a way between two basins only the vehicle's is kept, and that is told; on land it is refused."""
    chart = cell(DEPARE=((box(10.0, 54.0, 10.004, 54.01), 5.0), (box(10.01, 54.0, 10.02, 54.01), 5.0)))
    scenario, notes = chart_site([chart], depth=2.0, vehicles=[("usv-1", 10.015, 54.005)])
    assert isinstance(scenario.site.operating, MultiPolygon)
    assert len(scenario.site.operating.geoms) == 1
    assert any("1 parts of the water" in line for line in notes)
    with pytest.raises(InputError, match=r"usv-1 starts .* from the nearest water"):
        chart_site([chart], depth=2.0, vehicles=[("usv-1", 10.007, 54.005)])


def test_no_water_or_no_depths_is_one_line():
    """A depth that the chart does not have, and a cell without depth areas, are told."""
    with pytest.raises(InputError, match="no water of at least 50 m"):
        chart_site([cell()], depth=50.0)
    with pytest.raises(InputError, match="no depth areas"):
        chart_site([cell(DEPARE=())], depth=1.0)


def test_what_is_no_cell_is_refused(tmp_path):
    """A text file named .000, an encrypted one and none at all, each in its own words."""
    pytest.importorskip("pyogrio", reason="the extra charts is not installed")
    text, noise = tmp_path / "text.000", tmp_path / "noise.000"
    text.write_text("This is a list of things to do, and no chart.")
    noise.write_bytes(bytes(range(128, 256)))
    for path, words in ((text, "no S-57 cell"), (noise, "encrypted"), (tmp_path / "none.000", "cannot be read")):
        with pytest.raises(InputError, match=words):
            read_cell(path)


def test_a_cell_that_crashes_the_reader_is_refused(tmp_path, monkeypatch):
    """There are damaged cells at which GDAL's reader ends by a signal: it ends alone."""
    pytest.importorskip("pyogrio", reason="the extra charts is not installed")
    crash = tmp_path / "python"
    crash.write_text("#!/bin/sh\nkill -s SEGV $$\n")
    crash.chmod(0o755)
    monkeypatch.setattr("sys.executable", str(crash))
    with pytest.raises(InputError, match="crashes the reader"):
        read_cell(Path(__file__).resolve().parents[2] / "data" / "sample_chart.000")


@pytest.mark.skipif(not S57.exists(), reason=f"{S57} is absent: real cells were not read")
def test_a_real_cell_gives_a_site(tmp_path, capsys):
    """GDAL's sample cell gives a site that our own reader takes, and says what it left out."""
    pytest.importorskip("pyogrio", reason="the extra charts is not installed")
    site = tmp_path / "site.geojson"
    with pytest.raises(SystemExit) as stop:
        main(["chart", str(S57 / "1B5X02NE.000"), "--draught", "1.2", "--tide", "0.8", "-o", str(site)])
    assert stop.value.code == 0
    said = capsys.readouterr().err
    assert "4 DEPARE" in said
    assert "not for navigation" in said
    roles = [f["properties"]["role"] for f in json.loads(site.read_text())["features"]]
    assert {"operating", "area"} <= set(roles)


def test_our_sample_chart_gives_a_site_that_plans(tmp_path, capsys):
    """The packaged chart, update applied, gives a site whose plan is sound; its maker makes the same bytes again."""
    pytest.importorskip("pyogrio", reason="the extra charts is not installed")
    from quarterdeck.api import plan, read_scenario
    from quarterdeck.mission.check import check_mission

    root = Path(__file__).resolve().parents[2]
    site = tmp_path / "site.geojson"
    arguments = ["--draught", "1.2", "--bounds", "5.0,58.0,5.02,58.01", "--start", "5.004,58.004", "--spacing", "100"]
    with pytest.raises(SystemExit) as stop:
        main(["chart", str(root / "data" / "sample_chart.000"), *arguments, "-o", str(site)])
    assert stop.value.code == 0
    assert "update 1" in capsys.readouterr().err
    scenario = read_scenario(site)
    islet = scenario.frame.to_metres([(5.011, 58.0045)])[0]
    assert not scenario.site.coverable.contains(Point(islet))
    mission = plan(scenario)
    assert all("needs" in line for line in check_mission(mission))  # but for the battery it can be driven


def test_the_sample_chart_is_what_its_maker_makes(tmp_path):
    """data/sample_chart.000 and .001 are examples/make_chart.py's."""
    root = Path(__file__).resolve().parents[2]
    subprocess.run([sys.executable, root / "examples" / "make_chart.py", tmp_path / "chart"], check=True)
    for ending in (".000", ".001"):
        assert (tmp_path / f"chart{ending}").read_bytes() == (root / "data" / f"sample_chart{ending}").read_bytes()


def test_spots_become_soundings_of_the_site():
    """Spots in the water that is left, of all cells and each once; those on land or without a depth are not."""
    spots = (
        (Point(10.015, 54.005), 7.5),
        (Point(10.018, 54.002), 9.0),
        (Point(10.002, 54.005), 0.3),
        (Point(10.011, 54.001), NAN),
    )
    scenario, notes = chart_site([cell("A", SOUNDG=spots), cell("B", SOUNDG=spots[:1])], depth=2.0)
    assert sorted(d for _, _, d in scenario.soundings) == [7.5, 9.0]
    assert any(line.startswith("soundings: 2 in the water") for line in notes)
