"""The swept-path check against hulls drawn fifty to a step: python benchmarks/swept.py --runs 10000.

Each run takes a hull past an obstacle, most of them near a graze. Where the drawn hulls come within 2 mm without touching,
what lies between two of them decides, and neither is held to the other.
"""

import argparse
import json
import time

import numpy as np
import shapely
from shapely import MultiPolygon, Point, box

from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Obstacle, Site, Vehicle
from quarterdeck.physics.swept import sweep
from quarterdeck.physics.trace import COLUMNS, Trace

BESIDE = 6  # obstacles a track
POSES = 40


def main() -> None:
    """Parse the command line, run, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    random = np.random.default_rng(options.seed)
    vehicle, area = Vehicle("usv", load_model("otter"), (0.0, 0.0)), MultiPolygon([box(-100, -100, 100, 100)])
    length, width = vehicle.model.length, vehicle.model.width
    hull = np.array([(length, width), (-length, width), (-length, -width), (length, -width)]) / 2
    began, counts = time.process_time(), {"runs": 0, "hits": 0, "undecided": 0, "missed": 0, "false": 0}
    while counts["runs"] < options.runs:
        steps = random.normal(0.3, 0.05, POSES)
        heading = random.uniform(-np.pi, np.pi) + np.cumsum(random.normal(0, 0.02, POSES))
        x, y = np.cumsum(steps * np.cos(heading)), np.cumsum(steps * np.sin(heading))
        at = random.integers(5, POSES - 5, BESIDE)
        side = heading[at] + random.choice([-1, 1], BESIDE) * np.pi / 2
        away = width / 2 + 0.3 + random.normal(0, 0.3, BESIDE)
        places = np.column_stack([x[at] + away * np.cos(side), y[at] + away * np.sin(side)])
        obstacles = tuple(Obstacle(str(i), Point(*p).buffer(0.3, quad_segs=3)) for i, p in enumerate(places))
        columns = {name: np.zeros((POSES, 1), dtype) for name, dtype in COLUMNS.items()}
        columns |= {"x": np.c_[x], "y": np.c_[y], "heading": np.c_[heading]}
        trace = Trace(("usv",), time=np.arange(POSES, dtype=float), **columns)
        found = sweep(Site((Area("a", area),), area, obstacles), vehicle, trace, 0).hits
        fine = np.arange(0, POSES - 1 + 1e-9, 0.02)
        px, py, psi = (np.interp(fine, range(POSES), column)[:, None] for column in (x, y, heading))
        cos, sin = np.cos(psi), np.sin(psi)
        corners = np.dstack([cos * hull[:, 0] - sin * hull[:, 1] + px, sin * hull[:, 0] + cos * hull[:, 1] + py])
        drawn = shapely.polygons(corners)
        for obstacle in obstacles:
            gap = float(shapely.distance(drawn, obstacle.polygon).min())
            counts["runs"] += 1
            counts["hits"] += gap == 0
            counts["undecided"] += 0 < gap < 0.002
            counts["missed"] += gap == 0 and obstacle.id not in found
            counts["false"] += gap >= 0.002 and obstacle.id in found
    print(json.dumps({**counts, "cpu_seconds": round(time.process_time() - began, 1)}, indent=2))


if __name__ == "__main__":
    main()
