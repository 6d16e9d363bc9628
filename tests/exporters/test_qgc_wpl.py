"""WPL files as pymavlink, the strictest rules and the autopilots read them."""

import ast
import json
import math
import re
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from pyproj import Geod

from quarterdeck.exporters import qgc_plan, qgc_wpl
from quarterdeck.exporters.export import Settings, export
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame

mavwp = pytest.importorskip("pymavlink.mavwp", reason="pymavlink is not installed")


def load(tmp_path, text):
    path = tmp_path / "mission.waypoints"
    path.write_text(text)
    loader = mavwp.MAVWPLoader()
    loader.load(str(path))
    return loader.wpoints


def metres_apart(frame, places, xy):
    """Degrees that 1e-7 apart are a centimetre: compare in degrees, longitudes across the antimeridian."""
    degrees = frame.to_degrees(xy)
    difference = np.abs(np.asarray(places) - degrees)
    difference[:, 0] = np.minimum(difference[:, 0], 360.0 - difference[:, 0])
    return difference.max()


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
@pytest.mark.parametrize("frame", [Frame(121.6, 38.9), Frame(179.9995, -17.0), Frame(15.0, 75.0)])
def test_pymavlink_reads_the_same_places(tmp_path, make_fleet, frame, autopilot):
    """Positions, order and speeds come back within 1e-7 degree, on the antimeridian and at 75 degrees north too."""
    mission = make_fleet(2, frame)
    made = qgc_wpl.files(mission, Settings(autopilot))
    for route in mission.routes:
        items = load(tmp_path, made[f"{route.vehicle}.waypoints"])
        assert (items[0].command, items[0].frame, items[0].seq) == (16, 0, 0)
        places = [(w.y, w.x) for w in items if w.command == 16]
        assert metres_apart(frame, places, route.xyz[:, :2]) <= 1e-7
        speeds = [w.param2 for w in items if w.command == 178]
        assert speeds == [1.5, 1.0]
        assert not {w.command for w in items} & {20, 21, 22, 206, 177}


def test_lines_are_strict(boats, quads, ugv):
    """Twelve columns parted by tabs, plain decimals, contiguous numbers, LF."""
    for mission in (boats, quads, ugv):
        for text in qgc_wpl.files(mission, Settings("px4")).values():
            head, *rows, end = text.split("\n")
            assert head == "QGC WPL 110"
            assert end == ""
            for number, row in enumerate(rows):
                columns = row.split("\t")
                assert len(columns) == 12
                assert int(columns[0]) == number
                assert all(re.fullmatch(r"-?\d+(\.\d+)?", value) for value in columns)


def test_quadrotor_takes_off_shoots_on_survey_legs_only_and_returns(tmp_path, quads):
    """Take-off first, return last; pictures between the ends of each survey leg, none in turns or transits."""
    route = quads.routes[0]
    items = load(tmp_path, qgc_wpl.files(quads, Settings())["quad1.waypoints"])
    commands = [w.command for w in items]
    assert (commands[1], items[1].z, commands[-1]) == (22, 40.0, 20)
    shooting, shot, told = False, 0, [w for w in route.waypoints if w.leg not in ("start", "takeoff", "landing")]
    legs = iter(told)
    for item in items[1:]:
        if item.command == 206:
            shooting = item.param1 > 0
            assert item.param1 in (0.0, 7.5)
        if item.command == 16:
            leg = next(legs)
            assert shooting == (leg.leg == "survey")
            shot += shooting
            assert item.z == 40.0
    assert shot == 4
    assert next(legs, None) is None


def test_px4_heads_along_the_track_and_ardupilot_is_told_no_yaw(tmp_path, quads):
    """PX4's yaw is the geodesic's azimuth at the end of the leg that comes there; ArduPilot gets none."""
    made = qgc_wpl.files(quads, Settings("px4"))["quad1.waypoints"]
    places = [w for w in load(tmp_path, made) if w.command in (16, 22)][1:]
    legs = [(a, b) for a, b in pairwise(places) if (a.x, a.y) != (b.x, b.y)]
    assert len(legs) >= 4
    for a, b in legs:
        back = Geod(ellps="WGS84").inv(a.y, a.x, b.y, b.x)[1] + 180.0
        assert abs((b.param4 - back + 180.0) % 360.0 - 180.0) < 0.1
    ardupilot = load(tmp_path, qgc_wpl.files(quads, Settings())["quad1.waypoints"])
    assert {w.param4 for w in ardupilot} == {0.0}


def test_ugv_waits_at_its_tasks_in_whole_seconds(tmp_path, ugv):
    """A hold is rounded up, for autopilots keep whole seconds."""
    items = load(tmp_path, qgc_wpl.files(ugv, Settings())["husky.waypoints"])
    assert [w.param1 for w in items if w.command == 16] == [0, 31, 31, 31, 0]


