"""Memory and seconds that `quarterdeck plan` takes up to the largest site that it accepts: `python benchmarks/limits.py`.

A square of sea with islands for one line of vessels is planned at ever smaller spacings, each in a process of its own, of
which the kernel tells the peak of resident memory and the CPU seconds. `--islands` makes many small ones: ways around them
have many corners.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

SIDE = 4000.0  # m
DEGREE = 111_320.0  # m of a degree of latitude, and of longitude at the equator, nearly


def main() -> None:
    """Print a line of JSON for each size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="+", default=[5_000, 100_000, 400_000, 815_000], help="hypervertices")
    parser.add_argument("--vehicles", type=int, default=3)
    parser.add_argument("--islands", type=int, default=0, help="this many small ones instead of four")
    parser.add_argument("--options", default="", help="more options of `quarterdeck plan`, such as '--method lines'")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        site, plan = Path(folder) / "site.geojson", Path(folder) / "plan.geojson"
        site.write_text(json.dumps(_site(given.vehicles, given.islands)), encoding="utf-8")
        for size in given.sizes:
            spacing = SIDE / (2 * size**0.5)
            command = [sys.executable, "-m", "quarterdeck", "plan", str(site), "-o", str(plan), "--force", "--json"]
            command += ["--spacing", f"{spacing:.6g}", *given.options.split()]
            with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
                said = process.stderr.read() if process.stderr else ""
                _, status, used = os.wait4(process.pid, 0)
                process.returncode = os.waitstatus_to_exitcode(status)
            told = {"asked": size, "spacing": round(spacing, 4), "status": process.returncode}
            figures = next((json.loads(line)["figures"] for line in said.splitlines() if line.startswith("{")), None)
            told |= {"hypervertices": figures.get("hypervertices")} if figures else {"said": said.strip()[-300:]}
            told |= {"peak_mb": round(used.ru_maxrss / 1e3), "cpu_s": round(used.ru_utime + used.ru_stime, 1)}
            print(json.dumps(told), flush=True)


def _site(vehicles: int, islands: int) -> dict:
    """Return a square with four round islands, or many small ones, its fence 200 m about it and vessels along its southern
    edge.
    """
    features = [_feature("area", _box(0, SIDE)), _feature("operating", _box(-200, SIDE + 200))]
    side = math.isqrt(max(islands - 1, 0)) + 1
    lattice = [
        ((i % side + 0.3 + 0.4 * (i % 7) / 7) / side, (i // side + 0.3 + 0.4 * (i % 5) / 5) / side) for i in range(islands)
    ]
    size = 0.15 / side if islands else 0.04
    for x, y in lattice or ((0.2, 0.3), (0.5, 0.6), (0.8, 0.2), (0.7, 0.85)):
        corners = [(x + size * a, y + size * b) for a, b in ((1, 0), (0.5, 0.87), (-0.5, 0.87), (-1, 0), (-0.5, -0.87))]
        features.append(_feature("obstacle", [[_at(SIDE * u, SIDE * v) for u, v in (*corners, corners[0])]]))
    for i in range(vehicles):
        place = {"type": "Point", "coordinates": _at(SIDE * (i + 0.5) / vehicles, -50)}
        features.append(
            {
                "type": "Feature",
                "properties": {"role": "vehicle", "id": f"usv-{i + 1}", "model": "otter"},
                "geometry": place,
            }
        )
    return {"type": "FeatureCollection", "features": features}


def _feature(role: str, rings: list) -> dict:
    return {"type": "Feature", "properties": {"role": role}, "geometry": {"type": "Polygon", "coordinates": rings}}


def _box(low: float, high: float) -> list:
    return [[_at(x, y) for x, y in ((low, low), (high, low), (high, high), (low, high), (low, low))]]


def _at(x: float, y: float) -> list[float]:
    return [x / DEGREE, y / DEGREE]


if __name__ == "__main__":
    main()
