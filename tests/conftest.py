"""Options of the test run, and logs of our own making."""

import csv
import signal
from datetime import UTC, datetime

import gpxpy.gpx
import pytest
from fuzzing.autopilot_logs import dataflash, telemetry
from hypothesis import settings

# The same cases in each run; `--hypothesis-profile=default` draws new ones.
settings.register_profile("same", derandomize=True)
settings.load_profile("same")


def pytest_addoption(parser):
    """Add --soak N: the number of damaged inputs; --soak-from M: the first one's seed."""
    parser.addoption("--soak", type=int, default=1000, help="damaged inputs")
    parser.addoption("--soak-from", type=int, default=0, help="seed of the first damaged input")


@pytest.fixture
def soak_cases(request):
    """Return the number of damaged inputs."""
    return request.config.getoption("--soak")


@pytest.fixture
def soak_from(request):
    """Return the seed of the first damaged input."""
    return request.config.getoption("--soak-from")


@pytest.fixture
def hears_ctrl_c():
    """Have Ctrl-C heard here and by what is started: what a shell runs in the background ignores it, as do its children."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def write_log():
    """Return a writer of logs: `write(path, rows, began)`, by the path's ending.

    `rows` has the arrays `time` (Unix seconds), `lon`, `lat`, `height`, `heading` (compass degrees), `speed`, `energy`;
    `began` is when the autopilot went to AUTO, if it is to say so.
    """

    def write(path, rows, began=None):
        {".bin": _dataflash, ".tlog": _telemetry, ".gpx": _gpx, ".csv": _csv}[path.suffix](path, rows, began)
        return path

    return write


def _dataflash(path, rows, began):
    """ArduRover's own log."""
    pytest.importorskip("pymavlink", reason="the extra `logs` is not installed")
    path.write_bytes(dataflash(rows, began))


def _telemetry(path, rows, began):
    """A ground station's recording."""
    pytest.importorskip("pymavlink", reason="the extra `logs` is not installed")
    path.write_bytes(telemetry(rows, began))


def _gpx(path, rows, began):
    """A track as receivers write it: no more than places and times."""
    gpx = gpxpy.gpx.GPX()
    points = [
        gpxpy.gpx.GPXTrackPoint(lat, lon, elevation=3.0 + up, time=datetime.fromtimestamp(t, UTC))
        for t, lon, lat, up in zip(*(rows[n].tolist() for n in ("time", "lon", "lat", "height")), strict=True)
    ]
    gpx.tracks.append(gpxpy.gpx.GPXTrack())
    gpx.tracks[0].segments.append(gpxpy.gpx.GPXTrackSegment(points))
    path.write_text(gpx.to_xml(version="1.1"), encoding="utf-8")


def _csv(path, rows, began):
    """All the columns, times in ISO 8601."""
    names = ("lon", "lat", "height", "heading", "speed", "energy")
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["time", *names])
        for i, t in enumerate(rows["time"].tolist()):
            writer.writerow([datetime.fromtimestamp(t, UTC).isoformat(), *(f"{rows[n][i]:.9f}" for n in names)])
