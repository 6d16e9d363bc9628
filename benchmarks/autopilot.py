"""Fly exported files in ArduPilot's own simulator, from upload to the end of the mission.

    python benchmarks/autopilot.py --ardupilot CHECKOUT PLAN... [--vehicle usv-1] [--speedup 50] [--logs FOLDER]

CHECKOUT is an ArduPilot folder in which Rover and Copter stand built for its simulator (`build/sitl/bin`). Each vehicle of
each plan is exported (qgc-wpl), its mission, fence and rally point are uploaded over MAVLink as a ground station does it,
it is armed and set to AUTO with the fence switched on. Printed: items that the autopilot holds, whether the mission came to
its end, breaches of the fence, distance from the plan's track, time beside the plan's, pictures taken. The autopilot's
log is kept in `--logs`, for `quarterdeck report`.
"""

import argparse
import json
import math
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import shapely
from pymavlink import mavutil, mavwp

from quarterdeck.exporters.export import export
from quarterdeck.exporters.mavlink import acceptance_radius
from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.planfile import read_plan

MISSION, FENCE, RALLY = 0, 1, 2
SETTLE = 60.0  # s after the end in which a boat comes to its last place
# domain: program, simulated frame, its parameters in Tools/autotest/default_params
FRAMES = {
    "ground": ("ardurover", "rover-skid", ["rover.parm", "rover-skid.parm"]),
    "surface": ("ardurover", "motorboat", ["rover.parm", "motorboat.parm"]),
    "aerial": ("arducopter", "quad", ["copter.parm"]),
}


def main() -> None:
    """Parse the command line, fly, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("plans", nargs="+", type=Path)
    parser.add_argument("--ardupilot", type=Path, required=True, help="an ArduPilot folder, built for its simulator")
    parser.add_argument("--vehicle", action="append", help="fly these alone; repeatable")
    parser.add_argument("--speedup", type=float, default=50.0, help="times real time, as far as the machine goes")
    parser.add_argument("--logs", type=Path, default=Path("out/autopilot"), help="where the autopilot's logs are kept")
    parser.add_argument("--instance", type=int, default=0, help="of the simulator: ports of its own, to fly side by side")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows = []
    for path in options.plans:
        mission = read_plan(str(path))
        for vehicle in mission.vehicles:
            if not options.vehicle or vehicle.id in options.vehicle:
                rows.append(fly(mission, vehicle, options))
                print(json.dumps(rows[-1]) if options.json else _line(rows[-1]), flush=True)
    sys.exit(0 if all(row["ended"] and not row["breaches"] for row in rows) else 1)


def fly(mission: Mission, vehicle: Vehicle, options: argparse.Namespace) -> dict[str, object]:
    """Fly one vehicle's files in a simulator of its own; return the figures."""
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        files = export(mission, "qgc-wpl", here)
        stem = next(p for p in files if p.name.endswith(".waypoints") and p.name.startswith(vehicle.id)).name[:-10]
        plans = {
            kind: _items(here / f"{stem}{end}") for kind, end in ((0, ".waypoints"), (1, ".fence.txt"), (2, ".rally.txt"))
        }
        program = _start(mission, vehicle, plans[MISSION][0], here, options)
        try:
            link = mavutil.mavlink_connection(f"tcp:127.0.0.1:{5760 + 10 * options.instance}", retries=50)
            figures = _fly(link, vehicle, plans, program)
        finally:
            program.terminate()
            program.wait()
        logs = sorted((here / "logs").glob("*.BIN"))
        if logs:
            kept = options.logs / f"{vehicle.id}.bin"
            kept.parent.mkdir(parents=True, exist_ok=True)
            shutil.move(logs[-1], kept)
    return {"plan": mission.name, "vehicle": vehicle.id, **_judged(mission, vehicle, figures)}


