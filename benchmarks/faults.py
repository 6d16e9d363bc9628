"""Lose robots at random: `python benchmarks/faults.py --schedules 10000 --json`, and see that no guard stays unseen.

Each schedule has a random graph or, with `--map`, the guards of a map; 2 to 10 robots, of which up to all but one are
lost, in any order and at any time, at once or one by one, during recovery too; losses are noticed late, the last
observations of a lost robot are not confirmed, and some are false alarms: the robot works on and comes back. The same
schedules are judged by Definition 1 as printed: how often it finds no supportive tree.
"""

import argparse
import json
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial import Delaunay

from quarterdeck.coverage.forest import Forest, multi_prims
from quarterdeck.coverage.graph import Graph, graph_of
from quarterdeck.coverage.recovery import printed_supportive, recover, redivide, unseen_by
from quarterdeck.coverage.reduced import reduced_cdt
from quarterdeck.reproduce.guard_maps import paper_network, read_map, scenario_on

HEARTBEAT = 20.0  # s between messages: what a robot saw after its last one is not confirmed


@dataclass
class Robot:
    """A robot that walks straight from guard to guard at 1 m/s."""

    place: int
    time: float = 0.0
    queue: list[int] = field(default_factory=list)
    visits: list[tuple[float, int]] = field(default_factory=list)
    dies: float = np.inf

    def advance(self, points: np.ndarray, until: float) -> None:
        """Visit what can be visited before `until` and before it dies."""
        while self.queue:
            arrival = self.time + float(np.linalg.norm(points[self.queue[0]] - points[self.place]))
            if arrival > min(until, self.dies):
                return
            self.time, self.place = arrival, self.queue.pop(0)
            self.visits.append((arrival, self.place))

    def confirmed(self) -> list[int]:
        """Return what it has told: all, or what it saw before its last message."""
        last = np.inf if self.dies == np.inf else np.floor(self.dies / HEARTBEAT) * HEARTBEAT
        return [v for t, v in self.visits if t <= last]


def random_graph(rng: np.random.Generator) -> tuple[Graph, np.ndarray]:
    """Return the Reduced-CDT of a random Delaunay graph, and its guards."""
    points = rng.uniform(0, 100, (int(rng.integers(8, 70)), 2))
    triangles = Delaunay(points).simplices
    edges = np.unique(np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    guards = np.sort(rng.permutation(len(points))[: int(rng.integers(4, len(points)))])
    return reduced_cdt(graph_of(points, edges), guards), guards


def run_schedule(reduced: Graph, guards: np.ndarray, rng: np.random.Generator) -> tuple[int, int, int]:
    """Run one schedule; return guards left unseen, losses, and how often the printed definition found no helper."""
    k = int(rng.integers(2, 11))
    vertices = np.unique(reduced.edges)
    starts = rng.choice(vertices, k)
    forest = multi_prims(reduced, guards, starts)
    robots = [Robot(int(s)) for s in starts]
    horizon = 2 * reduced.weight / k
    doomed = rng.permutation(k)[: int(rng.integers(1, k))]
    times = rng.uniform(0, horizon, len(doomed))
    if rng.random() < 0.3:
        times[:] = times[0]  # all at once
    events: list[tuple[float, str, int]] = []
    for robot, at in zip(doomed.tolist(), times.tolist(), strict=True):
        if rng.random() < 0.2:
            events += [(at, "lost", robot), (at + rng.uniform(1, horizon), "returned", robot)]
        else:
            robots[robot].dies = at
            events.append((at + rng.choice([0.0, rng.uniform(0, horizon / 2)]), "lost", robot))
    lost, failures, printed = np.zeros(k, dtype=np.bool_), 0, 0
    _order(robots, forest, np.zeros(len(reduced.points), dtype=np.bool_), lost)
    while events:
        now = min(events)[0]
        batch = [e for e in events if e[0] == now]
        events = [e for e in events if e[0] > now]
        for robot in robots:
            robot.advance(reduced.points, now)
        fresh = np.zeros(k, dtype=np.bool_)
        for _, kind, robot in batch:
            fresh[robot] = kind == "lost"
            lost[robot] = kind == "lost"
        seen = _seen(robots, lost, len(reduced.points))
        if any(kind == "returned" for _, kind, _ in batch):
            entries = np.array([r.place for r in robots])
            forest = redivide(reduced, guards, seen=seen, entries=entries, lost=lost)
        else:
            failures += 1
            left = np.intersect1d(np.flatnonzero(~seen), np.concatenate([forest.chosen[r] for r in np.flatnonzero(fresh)]))
            printed += len(left) > 0 and not printed_supportive(reduced, forest, fresh | lost)
            forest = recover(reduced, guards, forest, seen=seen, lost=lost).forest
        _order(robots, forest, seen, lost)
    for robot in robots:
        robot.advance(reduced.points, np.inf)
    seen = _seen(robots, np.array([r.dies < np.inf for r in robots]), len(reduced.points))
    return int((~seen[guards]).sum()), failures, printed


def _seen(robots: list[Robot], lost: np.ndarray, n: int) -> np.ndarray:
    """Return (n,) bool: visited by a robot that works, or confirmed by one that is lost."""
    seen = np.zeros(n, dtype=np.bool_)
    for robot, gone in zip(robots, lost, strict=True):
        seen[robot.confirmed() if gone else [v for _, v in robot.visits]] = True
    return seen


def _order(robots: list[Robot], forest: Forest, seen: np.ndarray, lost: np.ndarray) -> None:
    """Give the working robots what they have to visit; one wrongly held for lost works on as before."""
    for robot, mine, gone in zip(robots, unseen_by(forest, seen), lost, strict=True):
        if not gone:
            robot.queue = mine.tolist()


def main() -> None:
    """Run the schedules and print how they went."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--schedules", type=int, default=1000)
    parser.add_argument("--map", type=Path)
    parser.add_argument("--range", type=float, default=20.0, dest="reach")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    rng = np.random.default_rng(args.seed)
    if args.map:
        polygon = read_map(args.map)
        net = paper_network(polygon, args.reach, scenario_on(polygon, 1).starts)
    began, losing, unseen, losses, printed = time.process_time(), 0, 0, 0, 0
    for _ in range(args.schedules):
        reduced, guards = (net.reduced, net.guards) if args.map else random_graph(rng)
        left, failures, without = run_schedule(reduced, guards, rng)
        losing += left > 0
        unseen += left
        losses += failures
        printed += without > 0
    result = {"schedules": args.schedules, "losses": losses, "schedules_that_lose_guards": losing, "guards_unseen": unseen}
    result |= {"schedules_without_helper_as_printed": printed, "cpu_seconds": round(time.process_time() - began, 1)}
    print(json.dumps(result) if args.json else "\n".join(f"{v:>8} {k.replace('_', ' ')}" for k, v in result.items()))


if __name__ == "__main__":
    main()
