"""Measure limited-visibility coverage: `python benchmarks/guards.py MAP.json --range 20 --robots 5 --json`.

A map is a GeoJSON Feature with a Polygon in metres. Robots are points that start as `--starts` and `--seed` say
and move at 1 m/s, so that makespans are metres too.
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

from quarterdeck.mission.guards import plan_guards
from quarterdeck.reproduce.guard_maps import read_map, scenario_on


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
