"""Logs of real vehicles, whatever wrote them: where each was and when, and what it used."""

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import Literal

import numpy as np
from lxml import etree

from quarterdeck.geo.arrays import load_arrays
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.kinds import kind_of

UNIX = 1e8  # s: a larger number of seconds in a CSV file counts from 1970, a smaller one from the mission's start


@dataclass(frozen=True, slots=True)
class Log:
    """What one file tells of one vehicle, as it stands there. Arrays are (n,), NaN where the file does not say.

    `vehicle` is the name that the file gives it, "" for none; `source` names the file. `time` is seconds, by `clock`: since
    the mission's start, since 1970 or since the vehicle was switched on. `lon`, `lat` degrees (NaN: no fix), `height`
    metres above where it was launched, `heading` radians counter-clockwise from east, `speed` m/s over ground, `energy`
    Wh used. `begun` are the times at which the autopilot took up a mission, `notes` what was wrong with the file.
    """

    vehicle: str
    source: str
    clock: Literal["mission", "unix", "boot"]
    time: np.ndarray
    lon: np.ndarray
    lat: np.ndarray
    height: np.ndarray
    heading: np.ndarray
    speed: np.ndarray
    energy: np.ndarray
    begun: tuple[float, ...] = ()
    notes: tuple[str, ...] = field(default=())


def read_logs(path: str) -> list[Log]:
    """Return a log for each vehicle in a file: ArduPilot .bin and .tlog, GPX tracks, CSV, or a trace of `simulate`.

    What it is told by its content. Of a damaged file what can be read is, and a note says so. Raises InputError if it
    cannot be read at all, or has no vehicle's track in it; UnavailableError where reading it needs pymavlink and there is
    none.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); give the path of a log") from None
    text = data[:4096].lstrip(b"\xef\xbb\xbf \t\r\n")
    if data[:2] == b"\xa3\x95":
        from quarterdeck.geo.dataflash import read_dataflash

        return read_dataflash(path, len(data))
    if data[:2] == b"PK":
        return _trace(path, data)
    if text.startswith(b"<"):
        return _gpx(path, data)
    if Path(path).suffix.lower() == ".tlog" or (len(data) > 8 and data[8:9] in {b"\xfd", b"\xfe"}):
        from quarterdeck.geo.telemetry import read_telemetry

        return read_telemetry(path, data)
    if (kind := kind_of(data)) is not None:
        raise InputError(f"{path}: is {kind}; a log is a .bin, .tlog, .gpx, .csv, or what `simulate --trace` wrote")
    if not data or b"\0" in data[:4096]:
        raise InputError(
            f"{path}: is no log that is known; give a .bin, .tlog, .gpx, .csv, or what `simulate --trace` wrote"
        )
    return _csv(path, data)


def sampled(when: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return (n,) values, given at (m,) times, at the times `when`: interpolated, NaN beyond them."""
    order = np.argsort(time, kind="stable")
    if not len(order):
        return np.full(len(when), np.nan)
    return np.interp(when, time[order], values[order], left=np.nan, right=np.nan)


def finite(values: np.ndarray) -> np.ndarray:
    """Return (n,) floats, NaN in place of what is no finite number: a log that is damaged may hold any."""
    with np.errstate(invalid="ignore"):  # a signalling NaN
        floats = values.astype(float)
    return np.where(np.isfinite(floats), floats, np.nan)


def from_compass(degrees: np.ndarray) -> np.ndarray:
    """Return radians counter-clockwise from east of compass degrees, without leaps at north; NaN stays NaN."""
    radians = np.pi / 2 - np.radians(degrees)
    known = ~np.isnan(radians)
    radians[known] = np.unwrap(radians[known])
    return radians


def _trace(path: str, data: bytes) -> list[Log]:
    columns = ("x", "y", "z", "heading", "speed", "energy")
    try:
        found = load_arrays(data, ("origin", "time", *columns), ("vehicles",))
        names = [str(n) for n in found["vehicles"]]
        longitude, latitude = map(float, found["origin"])
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: is no trace of `simulate --trace` ({' '.join(str(error).split())})") from None
    frame, time = Frame(longitude, latitude), found["time"]
    if not (abs(longitude) <= 180 and abs(latitude) <= 90):
        raise InputError(f"{path}: is a damaged trace: its origin is nowhere on Earth")
    if time.ndim != 1 or any(found[c].shape != (len(time), len(names)) for c in columns):
        raise InputError(f"{path}: is a damaged trace: its columns are of different lengths")
    logs = []
    for i, name in enumerate(names):
        own = {n: finite(found[n][:, i]) for n in columns}
        lon, lat = frame.to_degrees(np.column_stack([own["x"], own["y"]])).T
        known = (own["z"], own["heading"], own["speed"], own["energy"])
        logs.append(Log(name, path, "mission", time, lon, lat, *known))
    return logs


