"""How long logs of 5 h at 10 Hz of 5 vehicles take to read and to report on; CPU seconds, as JSON lines.

    python benchmarks/logs.py [--hours 5] [--formats bin,tlog,gpx,csv,npz] [--folder /tmp/logs]

The vehicles run the sea sample's plan perfectly; each format holds places at 10 Hz, attitude and energy where it can.
"""

import argparse
import json
import struct
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.telemetry import GLOBAL_POSITION, checksum
from quarterdeck.mission.cover import cover
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.tracks import read_tracks
from quarterdeck.physics.observed import report_tracks

DATA = Path(__file__).parents[1] / "data"
BEGAN = 1_780_000_000.0


def main() -> None:
    """Write the logs, then read and report on each format."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=5.0)
    parser.add_argument("--formats", default="bin,tlog,gpx,csv,npz")
    parser.add_argument("--folder", type=Path)
    given = parser.parse_args()
    mission = cover(read_scenario(DATA / "west_ant_island.geojson"))
    with tempfile.TemporaryDirectory() as folder:
        for ending in given.formats.split(","):
            here = (given.folder or Path(folder)) / ending
            here.mkdir(parents=True, exist_ok=True)
            paths = written(mission, here, ending, given.hours * 3600.0)
            read_tracks(mission, [paths[0]])  # compiles
            began = time.process_time()
            record = read_tracks(mission, paths)
            read = time.process_time()
            run = report_tracks(mission, record)
            done = time.process_time()
            size = sum(Path(p).stat().st_size for p in {p.split("=")[-1] for p in paths})
            figures = {
                "format": ending,
                "vehicles": len(record.tracks),
                "hours": given.hours,
                "megabytes": round(size / 1e6),
            }
            seconds = {"read": round(read - began, 2), "report": round(done - read, 2)}
            coverage = {
                "coverage_driven": round(run.report.figures["coverage_driven"] or 0.0, 4),
                "reasons": len(record.reasons),
            }
            print(json.dumps(figures | seconds | coverage))


def written(mission: Mission, folder: Path, ending: str, until: float) -> list[str]:
    """Write the logs of a perfect run and return them as --track takes them."""
    paths, columns = [], []
    for route in mission.routes:
        at = np.array([(t, w.x, w.y) for w in route.waypoints for t in (w.time, w.time + w.hold)])
        t = np.arange(0.0, min(until, route.duration), 0.1)
        x, y = (np.interp(t, at[:, 0], at[:, i]) for i in (1, 2))
        lonlat = mission.frame.to_degrees(np.column_stack([x, y]))
        heading = np.arctan2(np.gradient(y), np.gradient(x))
        path = folder / f"{route.vehicle}.{ending}"
        if ending == "npz":
            columns.append((t, x, y, heading, route.energy * t / route.duration))
            continue
        if ending == "gpx":
            _gpx(path, t, lonlat)
        else:
            {"bin": _bin, "tlog": _tlog, "csv": _csv}[ending](path, t, lonlat, heading)
        paths.append(f"{route.vehicle}={path}")
    if ending == "npz":
        longest = max(columns, key=lambda c: len(c[0]))[0]
        names = dict.fromkeys(("x", "y", "z", "heading", "speed", "energy"))
        filled: dict[str, Any] = {n: np.zeros((len(longest), len(columns))) for n in names}
        for i, (t, x, y, heading, energy) in enumerate(columns):
            for name, values in (("x", x), ("y", y), ("heading", heading), ("energy", energy)):
                filled[name][:, i] = np.interp(longest, t, values)
        whole = folder / "run.npz"
        origin = np.array([mission.frame.lon, mission.frame.lat])
        np.savez(whole, vehicles=[r.vehicle for r in mission.routes], origin=origin, time=longest, **filled)
        paths = [str(whole)]
    return paths


def _bin(path: Path, t: np.ndarray, lonlat: np.ndarray, heading: np.ndarray) -> None:
    """GPS, POS, ATT, BAT and four fast messages (IMU) of 50 bytes at each place."""
    shapes = {
        "GPS": ("QBBIHBcLLeffffB", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U", "<QBBIHBhiiiffffB"),
        "POS": ("QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt", "<Qiifff"),
        "ATT": ("QccccCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw", "<QhhhhHH"),
        "BAT": ("QBfffff", "TimeUS,Inst,Volt,VoltR,Curr,CurrTot,EnrgTot", "<QBfffff"),
        "IMU": ("QBffffffffB", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,T,TX,H", "<QBffffffffB"),
    }
    head = [_form(0x80, "FMT", 89, "BBnNZ", "Type,Length,Name,Format,Columns")]
    sizes = {n: struct.calcsize(s) + 3 for n, (_, _, s) in shapes.items()}
    head += [_form(i, n, sizes[n], f, c) for i, (n, (f, c, _)) in enumerate(shapes.items(), 1)]
    order = ["GPS", "POS", "ATT", "BAT", "IMU", "IMU", "IMU", "IMU"]
    fields: list[Any] = []
    for i, name in enumerate(order):
        codes = {"B": "u1", "Q": "<u8", "I": "<u4", "H": "<u2", "h": "<i2", "i": "<i4", "f": "<f4"}
        body = [(c, codes[k]) for c, k in zip(shapes[name][1].split(","), shapes[name][2][1:], strict=True)]
        fields.append((f"{name}{i}", [("head", "S3"), *body]))
    rows = np.zeros(len(t), np.dtype(fields))
    gps = BEGAN + t - 315964800 + 18
    for i, name in enumerate(order):
        message = rows[f"{name}{i}"]
        message["head"] = bytes([0xA3, 0x95, list(shapes).index(name) + 1])
        message["TimeUS"] = np.round((20.0 + t) * 1e6)
        if name in ("GPS", "POS"):
            message["Lng"], message["Lat"] = np.round(lonlat * 1e7).astype(int).T
    rows["GPS0"]["Status"], rows["GPS0"]["GWk"], rows["GPS0"]["GMS"] = 3, gps // 604800, np.round(gps % 604800 * 1e3)
    rows["GPS0"]["Spd"], rows["ATT2"]["Yaw"] = 1.5, np.round(np.degrees(np.pi / 2 - heading) % 360 * 100) % 36000
    rows["BAT3"]["EnrgTot"], rows["BAT3"]["Volt"] = t / 50.0, 15.0
    path.write_bytes(b"".join(head) + rows.tobytes())


def _form(kind: int, name: str, length: int, form: str, columns: str) -> bytes:
    return struct.pack("<BBBBB4s16s64s", 0xA3, 0x95, 0x80, kind, length, name.encode(), form.encode(), columns.encode())


def _tlog(path: Path, t: np.ndarray, lonlat: np.ndarray, heading: np.ndarray) -> None:
    """GLOBAL_POSITION_INT at each place, and eight times as many frames of other messages."""
    from pymavlink.dialects.v20 import ardupilotmega as mavlink

    row = np.dtype([("stamp", ">u8"), ("head", "S10"), ("boot", "<u4"), ("place", "<i4", (4,)), ("v", "<i2", (3,)),
                    ("hdg", "<u2"), ("crc", "<u2")])  # fmt: skip
    rows = np.zeros(len(t), row)
    rows["stamp"], rows["boot"] = np.round((BEGAN + t) * 1e6), np.round((20.0 + t) * 1e3)
    rows["head"] = bytes([0xFD, 28, 0, 0, 0, 1, 1, GLOBAL_POSITION, 0, 0])
    rows["place"][:, 1], rows["place"][:, 0] = np.round(lonlat * 1e7).astype(int).T
    rows["hdg"] = np.round(np.degrees(np.pi / 2 - heading) % 360 * 100) % 36000
    raw = rows.view(np.uint8).reshape(len(t), row.itemsize)
    raw[:, 8:18] = np.frombuffer(bytes([0xFD, 28, 0, 0, 0, 1, 1, GLOBAL_POSITION, 0, 0]), np.uint8)
    extra = mavlink.mavlink_map[GLOBAL_POSITION].crc_extra
    rows["crc"] = [checksum(frame[9:-2], extra) for frame in raw]
    other = np.tile(raw[:, None, :], (1, 9, 1))
    other[:, 1:, 15] = 27  # RAW_IMU: another message
    path.write_bytes(other.tobytes())


def _gpx(path: Path, t: np.ndarray, lonlat: np.ndarray) -> None:
    when = np.datetime_as_string(np.round((BEGAN + t) * 1e3).astype("datetime64[ms]"))
    points = (
        f'<trkpt lat="{lat:.7f}" lon="{lon:.7f}"><time>{moment}Z</time></trkpt>'
        for (lon, lat), moment in zip(lonlat.tolist(), when.tolist(), strict=True)
    )
    space = 'xmlns="http://www.topografix.com/GPX/1/1"'
    path.write_text(
        f'<gpx version="1.1" creator="benchmark" {space}><trk><trkseg>' + "\n".join(points) + "</trkseg></trk></gpx>"
    )


def _csv(path: Path, t: np.ndarray, lonlat: np.ndarray, heading: np.ndarray) -> None:
    compass = np.degrees(np.pi / 2 - heading) % 360
    table = np.column_stack([BEGAN + t, lonlat, compass, np.full(len(t), 1.5), t / 50.0])
    form = ["%.2f", "%.7f", "%.7f", "%.2f", "%.2f", "%.4f"]
    np.savetxt(path, table, fmt=form, delimiter=",", header="time,lon,lat,heading,speed,energy", comments="")


if __name__ == "__main__":
    main()
