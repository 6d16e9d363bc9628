"""Inspections of buildings whose doors are not all open: what is reachable is served, nothing is touched, nothing hangs.

    python benchmarks/closed_doors.py --runs 100 [--amcl] [--seed N --picture FILE.png]

Each run is a building of rooms with a door between every two neighbours, tasks with priorities, service times and
precedence, and two or three robots in rooms of their own. The plan knows the walls, and not which doors are closed, nor
three crates. A task is reachable if a robot can get to it by the doors that are open, and so are all that come before it.
"""

import argparse
import json
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import shapely
from shapely import MultiPolygon, box

from quarterdeck.geo.frame import Frame
from quarterdeck.geo.gridpath import find_ways
from quarterdeck.geo.models import load_model
from quarterdeck.geo.occupancy import site_occupancy
from quarterdeck.geo.scenario import Obstacle, Precedence, Scenario, Site, Task, Vehicle
from quarterdeck.mission.assign import assign
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.recovery import recovering
from quarterdeck.physics.sensing import Sensing
from quarterdeck.physics.simulate import Run, simulate

WIDE, HIGH, WALL, DOOR = 8.0, 7.0, 0.2, 1.8  # m: rooms, walls, doors
CLEARANCE = 0.45


@dataclass(frozen=True, slots=True)
class Building:
    """A site with tasks and robots, and what is there besides."""

    scenario: Scenario
    closed: tuple[Obstacle, ...]


def building(seed: int, *, columns: int = 4, rows: int = 3, tasks: int = 8, shut: float = 0.3) -> Building:
    """Return a building of `columns` x `rows` rooms, a part `shut` of its doors closed."""
    random = np.random.default_rng([seed, 0xD0])
    walls = [box(0, 0, columns * WIDE, rows * HIGH).boundary.buffer(WALL / 2, join_style="mitre")]
    doors = []
    for c in range(columns):
        for r in range(rows):
            x, y = c * WIDE, r * HIGH
            if c:  # the wall to the west, with a door somewhere
                at = y + random.uniform(DOOR, HIGH - DOOR)
                walls += [box(x - 0.1, y, x + 0.1, at - DOOR / 2), box(x - 0.1, at + DOOR / 2, x + 0.1, y + HIGH)]
                doors.append(box(x - 0.05, at - DOOR / 2, x + 0.05, at + DOOR / 2))
            if r:
                at = x + random.uniform(DOOR, WIDE - DOOR)
                walls += [box(x, y - 0.1, at - DOOR / 2, y + 0.1), box(at + DOOR / 2, y - 0.1, x + WIDE, y + 0.1)]
                doors.append(box(at - DOOR / 2, y - 0.05, at + DOOR / 2, y + 0.05))
    solid = shapely.union_all(walls)
    closed = [Obstacle(f"door-{n}", d) for n, d in enumerate(doors) if random.random() < shut]
    rooms = random.permutation(columns * rows)
    middle = [((n % columns + 0.5) * WIDE, (n // columns + 0.5) * HIGH) for n in rooms.tolist()]
    k = int(random.integers(2, 4))
    crates = []
    for x, y in middle[-3:]:
        u, v = random.uniform(-1.5, 1.5, 2)
        crates.append(box(x + u - 0.4, y + v - 0.3, x + u + 0.4, y + v + 0.3))
    model = load_model("jackal")
    robots = tuple(
        Vehicle(f"r{n + 1}", model, middle[n], speed=1.0, clearance=CLEARANCE, battery=model.battery) for n in range(k)
    )
    wanted: list[Task] = []
    while len(wanted) < tasks:
        x, y = random.uniform(1.0, WIDE - 1), random.uniform(1.0, HIGH - 1)
        x, y = x + WIDE * random.integers(columns), y + HIGH * random.integers(rows)
        if any(c.distance(shapely.Point(x, y)) < 2 * CLEARANCE for c in crates):
            continue
        after = (Precedence(wanted[int(random.integers(len(wanted)))].id),) if wanted and random.random() < 0.25 else ()
        service = float(random.integers(0, 20))
        wanted.append(Task(f"t{len(wanted)}", (x, y), int(random.integers(4)), service, after))
    outline = MultiPolygon([box(0, 0, columns * WIDE, rows * HIGH)])
    site = Site((), outline, tuple(Obstacle(f"wall-{n}", w) for n, w in enumerate(shapely.get_parts(solid))))
    scenario = Scenario(f"building {seed}", Frame(8.5, 47.4), site, robots, tuple(wanted))
    return Building(scenario, (*closed, *(Obstacle(f"crate-{n}", c) for n, c in enumerate(crates))))


def reachable(b: Building) -> set[str]:
    """Return the ids of the tasks that can be served, by a search on the true map of its own."""
    site = b.scenario.site
    real = Site(site.areas, site.operating, (*site.obstacles, *b.closed))
    grid = site_occupancy(real, "ground", 0.1, CLEARANCE)
    points = [*(t.position for t in b.scenario.tasks), *(v.start for v in b.scenario.vehicles)]
    steps = find_ways(grid, grid.free(), np.array(points)).steps
    n = len(b.scenario.tasks)
    can = {t.id for i, t in enumerate(b.scenario.tasks) if np.isfinite(steps[i, n:]).any()}
    while True:
        less = {t.id for t in b.scenario.tasks if t.id in can and all(a.task in can for a in t.after)}
        if less == can:
            return can
        can = less


def drive(b: Building, *, amcl: bool, seed: int) -> tuple[Mission, Run]:
    """Return the plan and its run, replanned where a task cannot be reached."""
    mission = assign(b.scenario, iterations=30, seed=seed)
    sensing = Sensing(lidar=True, amcl=amcl, unmapped=b.closed)
    return mission, simulate(mission, director=recovering(mission), seed=seed, sensing=sensing, sample=0.2)


def main() -> None:
    """Print the figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--amcl", action="store_true")
    parser.add_argument("--picture")
    options = parser.parse_args()
    began, figures, failed = time.process_time(), [], []
    for seed in range(options.seed, options.seed + options.runs):
        b = building(seed)
        mission, run = drive(b, amcl=options.amcl, seed=seed)
        f, can = run.report.figures, reachable(b)
        served = {t.id for t in run.report.tasks if t.driven}
        untold = [t.id for t in run.report.tasks if not t.driven and not t.reason]
        figures.append((len(can), len(can & served), len(served - can), f["collisions"], len(untold), len(mission.tasks)))
        if can - served or f["collisions"] or untold:
            failed.append({"seed": seed, "missed": sorted(can - served), "collisions": f["collisions"], "untold": untold})
        if options.picture:
            from quarterdeck.exporters.picture import picture

            there = replace(mission, site=run.site or mission.site)
            Path(options.picture).write_bytes(picture(there, run.trace, run.report, strange=b.closed))
    told = np.array(figures).sum(axis=0).tolist()
    names = ("reachable", "reachable_served", "served_though_not_reachable", "collisions", "untold", "tasks")
    seconds = round(time.process_time() - began, 1)
    print(
        json.dumps({"runs": options.runs, **dict(zip(names, told, strict=True)), "failed": failed, "cpu_seconds": seconds})
    )


if __name__ == "__main__":
    main()