def _gpx(path: str, data: bytes) -> list[Log]:
    parser = etree.XMLParser(resolve_entities=False, no_network=True, recover=True)
    root = etree.fromstring(data, parser)
    if root is None or etree.QName(root).localname != "gpx":
        raise InputError(f"{path}: is XML, but no GPX; give a .bin, .tlog, .gpx or .csv")
    damaged = [f"{path}: damaged at line {parser.error_log[0].line}; read as far as it goes"] if parser.error_log else []
    logs = []
    for track in root.iter("{*}trk"):
        points = list(track.iter("{*}trkpt"))
        rows = [(p.get("lon"), p.get("lat"), p.findtext("{*}ele"), p.findtext("{*}time")) for p in points]
        timed = [r for r in rows if not np.isnan(_time(r[3] or ""))]
        notes = [*damaged]
        if len(timed) < len(rows):
            notes.append(f"{path}: {len(rows) - len(timed)} of {len(rows)} points without a time are left out")
        if not timed:
            continue
        lon, lat, height, when = zip(*timed, strict=True)
        lost = np.full(len(timed), np.nan)
        above_sea = _numbers(height)
        places = (_numbers(lon), _numbers(lat), above_sea - next(iter(above_sea[~np.isnan(above_sea)]), np.nan))
        name = (track.findtext("{*}name") or "").strip()
        logs.append(Log(name, path, "unix", _times(when), *places, lost, lost, lost, notes=tuple(notes)))
    if not logs:
        raise InputError(f"{path}: has no track with times in it (routes and waypoints say what is to be, not what was)")
    return logs


COLUMNS = {
    "vehicle": ("vehicle",),
    "time": ("time", "time_s"),
    "lon": ("lon", "longitude"),
    "lat": ("lat", "latitude"),
    "height": ("height", "height_m"),
    "heading": ("heading", "heading_deg", "course_deg"),
    "speed": ("speed", "speed_m_s"),
    "energy": ("energy", "energy_wh"),
}


CHUNK = 50_000  # rows of a CSV file turned into numbers at a time


def _csv(path: str, data: bytes) -> list[Log]:
    try:
        rows = csv.reader(io.StringIO(data.decode("utf-8-sig", "replace"), newline=""))
        head = [name.strip().lower() for name in next(rows, [])]
        place = {n: next((head.index(a) for a in also if a in head), None) for n, also in COLUMNS.items()}
        lacking = [n for n in ("time", "lon", "lat") if place[n] is None]
        if lacking:
            raise InputError(f"{path}: line 1 lacks the column {lacking[0]!r}; see docs/logs.md for a log's columns")
        parts = []
        while chunk := list(islice(rows, CHUNK)):
            parts.append(_columns(chunk, place, len(head)))
    except csv.Error as error:
        raise InputError(f"{path}: is no CSV ({error}); give a .bin, .tlog, .gpx or .csv") from None
    figures = {n: np.concatenate([p[n] for p in parts]) for n in COLUMNS} if parts else {"time": np.empty(0)}
    told = ~np.isnan(figures["time"])
    if not told.any():
        raise InputError(f"{path}: has no row with a time; `time` is seconds or 2026-06-01T12:00:00Z")
    count = int(np.count_nonzero(~told))
    notes = (f"{path}: {count} rows that are cut short or have no time are left out",) if count else ()
    figures["heading"] = from_compass(figures["heading"])
    clock: Literal["unix", "mission"] = "unix" if np.nanmax(figures["time"]) > UNIX else "mission"
    logs = []
    for name in dict.fromkeys(figures["vehicle"][told].tolist()):
        own = told & (figures["vehicle"] == name)
        known = {n: figures[n][own] for n in COLUMNS if n != "vehicle"}
        logs.append(Log(vehicle=name, source=path, clock=clock, notes=notes, **known))
    return logs


def _columns(rows: list[list[str]], place: Mapping[str, int | None], width: int) -> dict[str, np.ndarray]:
    """Return the columns of some rows; NaN, and no time, for all of a row that is cut short."""
    rows = [row if len(row) >= width else [""] * width for row in rows if row]
    found = {n: [row[i] for row in rows] if i is not None else [""] * len(rows) for n, i in place.items()}
    columns = {n: _times(texts) if n == "time" else _numbers(texts) for n, texts in found.items() if n != "vehicle"}
    return columns | {"vehicle": np.array([name.strip() for name in found["vehicle"]], dtype=object)}


def _numbers(texts: Sequence[str | None]) -> np.ndarray:
    """Return (n,) floats, NaN for what is none."""
    try:
        return np.array(texts, dtype=float)
    except (TypeError, ValueError):
        return np.array([_number(t) for t in texts], dtype=float)


def _number(text: str | None) -> float:
    try:
        return float(text or "nan")
    except ValueError:
        return np.nan


def _times(texts: Iterable[str | None]) -> np.ndarray:
    """Return (n,) seconds of numbers or of ISO 8601 times (without a zone they are UTC), NaN for what is neither."""
    return np.array([_time(t or "") for t in texts], dtype=float)


def _time(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        try:
            return read_time(text)
        except InputError:
            return np.nan


def read_time(text: str) -> float:
    """Return Unix seconds of an ISO 8601 time, UTC where it names no zone. Raises InputError for anything else."""
    try:
        when = datetime.fromisoformat(text.strip())
        return (when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp()
    except (ValueError, OverflowError):
        raise InputError(f"{text!r} is no time such as 2026-06-01T12:00:00Z") from None
