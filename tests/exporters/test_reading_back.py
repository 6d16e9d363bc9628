"""What we write, read back by the clients' own parsers, schemas and other people's libraries: places, order, meaning."""

import csv
import io
import itertools
import re
import shutil
import subprocess
import zipfile
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import gpxpy
import numpy as np
import pytest
from lxml import etree
from pyproj import Transformer

from quarterdeck.exporters import gpx, kml, moos, nav2, qgc_plan, rtz, waypoint_table
from quarterdeck.exporters.export import Settings
from quarterdeck.exporters.places import distinct, file_stems
from quarterdeck.geo.frame import Frame

FORMATS = Path(__file__).resolve().parents[2].parent / "shared" / "formats"
PLACES = [Frame(121.6, 38.9), Frame(179.9995, -17.0), Frame(-179.9999, 75.0)]


def difference(lonlat, frame, xy):
    """Return the greatest difference in degrees, longitudes compared round the antimeridian."""
    apart = np.abs(np.asarray(lonlat, dtype=float) - frame.to_degrees(xy))
    apart[:, 0] = np.minimum(apart[:, 0], 360.0 - apart[:, 0])
    return apart.max()


def kept(route):
    """Return the (n, 2) metres that a format without holds writes."""
    return route.xyz[distinct(route), :2]


@pytest.mark.parametrize("version", ["1.0", "1.1", "1.2"])
@pytest.mark.parametrize("frame", PLACES)
def test_rtz(make_fleet, version, frame):
    """Valid by its schema, ids unique, no leg on the first waypoint and one on all others, route named as the file."""
    mission = make_fleet(2, frame)
    made = rtz.files(mission, Settings(), version=version)
    schema = FORMATS / "rtz" / f"RTZ Schema version {version.replace('.', '_')}.xsd"
    for route, (name, content) in zip(mission.routes, made.items(), strict=True):
        root = etree.fromstring(content)
        if schema.exists():
            etree.XMLSchema(etree.parse(schema)).assertValid(root)
        space = {"r": f"http://www.cirm.org/RTZ/{version.replace('.', '/')}"}
        assert root.find("r:routeInfo", space).get("routeName") + ".rtz" == name
        points = root.findall("r:waypoints/r:waypoint", space)
        ids = [p.get("id") for p in points]
        assert len(set(ids)) == len(ids) == len(kept(route))
        assert [p.find("r:leg", space) is not None for p in points] == [False] + [True] * (len(points) - 1)
        places = [(p.find("r:position", space).get("lon"), p.find("r:position", space).get("lat")) for p in points]
        assert difference(places, frame, kept(route)) <= 1e-7
        assert all(-180.0 <= float(lon) < 180.0 for lon, _ in places)
        knots = [float(p.find("r:leg", space).get("speedMax")) for p in points[1:]]
        assert np.allclose(
            np.array(knots) * 1852 / 3600, [route.waypoints[i].speed for i in distinct(route)[1:]], atol=1e-3
        )


@pytest.mark.parametrize("version", ["1.0", "1.1", "1.2"])
def test_rtz_schedule(make_fleet, version):
    """Speeds and stays always, times only from a departure; each waypoint of the route once, valid by the schema."""
    mission = make_fleet(1)
    route = mission.routes[0]
    held = [replace(w, hold=3725.0 if i == 3 else 0.0) for i, w in enumerate(route.waypoints)]
    mission = replace(mission, routes=(replace(route, waypoints=tuple(held)),))
    depart = datetime(2026, 5, 1, 6, 30, tzinfo=UTC)
    for given in (None, depart):
        (content,) = rtz.files(mission, Settings(depart=given), version=version).values()
        root = etree.fromstring(content)
        schema = FORMATS / "rtz" / f"RTZ Schema version {version.replace('.', '_')}.xsd"
        if schema.exists():
            etree.XMLSchema(etree.parse(schema)).assertValid(root)
        elements = list(root.find(".//{*}schedule/{*}manual"))
        assert [e.get("waypointId") for e in elements] == [w.get("id") for w in root.iter("{*}waypoint")]
        knots = [float(e.get("speed")) for e in elements[1:]]
        assert np.allclose(np.array(knots) * 1852 / 3600, [held[i].speed for i in distinct(route)[1:]], atol=1e-3)
        stays = {e.get("waypointId"): e.get("stay") for e in elements if e.get("stay")}
        assert stays == {"3": "01:02:05" if version == "1.0" else "PT3725S"}
        times = [(e.get("eta"), e.get("etd")) for e in elements]
        if given is None:
            assert times == [(None, None)] * len(times)
            continue
        assert times[0] == (None, "2026-05-01T06:30:00Z")
        assert times[-1][1] is None
        last = datetime.fromisoformat(times[-1][0]) - depart
        assert abs(last.total_seconds() - held[-1].time) <= 1.0


