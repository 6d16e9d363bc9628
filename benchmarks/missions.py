"""Random missions with random faults, recovered live in PyBullet: `python benchmarks/missions.py --cases 1000`.

Each case (`random_missions.py`) is judged by what was driven, not by what is believed (`mission_judge.py`): nobody touches
anything; all that was planned is covered, seen or served, but what the last plan tells of and nobody had the energy for;
every casualty that was reported is treated; all who work come home. A case that fails is told with the command that replays
it: `python benchmarks/missions.py --seed N`. Seeds from 1000 on draw triage drills and messages within range too.
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

from quarterdeck.mission.mission import Mission
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.recovery import recovering
from quarterdeck.mission.recovery_memory import undone
from quarterdeck.mission.triage.plan import METHOD
from quarterdeck.physics.simulate import Run, simulate

draw_case = runpy.run_path(str(Path(__file__).with_name("random_missions.py")))["draw_case"]
judge = runpy.run_path(str(Path(__file__).with_name("mission_judge.py")))["judge"]


@dataclass
class Watched:
    """What the director heard and told in a run, and its plans in the fast world."""

    served: Counter[str] = field(default_factory=Counter)
    order: list[str] = field(default_factory=list)
    plans: list[tuple[float, Mission]] = field(default_factory=list)
    undone: tuple[Reason, ...] = ()
    fast: list[Mission] = field(default_factory=list)
    ends: dict[str, tuple[float, float]] = field(default_factory=dict)  # of the last commands that were heard


def run_case(case: Any) -> tuple[Run, Watched]:
    """Run a case in PyBullet under the director that recovers."""
    watched = Watched()
    director = recovering(case.mission, delay=case.delay, tell=lambda t, m: watched.plans.append((t, m)))
    fast = recovering(case.mission, delay=case.delay, tell=lambda _, m: watched.fast.append(m))

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

    total = sum(r.duration for r in case.mission.routes)
    run = simulate(
        case.mission,
        director=listening,
        expected=fast,
        seed=case.seed,
        current=case.current,
        faults=[str(f) for f in case.faults],
        terrain=case.terrain,
        duration=None if case.mission.method == METHOD else 4.0 * total + 40.0 * case.delay + 1200.0,
    )
    return run, watched


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
        told = watched.plans[-1][1].reasons if watched.plans else run.triage.driven.reasons if run.triage else ()
        row |= {"replans": len(watched.plans), "told": list(map(str, told))}
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
