"""How fast replanning is, and what is lost by not knowing: `python benchmarks/replanning.py --cases 200`.

Speed: CPU seconds of one replan after a loss, the median of 5 warm runs, planning and compilation apart.

Regret: seeded random sites, fleets and losses; the makespan from the mission's start to the last return, over that of a
clairvoyant who knew at the start who would be lost and when, lets it do the same until then, and plans the rest for the
others: anew, or by sharing the same lines out from the start, whichever is sooner done. Beside it the time from the loss
on, over a bound that nothing can beat from where the survivors are then: the work left, along straight lines without turns,
over the sum of speeds (for guards Held and Karp's), the farthest work there and back, and everyone's way home.
"""

import argparse
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from shapely import MultiPolygon, Point, box

from quarterdeck.coverage.metrics import track_length
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Obstacle, Scenario, Site, Task, Vehicle, as_multipolygon
from quarterdeck.mission.assign import assign
from quarterdeck.mission.cover import cover
from quarterdeck.mission.guard_recovery import guards_from_now
from quarterdeck.mission.guards import plan_guards
from quarterdeck.mission.lines import plan_lines
from quarterdeck.mission.mission import Mission, unbroken
from quarterdeck.mission.progress import Progress, planned_progress
from quarterdeck.mission.remaining import remaining_parts
from quarterdeck.mission.replan import Changes, replan
from quarterdeck.reproduce.guard_maps import ROOM, random_room, scenario_on

SPACING = 5.0
LOSSES = 5  # cases a plan


def site(side: float, obstacles: int, vehicles: int, seed: int, *, tasks: int = 0, area: bool = True) -> Scenario:
    """Return a square of ground with boxes in it, vehicles along its southern edge, and tasks."""
    rng = np.random.default_rng(seed)
    low, size = rng.uniform(0.05 * side, 0.85 * side, (obstacles, 2)), rng.uniform(0.02 * side, 0.1 * side, (obstacles, 2))
    boxes = [box(x, y, x + w, y + h) for (x, y), (w, h) in zip(low, size, strict=True)]
    blocked = shapely.union_all(boxes).buffer(2.0)
    free = [tuple(p) for p in rng.uniform(2, side - 2, (4 * tasks, 2)) if not blocked.covers(Point(p))][:tasks]
    places = rng.uniform(0.02, 0.98, vehicles) * side
    model = load_model("jackal")
    return Scenario(
        name="square",
        frame=Frame(5.0, 52.0),
        site=Site(
            (Area("a", MultiPolygon([box(0, 0, side, side)])),) if area else (),
            as_multipolygon(box(-10, -10, side + 10, side + 10)),
            tuple(Obstacle(f"o{i}", b) for i, b in enumerate(boxes)),
        ),
        vehicles=tuple(
            Vehicle(f"v{i}", model, (x, -4.0), speed=1.0, clearance=1.0, battery=1e6) for i, x in enumerate(places)
        ),
        tasks=tuple(Task(f"t{i}", p, priority=int(rng.integers(4)), service_time=10.0) for i, p in enumerate(free)),
        spacing=SPACING,
    )


def speeds() -> list[dict[str, Any]]:
    """Return the CPU seconds of one replan for each kind of plan."""
    room, corners = as_multipolygon(ROOM), as_multipolygon(random_room(100, 0))
    big = site(2000.0, 12, 10, 0)
    many = site(300.0, 12, 20, 0, tasks=200, area=False)
    cases: list[tuple[str, float, Callable[[], Mission], str]] = [
        ("stc, 40,000 cells, 10 vehicles", 1.0, lambda: cover(big), "v4"),
        ("lines, the same area", 1.0, lambda: plan_lines(big), "v4"),
        ("200 tasks, 20 robots", 2.0, lambda: assign(many, iterations=5), "v4"),
        (
            "guards, the paper's room, range 20 m, 5 robots",
            0.02,
            lambda: plan_guards(scenario_on(room, 5), range=20.0),
            "r3",
        ),
        ("guards, 100 corners, range 20 m, 5 robots", 0.02, lambda: plan_guards(scenario_on(corners, 5), range=20.0), "r3"),
        ("guards, 100 corners, range 10 m, 5 robots", 0.02, lambda: plan_guards(scenario_on(corners, 5), range=10.0), "r3"),
    ]
    return [_speed(name, target, make(), lost) for name, target, make, lost in cases]


def _speed(name: str, target: float, mission: Mission, lost: str) -> dict[str, Any]:
    end = max(r.duration for r in mission.routes)
    took = []
    for part in (0.3, 0.01, 0.1, 0.2, 0.3, 0.5):
        progress = planned_progress(mission, part * end, stopped={lost: part * end})
        began = time.process_time()
        replan(mission, progress, Changes(lost=frozenset({lost})))
        took.append(time.process_time() - began)
    return {"what": name, "target_s": target, "median_s": float(np.median(took[1:])), "worst_s": max(took[1:])}


