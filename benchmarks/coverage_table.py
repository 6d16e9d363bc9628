"""Print the table of division and tours: `python benchmarks/coverage_table.py [FILE.npz ...]`.

Without files the instances are made here, by seeds: empty ground, scattered obstacles, starts in a corner, two rooms with a
neck, mazes, caves, streets, a million cells (`--large`). Each runs in a process of its own, by benchmarks/division.py.
`--peer darp-python=PATH` runs a checkout of DARP-Python on the same instances, with the interpreter of `--peer-python`
(it needs OpenCV, pygame and Pillow), and prints the ratios; one that is not done after `--timeout` seconds is shown so.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import convolve, label

HERE = Path(__file__).parent


def instances(folder: Path, large: bool) -> list[Path]:
    """Write the instances into `folder` and return their files."""
    files = []

    def keep(name: str, free: np.ndarray, starts: np.ndarray | int, seed: int = 0) -> None:
        parts, _ = label(free)
        free = parts == np.bincount(parts[parts > 0]).argmax()
        if isinstance(starts, int):
            cells = np.argwhere(free)
            starts = cells[np.random.default_rng(seed).choice(len(cells), starts, replace=False)]
        files.append(folder / f"{name}.npz")
        np.savez_compressed(files[-1], grid=free.astype(np.uint8), starts=starts)

    open_ = np.ones((40, 50), dtype=bool)
    for k in (5, 10, 20, 50):
        for seed in (0, 1):
            keep(f"empty_40x50_k{k}_s{seed}", open_, k, seed)
    keep("corner_40x50_k10", open_, np.argwhere(np.ones((5, 2))))
    neck = open_.copy()
    neck[:19, 20:30] = neck[21:, 20:30] = False
    keep("two_rooms_k4", neck, np.array([[5, 2], [15, 2], [25, 2], [35, 2]]))
    for side, k in ((100, 10), (100, 20), (200, 20)):
        keep(f"rand10_{side}x{side}_k{k}", np.random.default_rng(side).random((side, side)) >= 0.1, k)
    keep("empty_200x200_k20", np.ones((200, 200), dtype=bool), 20)
    for k in (8, 32, 100):
        keep(f"maze_k{k}", maze(20, 4, k), k)
        keep(f"cave_k{k}", cave(100, k), k)
        keep(f"streets_k{k}", streets(128, k), k)
    if large:
        for k in (20, 100):
            keep(f"empty_1000x1000_k{k}", np.ones((1000, 1000), dtype=bool), k)
            keep(f"rand10_1000x1000_k{k}", np.random.default_rng(k).random((1000, 1000)) >= 0.1, k)
    return files


def maze(nodes: int, corridor: int, seed: int) -> np.ndarray:
    """Return a perfect maze of nodes x nodes rooms, walls one cell thick, by a random depth-first search."""
    rng = np.random.default_rng(seed)
    pitch = corridor + 1
    free = np.zeros((nodes * pitch + 1,) * 2, dtype=bool)
    stack = [(0, 0)]
    seen = {(0, 0)}
    while stack:
        i, j = stack[-1]
        free[i * pitch + 1 : (i + 1) * pitch, j * pitch + 1 : (j + 1) * pitch] = True
        near = [(i + a, j + b) for a, b in ((0, 1), (1, 0), (0, -1), (-1, 0)) if (i + a, j + b) not in seen]
        near = [(a, b) for a, b in near if 0 <= a < nodes and 0 <= b < nodes]
        if not near:
            stack.pop()
            continue
        a, b = near[rng.integers(len(near))]
        seen.add((a, b))
        stack.append((a, b))
        if a == i:
            free[i * pitch + 1 : (i + 1) * pitch, max(j, b) * pitch] = True
        else:
            free[max(i, a) * pitch, j * pitch + 1 : (j + 1) * pitch] = True
    return free


def cave(side: int, seed: int) -> np.ndarray:
    """Return a cave by a cellular automaton."""
    free = np.random.default_rng(seed).random((side, side)) > 0.45
    for _ in range(5):
        free = convolve(free.astype(int), np.ones((3, 3), dtype=int), mode="constant") >= 5
    return free


def streets(side: int, seed: int) -> np.ndarray:
    """Return streets of 1 to 3 cells between blocks of 3 to 12."""
    rng = np.random.default_rng(seed)
    free = np.ones((side, side), dtype=bool)
    row = 0
    while row < side:
        deep = rng.integers(5, 15)
        col = 0
        while col < side:
            wide = rng.integers(5, 15)
            free[row + rng.integers(1, 4) : row + deep, col + rng.integers(1, 4) : col + wide] = False
            col += wide
        row += deep
    return free


PEER = """
import json, sys, time
import numpy as np
z = np.load(sys.argv[1])
grid = z['grid'] > 0
R, C = grid.shape
starts = [int(r) * C + int(c) for r, c in z['starts']]
from multiRobotPathPlanner import MultiRobotPathPlanner
MultiRobotPathPlanner(6, 6, False, [0, 35], [0.5, 0.5], [], False)  # compiles
began = time.process_time()
run = MultiRobotPathPlanner(R, C, False, starts, [], np.flatnonzero(~grid.ravel()).tolist(), False)
took = time.process_time() - began
turns = 0
longest = 0
if run.DARP_success:
    for path in run.best_case.paths:
        moves = [(c - a, d - b) for a, b, c, d in path]
        if path and tuple(path[0][:2]) != tuple(path[-1][2:]):
            moves.append((path[0][0] - path[-1][2], path[0][1] - path[-1][3]))
        turns += sum(m != moves[i - 1] for i, m in enumerate(moves))
        longest = max(longest, len(moves))
