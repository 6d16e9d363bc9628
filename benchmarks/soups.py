"""Feed random segment soups to the triangulation: `python benchmarks/soups.py --cases 100000 --json`.

Three families: segments on a coarse grid with many duplicates, crossing floats, and a grid with noise of 1e-15 to 1e-8.
The triangulation refuses by itself where its triangles do not fill the faces that it found. Here the area is compared once
more with faces noded without any grid, where that is well defined (with noise, whether a face closes depends on the grid),
and every 50th case with the other backend.
"""

import argparse
import json
import time

import numpy as np
import shapely

from quarterdeck.geo.triangulation import TriangulationError, triangulate_segments


def soup(rng: np.random.Generator, family: int) -> np.ndarray:
    """Return (m, 2, 2) random segments."""
    m = int(rng.integers(1, 40))
    if family == 1:
        return rng.uniform(0, 100, (m, 2, 2))
    grid = rng.integers(0, 8, (m, 2, 2)).astype(float)
    return grid + rng.normal(size=grid.shape) * 10.0 ** rng.uniform(-15, -8) if family == 2 else grid


def main() -> None:
    """Run the cases and print how they went."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    rng = np.random.default_rng(args.seed)
    refused = wrong = differ = empty = 0
    began = time.process_time()
    for case in range(args.cases):
        segments = soup(rng, case % 3)
        try:
            mesh = triangulate_segments(segments)
        except TriangulationError:
            refused += 1
            continue
        empty += not len(mesh.triangles)
        if case % 3 < 2:
            noded = shapely.union_all(shapely.linestrings(segments))
            area = float(shapely.area(shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))).sum())
            wrong += abs(mesh.area - area) > 1e-6 * max(area, 1e-3)
        if case % 50 == 0:
            differ += abs(triangulate_segments(segments, backend="pythoncdt").area - mesh.area) > 1e-9 * max(
                mesh.area, 1e-3
            )
    result = {"cases": args.cases, "refused": refused, "wrong_area": wrong, "backends_differ": differ, "empty": empty}
    result["cpu_seconds"] = round(time.process_time() - began, 1)
    print(json.dumps(result) if args.json else "\n".join(f"{k:>16} {v}" for k, v in result.items()))


if __name__ == "__main__":
    main()
