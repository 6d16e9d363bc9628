"""Each sample plan to all its formats but the pictures, with one command: processor seconds, printed as JSON.

    python benchmarks/exports.py

The command runs in a process of its own, start and imports included, `--runs` times after one that warms the disk.
"""

import argparse
import json
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

PICTURES = {"png", "html", "rerun"}
SITES = {
    "5 USVs": ("west_ant_island", "plan", []),
    "3 UAVs with cameras and fences": ("farm_survey", "plan", ["--method", "lines"]),
    "UGV inspection": ("inspection_hall", "assign", []),
}


def main() -> None:
    """Plan each sample, export it, print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=5)
    runs = parser.parse_args().runs
    from quarterdeck.exporters.export import FORMATS

    formats = ",".join(name for name in FORMATS if name not in PICTURES)
    data = Path(__file__).parents[1] / "data"
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name, (site, verb, options) in SITES.items():
            plan = Path(folder) / f"{site}.plan.geojson"
            spend([verb, str(data / f"{site}.geojson"), *options, "-o", str(plan), "--force"])
            command = ["export", str(plan), "--to", formats, "-o", str(Path(folder) / site), "--force"]
            spend(command)
            seconds = [spend(command) for _ in range(runs)]
            files = sum(1 for path in (Path(folder) / site).rglob("*") if path.is_file())
            rows.append({"plan": name, "site": site, "files": files, "cpu_seconds": round(statistics.median(seconds), 3)})
    print(json.dumps({"formats": formats.split(","), "runs": runs, "exports": rows}, indent=1))


def spend(arguments: list[str]) -> float:
    """Run quarterdeck with the arguments and return the processor seconds that it took, user and system."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, "-m", "quarterdeck", *arguments], capture_output=True, text=True, check=False)
    if done.returncode == 2:
        raise SystemExit(done.stderr)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    main()