print('RESULT ' + json.dumps({'makespan': longest, 'turns': turns, 'cpu': took, 'done': bool(run.DARP_success)}))
"""


def peer_figures(checkout: str, python: str, file: Path, timeout: float) -> dict[str, Any]:
    """Run DARP-Python on one instance in its checkout; {} if it fails or is not done in time."""
    try:
        done = subprocess.run(
            [python, "-c", PEER, str(file.resolve())],
            cwd=checkout,
            env={"PYTHONPATH": checkout, "PATH": "/usr/bin:/bin", "SDL_VIDEODRIVER": "dummy"},
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return {"why": f"> {timeout:.0f} s"}
    lines = [line for line in done.stdout.splitlines() if line.startswith("RESULT ")]
    if not lines:
        return {"why": (done.stderr.strip().splitlines() or [f"exit {done.returncode}"])[-1][:60]}
    figures: dict[str, Any] = json.loads(lines[-1][7:])
    return figures if figures["done"] else {"why": "gave up"}


def main() -> None:
    """Run every instance and print a Markdown table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--large", action="store_true", help="a million cells too")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--peer", metavar="darp-python=PATH", help="a checkout to run on the same instances")
    parser.add_argument("--peer-python", default=sys.executable, help="the interpreter that has the peer's dependencies")
    parser.add_argument("--timeout", type=float, default=120.0, help="seconds of wall clock that a peer gets an instance")
    args = parser.parse_args()
    name, _, checkout = (args.peer or "").partition("=")
    if args.peer and (name != "darp-python" or not (Path(checkout) / "darp.py").is_file()):
        parser.error(f"--peer {args.peer}: expected darp-python=PATH with darp.py in PATH")

    heads = ["instance", "vehicles", "cells", "bound", "makespan", "ratio", "turns", "division s", "tours s", "peak MB"]
    heads += ["DARP makespan", "ours / DARP", "DARP turns", "DARP CPU s"] if args.peer else []
    print("| " + " | ".join(heads) + " |\n|" + " --- |" * len(heads), flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for file in args.files or instances(Path(folder), args.large):
            command = [sys.executable, str(HERE / "division.py"), str(file), "--json", "--runs", str(args.runs)]
            f = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
            row = [file.stem, f["vehicles"], f["cells"], f["bound"], f["makespan"], f"{f['ratio']:.4f}", f["turns"]]
            row += [f"{f['cpu_seconds']['division']:.4f}", f"{f['cpu_seconds']['tours']:.4f}", f"{f['peak_mb']:.0f}"]
            if args.peer:
                p = peer_figures(checkout, args.peer_python, file, args.timeout)
                if "why" in p:
                    row += [p["why"], "", "", ""]
                else:
                    row += [p["makespan"], f"{f['makespan'] / p['makespan']:.3f}", p["turns"], f"{p['cpu']:.1f}"]
            print("| " + " | ".join(map(str, row)) + " |", flush=True)


if __name__ == "__main__":
    main()
