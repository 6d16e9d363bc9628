"""How fast other simulators are, from a checkout that the user has: python benchmarks/peers.py pvs PATH [--vehicles N].

`pvs` is PythonVehicleSimulator's own loop with its Otter under heading autopilot in a current, one vessel at 50 Hz, as it
comes; `gpd` is gym-pybullet-drones' CtrlAviary with its PID controllers, PyBullet at 240 Hz, control at 48 Hz, nothing
drawn, as in its pid.py. Prints JSON; times are processor seconds, imports and construction apart.
"""

import argparse
import contextlib
import importlib
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ENOUGH = 2.0  # processor seconds measured, at least


def pvs(vehicles: int) -> dict[str, Any]:  # noqa: ARG001 - called as all peers are
    """Return the figures of PythonVehicleSimulator; it knows one vehicle at a time, so `vehicles` changes nothing."""
    loop = importlib.import_module("python_vehicle_simulator.lib.mainLoop")
    otter = importlib.import_module("python_vehicle_simulator.vehicles.otter").otter
    step, seconds = 0.02, 20.0  # its record grows by copying: a long run would be slower
    runs, began = 0, time.process_time()
    while time.process_time() - began < ENOUGH:
        loop.simulate(round(seconds / step), step, otter("headingAutopilot", 100.0, 0.3, -30.0, 200.0))
        runs += 1
    return figures("PythonVehicleSimulator", 1, runs * seconds, time.process_time() - began)


def gpd(vehicles: int) -> dict[str, Any]:
    """Return the figures of gym-pybullet-drones, `vehicles` drones a metre apart that hold their places."""
    aviary = importlib.import_module("gym_pybullet_drones.envs.CtrlAviary").CtrlAviary
    control = importlib.import_module("gym_pybullet_drones.control.DSLPIDControl").DSLPIDControl
    enums = importlib.import_module("gym_pybullet_drones.utils.enums")
    side = int(np.ceil(np.sqrt(vehicles)))
    places = np.array([[i % side, i // side, 1.0] for i in range(vehicles)])
    model, physics = enums.DroneModel.CF2X, enums.Physics.PYB
    env = aviary(model, vehicles, 10, places, physics=physics, pyb_freq=240, ctrl_freq=48)
    controllers = [control(drone_model=model) for _ in places]
    action, steps, began = np.zeros((vehicles, 4)), 0, time.process_time()
    while time.process_time() - began < ENOUGH:
        seen = env.step(action)[0]
        for i, controller in enumerate(controllers):
            action[i] = controller.computeControlFromState(env.CTRL_TIMESTEP, seen[i], places[i])[0]
        steps += 1
    spent = time.process_time() - began
    if np.abs(seen[:, :3] - places).max() > 1.0:
        raise SystemExit("gym-pybullet-drones did not hold its places; its figure would mean nothing")
    env.close()
    return figures("gym-pybullet-drones", vehicles, steps * env.CTRL_TIMESTEP, spent)


PEERS: dict[str, tuple[Callable[[int], dict[str, Any]], str]] = {  # how, and the folder in its checkout
    "pvs": (pvs, "src"),
    "gpd": (gpd, "."),
}


def figures(name: str, vehicles: int, seconds: float, cpu: float) -> dict[str, Any]:
    """Return what is printed of a peer."""
    return {
        "peer": name,
        "vehicles": vehicles,
        "simulated_seconds": round(seconds, 2),
        "cpu_seconds": round(cpu, 3),
        "vehicle_seconds_per_second": round(vehicles * seconds / cpu, 1),
    }


def main() -> None:
    """Parse the command line, run, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("peer", choices=sorted(PEERS))
    parser.add_argument("path", type=Path, help="its checkout")
    parser.add_argument("--vehicles", type=int, default=1)
    o = parser.parse_args()
    run, folder = PEERS[o.peer]
    sys.path.insert(0, str(o.path / folder))
    try:
        with contextlib.redirect_stdout(sys.stderr):
            row = run(o.vehicles)
    except ModuleNotFoundError as error:
        raise SystemExit(f"{o.peer} at {o.path}: {error}; give its checkout's root, and install what it needs") from None
    json.dump(row, sys.stdout)
    print()


if __name__ == "__main__":
    main()
