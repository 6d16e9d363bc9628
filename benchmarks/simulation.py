"""How fast missions are simulated: python benchmarks/simulation.py --vehicles 50 --domain surface --json.

Vehicles on parallel survey legs over 20 km2 (ground: 1 km2) among 200 obstacles of 16 corners, PyBullet at 10 Hz,
everything recorded, the report included. One process, one core; times are processor seconds, compilation apart.
`--peer pvs=PATH` and `--peer gpd=PATH`, checkouts of PythonVehicleSimulator and gym-pybullet-drones, have peers.py run them
beside ours.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from shapely import MultiPolygon, Point, box

from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import DEFAULT_MODEL, load_model
from quarterdeck.geo.scenario import Area, Obstacle, Site, Vehicle
from quarterdeck.mission.mission import Mission, Route, Waypoint
from quarterdeck.physics.sensing import Sensing
from quarterdeck.physics.simulate import simulate

REACH = {"surface": 5000.0, "ground": 1000.0, "aerial": 5000.0}  # m, length of a survey leg
PEERS = {"pvs": "surface", "gpd": "aerial"}  # what peers.py runs, and what it is set beside
BREADTH = {"surface": 4000.0, "ground": 1000.0, "aerial": 4000.0}  # m, over which the vehicles share themselves out


def mission(count: int, domain: str, model: str) -> Mission:
    """Return `count` vehicles side by side, each on the legs of its own strip, islands on the borders of the strips."""
    kind, reach = load_model(model), REACH[domain]
    strip = max(BREADTH[domain] / count, 4 * kind.length)
    spacing = strip / 2
    area = box(0.0, 0.0, reach, count * strip)
    radius = min(20.0, strip / 8)
    places = np.random.default_rng(0).integers(0, [50, count + 1], (200, 2)) * [reach / 50, strip]
    obstacles = tuple(Obstacle(f"o{i}", Point(*at).buffer(radius, quad_segs=4)) for i, at in enumerate(places))
    vehicles, routes = [], []
    for i in range(count):
        low, z = i * strip + strip / 4, kind.altitude
        vehicle = Vehicle(
            f"v{i}", kind, (0.0, low), speed=kind.speed, turn_radius=kind.turn_radius, clearance=kind.clearance
        )
        vehicles.append(replace(vehicle, altitude=z))
        places = [(0.0, low, 0.0, "start"), (0.0, low, z, "takeoff")][: 2 if z else 1]
        places += [(reach, low, z, "survey"), (reach, low + spacing, z, "survey"), (0.0, low + spacing, z, "survey")]
        places += [(0.0, low, z, "transit")]
        routes.append(Route(f"v{i}", tuple(Waypoint(*p[:3], leg=p[3], speed=kind.speed) for p in places)))
    site = Site((Area("area", MultiPolygon([area])),), MultiPolygon([area.buffer(500)]), obstacles)
    return Mission("benchmark", Frame(0, 0), site, tuple(vehicles), tuple(routes), "by hand", spacing=spacing)


def measure(
    count: int, domain: str, model: str, seconds: float, step: float, gusts: float, runs: int, sensing: Sensing
) -> dict[str, Any]:
    """Return the figures of the median of `runs` runs."""
    plan = mission(count, domain, model)
    simulate(plan, duration=2.0, step=step, gusts=gusts, sensing=sensing)  # compile
    spent = []
    for _ in range(runs):
        began = time.process_time()
        run = simulate(plan, duration=seconds, step=step, gusts=gusts, sensing=sensing)
        spent.append(time.process_time() - began)
    simulated, cpu = float(run.trace.time[-1]), float(np.median(spent))
    return {
        "domain": domain,
        "vehicles": count,
        "simulated_seconds": simulated,
        "step": step,
        "lidar": sensing.lidar,
        "amcl": sensing.amcl,
        "obstacles": len(plan.site.obstacles),
        "cpu_seconds": round(cpu, 3),
        "times_real_time": round(simulated / cpu, 1),
        "vehicle_seconds_per_second": round(count * simulated / cpu),
        "peak_megabytes": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
        "collisions": run.report.figures["collisions"],
        "localisation_p95": run.report.figures["localisation_p95"],
    }


def beside(row: dict[str, Any], peers: dict[str, str]) -> dict[str, Any]:
    """Return the row with the figure of the peer of its domain, run now on as many vehicles (50 at most), and our ratio."""
    added: dict[str, Any] = {"peer": None, "peer_vehicle_seconds_per_second": None, "ratio": None}
    for peer, path in peers.items():
        if PEERS[peer] == row["domain"]:
            count = str(min(row["vehicles"], 50))
            script = str(Path(__file__).with_name("peers.py"))
            done = subprocess.run(  # apart: what it imports and opens is no business of ours
                [sys.executable, script, peer, path, "--vehicles", count], stdout=subprocess.PIPE, text=True, check=False
            )
            if done.returncode:
                raise SystemExit(f"--peer {peer}={path} could not be run")
            theirs = json.loads(done.stdout.splitlines()[-1])
            speed = theirs["vehicle_seconds_per_second"]
            ratio = round(row["vehicle_seconds_per_second"] / speed, 1)
            added = {"peer": theirs["peer"], "peer_vehicle_seconds_per_second": speed, "ratio": ratio}
    return row | added


def checkout(text: str) -> tuple[str, str]:
    """Read NAME=PATH."""
    peer, _, path = text.partition("=")
    if peer not in PEERS or not Path(path or "?").is_dir():
        raise argparse.ArgumentTypeError(f"{text!r} is not pvs=PATH or gpd=PATH with the folder of its checkout")
    return peer, path


def main() -> None:
    """Parse the command line, run, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vehicles", type=int, default=50)
    parser.add_argument("--domain", choices=sorted(DEFAULT_MODEL), default="surface")
    parser.add_argument("--model", help="a packaged vehicle model (default: the domain's)")
    parser.add_argument("--seconds", type=float, default=600.0, help="simulated seconds")
    parser.add_argument("--step", type=float, default=0.1)
    parser.add_argument("--gusts", type=float, default=0.0)
    parser.add_argument("--runs", type=int, default=3, help="the median of so many")
    parser.add_argument("--lidar", action="store_true", help="ground robots see: 180 beams at 10 Hz")
    parser.add_argument("--amcl", action="store_true", help="and localise by it: particle filters at 2 Hz")
    parser.add_argument("--peer", type=checkout, action="append", default=[], help="run it too: pvs=PATH or gpd=PATH")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--table", action="store_true", help="5, 50 and 1,000 vehicles of each domain instead")
    o = parser.parse_args()
    cases = [(o.vehicles, o.domain, o.seconds)]
    if o.table:
        cases = [(count, domain, 600.0 if count < 1000 else 60.0) for domain in REACH for count in (5, 50, 1000)]
    sensing = Sensing(lidar=o.lidar or o.amcl, amcl=o.amcl)
    rows = [
        measure(count, domain, o.model or DEFAULT_MODEL[domain], seconds, o.step, o.gusts, o.runs, sensing)
        for count, domain, seconds in cases
    ]
    if o.peer:
        rows = [beside(row, dict(o.peer)) for row in rows]
    if o.json:
        json.dump(rows if o.table else rows[0], sys.stdout, indent=2)
        print()
        return
    print("| " + " | ".join(name.replace("_", " ") for name in rows[0]) + " |")
    print("|" + "---|" * len(rows[0]))
    for row in rows:
        print(
            "| "
            + " | ".join(f"{value:,}" if isinstance(value, int | float) else str(value or "") for value in row.values())
            + " |"
        )


if __name__ == "__main__":
    main()
