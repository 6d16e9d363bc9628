"""How well each kind keeps its track in what nature does to it: python benchmarks/tracking.py --seeds 30.

Two straight legs of 300 m (ground: 40 m) and back; 95 % of the cross-track errors on straight legs, metres: the worst
and the mean over the seeds.
"""

import argparse
import json

import numpy as np
from shapely import MultiPolygon, box

from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Site, Vehicle
from quarterdeck.mission.mission import Mission, Route, Waypoint
from quarterdeck.physics.simulate import simulate

CASES = {
    "otter": {"current": (0.0, 0.5)},
    "wam-v": {"current": (0.0, 0.5)},
    "husky": {},
    "jackal": {},
    "survey-quad": {"gusts": 3.0},
}


def legs(model: str) -> Mission:
    """Return a mission of two legs and the way back."""
    kind = load_model(model)
    reach, apart, z = (40.0, 5.0, 0.0) if kind.domain == "ground" else (300.0, 50.0, kind.altitude)
    area = MultiPolygon([box(-50, -50, reach + 50, apart + 50)])
    places = [(0.0, 0.0, 0.0, "start"), (0.0, 0.0, z, "takeoff")][: 2 if z else 1]
    places += [(reach, 0.0, z, "survey"), (reach, apart, z, "survey"), (0.0, apart, z, "survey"), (0.0, 0.0, z, "transit")]
    places += [(0.0, 0.0, 0.0, "landing")] if z else []
    route = Route("v", tuple(Waypoint(*p[:3], leg=p[3], speed=kind.speed) for p in places))
    vehicle = Vehicle("v", kind, (0.0, 0.0), speed=kind.speed, turn_radius=kind.turn_radius, clearance=kind.clearance)
    site = Site((Area("area", area),), area)
    return Mission("tracking", Frame(0, 0), site, (vehicle,), (route,), "by hand", spacing=apart)


def main() -> None:
    """Parse the command line, run, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    result = {}
    for model, nature in CASES.items():
        seeds = range(1 if "current" in nature else options.seeds)  # a current is the same for every seed
        errors = [simulate(legs(model), seed=seed, **nature).report.figures["legs_p95"] for seed in seeds]
        result[model] = {
            **nature,
            "runs": len(errors),
            "worst": round(max(errors), 3),
            "mean": round(float(np.mean(errors)), 3),
        }
    if options.json:
        print(json.dumps(result, indent=2))
    else:
        for model, row in result.items():
            print(f"{model:>12}  " + "  ".join(f"{name} {value}" for name, value in row.items()))


if __name__ == "__main__":
    main()