def test_rtz_schema_is_there_to_test_against():
    """The schemas are data beside the repository: say so when they are absent."""
    if not (FORMATS / "rtz").exists():
        pytest.skip(f"{FORMATS} is absent: RTZ was not validated against its XSD")


def test_long_rtz_is_split_where_it_can_be_joined(make_fleet):
    """No file above 400 kB, parts valid by themselves and each beginning where the last ended; the user is told."""
    said = []
    mission = make_fleet(1, lines=5000)
    made = rtz.files(mission, Settings("ardupilot", said.append), version="1.0")
    assert len(made) > 1
    assert max(map(len, made.values())) < 400_000
    assert "split" in said[0]
    parts = [[p.attrib for p in etree.fromstring(c).iter("{*}position")] for c in made.values()]
    assert all(dict(a[-1]) == dict(b[0]) for a, b in itertools.pairwise(parts))
    assert sum(map(len, parts)) - len(parts) + 1 == len(kept(mission.routes[0]))


@pytest.mark.parametrize("frame", PLACES)
def test_gpx(make_fleet, frame):
    """Gpxpy reads the same places; the XSD accepts it; the fleet's file holds every route."""
    mission = make_fleet(3, frame)
    made = gpx.files(mission, Settings())
    fleet = gpxpy.parse(made["five_boats.gpx"])
    for route, read in zip(mission.routes, fleet.routes, strict=True):
        assert difference([(p.longitude, p.latitude) for p in read.points], frame, kept(route)) <= 1e-7
        own = gpxpy.parse(made[f"{route.vehicle}.gpx"]).routes
        assert [p.name for p in own[0].points] == [p.name for p in read.points]
    schema = FORMATS / "gpx" / "gpx11.xsd"
    if not schema.exists():
        pytest.skip(f"{schema} is absent: GPX was not validated against its XSD")
    validator = etree.XMLSchema(etree.parse(schema))
    for text in made.values():
        validator.assertValid(etree.fromstring(text.encode()))


@pytest.mark.skipif(shutil.which("gpsbabel") is None, reason="gpsbabel is not installed")
@pytest.mark.parametrize("kind", ["gpx", "kml"])
def test_gpsbabel(make_fleet, tmp_path, kind):
    """gpsbabel, which gpxpy has nothing to do with, reads the same places from GPX and KML."""
    mission = make_fleet(1)
    made = (gpx if kind == "gpx" else kml).files(mission, Settings())
    (tmp_path / f"in.{kind}").write_text(made[f"five_boats.{kind}"])
    what = "-r" if kind == "gpx" else "-t"
    command = ["gpsbabel", what, "-i", kind, "-f", tmp_path / f"in.{kind}", "-o", "gpx", "-F", tmp_path / "out.gpx"]
    subprocess.run(command, check=True, capture_output=True)
    read = gpxpy.parse((tmp_path / "out.gpx").read_text())
    points = [p for r in read.routes for p in r.points] or [p for t in read.tracks for s in t.segments for p in s.points]
    assert len(points) >= len(kept(mission.routes[0]))
    places = mission.frame.to_metres(np.array([(p.longitude, p.latitude) for p in points]))
    assert all(np.hypot(*(places - own).T).min() < 0.02 for own in kept(mission.routes[0]))


def test_kml_and_kmz(quads):
    """Every leg in longitude, latitude, height order, above ground; the KMZ holds the same document."""
    text = kml.files(quads, Settings())["field_survey.kml"]
    packed = kml.files(quads, Settings(), packed=True)["field_survey.kmz"]
    assert zipfile.ZipFile(io.BytesIO(packed)).read("doc.kml").decode() == text
    root = etree.fromstring(text.encode())
    folders = [f for f in root.iter("{*}Folder") if f.find("{*}name").text == "quad1"]
    lines = [line.find("{*}coordinates").text.split() for line in folders[0].iter("{*}LineString")]
    joined = lines[0] + [place for line in lines[1:] for place in line[1:]]
    read = np.array([[float(part) for part in place.split(",")] for place in joined])
    route = quads.routes[0]
    assert difference(read[:, :2], quads.frame, route.xyz[:, :2]) <= 1e-7
    assert np.allclose(read[:, 2], route.xyz[:, 2])
    assert {mode.text for mode in folders[0].iter("{*}altitudeMode")} >= {"relativeToGround"}


