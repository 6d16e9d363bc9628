"""Sound files of every format that Quarterdeck reads, small ones; what is fed to it is made by damaging these."""

import io
import json
import zipfile
from pathlib import Path

import numpy as np
from fuzzing.autopilot_logs import dataflash, telemetry

from quarterdeck.geo.frame import Frame

DATA = Path(__file__).parents[3] / "data"


def small_site(domain: str = "ground") -> bytes:
    """Return a site of 50 x 30 m with everything in it: two vehicles, an obstacle, three tasks, casualties, a medic."""
    lon, lat = 1 / 65000, 1 / 111000  # degrees a metre, nearly, at 54 degrees north

    def at(x: float, y: float) -> list[float]:
        return [round(10 + x * lon, 7), round(54 + y * lat, 7)]

    def feature(role: str, kind: str, coordinates: object, **properties: object) -> dict:
        geometry = {"type": kind, "coordinates": coordinates}
        return {"type": "Feature", "properties": {"role": role} | properties, "geometry": geometry}

    def box(x0: float, y0: float, x1: float, y1: float) -> list:
        return [[at(x0, y0), at(x1, y0), at(x1, y1), at(x0, y1), at(x0, y0)]]

    features = [
        feature("area", "Polygon", box(0, 0, 50, 30), id="field", spacing=5.0),
        feature("operating", "Polygon", box(-15, -15, 65, 45)),
        feature("obstacle", "Polygon", box(20, 10, 24, 15), id="shed", height=4.0),
        feature("vehicle", "Point", at(-5, -5), id="v1", domain=domain, range=12.0, can=["look"]),
        feature("vehicle", "Point", at(55, -5), id="v2", domain=domain, range=12.0, endurance=4000.0, end=at(50, -5)),
        feature("task", "Point", at(5, 5), id="t1", priority=3, service_time=10.0),
        feature("task", "Point", at(40, 25), id="t2", after=["t1"], window=[0, 900]),
        feature("task", "Point", at(30, 5), id="t3", needs=["look"], after=[{"task": "t2", "mode": "same_robot"}]),
        feature("casualty", "Point", at(10, 20), id="c1", colour="red"),
        feature("casualty", "Point", at(35, 20), id="c2", colour="yellow"),
        feature("medic", "Point", at(-5, 0), id="m1"),
        feature("rendezvous", "Point", at(0, 15), id="r1"),
    ]
    return json.dumps({"type": "FeatureCollection", "name": "small", "features": features}).encode()


KML = b"""<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document>
<Placemark><name>field</name><Polygon><outerBoundaryIs><LinearRing><coordinates>
10,54,0 10.01,54,0 10.01,54.01,0 10,54.01,0 10,54,0</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>
<Folder><name>No-fly zones</name><Placemark><name>mast</name><Polygon><outerBoundaryIs><LinearRing><coordinates>
10.004,54.004 10.005,54.004 10.005,54.005 10.004,54.004</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>
</Folder>
<Placemark><name>north start</name><Point><coordinates>10.001,54.001,3</coordinates></Point></Placemark>
<Placemark><name>pump</name><Point><coordinates>10.002,54.002</coordinates></Point></Placemark></Document></kml>"""
GPX = b"""<gpx xmlns="http://www.topografix.com/GPX/1/1" version="1.1" creator="t">
<wpt lat="54.1" lon="10.1"><name>a</name></wpt>
<rte><rtept lat="54.2" lon="10.2"><name>a</name></rtept><rtept lat="54.3" lon="10.3"/></rte></gpx>"""
QGC = json.dumps(
    {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": {
            "items": [
                {
                    "type": "ComplexItem",
                    "complexItemType": "survey",
                    "polygon": [[54, 10], [54, 10.01], [54.01, 10.01]],
                    "TransectStyleComplexItem": {"CameraCalc": {"AdjustedFootprintSide": 25}},
                }
            ],
            "plannedHomePosition": [54.001, 10.002, 0],
            "vehicleType": 11,
        },
        "geoFence": {
            "polygons": [{"inclusion": True, "polygon": [[53.99, 9.99], [53.99, 10.02], [54.02, 10.02], [54.02, 9.99]]}],
            "circles": [{"inclusion": False, "circle": {"center": [54.002, 10.006], "radius": 50.0}}],
        },
    }
).encode()
MAP = b"""image: map.pgm
resolution: 0.5
origin: [-20.0, -20.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""
TERRAIN = b"ncols 5\nnrows 4\nxllcorner -60\nyllcorner -60\ncellsize 40\nnodata_value -9999\n" + b"0 1 2 1 0\n" * 4
STUDY = b"""plan = "stc.geojson"
runs = 2
seed = 3

[conditions]
current_speed = [0.0, 0.2]
current_towards = { uniform = [0, 360] }
wind_speed = { normal = [2, 1] }
wind_from = 270
gusts = 0.5
faults = [[], ["random:1"]]

[limits]
cross_track = 5.0
"""
DRILL = b"""runs = 2
seed = 1