def test_fence_and_rally(boats, monkeypatch):
    """Every vertex tells how many its ring has; rings are open; the island is excluded, the rally point is the start."""
    made = qgc_wpl.files(boats, Settings())
    rows = [row.split("\t") for row in made["usv1.fence.txt"].splitlines()[1:]]
    inclusion = [row for row in rows if row[3] == "5001"]
    exclusion = [row for row in rows if row[3] == "5002"]
    assert len(inclusion) == 4
    assert {float(row[4]) for row in inclusion} == {4.0}
    assert {float(row[4]) for row in exclusion} == {float(len(exclusion))}
    assert exclusion[0][8:10] != exclusion[-1][8:10]
    rally = made["usv1.rally.txt"].splitlines()[1].split("\t")
    lon, lat = boats.frame.to_degrees(np.array([boats.vehicles[0].start]))[0]
    assert math.isclose(float(rally[8]), lat, abs_tol=1e-8)
    assert math.isclose(float(rally[9]), lon, abs_tol=1e-8)


def test_too_many_items_are_told(make_fleet):
    """A mission beyond what boards hold is written, and told."""
    said = []
    made = qgc_wpl.files(make_fleet(1, lines=5000), Settings("ardupilot", said.append))
    assert len(made["usv1.waypoints"].splitlines()) > 10000
    assert "ArduPilot with 16 kB of storage holds 655" in said[0]


@pytest.mark.parametrize(
    ("altitude", "frame", "height"), [("relative", 3, 40.0), ("terrain", 10, 40.0), ("amsl", 0, 152.5)]
)
def test_heights_count_from_what_was_asked(tmp_path, quads, altitude, frame, height):
    """Take-off and waypoints are in the frame of the altitude; only heights above the sea have the ground's added."""
    settings = Settings("ardupilot", altitude=altitude, ground=112.5)
    items = load(tmp_path, qgc_wpl.files(quads, settings)["quad1.waypoints"])
    assert {(w.frame, w.z) for w in items[1:] if w.command in (16, 22)} == {(frame, height)}
    plan = json.loads(qgc_plan.files(quads, settings)["quad1.plan"])["mission"]
    modes = {(i["frame"], i["AltitudeMode"], i["Altitude"]) for i in plan["items"] if "Altitude" in i}
    assert modes == {(frame, {3: 1, 10: 4, 0: 2}[frame], height)}
    assert plan["plannedHomePosition"][2] == 112.5


def test_altitudes_that_cannot_be_are_refused(quads, tmp_path):
    """Above the sea without the ground, and above terrain for PX4, are each one line."""
    for options, words in (({"altitude": "amsl"}, "--ground"), ({"altitude": "terrain", "autopilot": "px4"}, "PX4")):
        with pytest.raises(InputError, match=words):
            export(quads, "qgc-wpl", tmp_path, **options)


@pytest.mark.parametrize("clearance", [0.0, 0.4, 0.8, 1.9, 2.0, 2.6, 5.0])
def test_clearance_exceeds_the_acceptance_radius_or_it_is_told(boats, clearance):
    """Corners are cut by as much as waypoints accept: less than the clearance, or the user is told."""
    vehicles = tuple(replace(v, clearance=clearance) for v in boats.vehicles)
    said = []
    made = qgc_wpl.files(replace(boats, vehicles=vehicles), Settings("ardupilot", said.append))
    accepted = {float(row.split("\t")[5]) for row in made["usv1.waypoints"].splitlines()[2:] if row.split("\t")[3] == "16"}
    assert max(accepted) < clearance or any("usv1: autopilots cut corners" in line for line in said)
    assert any("cut corners" in line for line in said) == (clearance <= 2.0)


def test_pymavlink_reads_fences_and_rally_points(boats, tmp_path):
    """Its loaders of fences and rally points, which want MAVLink 2 from the start, give back every vertex."""
    made = qgc_wpl.files(boats, Settings())
    for kind, name in (("Fence", "usv1.fence.txt"), ("Rally", "usv1.rally.txt")):
        (tmp_path / name).write_text(made[name])
        code = (
            "import os, sys; os.environ['MAVLINK20'] = '1'\nfrom pymavlink import mavwp\n"
            f"loader = mavwp.MissionItemProtocol_{kind}(); loader.load(sys.argv[1])\n"
            "print([(w.command, w.x, w.y) for w in loader.wpoints])"
        )
        done = subprocess.run([sys.executable, "-c", code, tmp_path / name], capture_output=True, text=True, check=True)
        rows = [row.split("\t") for row in made[name].splitlines()[1:]]
        assert ast.literal_eval(done.stdout) == [(int(r[3]), float(r[8]), float(r[9])) for r in rows]
