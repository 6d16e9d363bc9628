"""Telemetry logs of ground stations (.tlog): MAVLink frames, each behind its time; framed here, defined by pymavlink."""

from typing import Any

import numpy as np
from numba import njit

from quarterdeck.geo.errors import InputError, UnavailableError
from quarterdeck.geo.logs import Log, finite, from_compass, sampled

HEARTBEAT, SYS_STATUS, ATTITUDE, GLOBAL_POSITION, BATTERY = 0, 1, 30, 33, 147
WANTED = (HEARTBEAT, SYS_STATUS, ATTITUDE, GLOBAL_POSITION, BATTERY)
GROUND_STATION = 6  # MAV_TYPE_GCS
DELAYED = 5.0  # s: a frame stamped so much later than its own clock says came late, or the clock began anew


def read_telemetry(path: str, data: bytes) -> list[Log]:
    """Return a log for each vehicle (MAVLink system, named by its number) in a .tlog file, of GLOBAL_POSITION_INT.

    Times are those of the ground station's clock, less the delays of the link. Raises InputError if no position is in it,
    UnavailableError without pymavlink.
    """
    try:
        from pymavlink import mavutil
        from pymavlink.dialects.v20 import ardupilotmega as mavlink
    except ImportError:
        raise UnavailableError(f"{path}: reading it needs pymavlink; pip install 'quarterdeck[logs]'") from None
    extra = np.full(256, -1, np.int64)
    for kind in WANTED:
        extra[kind] = mavlink.mavlink_map[kind].crc_extra
    raw = np.frombuffer(data, np.uint8)
    starts, kinds, systems, lengths, junk = find_frames(raw, extra)
    stamp = raw[starts[:, None] - 8 + np.arange(8)].view(">u8")[:, 0] * 1e-6 if len(starts) else np.empty(0)
    notes = (f"{path}: damaged: {junk:,} bytes of it are no messages",) if junk > 0 else ()
    logs = []
    for system in np.unique(systems[kinds == GLOBAL_POSITION]).tolist():
        own = systems == system
        tables = {}
        for kind in WANTED:
            chosen = own & (kinds == kind)
            table = _payloads(raw, starts[chosen], lengths[chosen], mavlink.mavlink_map[kind])
            tables[kind] = table | {"stamp": stamp[chosen]}
        logs.append(_log(path, str(system), tables, mavutil, notes))
    if not logs:
        raise InputError(f"{path}: has no position in it: no sound GLOBAL_POSITION_INT message")
    return logs


