"""Logs are read as pymavlink reads them; damaged ones as far as they go, and it is told."""

import sys

import numpy as np
import pytest

from quarterdeck.geo.errors import InputError, UnavailableError
from quarterdeck.geo.logs import read_logs, read_time

BEGAN = 1_780_000_000.0


def made(count=400):
    """Return the rows of a log at 10 Hz: a vehicle that goes north-east from its start."""
    n = np.arange(count)
    rows = {"time": BEGAN + 0.1 * n, "lon": 121.6 + 1e-6 * n, "lat": 38.9 + 1e-6 * n, "height": 0.01 * n}
    return rows | {"heading": np.full(count, 38.0), "speed": np.full(count, 1.4), "energy": 2.0 + 0.001 * n}


@pytest.mark.parametrize("ending", [".bin", ".tlog", ".gpx", ".csv"])
def test_reading_back(write_log, tmp_path, ending):
    """What was written is read, as finely as the format has it."""
    rows = made()
    [log] = read_logs(str(write_log(tmp_path / f"a{ending}", rows, BEGAN + 5.0)))
    assert log.clock == "unix"
    assert not log.notes
    assert np.allclose(log.time, rows["time"], atol=0.01)
    assert np.allclose(log.lon, rows["lon"], atol=1e-7)
    assert np.allclose(log.lat, rows["lat"], atol=1e-7)
    assert np.allclose(log.height, rows["height"], atol=0.01)
    assert log.begun == (pytest.approx((BEGAN + 5.0,), abs=1.1) if ending in {".bin", ".tlog"} else ())
    if ending != ".gpx":
        assert np.allclose(log.heading[5:-5], np.pi / 2 - np.radians(38.0), atol=1e-3)
        assert np.nanmax(np.abs(log.energy - rows["energy"])) < 0.05
        assert np.allclose(log.speed[5:-5], 1.4, atol=0.01)


def test_dataflash_is_read_as_pymavlink_reads_it(write_log, tmp_path):
    """Every position and every time, message by message."""
    reader = pytest.importorskip("pymavlink.DFReader", reason="the extra `logs` is not installed")
    path = str(write_log(tmp_path / "a.bin", made(), BEGAN + 5.0))
    [log] = read_logs(path)
    with reader.DFReader_binary(path) as theirs:
        messages = [theirs.recv_match(type="POS") for _ in range(len(log.time))]
    assert np.allclose(log.time, [m._timestamp for m in messages], atol=1e-5)
    assert np.allclose(log.lon, [m.Lng for m in messages], atol=1e-9)
    assert np.allclose(log.height, [m.RelHomeAlt for m in messages], atol=1e-4)


def test_telemetry_is_read_as_pymavlink_reads_it(write_log, tmp_path):
    """Every position of a recording, though bytes are damaged here and there: the same frames are sound."""
    mavutil = pytest.importorskip("pymavlink.mavutil", reason="the extra `logs` is not installed")
    path = write_log(tmp_path / "a.tlog", made(), BEGAN + 5.0)
    data = bytearray(path.read_bytes())
    for place in (5003, 12345, 20007):
        data[place] ^= 0x5A
    path.write_bytes(data)
    [log] = read_logs(str(path))
    theirs = mavutil.mavlogfile(str(path))
    found = {}
    while (message := theirs.recv_match()) is not None:
        if message.get_type() == "GLOBAL_POSITION_INT":
            found[message.time_boot_ms] = message.lat * 1e-7
    theirs.f.close()
    mine = dict(zip(np.round((log.time - log.time[0]) * 1e3).tolist(), log.lat.tolist(), strict=True))
    first = min(found)
    shared = [t for t in found if t - first in mine]
    assert len(mine) >= 397
    assert len(shared) >= len(found) - 1
    assert np.allclose([found[t] for t in shared], [mine[t - first] for t in shared], atol=1e-9)


@pytest.mark.parametrize("ending", [".bin", ".tlog", ".gpx", ".csv"])
def test_half_a_log(write_log, tmp_path, ending):
    """A log that was cut off is read as far as it goes."""
    path = write_log(tmp_path / f"a{ending}", made(), BEGAN)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    [log] = read_logs(str(path))
    assert 150 <= len(log.time) <= 210
    assert len(log.notes) <= 2
    assert bool(log.notes) == (ending in {".gpx", ".csv"})  # the others may end at a message


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is no log that is known"),
        (b"\0\1\2" * 400, "is no log that is known"),
        (b"<kml></kml>", "is XML, but no GPX"),
        (b"<gpx><rte/></gpx>", "has no track with times"),
        (b"PK\3\4nothing", "is no trace"),
        (b"\xa3\x95nothing at all of a log here", "log.bin"),
        (b"time,lon\n1,2\n", "lacks the column 'lat'"),
        (b"time,lon,lat\nsoon,1,2\n", "has no row with a time"),
    ],
)
def test_what_is_no_log(tmp_path, content, words):
    """One line that names the file and what it is instead."""
    path = tmp_path / "log.bin"
    path.write_bytes(content)
    with pytest.raises(InputError, match=words) as told:
        read_logs(str(path))
    assert "\n" not in str(told.value)
    assert str(path) in str(told.value)


