"""The one door: registry, names, refusal before anything is written."""

import json
import math
from dataclasses import replace

import pytest
from shapely import box

from quarterdeck.exporters.export import FORMATS, export
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.files import safe_names
from quarterdeck.geo.scenario import Obstacle
from quarterdeck.mission.reason import Reason


@pytest.mark.parametrize("make", ["boats", "quads", "ugv"])
def test_every_mission_leaves_in_every_format(make, request, tmp_path):
    """A fleet of boats, a camera survey and an inspection are written in all formats, no file empty."""
    mission = request.getfixturevalue(make)
    paths = export(mission, FORMATS, tmp_path)
    assert all(path.stat().st_size > 0 for path in paths)
    assert len(set(paths)) == len(paths)


def test_same_mission_gives_the_same_bytes(boats, tmp_path):
    """Exports hold no clock and no chance; rerun's recordings are compared by rerun's own tool elsewhere."""
    names = [name for name in FORMATS if name != "rerun"]
    first, second = export(boats, names, tmp_path / "a"), export(boats, names, tmp_path / "b")
    assert [p.read_bytes() for p in first] == [p.read_bytes() for p in second]


def test_nothing_is_written_where_a_file_stands(boats, tmp_path):
    """An existing file stops the whole export before it writes; --force does not."""
    (tmp_path / "usv3.waypoints").write_text("mine")
    with pytest.raises(InputError, match=r"usv3\.waypoints exists"):
        export(boats, "qgc-wpl", tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["usv3.waypoints"]
    export(boats, "qgc-wpl", tmp_path, force=True)
    assert (tmp_path / "usv3.waypoints").read_text().startswith("QGC")


def test_unknown_names_are_answered_with_the_nearest(boats, tmp_path):
    """A misspelt format or autopilot is refused in one line."""
    with pytest.raises(InputError, match="did you mean 'qgc-wpl'"):
        export(boats, "qgcwpl", tmp_path)
    with pytest.raises(InputError, match="unknown autopilot"):
        export(boats, "qgc-wpl", tmp_path, autopilot="apm")


HOSTILE = ["../../etc/passwd", "a/b", "a_b", "A_B", "CON", "船 1", "..", "x" * 300, "a\nb\0c", "é", "e\u0301", ""]


def test_hostile_names_make_safe_and_different_files(make_fleet, tmp_path):
    """No name leaves the folder, is reserved, too long, or the same as another's."""
    out = tmp_path / "out"
    mission = make_fleet(len(HOSTILE), names=HOSTILE)
    paths = export(mission, [name for name in FORMATS if name not in ("png", "rerun")], out)
    assert {p.resolve().parent for p in paths} == {out.resolve()}
    assert all(len(p.name.encode()) < 200 for p in paths)
    stems = list(safe_names(HOSTILE).values())
    assert len({s.casefold() for s in stems}) == len(HOSTILE)
    assert stems[5] == "船_1"
    assert stems[4] != "CON"


def test_geojson_is_styled_and_split_at_the_antimeridian(make_fleet, tmp_path):
    """Lines carry simplestyle strokes; across 180 degrees they are cut, never drawn round the world."""
    from quarterdeck.geo.frame import Frame

    (path,) = export(make_fleet(1, Frame(179.9995, -17.0)), "geojson", tmp_path)
    features = json.loads(path.read_text())["features"]
    lines = [f for f in features if "LineString" in f["geometry"]["type"]]
    assert lines
    assert all(f["properties"]["stroke"].startswith("#") for f in lines)
    for f in lines:
        parts = (
            f["geometry"]["coordinates"] if f["geometry"]["type"] == "MultiLineString" else [f["geometry"]["coordinates"]]
        )
        for part in parts:
            longitudes = [position[0] for position in part]
            assert max(longitudes) - min(longitudes) < 1.0


def test_a_plan_that_trespasses_is_refused(boats, tmp_path):
    """A route through the island, over the fence or with a NaN stops the export; nothing is written."""
    route = boats.routes[2]
    cases = ((400.0, 300.0, "no-go zone 'island'"), (900.0, 250.0, "leaves the operating"), (0.0, math.nan, "y is nan"))
    for x, y, why in cases:
        waypoints = (*route.waypoints[:5], replace(route.waypoints[5], x=x, y=y), *route.waypoints[6:])
        bad = replace(boats, routes=(*boats.routes[:2], replace(route, waypoints=waypoints), *boats.routes[3:]))
        with pytest.raises(InputError, match=why):
            export(bad, "qgc-wpl", tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_plan_that_fails_a_check_is_for_eyes_alone(boats, tmp_path):
    """What jumps, flies without wings, is unfeasible or too near is drawn and told; a mission file needs --unsafe."""
    route = boats.routes[0]

    def changed(number, **values):
        waypoints = [replace(w, **values) if i == number else w for i, w in enumerate(route.waypoints)]
        return replace(boats, routes=(replace(route, waypoints=tuple(waypoints)), *boats.routes[1:]))

    rock = Obstacle("rock", box(100.0, 12.0, 110.0, 18.0))
    cases = {
        "jumps": changed(3, x=200.0, y=31.0),
        "does not fly": changed(3, z=5.0),
        "no battery": replace(boats, reasons=(Reason("no battery"),)),
        "passes 'rock' at 2.00 m": replace(boats, site=replace(boats.site, obstacles=(rock,))),
    }
    for number, (why, mission) in enumerate(cases.items()):
        with pytest.raises(InputError, match=f"fails .* check.*--unsafe.*: .*{why}"):
            export(mission, ["png", "qgc-wpl"], tmp_path / "refused")
        said = []
        export(mission, "geojson", tmp_path / f"drawn-{number}", tell=said.append)
        assert any(why in line for line in said)
        assert export(mission, "qgc-wpl", tmp_path / f"unsafe-{number}", unsafe=True)
    assert not (tmp_path / "refused").exists()


def test_the_way_home_is_told(boats, tmp_path):
    """A straight return that would cross a no-go zone is said when a mission file is written."""
    rock = Obstacle("rock", box(100.0, 16.0, 110.0, 22.0))
    said = []
    export(replace(boats, site=replace(boats.site, obstacles=(rock,))), "qgc-wpl", tmp_path, tell=said.append)
    assert any("usv1" in line and "straight way home" in line for line in said)


def test_what_is_too_far_is_told_or_split_into_sorties(boats, tmp_path):
    """Without sorties it is refused, unless unsafe; with them each round has a folder, each file its own home and work."""
    vehicles = tuple(replace(v, endurance=1200.0) for v in boats.vehicles)
    far, said = replace(boats, vehicles=vehicles), []
    with pytest.raises(InputError, match=r"--sorties, or give --unsafe .*: usv1: .*short by .*; usv2: .*short by "):
        export(far, "qgc-wpl", tmp_path / "whole")
    export(far, "qgc-wpl", tmp_path / "whole", unsafe=True, tell=said.append)
    assert any("fails a check: usv1: needs" in line for line in said)
    paths = export(far, ["qgc-wpl", "gpx"], tmp_path / "parts", split=True)
    assert {p.parent.name for p in paths} == {"sortie-1", "sortie-2"}
    assert sum(p.name == "usv1.waypoints" for p in paths) == 2


@pytest.mark.parametrize("name", FORMATS)
def test_one_waypoint_and_ten_thousand(name, make_fleet, tmp_path):
    """A vehicle that stays where it is, and a route of ten thousand waypoints, are written or told in every format."""
    few = make_fleet(1)
    alone = replace(few, routes=(replace(few.routes[0], waypoints=few.routes[0].waypoints[:1]),))
    for number, mission in enumerate((alone, make_fleet(1, lines=5000))):
        said = []
        assert export(mission, name, tmp_path / str(number), tell=said.append) or said