@njit(cache=True)
def find_frames(data: np.ndarray, extra: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, int]:
    """Return starts, message ids, systems and payload lengths of the sound MAVLink 1 and 2 frames of wanted messages.

    `data` (n,) bytes; `extra` (256,) the last byte of each message's checksum, -1 for those not wanted, whose checksum is
    not looked at. The last figure is how many bytes belong to no frame. Where a frame is not sound the next is looked for.
    """
    starts = np.empty(max(len(data) // 17, 1), np.int64)
    kinds, systems, lengths = np.empty_like(starts), np.empty_like(starts), np.empty_like(starts)
    count = junk = 0
    at: Any = 8
    while at + 8 <= len(data):
        second = data[at] == 0xFD
        if not second and data[at] != 0xFE:
            at, junk = at + 1, junk + 1
            continue
        length, head = np.int64(data[at + 1]), 10 if second else 6
        whole = head + length + 2 + (13 if second and data[at + 2] & 1 else 0)
        if at + whole > len(data) or (at + whole + 8 < len(data) and data[at + whole + 8] not in (0xFD, 0xFE)):
            at, junk = at + 1, junk + 1
            continue
        kind = np.int64(data[at + 5])
        system = np.int64(data[at + 3])
        if second:
            kind = np.int64(data[at + 7]) + 256 * np.int64(data[at + 8]) + 65536 * np.int64(data[at + 9])
            system = np.int64(data[at + 5])
        if kind < 256 and extra[kind] >= 0:
            end = at + head + length
            if checksum(data[at + 1 : end], extra[kind]) == np.int64(data[end]) + 256 * np.int64(data[end + 1]):
                starts[count], kinds[count], systems[count], lengths[count] = at, kind, system, length
                count += 1
        at += whole + 8
    return starts[:count], kinds[:count], systems[:count], lengths[:count], junk


@njit(cache=True)
def checksum(data: np.ndarray, extra: int) -> int:
    """Return MAVLink's checksum, CRC-16/MCRF4XX, over the bytes and the message's own."""
    crc: Any = np.int64(0xFFFF)
    for i in range(len(data) + 1):
        byte: Any = (np.int64(data[i]) if i < len(data) else np.int64(extra)) ^ (crc & 0xFF)
        byte = (byte ^ (byte << 4)) & 0xFF
        crc = (crc >> 8) ^ (byte << 8) ^ (byte << 3) ^ (byte >> 4)
    return int(crc & 0xFFFF)


def _payloads(raw: np.ndarray, starts: np.ndarray, lengths: np.ndarray, message: Any) -> dict[str, np.ndarray]:
    """Return the (n,) or (n, m) columns of frames of one message type; bytes that MAVLink 2 left off are zero."""
    codes = message.native_format.decode().lstrip("<")
    shapes = [(size,) if size else () for size in message.array_lengths]
    fields = [(n, f"<{c}", s) for n, c, s in zip(message.ordered_fieldnames, codes, shapes, strict=True)]
    row = np.dtype(fields)
    head = np.where(raw[starts] == 0xFD, 10, 6)
    place = np.arange(row.itemsize)
    index = np.minimum((starts + head)[:, None] + place, len(raw) - 1)
    payload = np.where(place < lengths[:, None], raw[index], 0).astype(np.uint8)
    rows = payload.view(row)[:, 0] if len(starts) else np.empty(0, row)
    return {name: finite(rows[name]) for name in row.names or ()}


def _log(path: str, system: str, tables: dict[int, dict[str, np.ndarray]], mavutil: Any, notes: tuple[str, ...]) -> Log:
    place = tables[GLOBAL_POSITION]
    when = _on_time(place)
    none = (place["lat"] == 0) & (place["lon"] == 0)
    attitude, course = tables[ATTITUDE], np.where(place["hdg"] == 65535, np.nan, place["hdg"] / 100.0)
    heading = sampled(when, _on_time(attitude), from_compass(np.degrees(attitude["yaw"])))
    return Log(
        vehicle=system,
        source=path,
        clock="unix",
        time=when,
        lon=np.where(none, np.nan, place["lon"] * 1e-7),
        lat=np.where(none, np.nan, place["lat"] * 1e-7),
        height=place["relative_alt"] * 1e-3,
        heading=np.where(np.isnan(heading), from_compass(course), heading),
        speed=np.hypot(place["vx"], place["vy"]) * 0.01,
        energy=_energy(when, tables[BATTERY], tables[SYS_STATUS]),
        begun=_begun(tables[HEARTBEAT], mavutil),
        notes=notes,
    )


def _on_time(table: dict[str, np.ndarray]) -> np.ndarray:
    """Return (n,) Unix seconds: the vehicle's own clock, set by the ground station's; as stamped where the two part."""
    if not len(table["stamp"]):
        return table["stamp"]
    boot = table["time_boot_ms"] / 1000.0
    offset = float(np.median(table["stamp"] - boot))
    late = np.abs(table["stamp"] - boot - offset) > DELAYED
    return np.where(late, table["stamp"], boot + offset)


def _begun(heartbeats: dict[str, np.ndarray], mavutil: Any) -> tuple[float, ...]:
    """Return when the autopilot went over to AUTO."""
    vehicle = heartbeats["type"] != GROUND_STATION
    kinds, modes, stamps = (heartbeats[n][vehicle] for n in ("type", "custom_mode", "stamp"))
    auto = np.zeros(len(stamps), bool)
    for kind, mode in {*zip(kinds.tolist(), modes.tolist(), strict=True)}:
        if (mavutil.mode_mapping_bynumber(int(kind)) or {}).get(int(mode)) == "AUTO":
            auto |= (kinds == kind) & (modes == mode)
    return tuple(stamps[auto & ~np.r_[False, auto[:-1]]].tolist())


def _energy(when: np.ndarray, battery: dict[str, np.ndarray], status: dict[str, np.ndarray]) -> np.ndarray:
    """Return (n,) Wh used, over all batteries: as counted, or else by charge and voltage; NaN where not told."""
    total, known = np.zeros(len(when)), False
    for number in np.unique(battery["id"]):
        own = {n: v[battery["id"] == number] for n, v in battery.items()}
        if (own["energy_consumed"] > 0).any():
            used = own["energy_consumed"] * 100.0 / 3600.0  # hectojoules
        elif (own["current_consumed"] > 0).any() and len(status["stamp"]):
            volts = sampled(own["stamp"], status["stamp"], status["voltage_battery"] / 1000.0)
            volts = np.where(np.isnan(volts), np.nanmedian(status["voltage_battery"]) / 1000.0, volts)
            used = np.cumsum(np.diff(own["current_consumed"], prepend=own["current_consumed"][:1]) * volts) / 1000.0
        else:
            continue
        total, known = total + sampled(when, own["stamp"], used), True
    return total if known else np.full(len(when), np.nan)
