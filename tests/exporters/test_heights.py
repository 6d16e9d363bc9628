"""Heights in autopilots' files: one place in all frames, over terrain as on a plain; what is said, and when."""

from dataclasses import replace

import numpy as np
import pytest

from quarterdeck.cli import main
from quarterdeck.exporters import qgc_plan, qgc_wpl
from quarterdeck.exporters.export import Settings, export
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.terrain import Terrain
from quarterdeck.mission.follow import follow
from quarterdeck.mission.planfile import plan_text


@pytest.fixture(scope="module")
def hills():
    """Ground of 300 m with waves of 20 m under the three quadrotors' fields."""
    x, y = np.meshgrid(np.arange(-100.0, 400.0, 5.0), np.arange(-100.0, 500.0, 5.0))
    return Terrain((-100.0, -100.0), 5.0, 300.0 + 20.0 * np.sin(x / 40.0) * np.cos(y / 60.0), "hills.tif")


def rows(text):
    """Return the items of a WPL file as (command, frame, latitude, longitude, altitude)."""
    table = [row.split("\t") for row in text.splitlines()[1:]]
    return [(int(r[3]), int(r[2]), r[8], r[9], float(r[10])) for r in table]


def test_relative_terrain_and_sea_are_one_place_to_a_centimetre(quads, hills):
    """Home's height and the ground's bring the three frames together at every take-off, waypoint and home."""
    mission = follow(quads, hills)
    made = {a: qgc_wpl.files(mission, Settings("ardupilot", altitude=a)) for a in ("relative", "terrain", "amsl")}
    for route in mission.routes:
        one, two, three = (rows(made[a][f"{route.vehicle}.waypoints"]) for a in ("relative", "terrain", "amsl"))
        home = one[0][4]
        assert home == pytest.approx(float(hills.height(np.array(route.xyz[0, :2]))), abs=0.002)
        assert {r[:2] for r in one if r[0] in (16, 22)} == {(16, 0), (16, 3), (22, 3)}
        assert {r[:2] for r in two if r[0] in (16, 22)} == {(16, 0), (16, 10), (22, 10)}
        ground = {}
        for w, (lon, lat) in zip(route.waypoints, mission.frame.to_degrees(route.xyz[:, :2]), strict=True):
            ground[f"{lat:.8f}", f"{lon:.8f}"] = w.ground
        checked = 0
        for a, b, c in zip(one[1:], two[1:], three[1:], strict=True):
            assert a[0] == b[0] == c[0]
            assert a[2:4] == b[2:4] == c[2:4]
            if a[0] in (16, 22):
                assert a[4] + home == pytest.approx(c[4], abs=0.01)
                assert b[4] + ground[a[2:4]] == pytest.approx(c[4], abs=0.01)
                checked += 1
        assert checked > len([w for w in route.waypoints if w.leg == "survey"])


def test_plan_files_have_the_same_heights(quads, hills):
    """A .plan's items are those of the WPL file, its home stands on the ground."""
    import json

    mission = follow(quads, hills)
    for altitude in ("relative", "terrain", "amsl"):
        settings = Settings("ardupilot", altitude=altitude)
        items = rows(qgc_wpl.files(mission, settings)["quad1.waypoints"])
        plan = json.loads(qgc_plan.files(mission, settings)["quad1.plan"])["mission"]
        assert plan["plannedHomePosition"][2] == items[0][4]
        assert [i["params"][6] for i in plan["items"]] == pytest.approx([i[4] for i in items[1:]])


def test_terrain_may_come_at_export(quads, hills, tmp_path):
    """A plan of flat ground exported over terrain is that of the plan made over it; sorties are followed too."""
    export(quads, "qgc-wpl", tmp_path / "a", terrain=hills, altitude="amsl")
    export(follow(quads, hills), "qgc-wpl", tmp_path / "b", altitude="amsl")
    for path in (tmp_path / "a").iterdir():
        assert path.read_text() == (tmp_path / "b" / path.name).read_text()


def test_sorties_over_terrain_are_followed_too(quads, hills, tmp_path):
    """Ways home of their own get their own waypoints; without the terrain they are refused, for it is needed again."""
    tired = replace(quads, vehicles=tuple(replace(v, endurance=200.0) for v in quads.vehicles))
    mission = follow(tired, hills)
    with pytest.raises(InputError, match="sorties of a plan over terrain"):
        export(mission, "qgc-wpl", tmp_path / "a", split=True)
    paths = export(mission, "qgc-wpl", tmp_path / "b", split=True, terrain=hills, altitude="amsl")
    assert {p.parent.name for p in paths} >= {"sortie-1", "sortie-2"}
    for path in paths:
        if path.suffix == ".waypoints":
            for command, _, lat, lon, altitude in rows(path.read_text()):
                if command == 16 and altitude > 0:
                    xy = mission.frame.to_metres(np.array([[float(lon), float(lat)]]))[0]
                    assert altitude - hills.height(xy) > -0.01


def test_what_the_ground_cannot_be_is_refused(quads, hills, tmp_path):
    """A second ground, and a plan over terrain that has lost its ground, are each one line."""
    with pytest.raises(InputError, match="leave out --ground"):
        export(follow(quads, hills), "qgc-wpl", tmp_path, ground=10.0, altitude="amsl")
    changed = replace(quads, parameters={"terrain": "hills.tif"})
    with pytest.raises(InputError, match="with --terrain FILE"):
        export(changed, "qgc-wpl", tmp_path)


def test_speed_changes_are_over_ground_and_none_is_for_a_climb(quads, hills):
    """Vertical legs change no speed; where the ground is steep the speed over ground falls, never above the plan's."""
    items = [row.split("\t") for row in qgc_wpl.files(quads, Settings())["quad1.waypoints"].splitlines()[1:]]
    assert [float(r[5]) for r in items if r[3] == "178"] == [8.0]
    items = [row.split("\t") for row in qgc_wpl.files(follow(quads, hills), Settings())["quad1.waypoints"].splitlines()[1:]]
    speeds = [float(r[5]) for r in items if r[3] == "178"]
    assert max(speeds) == 8.0
    assert min(speeds) < 8.0


def test_a_refusal_is_the_only_thing_said(boats, tmp_path, capsys):
    """Notes come after the files: where one stands already, the error stands alone and nothing is written."""
    plan = tmp_path / "plan.geojson"
    plan.write_text(plan_text(boats), encoding="utf-8")
    out = tmp_path / "out"
    out.mkdir()
    (out / "usv1.yaml").write_text("mine")
    for formats in ("rtz,nav2,qgc-wpl", "qgc-wpl,nav2"):
        with pytest.raises(SystemExit) as stop:
            main(["export", str(plan), "--to", formats, "-o", str(out)])
        assert stop.value.code == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert len(said.err.splitlines()) == 1
        assert "usv1.yaml exists" in said.err
    assert [p.name for p in out.iterdir()] == ["usv1.yaml"]