[triage]
site = "site.geojson"
method = ["relay", "constant"]
casualties = [1, 3]
medic_speed = { uniform = [1.0, 1.6] }
treat = [10, 60]
"""
LOG = b"vehicle,time,lat,lon,height,speed\n" + b"".join(
    b"v1,%d,%.7f,%.7f,0,1.0\n" % (t, 54 + t / 111000 / 4, 10 + t / 65000) for t in range(0, 40, 2)
)
TRACK = (
    '<gpx xmlns="http://www.topografix.com/GPX/1/1" version="1.1" creator="t"><trk><name>v1</name><trkseg>'
    + "".join(
        f'<trkpt lat="{54 + t / 444000:.7f}" lon="{10 + t / 65000:.7f}"><time>2026-05-01T09:00:{t:02}Z</time></trkpt>'
        for t in range(0, 40, 2)
    )
    + "</trkseg></trk></gpx>"
).encode()
CHANGES = json.dumps(
    {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "geometry": None,
                "properties": {"role": "vehicle", "id": "v2", "change": "remove", "since": 20},
            },
            {"type": "Feature", "geometry": None, "properties": {"role": "obstacle", "id": "shed", "change": "remove"}},
            {
                "type": "Feature",
                "geometry": None,
                "properties": {"role": "vehicle", "id": "v1", "change": "set", "speed": 0.5},
            },
            {
                "type": "Feature",
                "geometry": {
                    "type": "Polygon",
                    "coordinates": [[[10.0005, 54.0001], [10.0006, 54.0001], [10.0006, 54.0002], [10.0005, 54.0001]]],
                },
                "properties": {"role": "obstacle", "id": "wreck"},
            },
        ],
    }
).encode()
DISTANCES = json.dumps({"dist": [[abs(i - j) * 2.0 for i in range(7)] for j in range(7)]}).encode()


def packed(members: dict[str, bytes]) -> bytes:
    """Return a zip file."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return made.getvalue()


def image() -> bytes:
    """Return a grey map with a wall and a border that is not known."""
    grey = np.full((160, 240), 254, np.uint8)
    grey[70:80, 100:120] = 0
    grey[:4], grey[-4:] = 205, 205
    return b"P5\n240 160\n255\n" + grey.tobytes()


def terrain_npz() -> bytes:
    """Return level ground about the small site."""
    made = io.BytesIO()
    np.savez(made, origin=np.array([-60.0, -60.0]), cell=np.array(40.0), heights=np.zeros((4, 5)))
    return made.getvalue()


def autopilot_logs(trace: bytes) -> dict[str, bytes]:
    """Return the logs of the first vehicle of a trace of `simulate`, as ArduRover and its ground station write them."""
    with np.load(io.BytesIO(trace)) as file:
        every = slice(0, None, max(1, len(file["time"]) // 300))
        own = {name: file[name][every, 0] for name in ("x", "y", "heading", "speed", "energy")}
        lon, lat = Frame(*file["origin"].tolist()).to_degrees(np.column_stack([own["x"], own["y"]])).T
        time = 1_780_000_000.0 + file["time"][every]
    rows = {"time": time, "lon": lon, "lat": lat, "height": np.zeros(len(time)), "speed": own["speed"]}
    rows |= {"heading": 90.0 - np.degrees(own["heading"]), "energy": own["energy"]}
    return {"log.bin": dataflash(rows, time[0]), "log.tlog": telemetry(rows, time[0])}


def raster() -> dict[str, bytes]:
    """Return a GeoTIFF about the small site, where there is rasterio to make and read it."""
    try:
        import rasterio
    except ImportError:
        return {}
    look = {"driver": "GTiff", "width": 12, "height": 12, "count": 1, "dtype": "float32", "crs": "EPSG:4326"}
    with rasterio.MemoryFile() as made:
        with made.open(**look, transform=rasterio.Affine(0.0005, 0, 9.998, 0, -0.0005, 54.003)) as file:
            file.write(np.add.outer(np.arange(12.0), np.zeros(12)).astype(np.float32), 1)
        return {"terrain.tif": made.read()}


def sites() -> dict[str, bytes]:
    """Return sound sites by file name, one of each format and kind."""
    own = {path.name: path.read_bytes() for path in sorted(DATA.glob("*.geojson"))}
    small = {f"{domain}.geojson": small_site(domain) for domain in ("ground", "surface", "aerial")}
    return own | small | {"site.kml": KML, "site.kmz": packed({"doc.kml": KML}), "site.gpx": GPX, "site.plan": QGC}


def room() -> bytes:
    """Return a room of 30 x 20 m with a pillar, for guards."""
    ring = [[0, 0], [30, 0], [30, 20], [0, 20], [0, 0]]
    hole = [[10, 8], [14, 8], [14, 12], [10, 12], [10, 8]]
    geometry = {"type": "Polygon", "coordinates": [ring, hole]}
    return json.dumps(
        {"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {}, "geometry": geometry}]}
    ).encode()