def _start(mission: Mission, vehicle: Vehicle, home, folder: Path, options: argparse.Namespace) -> subprocess.Popen[bytes]:
    name, frame, parameters = FRAMES[vehicle.domain]
    route = next(r for r in mission.routes if r.vehicle == vehicle.id)
    steps = np.diff(route.xyz[:, :2], axis=0)
    east, north = next((s for s in steps if np.hypot(*s) > 0.1), (0.0, 1.0))
    heading = np.degrees(np.arctan2(east, north)) % 360
    defaults = [str(options.ardupilot / "Tools/autotest/default_params" / p) for p in parameters]
    own = folder / "own.parm"
    own.write_text("".join(f"{k} {v:g}\n" for k, v in _parameters(vehicle).items()))
    command = [
        str(options.ardupilot / "build/sitl/bin" / name),
        *("--model", frame, "--speedup", f"{options.speedup:g}", "--wipe", "-I", str(options.instance)),
        *("--home", f"{home.x:.8f},{home.y:.8f},{home.z:g},{heading:.1f}"),
        *("--defaults", ",".join([*defaults, str(own)])),
    ]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _parameters(vehicle: Vehicle) -> dict[str, float]:
    """What docs/exports.md tells an operator to set, and the fence switched on to stop what breaches it."""
    radius = acceptance_radius(vehicle)
    common = {
        "FENCE_ENABLE": 1,
        "FENCE_ACTION": 1,
        "FENCE_TYPE": 4,
        "FENCE_MARGIN": 0.0,
        "LOG_DISARMED": 0,
        "LOG_FILE_DSRMROT": 1,
    }
    if vehicle.domain == "aerial":
        return common | {"WPNAV_RADIUS": radius * 100, "CAM1_TYPE": 1, "SERVO9_FUNCTION": 10, "FENCE_MARGIN": 1.0}
    return common | {"WP_RADIUS": radius, "WP_SPEED": vehicle.speed, "FS_ACTION": 0}


def _items(path: Path) -> list:
    loader = mavwp.MAVWPLoader()
    loader.load(str(path))
    return [loader.wp(i) for i in range(loader.count())]


def _fly(link, vehicle: Vehicle, plans: dict[int, list], program: subprocess.Popen[bytes]) -> dict[str, object]:
    """Upload, arm, start, follow; return what was seen."""
    until = time.monotonic() + 60
    while link.wait_heartbeat(timeout=5).system_status < mavutil.mavlink.MAV_STATE_STANDBY and time.monotonic() < until:
        pass  # while it boots it has no room for a mission
    for message, hertz in (("GLOBAL_POSITION_INT", 5), ("MISSION_CURRENT", 2), ("SYSTEM_TIME", 1)):
        identity = getattr(mavutil.mavlink, f"MAVLINK_MSG_ID_{message}")
        _command(link, mavutil.mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, identity, 1e6 / hertz)
    for kind, items in plans.items():
        _upload(link, items, kind)
    held = _count(link)
    _arm(link)
    link.set_mode("AUTO")
    _command(link, mavutil.mavlink.MAV_CMD_MISSION_START)
    return {"items": len(plans[MISSION]), "held": held} | _follow(link, len(plans[MISSION]) - 1, vehicle, program)


def _upload(link, items: list, kind: int) -> None:
    """The mission protocol as a ground station speaks it: count, a request for each item, the acknowledgement."""
    link.mav.mission_count_send(link.target_system, link.target_component, len(items), kind)
    until = time.monotonic() + 120
    while time.monotonic() < until:
        message = link.recv_match(type=["MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK"], blocking=True, timeout=5)
        if message is None or message.mission_type != kind:
            continue
        if message.get_type() == "MISSION_ACK":
            if message.type != mavutil.mavlink.MAV_MISSION_ACCEPTED:
                sys.exit(f"refused: mission type {kind}, result {message.type}")
            return
        item = items[message.seq]
        place = round(item.x * 1e7), round(item.y * 1e7), item.z
        free = item.param1, item.param2, item.param3, item.param4
        head = (
            link.target_system,
            link.target_component,
            message.seq,
            item.frame,
            item.command,
            item.current,
            item.autocontinue,
        )
        link.mav.mission_item_int_send(*head, *free, *place, kind)
    sys.exit(f"upload of mission type {kind} was not acknowledged")