def test_a_message_of_no_length(write_log, tmp_path):
    """A format that says so would be read for ever: it is refused."""
    path = write_log(tmp_path / "a.bin", made(), BEGAN)
    data = bytearray(path.read_bytes())
    of_nothing = b"\xa3\x95\x80" + bytes([77, 0]).ljust(86, b"\0")
    path.write_bytes(data[:89] + of_nothing + b"\xa3\x95" + bytes([77]) + data[89:])
    with pytest.raises(InputError, match="a message of no length"):
        read_logs(str(path))


@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan])
def test_figures_that_are_none(write_log, tmp_path, value):
    """A voltage or a speed that is no number is not told; the track is."""
    rows = made()
    for name in ("speed", "energy"):
        rows[name][50] = value
    [log] = read_logs(str(write_log(tmp_path / "a.bin", rows, BEGAN)))
    assert len(log.time) == len(rows["time"])
    assert not np.isinf(log.speed).any()
    assert not np.isinf(log.energy).any()


def test_a_trace_off_the_earth(tmp_path):
    """Places and energies that can be none are not known; what is known stays."""
    columns = {n: np.zeros((3, 1)) for n in ("x", "y", "z", "heading", "speed", "energy")}
    columns["x"][1], columns["energy"][2] = 1e300, np.inf
    path = tmp_path / "trace.npz"
    np.savez(path, **columns, origin=np.array([10.0, 54.0]), time=np.arange(3.0), vehicles=np.array(["v1"]))
    (log,) = read_logs(str(path))
    assert np.isnan(log.lon).tolist() == [False, True, False]
    assert np.isnan(log.energy).tolist() == [False, False, True]


@pytest.mark.parametrize("damage", ["kind", "shape", "origin", "text", "flood"])
def test_damaged_traces(tmp_path, damage):
    """Numbers of other kinds, other shapes, a place off the Earth, a header that is none: one line."""
    columns = dict.fromkeys(("x", "y", "z", "heading", "speed", "energy"), np.zeros((5, 1)))
    arrays = columns | {"origin": np.array([10.0, 54.0]), "time": np.arange(5.0), "vehicles": np.array(["v1"])}
    changed = {
        "kind": {"x": np.zeros((5, 1), complex)},
        "shape": {"y": np.zeros((5, 2))},
        "origin": {"origin": np.array([10.0, 1e300])},
        "text": {},
        "flood": {"more": np.zeros(30_000_000)},
    }[damage]
    path = tmp_path / "trace.npz"
    (np.savez_compressed if damage == "flood" else np.savez)(path, **arrays | changed)
    if damage == "text":
        path.write_bytes(path.read_bytes().replace(b"'fortran_order'", b"\0fortran_order\0"))
    with pytest.raises(InputError, match="trace") as told:
        read_logs(str(path))
    assert "\n" not in str(told.value)


def test_several_vehicles_in_one_table(tmp_path):
    """A column `vehicle` parts them; seconds from the mission's start are taken as such; a bad row is told."""
    path = tmp_path / "fleet.csv"
    path.write_text("vehicle,time,lon,lat\na,0,1,2\nb,0,3,4\na,1,1,2.1\nb,one,3,4\nb,1,3,4.1\n")
    first, second = read_logs(str(path))
    assert (first.vehicle, second.vehicle) == ("a", "b")
    assert first.clock == "mission"
    assert second.lat.tolist() == [4, 4.1]
    assert "1 rows" in first.notes[0]


def test_without_pymavlink(monkeypatch, write_log, tmp_path):
    """It is said how to get it."""
    paths = [write_log(tmp_path / f"a{ending}", made(20), BEGAN) for ending in (".bin", ".tlog")]
    monkeypatch.setitem(sys.modules, "pymavlink", None)
    for path in paths:
        with pytest.raises(UnavailableError, match=r"pip install 'quarterdeck\[logs\]'"):
            read_logs(str(path))


def test_times():
    """UTC where no zone is named."""
    assert read_time("2026-06-01T12:00:00Z") == read_time("2026-06-01T12:00:00") == read_time("2026-06-01T14:00:00+02:00")
    with pytest.raises(InputError, match="2026-06-01"):
        read_time("noon")
