"""MAVSDK's importer of .plan files: it needs a heartbeat on loopback and nothing else."""

import asyncio
import socket
import threading

import pytest

from quarterdeck.exporters import qgc_plan, qgc_wpl
from quarterdeck.exporters.export import Settings

mavsdk = pytest.importorskip("mavsdk", reason="mavsdk (below 4) is not installed")
mavutil = pytest.importorskip("pymavlink.mavutil", reason="pymavlink is not installed")

# mavsdk 3's own habits: importlib.resources.path, a subprocess and a gRPC channel left to the garbage collector.
pytestmark = [
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

PRELUDE = {"ardupilot": 1, "px4": 0}  # for ArduPilot MAVSDK puts the home before the items


def free_port() -> int:
    """Return a UDP port that nobody uses now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture(params=["ardupilot", "px4"])
def system(request):
    """A MAVSDK system that hears the heartbeat of an autopilot of the kind."""
    if not hasattr(mavsdk, "System"):
        pytest.skip("mavsdk 4 has another interface; mavsdk<4 is needed")
    port, stop = free_port(), threading.Event()
    link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", source_system=1, source_component=1)
    autopilot = {"ardupilot": 3, "px4": 12}[request.param]

    def beat() -> None:
        while not stop.wait(0.2):
            link.mav.heartbeat_send(2, autopilot, 0, 0, 4)

    thread = threading.Thread(target=beat, daemon=True)
    thread.start()
    yield request.param, port
    stop.set()
    thread.join()
    link.close()


def test_mavsdk_imports_the_same_items(system, request, tmp_path, monkeypatch):
    """Every vehicle's .plan is imported; commands, frames, places and parameters are those of its WPL file."""
    autopilot, port = system
    wanted = {}
    for name in ("boats", "quads", "ugv"):
        mission = request.getfixturevalue(name)
        plans = qgc_plan.files(mission, Settings(autopilot))
        lists = qgc_wpl.files(mission, Settings(autopilot))
        stem = next(iter(plans)).removesuffix(".plan")
        path = tmp_path / f"{stem}.plan"
        path.write_text(plans[f"{stem}.plan"])
        wanted[path] = [row.split("\t") for row in lists[f"{stem}.waypoints"].splitlines()[2:]]
    imported = asyncio.run(asyncio.wait_for(import_plans(port, list(wanted)), 120))
    for path, rows in wanted.items():
        data = imported[path]
        items = data.mission_items[PRELUDE[autopilot] :]
        assert [(i.command, i.frame) for i in items] == [(int(r[3]), int(r[2])) for r in rows]
        for item, row in zip(items, rows, strict=True):
            assert abs(item.x / 1e7 - float(row[8])) <= 1e-7
            assert abs(item.y / 1e7 - float(row[9])) <= 1e-7
            assert [item.param1, item.param2, item.param4, item.z] == pytest.approx(
                [float(row[4]), float(row[5]), float(row[7]), float(row[10])], rel=1e-5
            )
        assert len(data.geofence_items) >= 4
        assert len(data.rally_items) == 1


async def import_plans(port, paths):
    """Connect, then import every file."""
    from mavsdk import System

    drone = System(port=free_port())
    await drone.connect(f"udpin://127.0.0.1:{port}")
    async for state in drone.core.connection_state():
        if state.is_connected:
            break
    return {path: await drone.mission_raw.import_qgroundcontrol_mission(str(path)) for path in paths}
