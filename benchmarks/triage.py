"""Time triage studies: `python benchmarks/triage.py [--cases 1000] [--jobs 2]`; one JSON object on stdout.

All four methods on the same seeded cases (3 UGVs, 8 to 14 casualties, 80 x 50 m, no obstacles). `seconds` is wall time of
the study with `--jobs` processes; `cpu_seconds` is what it costs in one process, compilation and imports apart, from
`--sample` cases of each method; `cpu_minute_cores` is how many cores the study needs to be done within a minute.
"""

import argparse
import json
import time

from quarterdeck.mission.triage.settings import METHODS
from quarterdeck.mission.triage.study import Variant, run_case, run_study


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--sample", type=int, default=100)
    arguments = parser.parse_args()
    variants = {m: Variant(m) for m in METHODS}
    for variant in variants.values():  # compile, and divide the field, once
        run_case(variant, 0)
    milliseconds = {}
    for name, variant in variants.items():
        start = time.process_time()
        for seed in range(arguments.sample):
            run_case(variant, seed)
        milliseconds[name] = 1000.0 * (time.process_time() - start) / arguments.sample
    start = time.perf_counter()
    results = run_study(variants, range(arguments.cases), jobs=arguments.jobs)
    seconds = time.perf_counter() - start
    cpu = arguments.cases * sum(milliseconds.values()) / 1000.0
    print(
        json.dumps(
            {
                "cases": arguments.cases,
                "methods": len(variants),
                "jobs": arguments.jobs,
                "seconds": round(seconds, 2),
                "cpu_seconds": round(cpu, 2),
                "cpu_minute_cores": round(cpu / 60.0, 3),
                "cpu_milliseconds_a_mission": {k: round(v, 3) for k, v in milliseconds.items()},
                "complete": all(bool(r["complete"].all()) for r in results.values()),
            },
            indent=1,
        )
    )


if __name__ == "__main__":
    main()
