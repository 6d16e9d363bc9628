"""Divide one instance and walk its tours: `python benchmarks/division.py FILE.npz --json`.

FILE.npz holds `grid` (R, C), 1 a free hypervertex, and `starts` (k, 2), row and column; starts that coincide or are not
free get the nearest distinct entries. One JSON object on stdout. Moves are between path cells (4 a hypervertex) on closed
tours; seconds are the median of the warm runs in this process, compilation apart; a plan is the division and all tours.
"""

import argparse
import json
import resource
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from quarterdeck.coverage.division import Division, distinct_entries, divide
from quarterdeck.coverage.tour import count_turns, tours


def measure(free: np.ndarray, starts: np.ndarray, shares: np.ndarray | None, seed: int, runs: int) -> dict[str, Any]:
    """Return the figures of one instance."""
    small = np.ones((8, 8), dtype=bool)
    corners = np.array([[0, 0], [7, 7], [0, 7]])
    tours(divide(small, corners).labels, corners)  # compiles
    division, *took = _timed(lambda: divide(free, starts, shares, seed=seed), runs)
    walks, *walked = _timed(lambda: tours(division.labels, starts), runs)
    return _figures(division, walks) | {
        "seconds": {"division": took[0], "tours": walked[0]},
        "cpu_seconds": {"division": took[1], "tours": walked[1]},
        "peak_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, 1),
    }


def _timed(job: Callable[[], Any], runs: int) -> tuple[Any, float, float]:
    """Return the job's result and the medians of its wall and CPU seconds."""
    wall, cpu = [], []
    result = None
    for _ in range(runs):
        began = time.perf_counter(), time.process_time()
        result = job()
        wall.append(time.perf_counter() - began[0])
        cpu.append(time.process_time() - began[1])
    return result, round(float(np.median(wall)), 6), round(float(np.median(cpu)), 6)


def _figures(division: Division, walks: list[np.ndarray]) -> dict[str, Any]:
    makespan = max(len(walk) for walk in walks)
    return {
        "vehicles": len(walks),
        "cells": int(division.sizes.sum()),
        "bound": division.bound_moves,
        "proof": division.proof,
        "makespan": makespan,
        "ratio": division.ratio,
        "largest": int(division.sizes.max()),
        "smallest": int(division.sizes.min()),
        "sizes": division.sizes.tolist(),
        "targets": division.targets.tolist(),
        "turns": sum(count_turns(walk) for walk in walks),
        "reasons": list(division.reasons),
    }


def main() -> None:
    """Read the instance, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--shares", help="one number for each vehicle, separated by commas, summing to 1")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--runs", type=int, default=5, help="warm runs of which the median is told")
    parser.add_argument("--json", action="store_true", help="the whole object; without it, one line")
    args = parser.parse_args()
    with np.load(args.file) as file:
        free, given = file["grid"] > 0, file["starts"].astype(float)
    shares = None if args.shares is None else np.array([float(s) for s in args.shares.split(",")])
    figures = {"file": args.file.name} | measure(free, distinct_entries(free, given + 0.5), shares, args.seed, args.runs)
    if args.json:
        print(json.dumps(figures))
    else:
        f = figures
        print(
            f"{f['file']}: {f['vehicles']} vehicles, {f['cells']} cells, makespan {f['makespan']} moves, at least "
            f"{f['bound']} ({f['proof']}), ratio {f['ratio']:.4f}, regions {f['smallest']} to {f['largest']}, "
            f"{f['turns']} turns, {f['seconds']['division']:.3f} s + {f['seconds']['tours']:.3f} s, {f['peak_mb']} MB"
        )


if __name__ == "__main__":
    main()