def _count(link) -> int:
    link.mav.mission_request_list_send(link.target_system, link.target_component, MISSION)
    message = link.recv_match(type="MISSION_COUNT", blocking=True, timeout=10)
    link.mav.mission_ack_send(link.target_system, link.target_component, 0, MISSION)
    return message.count if message else -1


def _arm(link) -> None:
    """Arm in GUIDED with every check on: they pass when the position is known."""
    until = time.monotonic() + 180
    while time.monotonic() < until:
        link.set_mode("GUIDED")
        _command(link, mavutil.mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        if link.motors_armed():
            return
    sys.exit("the autopilot does not arm")


def _command(link, command: int, *free: float) -> None:
    link.mav.command_long_send(link.target_system, link.target_component, command, 0, *free, *([0.0] * (7 - len(free))))
    until = time.monotonic() + 2
    while time.monotonic() < until:
        message = link.recv_match(type=["COMMAND_ACK", "HEARTBEAT"], blocking=True, timeout=2)
        if message is not None and message.get_type() == "COMMAND_ACK" and message.command == command:
            link.recv_match(type="HEARTBEAT", blocking=True, timeout=1)
            return


def _follow(link, last: int, vehicle: Vehicle, program: subprocess.Popen[bytes]) -> dict[str, object]:
    """Follow until the mission is over: the last item reached, or disarmed after landing."""
    track: list[tuple[float, float, float, float]] = []
    said: list[str] = []
    pictures, ended, reached, settled = 0, False, -1, math.inf
    heard = time.monotonic()
    while time.monotonic() - heard < 60 and program.poll() is None:
        message = link.recv_match(blocking=True, timeout=5)
        if message is None:
            continue
        kind = message.get_type()
        if kind == "GLOBAL_POSITION_INT":
            heard = time.monotonic()
            track.append((message.time_boot_ms / 1e3, message.lon / 1e7, message.lat / 1e7, message.relative_alt / 1e3))
        elif kind == "MISSION_ITEM_REACHED":
            reached = max(reached, message.seq)
        elif kind == "CAMERA_FEEDBACK":
            pictures += 1
        elif kind == "STATUSTEXT":
            said.append(message.text)
            print(f"{vehicle.id}: {message.text}", file=sys.stderr)
            if "Mission Complete" in message.text:
                ended, settled = True, track[-1][0] + SETTLE
        disarmed = kind == "HEARTBEAT" and message.get_srcComponent() == 1 and not link.motors_armed()
        if (ended and track[-1][0] > settled) or (disarmed and len(track) > 50):
            ended = ended or reached >= last - 1
            break
    breaches = sum("breach" in line.lower() for line in said)
    return {"track": track, "ended": ended, "reached": reached, "pictures": pictures, "breaches": breaches, "said": said}


def _judged(mission: Mission, vehicle: Vehicle, seen: dict) -> dict[str, object]:
    track = np.array(seen.pop("track"))
    route = next(r for r in mission.routes if r.vehicle == vehicle.id)
    line = shapely.LineString(route.xyz[:, :2])
    away = np.array([])
    if len(track):
        points = shapely.points(mission.frame.to_metres(track[:, 1:3]))
        away = shapely.distance(line, points)
    blocked = shapely.union_all([o.polygon for o in mission.site.obstacles if vehicle.domain in o.blocks])
    seen["said"] = [
        line for line in seen["said"] if not line.startswith(("EKF", "AHRS", "GPS", "Ardu", "Frame", "RC", "PreArm"))
    ][-3:]
    return seen | {
        "off_track_p95": round(float(np.percentile(away, 95)), 2) if len(away) else None,
        "off_track_most": round(float(away.max()), 2) if len(away) else None,
        "in_obstacles": int(shapely.intersects(blocked, points).sum()) if len(away) else None,
        "seconds": round(float(np.ptp(track[:, 0]))) if len(track) else 0,
        "seconds_planned": round(route.waypoints[-1].time),
    }


def _line(row: dict) -> str:
    return ", ".join(f"{key} {value}" for key, value in row.items() if key != "said") + (
        f"; {row['said']}" if row["said"] else ""
    )


if __name__ == "__main__":
    main()
