"""Both patterns on the sample sites: `python benchmarks/patterns.py` prints a Markdown table, `--json` the figures.

What is compared is the whole mission: everything driven from the start and home, with its turns.
"""

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from quarterdeck.api import plan, read_scenario
from quarterdeck.coverage.metrics import count_turns

DATA = Path(__file__).parents[1] / "data"
SITES = ("dalian_harbour", "farm_survey", "plant_yard", "west_ant_island")
PATTERNS: dict[str, dict[str, Any]] = {
    "stc": {"method": "stc"},
    "lines": {"method": "lines"},
    "lines --alternate 2": {"method": "lines", "alternate": 2},
    "lines --lap": {"method": "lines", "lap": True},
}


def compared(site: str, options: dict[str, Any], turn_radius: float | None) -> dict[str, Any]:
    """Return a plan's figures: coverage, kilometres, corners at waypoints, seconds, watt-hours, CPU seconds."""
    scenario = read_scenario(DATA / f"{site}.geojson")
    if turn_radius is not None:
        scenario = replace(scenario, vehicles=tuple(replace(v, turn_radius=turn_radius) for v in scenario.vehicles))
    began = time.process_time()
    mission = plan(scenario, **options)
    took = time.process_time() - began
    driven = sum(route.length for route in mission.routes)
    return {
        "coverage": mission.figures["poc"],
        "survey_km": mission.figures["length"] / 1000,
        "driven_km": driven / 1000,
        "corners": sum(count_turns(route.xyz[:, :2]) for route in mission.routes),
        "makespan_s": mission.figures["makespan"],
        "energy_wh": mission.figures["energy"],
        "feasible": mission.feasible,
        "cpu_s": took,
    }


def main() -> None:
    """Parse the command line, plan, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--turn-radius", type=float, help="metres, instead of every vehicle's own")
    parser.add_argument("--site", choices=SITES, action="append", help="only this; repeatable")
    options = parser.parse_args()
    figures = {
        site: {name: compared(site, given, options.turn_radius) for name, given in PATTERNS.items()}
        for site in options.site or SITES
    }
    if options.json:
        print(json.dumps(figures, indent=2))
        return
    print("| site | pattern | coverage % | survey km | driven km | corners | makespan s | energy Wh | feasible |")
    print("|---|---|---|---|---|---|---|---|---|")
    for site, rows in figures.items():
        for name, f in rows.items():
            print(f"| {site} | {name} | {100 * f['coverage']:.2f} | {f['survey_km']:.2f} | {f['driven_km']:.2f} "
                  f"| {f['corners']} | {f['makespan_s']:,.0f} | {f['energy_wh']:,.0f} "
                  f"| {'yes' if f['feasible'] else 'no'} |")  # fmt: skip


if __name__ == "__main__":
    main()
