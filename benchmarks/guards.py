"""Measure limited-visibility coverage: `python benchmarks/guards.py MAP.json --range 20 --robots 5 --json`.

A map is a GeoJSON Feature with a Polygon in metres. Robots are points that start as `--starts` and `--seed` say
and move at 1 m/s, so that makespans are metres too.
"""

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from quarterdeck.coverage.guards.pieces import paper_guards
from quarterdeck.coverage.guards.space import Space
from quarterdeck.coverage.network import Network, network
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Scenario, Site, Vehicle, as_multipolygon
from quarterdeck.mission.guards import plan_guards


def read_map(path: Path) -> shapely.MultiPolygon:
    """Return the polygon of a map in metres."""
    document = json.loads(path.read_text())
    return as_multipolygon(shapely.geometry.shape(document.get("geometry", document)))


def scenario_on(polygon: shapely.MultiPolygon, robots: int, starts: str, seed: int, reach: float | None = None) -> Scenario:
    """Return point robots in a polygon: spread evenly on its border, or clustered around a place on it."""
    rng = np.random.default_rng(seed)
    border = max(polygon.geoms, key=lambda p: p.area).exterior
    first = rng.uniform(0, border.length)
    if starts == "spread":
        along = (first + border.length * np.arange(robots) / robots) % border.length
    else:
        along = (first + rng.uniform(-0.01, 0.01, robots) * border.length) % border.length
    places = shapely.get_coordinates(shapely.line_interpolate_point(border, along))
    model = replace(load_model("husky"), speed=1.0, turn_radius=0.0)
    fleet = tuple(Vehicle(f"r{i}", model, (x, y), range=reach) for i, (x, y) in enumerate(places.tolist()))
    site = Site((Area("area", polygon),), polygon)
    return Scenario("map", Frame(0.0, 0.0), site, fleet)


def paper_network(path: Path, reach: float, robots: int = 1) -> Network:
    """Return the network on the paper's guards of a map."""
    polygon = read_map(path)
    scenario = scenario_on(polygon, robots, "spread", 0)
    guards = paper_guards(Space(polygon, polygon, polygon, scenario.frame), reach)
    return network(polygon, guards, scenario.starts)


def measure(path: Path, reach: float, robots: int, starts: str, seed: int) -> dict[str, Any]:
    """Return the figures of both modes."""
    scenario = scenario_on(read_map(path), robots, starts, seed)
    result: dict[str, Any] = {"map": path.stem, "range": reach, "robots": robots, "starts": starts, "seed": seed}
    for mode in ("paper", "optimised"):
        began = time.process_time()
        mission = plan_guards(scenario, range=reach, mode=mode, seed=seed)  # type: ignore[arg-type]
        result[mode] = {
            "guards": mission.figures["guards"],
            "guards_bound": mission.bounds.get("guards"),
            "uncovered": mission.figures["certificate"]["uncovered"],
            "makespan": round(mission.figures["makespan"], 3),
            "makespan_bound": round(mission.bounds["makespan"], 3),
            "seconds": round(time.process_time() - began, 2),
        }
    return result


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("maps", nargs="+", type=Path)
    parser.add_argument("--range", type=float, default=20.0, dest="reach")
    parser.add_argument("--robots", type=int, default=5)
    parser.add_argument("--starts", choices=["spread", "clustered"], default="spread")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    for path in args.maps:
        result = measure(path, args.reach, args.robots, args.starts, args.seed)
        if args.json:
            print(json.dumps(result), flush=True)
            continue
        print(f"{path.stem}, range {args.reach:g} m, {args.robots} robots {args.starts}")
        for mode in ("paper", "optimised"):
            print(f"  {mode:>9}  " + "  ".join(f"{k} {v}" for k, v in result[mode].items()), flush=True)


if __name__ == "__main__":
    main()
