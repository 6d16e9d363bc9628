"""Random missions with random faults, recovered live in PyBullet: `python benchmarks/missions.py --cases 1000`.

Each case (`random_missions.py`) is judged by what was driven, not by what the director believes: nobody touches anything,
all that was planned is covered, seen or served but what the last plan tells of, all who work come home with what
the battery holds. A case that fails is told with the command that replays it: `python benchmarks/missions.py --seed N`.
"""

import argparse
import json
import runpy
import time
import traceback
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from scipy.spatial import cKDTree

from quarterdeck.mission.mission import Mission
from quarterdeck.mission.recovery import recovering, undone
from quarterdeck.mission.routes import survey_tracks
from quarterdeck.physics.paths import LEGS
from quarterdeck.physics.seen import seen_fraction, whole_tracks
from quarterdeck.physics.simulate import Run, simulate

_cases = runpy.run_path(str(Path(__file__).with_name("random_missions.py")))
draw_case, Case = _cases["draw_case"], _cases["Case"]
UNSEEN = 0.005  # of what guards were to see: tracks cut corners


@dataclass
class Watched:
    """What the director heard and told in a run, and what it told in the fast world."""

    served: Counter[str] = field(default_factory=Counter)
    order: list[str] = field(default_factory=list)
    plans: list[tuple[float, Mission]] = field(default_factory=list)
    undone: tuple[str, ...] = ()
    undone_fast: tuple[str, ...] = ()
    ends: dict[str, tuple[float, float]] = field(default_factory=dict)  # of the last commands that were heard


def run_case(case: Any) -> tuple[Run, Watched]:
    """Run a case in PyBullet under the director that recovers."""
    watched = Watched()
    director = recovering(case.mission, delay=case.delay, tell=lambda t, m: watched.plans.append((t, m)))
    fast = recovering(case.mission, delay=case.delay)

    def listening(now: float, states: Any, events: Any, memory: Any) -> Any:
        for event in events:
            if event.kind == "served":
                watched.served[event.subject] += 1
                watched.order.append(event.subject)
        commands, after = director(now, states, events, memory)
        heard = {v: c.waypoints[-1] for v, c in commands.items() if c.waypoints and states[v].alive}
        watched.ends |= {v: (w.x, w.y) for v, w in heard.items()}
        watched.undone = undone(after)
        return commands, after

    def expected(now: float, states: Any, events: Any, memory: Any) -> Any:
        commands, after = fast(now, states, events, memory)
        watched.undone_fast = undone(after)
        return commands, after

    total = sum(r.duration for r in case.mission.routes)
    run = simulate(
        case.mission,
        director=listening,
        expected=expected,
        seed=case.seed,
        current=case.current,
        faults=[str(f) for f in case.faults],
        duration=4.0 * total + 40.0 * case.delay + 1200.0,
    )
    return run, watched


def judge(case: Any, run: Run, watched: Watched) -> list[str]:
    """Return what is wrong with a run, a line each."""
    mission, report = case.mission, run.report
    lost = {f.vehicle for f in case.faults if f.kind == "lost"} | {
        v.id for v in report.vehicles if v.aground and not v.hits
    }
    silent = {f.vehicle for f in case.faults if f.kind == "comms" and f.end == float("inf")}
    last = watched.plans[-1][1] if watched.plans else mission
    moved = {
        v.id: v.home for v in last.vehicles for _, p in watched.plans if f"{v.id}: its end is in" in "\n".join(p.reasons)
    }
    wrong = []
    for i, v in enumerate(report.vehicles):
        vehicle = mission.vehicles[i]
        if (v.touched or v.hits) and v.id not in lost:
            wrong.append(f"{v.id} collided: {', '.join(v.hits) or 'a vehicle'}")
        if v.id in lost:
            continue
        if v.separation is not None and v.separation < 0:
            wrong.append(f"{v.id} overlapped {v.separation_vehicle} at {v.separation_time:.0f} s")
        # Who is never heard again does what it was told last: it may wait where it was to hear of others.
        home = watched.ends.get(v.id, vehicle.home) if v.id in silent else moved.get(v.id, vehicle.home)
        away = np.hypot(run.trace.x[-1, i] - home[0], run.trace.y[-1, i] - home[1])
        blind = 5.0 if any(f.kind == "gnss" for f in case.faults) else 0.0  # m: receivers have errors then
        if not v.finished or away > 4.0 * vehicle.model.length + blind:
            wrong.append(f"{v.id} is {away:.1f} m from home at the end" + (", not done" if not v.finished else ""))
        if v.energy > vehicle.battery:
            wrong.append(f"{v.id} used {v.energy:.1f} Wh of {vehicle.battery:.1f} Wh")
    wrong += [line for line in watched.undone if line.startswith("no new plan")]
    if lost | silent != {v.id for v in mission.vehicles} and not last.reasons and not watched.undone:
        wrong += _undone(mission, run, watched, last, any(f.kind == "comms" for f in case.faults))
    return wrong


