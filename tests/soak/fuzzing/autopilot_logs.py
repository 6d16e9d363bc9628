"""Logs as autopilots write them, packed by pymavlink: ArduPilot's .bin, and the .tlog of a ground station.

`rows` has the arrays `time` (Unix seconds), `lon`, `lat`, `height`, `heading` (compass degrees), `speed`, `energy`; `began`
is when the autopilot went to AUTO, if it is to say so.
"""

import struct
from collections.abc import Mapping
from types import SimpleNamespace

import numpy as np

SHAPES = {  # ArduRover's messages: codes of DFReader, columns
    "GPS": ("QBBIHBcLLeffffB", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U"),
    "POS": ("QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt"),
    "ATT": ("QccccCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw"),
    "BAT": ("QBfffff", "TimeUS,Inst,Volt,VoltR,Curr,CurrTot,EnrgTot"),
    "MODE": ("QMBB", "TimeUS,Mode,ModeNum,Rsn"),
    "MSG": ("QZ", "TimeUS,Message"),
}


def dataflash(rows: Mapping[str, np.ndarray], began: float | None = None) -> bytes:
    """Return a .bin log: positions at the rows' rate, the rest at other rates."""
    from pymavlink import DFReader as reader

    forms, pack = {}, reader.DFReader_binary.make_msgbuf
    whole = SimpleNamespace(formats={0x80: reader.DFFormat(0x80, "FMT", 89, "BBnNZ", "Type,Length,Name,Format,Columns")})
    whole.make_msgbuf = lambda form, values: pack(whole, form, values)
    out = [whole.make_msgbuf(whole.formats[0x80], [0x80, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns"])]
    for number, (name, (codes, columns)) in enumerate(SHAPES.items(), 1):
        length = struct.calcsize("<" + "".join(reader.FORMAT_TO_STRUCT[c][0] for c in codes)) + 3
        forms[name] = reader.DFFormat(number, name, length, codes, columns)
        out.append(reader.DFReader_binary.make_format_msgbuf(whole, forms[name]))
    boot = rows["time"][0] - 20.0
    week = 604800.0
    put = lambda name, *values: out.append(whole.make_msgbuf(forms[name], values))  # noqa: E731
    put("MSG", 0, b"ArduRover V4.6.3 (3fc7011a)")
    put("MODE", 0, 0, 0, 1)
    gone = began is None
    for i, t in enumerate(rows["time"].tolist()):
        stamp = round((t - boot) * 1e6)
        if not gone and t >= began:
            put("MODE", round((began - boot) * 1e6), 10, 10, 2)
            gone = True
        lat, lon = (round(rows[n][i] * 1e7) for n in ("lat", "lon"))
        if i % 2 == 0:
            gps = t - 315964800 + 18
            yaw, speed = rows["heading"][i], rows["speed"][i]
            put("GPS", stamp, 0, 3, round(gps % week * 1e3), int(gps // week), 12, 80, lat, lon, 300, speed, yaw, 0, 0, 1)
            put("BAT", stamp, 0, 15.0, 15.0, 4.0, rows["energy"][i] / 15e-3, rows["energy"][i])
        put("POS", stamp, lat, lon, 3.0 + rows["height"][i], rows["height"][i], rows["height"][i])
        put("ATT", stamp, 0, 0, 0, 0, 0, round(rows["heading"][i] % 360 * 100))
    return b"".join(out)


def telemetry(rows: Mapping[str, np.ndarray], began: float | None = None) -> bytes:
    """Return a .tlog: MAVLink 2 as a ground station records it, some frames up to 80 ms late."""
    from pymavlink.dialects.v20 import ardupilotmega as mavlink

    pack = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    boot, late = rows["time"][0] - 20.0, np.random.default_rng(0).choice([0.0, 0.0, 0.0, 0.08], len(rows["time"]))
    out = []
    for i, t in enumerate(rows["time"].tolist()):
        since = round((t - boot) * 1e3)
        lat, lon = (round(rows[n][i] * 1e7) for n in ("lat", "lon"))
        up, yaw, speed = round(rows["height"][i] * 1e3), rows["heading"][i], rows["speed"][i] * 100
        sent = [
            mavlink.MAVLink_global_position_int_message(
                since, lat, lon, 3000 + up, up, round(speed * np.cos(np.radians(yaw))),
                round(speed * np.sin(np.radians(yaw))), 0, round(yaw % 360 * 100) % 36000),
            mavlink.MAVLink_attitude_message(since, 0, 0, (np.radians(yaw) + np.pi) % (2 * np.pi) - np.pi, 0, 0, 0),
        ]  # fmt: skip
        if i % 10 == 0:
            auto = began is not None and t >= began
            sent.append(mavlink.MAVLink_heartbeat_message(11, 3, 1, 10 if auto else 0, 4, 3))
            used = rows["energy"][i]
            sent.append(
                mavlink.MAVLink_battery_status_message(
                    0, 0, 0, 0, [15000] + [65535] * 9, 400, round(used / 15e-3), round(used * 36), 80)
            )  # fmt: skip
        out += [struct.pack(">Q", round((t + late[i]) * 1e6)) + message.pack(pack) for message in sent]
    return b"".join(out)
