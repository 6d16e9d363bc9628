"""ArduPilot's .bin logs: indexed by pymavlink, decoded a message type at a time."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from quarterdeck.geo.errors import InputError, UnavailableError
from quarterdeck.geo.logs import Log, finite, from_compass, sampled

FIX = 3  # GPS.Status from which on a position is one
PADDING = 600  # bytes at the end of a sound log that are no messages, at the most
_TYPES = {"e": "<f2", "f": "<f4", "d": "<f8", "b": "i1", "B": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4"}
_TYPES |= {"q": "<i8", "Q": "<u8"}


def read_dataflash(path: str, size: int) -> list[Log]:
    """Return the one log of a .bin file of `size` bytes: the filter's positions (POS), or else the receiver's (GPS).

    Times are GPS time where the receiver ever knew it, else since power-on. Raises InputError if there is no position in
    it, UnavailableError without pymavlink.
    """
    try:
        from pymavlink import DFReader
    except ImportError:
        raise UnavailableError(f"{path}: reading it needs pymavlink; pip install 'quarterdeck[logs]'") from None

    class Reader(DFReader.DFReader_binary):
        def _parse_next(self) -> Any:
            start = self.offset
            message = super()._parse_next()
            if message is not None and self.offset <= start:  # it would be read for ever
                raise ValueError(f"a message of no length at byte {start:,}")
            return message

    with _silence():
        tables, begun, base, read = _decoded(Reader, path, size)
    gps = tables["GPS"]
    gps = {n: v[gps["Status"] >= FIX] for n, v in gps.items()} if "Status" in gps else gps
    placed = [t for t in (tables["POS"], gps) if {"Lat", "Lng"} <= set(t) and len(t["TimeUS"])]
    if not placed:
        raise InputError(f"{path}: has no position in it: no POS message, and no GPS message with a fix")
    place = placed[0]
    when = place["TimeUS"]
    height = place["RelHomeAlt"] if "RelHomeAlt" in place else place.get("Alt", np.full(len(when), np.nan))
    log = Log(
        vehicle="",
        source=path,
        clock="unix" if base > 0 else "boot",
        time=base + when * 1e-6,
        lon=place["Lng"],
        lat=place["Lat"],
        height=height if "RelHomeAlt" in place else height - height[0],
        heading=_at(when, tables["ATT"], "Yaw", from_compass),
        speed=_at(when, gps, "Spd"),
        energy=_energy(when, tables["BAT"]),
        begun=begun,
        notes=(f"{path}: damaged: {size - read:,} bytes of it are no messages",) if size - read > PADDING else (),
    )
    return [log]


@contextmanager
def _silence() -> Iterator[None]:
    """Keep what pymavlink and its indexer, in C, print of damaged logs off standard output and error."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = {number: os.dup(number) for number in (1, 2)}
    with Path(os.devnull).open("w", encoding="utf-8") as nowhere:
        for number in kept:
            os.dup2(nowhere.fileno(), number)
        try:
            with redirect_stdout(nowhere), redirect_stderr(nowhere):  # a program may have others than those two
                yield
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            for number, copy in kept.items():
                os.dup2(copy, number)
                os.close(copy)


def _decoded(kind: Any, path: str, size: int) -> tuple[dict[str, dict[str, np.ndarray]], tuple[float, ...], float, int]:
    """Return the tables by message type, when AUTO began, the Unix time of power-on (0: not known), and the bytes read."""
    reader = kind.__new__(kind)  # begun in two steps: closed even where the file is so damaged that it cannot be begun
    try:
        reader.__init__(path)
        while reader.recv_match(type=["MSG"], strict=True):
            pass  # messages name the firmware, and so the modes
        begun = tuple(float(start) for mode, start, _ in reader.flightmode_list() if mode == "AUTO")
        tables = {name: _table(reader, name, size) for name in ("POS", "GPS", "ATT", "BAT")}
        base = float(getattr(reader.clock, "timebase", 0.0) or 0.0)
        read = sum(len(reader.offsets[t]) * form.len for t, form in reader.formats.items())
    except Exception as error:
        raise InputError(f"{path}: is no sound ArduPilot log ({type(error).__name__}: {error})") from None
    finally:
        if hasattr(reader, "filehandle"):
            reader.filehandle.close()
    return tables, begun, base, read


def _table(reader: Any, name: str, size: int) -> dict[str, np.ndarray]:
    """Return the (n,) columns of a message type, scaled; none where the log has no such message."""
    kind = reader.name_to_id.get(name)
    if kind is None:
        return {}
    form = reader.formats[kind]
    codes = [_TYPES.get(c, f"S{c[:-1]}") for c in _split(form.msg_struct)]
    row = np.dtype({"names": form.columns, "formats": codes})
    if row.itemsize != form.len - 3:
        return {}
    starts = np.array(reader.offsets[kind], dtype=np.int64)
    starts = starts[starts + form.len <= size] + 3
    data = np.frombuffer(reader.data_map, np.uint8)
    rows = data[starts[:, None] + np.arange(row.itemsize)].view(row)[:, 0] if len(starts) else np.empty(0, row)
    instance = next((rows[n] for n in ("I", "Inst", "Instance") if n in form.columns), None)
    if name == "GPS" and instance is not None:
        rows = rows[instance == 0]
    scale = zip(form.columns, codes, form.msg_mults, strict=True)
    columns = {n: finite(rows[n]) * (factor or 1.0) for n, code, factor in scale if not code.startswith("S")}
    del data
    return columns if "TimeUS" in columns else {}


def _split(struct: str) -> list[str]:
    """Return the codes of a struct format such as `<QB16s`."""
    codes, number = [], ""
    for c in struct.lstrip("<"):
        number += c if c.isdigit() else ""
        if not c.isdigit():
            codes.append(number + c)
            number = ""
    return codes


def _at(when: np.ndarray, table: dict[str, np.ndarray], name: str, turned: Any = None) -> np.ndarray:
    if name not in table:
        return np.full(len(when), np.nan)
    values = turned(table[name]) if turned else table[name]
    return sampled(when, table["TimeUS"], values)


def _energy(when: np.ndarray, table: dict[str, np.ndarray]) -> np.ndarray:
    """Return (n,) Wh used, over all batteries: as the log counts it, or else from charge and voltage."""
    if not {"TimeUS", "Volt", "CurrTot"} <= set(table):
        return np.full(len(when), np.nan)
    number = next((table[n] for n in ("Inst", "Instance") if n in table), np.zeros(len(table["TimeUS"])))
    total = np.zeros(len(when))
    for battery in np.unique(number):
        own = {n: v[number == battery] for n, v in table.items()}
        charge = np.diff(own["CurrTot"], prepend=own["CurrTot"][:1])
        used = own["EnrgTot"] if np.any(own.get("EnrgTot", 0)) else np.cumsum(charge * own["Volt"]) / 1000.0
        total += sampled(when, own["TimeUS"], used)
    return total