def regrets(method: str, cases: int) -> dict[str, Any]:
    """Return the distribution of the two ratios over seeded losses."""
    pairs = [pair for seed in range(-(-cases // LOSSES)) for pair in _cases(method, seed)][:cases]
    known, bound = np.array(pairs).T
    told = {"method": method, "cases": len(pairs)}
    for name, ratios in (("clairvoyant", known), ("bound", bound)):
        told |= {f"{name}_{q}": float(np.percentile(ratios, p)) for q, p in (("median", 50), ("p90", 90), ("worst", 100))}
    return told


def _cases(method: str, seed: int) -> Iterator[tuple[float, float]]:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 7))
    if method == "guards":
        room = as_multipolygon(random_room(int(rng.integers(30, 70)), seed))
        mission = plan_guards(scenario_on(room, count, seed=seed), range=float(rng.uniform(18, 30)))
    else:
        scenario = site(float(rng.uniform(120, 300)), int(rng.integers(0, 6)), count, seed)
        try:
            mission = cover(scenario) if method == "stc" else plan_lines(scenario)
        except InputError:
            return
    for _ in range(LOSSES):
        time_ = float(rng.uniform(0.02, 0.95) * max(r.duration for r in mission.routes))
        lost = frozenset(rng.permutation([v.id for v in mission.vehicles])[: int(rng.integers(1, count))].tolist())
        yield (_guards if method == "guards" else _survey)(mission, time_, lost)


def _survey(mission: Mission, at: float, lost: frozenset[str]) -> tuple[float, float]:
    """Return the makespan after a loss over the clairvoyant's, and from the loss on over the bound."""
    progress = planned_progress(mission, at)
    after = replan(mission, progress, Changes(lost=lost))
    total = at + after.figures["makespan"]
    began = planned_progress(mission, 0.0)
    done = [t for r in mission.routes if r.vehicle in lost for t in planned_tracks(mission, r.vehicle, at)]
    shared = replan(mission, replace(began, tracks=tuple(done)), Changes(lost=lost)).figures["makespan"]
    survivors = tuple(replace(v, share=None) for v in mission.vehicles if v.id not in lost)
    swath = shapely.buffer(shapely.MultiLineString([shapely.LineString(t) for t in done]), SPACING / 2)
    rest = as_multipolygon(mission.site.area.difference(swath).buffer(-SPACING / 4).buffer(SPACING / 4))
    new = Scenario("rest", mission.frame, replace(mission.site, areas=(Area("a", rest),)), survivors, spacing=SPACING)
    try:
        anew = (cover if mission.method == "stc" else plan_lines)(new).figures["makespan"]
    except InputError:
        anew = np.inf
    runs = [run for r in mission.routes for run in unbroken(r.xyz[:, :2], r.survey)]
    left = [part for parts in remaining_parts(runs, progress.tracks, SPACING / 4) for part in parts]
    work = sum(track_length(t) for t in left)
    starts, homes = (np.array([getattr(v, end) for v in after.vehicles]) for end in ("start", "home"))
    corners = np.concatenate([*left, starts])
    away = np.linalg.norm(corners[:, None] - starts, axis=2) + np.linalg.norm(corners[:, None] - homes, axis=2)
    speed = np.array([v.speed for v in after.vehicles])
    alone = np.linalg.norm(homes - starts, axis=1) / speed
    bound = max(work / speed.sum(), (away / speed).min(axis=1).max(), alone.max())
    # Everyone may be home, with nothing left to do.
    return total / max(min(shared, anew), at), max(after.figures["makespan"], 1e-9) / max(bound, 1e-9)


def planned_tracks(mission: Mission, vehicle: str, at: float) -> tuple[np.ndarray, ...]:
    """Return the lines that one vehicle has surveyed by a time."""
    others = {v.id: 0.0 for v in mission.vehicles if v.id != vehicle}
    return planned_progress(mission, at, stopped=others).tracks


def _guards(mission: Mission, at: float, lost: frozenset[str]) -> tuple[float, float]:
    """Return the same ratios for guards."""
    after = replan(mission, planned_progress(mission, at), Changes(lost=lost))
    known: Progress = planned_progress(mission, at, stopped={v.id: 0.0 for v in mission.vehicles if v.id not in lost})
    survivors = tuple(v for v in mission.vehicles if v.id not in lost)
    start = Scenario("start", mission.frame, mission.site, survivors)
    clairvoyant = guards_from_now(mission, start, known.served, effort=1.0).figures["makespan"]
    makespan = after.figures["makespan"]
    alone = max(float(np.hypot(*np.subtract(v.home, v.start))) / v.speed for v in after.vehicles)
    return (at + makespan) / max(clairvoyant, at), makespan / max(after.bounds["makespan"], alone, 1e-9)


def main() -> None:
    """Parse the command line, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=200, help="losses for each of stc, lines and guards")
    parser.add_argument("--only", choices=["speed", "stc", "lines", "guards"], action="append", help="repeatable")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    chosen = options.only or ["speed", "stc", "lines", "guards"]
    told: dict[str, Any] = {"speed": speeds()} if "speed" in chosen else {}
    told["regret"] = [regrets(method, options.cases) for method in ("stc", "lines", "guards") if method in chosen]
    if options.json:
        print(json.dumps(told, indent=2))
        return
    if "speed" in told:
        print("| replan | CPU s, median | worst | asked for |\n|---|---|---|---|")
    for row in told.get("speed", []):
        print(f"| {row['what']} | {row['median_s']:.3f} | {row['worst_s']:.3f} | {row['target_s']:g} |")
    if told["regret"]:
        print("\n| method | cases | over the clairvoyant: median | 90 % | worst | over the bound: median | 90 % | worst |")
        print("|---|---|---|---|---|---|---|---|")
    for row in told["regret"]:
        ratios = [f"{row[f'{of}_{q}']:.3f}" for of in ("clairvoyant", "bound") for q in ("median", "p90", "worst")]
        print(f"| {row['method']} | {row['cases']} | {' | '.join(ratios)} |")


if __name__ == "__main__":
    main()