def _undone(mission: Mission, run: Run, watched: Watched, last: Mission, unheard: bool) -> list[str]:
    """Return what was planned, not done and not told of; where somebody was `unheard` a task may be done twice."""
    if mission.method == "guards":
        before = seen_fraction(mission, [shapely.LineString(r.xyz[:, :2]) for r in mission.routes if len(r.waypoints) > 1])
        after = seen_fraction(mission, whole_tracks(run.trace, 0.02))
        return [f"saw {after:.2%} of {before:.2%}"] if after < before - UNSEEN else []
    if mission.method == "assign":
        twice = [t for t, n in watched.served.items() if n > 1]
        undone = [t.id for t in mission.tasks if t.id not in watched.served]
        place = {t: i for i, t in enumerate(watched.order)}
        early = [
            f"{t.id} before {a.task}"
            for t in mission.tasks
            for a in t.after
            if t.id in place and place.get(a.task, len(place)) > place[t.id]
        ]
        wrong = [f"not served: {', '.join(undone)}"] if undone else []
        excused = {line.split("'")[1] for line in watched.undone_fast if line.startswith("task '")}
        slow = [t.id for t in run.report.tasks if t.fast is None and t.id not in excused]
        wrong += [f"not served in the fast world: {', '.join(slow)}"] if slow else []
        wrong += [f"served twice: {', '.join(twice)}"] if twice and not unheard else []
        return wrong + ([f"served {', '.join(early)}"] if early and not unheard else [])
    spacing = float(mission.spacing or 0.0)
    surveying = run.trace.kind == LEGS.index("survey")
    driven = np.column_stack([run.trace.x[surveying], run.trace.y[surveying]])
    step = spacing / 10
    planned = [t for v, r in zip(mission.vehicles, mission.routes, strict=True) for t in survey_tracks(v, r) if len(t) > 1]
    # GEOS cannot segmentize a line of no length: of a crumb of an area, or where corners are rounded.
    lines = [line if line.length == 0 else shapely.segmentize(line, step) for line in map(shapely.LineString, planned)]
    places = shapely.get_coordinates(lines)
    if len(driven):
        places = places[cKDTree(driven).query(places)[0] > 0.5 * spacing]
    wrecks = shapely.union_all([o.polygon for o in last.site.obstacles if o.id.startswith("wreck")])
    far = max(v.clearance for v in mission.vehicles) + spacing
    places = places[~shapely.contains_xy(wrecks.buffer(far), *places.T)] if wrecks.area else places
    pieces = shapely.union_all(shapely.buffer(shapely.points(places), step))
    found = [p for p in getattr(pieces, "geoms", [pieces]) if np.subtract(p.bounds[2:], p.bounds[:2]).max() > spacing]
    return [f"not driven: {p.area / 2 / step:.0f} m at {p.centroid.x:.1f}, {p.centroid.y:.1f}" for p in found[:5]]


def attempt(seed: int) -> dict[str, Any]:
    """Run and judge the case of a seed; an exception is a failure too."""
    began = time.process_time()
    row: dict[str, Any] = {"seed": seed}
    try:
        case = draw_case(seed)
        row |= {"kind": case.kind, "domain": case.domain, "vehicles": len(case.mission.vehicles)}
        row |= {"faults": " ".join(map(str, case.faults)), "lost": sum(f.kind == "lost" for f in case.faults)}
        row["planned"] = round(time.process_time() - began, 2)
        run, watched = run_case(case)
        row |= {"replans": len(watched.plans), "told": list(watched.plans[-1][1].reasons) if watched.plans else []}
        row["wrong"] = judge(case, run, watched)
        row["simulated"] = round(float(run.trace.time[-1]), 1)
    except Exception:  # whatever it is, it is what we look for
        row["wrong"] = [traceback.format_exc()]
    return row | {"seconds": round(time.process_time() - began, 2)}


def main() -> None:
    """Run cases and print what came of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--seed", type=int, help="replay the case of this seed alone, and tell all of it")
    parser.add_argument("--json", action="store_true", help="a JSON line for each case")
    args = parser.parse_args()
    if args.seed is not None:
        print(json.dumps(attempt(args.seed), indent=2).replace("\\n", "\n"))
        return
    rows = []
    for seed in range(args.first, args.first + args.cases):
        row = attempt(seed)
        rows.append(row)
        if args.json:
            print(json.dumps(row), flush=True)
        elif row["wrong"]:
            print(f"python benchmarks/missions.py --seed {seed}: {'; '.join(row['wrong'])[-600:]}", flush=True)
    print(_table(rows))


def _table(rows: list[dict[str, Any]]) -> str:
    lines = [
        "| missions | runs | vehicles | lost | replans | plans that tell what is left | failed | CPU s |",
        "|" + "---|" * 8,
    ]
    groups = {"all": rows} | {
        f"{k} {d}": [r for r in rows if (r.get("kind"), r.get("domain")) == (k, d)]
        for k, d in sorted({(r["kind"], r["domain"]) for r in rows if "kind" in r})
    }
    for name, group in groups.items():
        total = [sum(r.get(key, 0) for r in group) for key in ("vehicles", "lost", "replans")]
        told, failed = sum(bool(r.get("told")) for r in group), sum(bool(r["wrong"]) for r in group)
        seconds = sum(r["seconds"] for r in group)
        lines.append(
            f"| {name} | {len(group)} | {total[0]} | {total[1]} | {total[2]} | {told} | {failed} | {seconds:.0f} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