@pytest.mark.parametrize("frame", PLACES)
def test_moos_metres_are_moosgeodesys(make_fleet, frame):
    """Points, turned back through the origin's UTM zone as MOOSGeodesy does, are the route's degrees."""
    mission = make_fleet(1, frame)
    made = moos.files(mission, Settings())
    lat, lon = (float(re.search(rf"{k}\s*= (\S+)", made["five_boats.moos"])[1]) for k in ("LatOrigin", "LongOrigin"))
    assert (lat, lon) == pytest.approx((frame.lat, frame.lon), abs=1e-9)
    zone = int((lon + 180) // 6) + 1
    utm = Transformer.from_crs("EPSG:4326", f"EPSG:{(32600 if lat >= 0 else 32700) + zone}", always_xy=True)
    east, north = utm.transform(lon, lat)
    points = np.array(
        [p.split(",") for kind, given in behaviours(made["usv1.bhv"]) for p in dict(given)["points"].split(":")], float
    )
    lonlat = np.column_stack(utm.transform(points[:, 0] + east, points[:, 1] + north, direction="INVERSE"))
    assert difference(lonlat, frame, kept(mission.routes[0])[1:]) <= 1e-7
    assert re.findall(r"speed\s+= (\S+)", made["usv1.bhv"]) == ["1.500", "1.000"]


def test_moos_waits_in_order(ugv):
    """Each wait keeps station for its seconds between the legs before and after it, in one chain of steps."""
    text = moos.files(ugv, Settings())["husky.bhv"]
    assert re.findall(r"name\s+= (\w+)_\d", text) == ["route", "wait", "route", "wait", "route", "wait", "route"]
    assert re.findall(r"condition\s+= STEP = (\d)", text) == [str(i) for i in range(7)]
    assert re.findall(r"endflag\s+= STEP = (\d)", text) == [str(i) for i in range(1, 8)]
    assert re.findall(r"duration\s+= (\d+)", text) == ["30", "30", "30"]


def test_nav2(ugv):
    """YAML with latitude, longitude and the heading on arrival, radians from east."""
    yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
    read = yaml.safe_load(nav2.files(ugv, Settings())["husky.yaml"])["waypoints"]
    xy = kept(ugv.routes[0])
    assert difference([(w["longitude"], w["latitude"]) for w in read], ugv.frame, xy[1:]) <= 1e-7
    step = np.diff(xy, axis=0)
    assert [w["yaw"] for w in read] == pytest.approx(np.arctan2(step[:, 1], step[:, 0]).tolist(), abs=1e-5)


def test_csv(boats):
    """One row a waypoint, with places, legs and times."""
    rows = list(csv.DictReader(io.StringIO(waypoint_table.files(boats, Settings())["five_boats.csv"])))
    assert len(rows) == sum(len(r.waypoints) for r in boats.routes)
    own = [r for r in rows if r["vehicle"] == "usv2"]
    places = [(r["longitude"], r["latitude"]) for r in own]
    assert difference(places, boats.frame, boats.routes[1].xyz[:, :2]) <= 1e-7
    assert [r["leg"] for r in own] == [w.leg for w in boats.routes[1].waypoints]
    assert [float(r["time_s"]) for r in own] == pytest.approx([w.time for w in boats.routes[1].waypoints], abs=0.01)


def test_csv_holds_no_formula(make_fleet):
    """A vehicle named like a formula stays a text."""
    text = waypoint_table.files(make_fleet(1, names=["=1+1"]), Settings())["five_boats.csv"]
    assert list(csv.reader(io.StringIO(text)))[1][0] == "'=1+1"


def test_a_vehicle_named_as_the_mission_keeps_its_file(make_fleet):
    """The fleet's file gives way to a vehicle's of the same name."""
    mission = make_fleet(2, names=["five boats", "b"])
    fleet, stems = file_stems(mission)
    assert stems == {"five boats": "five_boats", "b": "b"}
    assert fleet == "five_boats-2"


def test_plan_is_what_qgroundcontrol_requires(quads):
    """Root, mission, fence and rally points have every key and version that QGroundControl and MAVSDK ask for."""
    import json

    for autopilot, firmware in (("ardupilot", 3), ("px4", 12)):
        made = qgc_plan.files(quads, Settings(autopilot))
        plan = json.loads(made["quad2.plan"])
        assert (plan["fileType"], plan["version"], type(plan["groundStation"])) == ("Plan", 1, str)
        mission = plan["mission"]
        assert (mission["version"], mission["firmwareType"], mission["vehicleType"]) == (2, firmware, 2)
        assert [item["doJumpId"] for item in mission["items"]] == list(range(1, len(mission["items"]) + 1))
        assert all(len(item["params"]) == 7 for item in mission["items"])
        assert mission["items"][0]["command"] == 22
        assert plan["geoFence"]["version"] == plan["rallyPoints"]["version"] == 2
        assert [p["inclusion"] for p in plan["geoFence"]["polygons"]] == [True, False]
        assert plan["rallyPoints"]["points"][0][2] == 40.0


# What the helm's behaviours take: moos-ivp, IvPBehavior.cpp, BHV_Waypoint.cpp and BHV_StationKeep.cpp, setParam.
EVERY = {"name", "pwt", "priority", "condition", "endflag", "duration", "duration_idle_decay", "perpetual", "updates",
         "configflag", "activeflag"}  # fmt: skip
TAKEN = {
    "BHV_Waypoint": {"points", "polygon", "speed", "capture_line", "capture_radius", "radius", "slip_radius", "nm_radius",
                     "lead", "lead_damper", "lead_to_start", "order", "repeat", "visual_hints", "wptflag", "cycleflag",
                     "speed_alt", "use_alt_speed", "wptflag_on_start", "efficiency_measure"},
    "BHV_StationKeep": {"station_pt", "point", "inner_radius", "outer_radius", "outer_speed", "extra_speed",
                        "transit_speed", "swing_time", "hibernation_radius", "visual_hints", "center_activate"},
}  # fmt: skip


def behaviours(text):
    """Return (kind, parameters) of a .bhv as the helm's Populator_BehaviorSet reads it: braces alone on their lines."""
    found, inside, kind = [], False, ""
    joined, merged = "", []
    for raw in text.splitlines():  # FileBuffer.cpp, fileBufferSlash: a buffer of 5000 characters, joined at backslashes
        assert len(raw) < 5000
        joined += raw.rstrip("\\ ")
        if not raw.rstrip().endswith("\\"):
            merged.append(joined)
            joined = ""
    for raw in merged:
        line = raw.split("//")[0].strip()
        if not line or line.split()[0] in ("initialize", "set"):
            continue
        if line == "{":
            inside = True
        elif line == "}":
            inside = False
        elif not inside:
            key, _, kind = (part.strip() for part in line.partition("="))
            assert key.lower() == "behavior"
            found.append((kind, []))
        else:
            name, equals, value = (part.strip() for part in line.partition("="))
            assert equals
            assert value
            found[-1][1].append((name, value))
    assert not inside
    return found


def test_moos_behaviours_are_those_of_the_helm(ugv, boats, make_fleet):
    """Every parameter is one that its behaviour takes, numbers are numbers, and names are given once."""
    for mission in (ugv, boats, make_fleet(1, lines=5000)):
        for name, text in moos.files(mission, Settings()).items():
            if not name.endswith(".bhv"):
                continue
            read = behaviours(text)
            assert read
            names = [value for _, given in read for key, value in given if key == "name"]
            assert len(set(names)) == len(read)
            for kind, given in read:
                assert {key for key, _ in given} <= EVERY | TAKEN[kind]
                numbers = [
                    v for k, v in given if k in ("pwt", "speed", "capture_radius", "slip_radius", "lead", "duration")
                ]
                assert all(float(v) > 0 for v in numbers)


def test_the_helms_own_sample_passes_the_same_reading():
    """MOOS-IvP's alpha mission, which its helm runs, is read alike: the test is not kinder to us, nor harder."""
    sample = FORMATS / "moos" / "alpha.bhv"
    if not sample.exists():
        pytest.skip(f"{sample} is absent")
    for kind, given in behaviours(sample.read_text()):
        if kind in TAKEN:
            assert {key for key, _ in given} <= EVERY | TAKEN[kind]


@pytest.mark.parametrize("make", ["boats", "quads", "ugv"])
def test_kml_is_valid_by_its_schema(make, request, tmp_path):
    """OGC's KML 2.2 schema, which fastkml ships, accepts it; fastkml itself reads every line."""
    fastkml = pytest.importorskip("fastkml", reason="fastkml is not installed: KML was not validated against its XSD")
    from fastkml.utils import find_all
    from fastkml.validator import validate

    mission = request.getfixturevalue(make)
    (text,) = kml.files(mission, Settings()).values()
    (tmp_path / "a.kml").write_text(text, encoding="utf-8")
    assert validate(file_to_validate=tmp_path / "a.kml")
    read = fastkml.KML.parse(tmp_path / "a.kml")
    marks = list(find_all(read, of_type=fastkml.Placemark))
    lines = [m for m in marks if m.geometry.geom_type == "LineString"]
    moves = sum(len(line.geometry.coords) - 1 for line in lines)
    assert moves == sum(len(route.waypoints) - 1 for route in mission.routes)
