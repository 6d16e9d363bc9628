"""Min-max multiple travelling salesmen, one instance: `python benchmarks/assignment.py INSTANCE.json --salesmen 3 --json`.

INSTANCE.json holds `coords` (n, 2); distances are Euclidean in floating point, the depot is city 0. `--time-limit` counts
CPU seconds of this process, so that a figure is honest on a busy machine; compilation apart. `--solver` is ours, pyvrp
(its longest route shrunk step by step) or ortools (guided local search with a span cost, its documentation's recipe).

`--table` runs all instances of `--data` with 2, 3, 5 and 7 salesmen: ours at 1 s and 5 s, the others at 5 s; it prints the
gaps to the references in its bks_small16.json, medians of `--seeds` seeds, in percent.
"""

import argparse
import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

Tours = list[list[int]]
SCALE = 10  # the others count in whole numbers: tenths; a finer scale made PyVRP's limits harder to meet
SHRINK = 0.998  # of its longest route, PyVRP's next limit; the least step was worse


def ours(distance: np.ndarray, salesmen: int, limit: float, seed: int) -> Tours:
    """Our search."""
    from quarterdeck.mission.tours.search import search

    found = search(_problem(distance, salesmen), iterations=None, time_limit=limit, seed=seed, clock=time.process_time)
    return [[task + 1 for task in row] for row in found.rows]


def _problem(distance: np.ndarray, salesmen: int):  # type: ignore[no-untyped-def]
    from quarterdeck.mission.tours.problem import problem

    out = np.tile(distance[0, 1:], (salesmen, 1))
    return problem(distance[1:, 1:], out, out)


def pyvrp(distance: np.ndarray, salesmen: int, limit: float, seed: int) -> Tours:
    """PyVRP minimises the total; the longest route's limit is lowered below the longest found until time is up."""
    import pyvrp as library

    until = time.process_time() + limit
    best: Tours = [list(range(1, len(distance)))] + [[] for _ in range(salesmen - 1)]
    longest = round(SCALE * 10 * distance.max() * len(distance))
    whole = np.rint(distance * SCALE).astype(np.int64)

    class Stop:
        def __init__(self) -> None:
            self.found = False

        def __call__(self, cost: float) -> bool:
            self.found = cost < 2**50
            return self.found or time.process_time() >= until

    while time.process_time() < until:
        clients = [library.Client(i) for i in range(1, len(distance))]
        data = library.ProblemData(
            locations=[library.Location(0, 0) for _ in range(len(distance))],
            clients=clients,
            depots=[library.Depot(0)],
            vehicle_types=[library.VehicleType(salesmen, max_distance=longest)],
            distance_matrices=[whole],
            duration_matrices=[np.zeros_like(whole)],
        )
        result = library.solve(data, stop=Stop(), seed=seed, display=False, collect_stats=False)
        if not result.is_feasible():
            break
        tours = [[a.idx + 1 for a in route if a.is_client()] for route in result.best.routes()]
        best = tours + [[] for _ in range(salesmen - len(tours))]
        longest = int(SHRINK * SCALE * makespan(distance, best))
    return best


def ortools(distance: np.ndarray, salesmen: int, limit: float, seed: int) -> Tours:  # noqa: ARG001 - it has no seed
    """OR-Tools' routing library: guided local search, span coefficient 100."""
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2

    until = time.process_time() + limit
    manager = pywrapcp.RoutingIndexManager(len(distance), salesmen, 0)
    routing = pywrapcp.RoutingModel(manager)
    whole = np.rint(distance * SCALE).astype(np.int64).tolist()
    callback = routing.RegisterTransitCallback(lambda i, j: whole[manager.IndexToNode(i)][manager.IndexToNode(j)])
    routing.SetArcCostEvaluatorOfAllVehicles(callback)
    routing.AddDimension(callback, 0, 10**15, True, "distance")
    routing.GetDimensionOrDie("distance").SetGlobalSpanCostCoefficient(100)
    parameters = pywrapcp.DefaultRoutingSearchParameters()
    parameters.first_solution_strategy = routing_enums_pb2.FirstSolutionStrategy.PATH_CHEAPEST_ARC
    parameters.local_search_metaheuristic = routing_enums_pb2.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
    parameters.time_limit.FromSeconds(int(20 * limit + 1))  # wall clock: the real limit is below
    routing.AddSearchMonitor(routing.solver().CustomLimit(lambda: time.process_time() >= until))
    answer = routing.SolveWithParameters(parameters)
    tours = []
    for vehicle in range(salesmen):
        index, tour = routing.Start(vehicle), []
        while not routing.IsEnd(index):
            if manager.IndexToNode(index):
                tour.append(manager.IndexToNode(index))
            index = answer.Value(routing.NextVar(index))
        tours.append(tour)
    return tours


SOLVERS: dict[str, Callable[[np.ndarray, int, float, int], Tours]] = {"ours": ours, "pyvrp": pyvrp, "ortools": ortools}


def makespan(distance: np.ndarray, tours: Tours) -> float:
    """Return the length of the longest tour from the depot and back."""
    return max(float(sum(distance[a, b] for a, b in zip([0, *t], [*t, 0], strict=True))) for t in tours)


def run(coords: np.ndarray, salesmen: int, limit: float, seed: int, solver: str) -> dict[str, object]:
    """Return the figures of one run; every city is checked to be in one tour."""
    distance = np.linalg.norm(coords[:, None] - coords, axis=2)
    if solver == "ours":
        ours(distance[:6, :6], 2, 0.0, 0)  # compiles
    began = time.process_time(), time.perf_counter()
    tours = SOLVERS[solver](distance, salesmen, limit, seed)
    took = time.process_time() - began[0], time.perf_counter() - began[1]
    if sorted(c for t in tours for c in t) != list(range(1, len(coords))):
        raise RuntimeError(f"{solver} did not visit every city once")
    return {
        "solver": solver,
        "salesmen": salesmen,
        "makespan": makespan(distance, tours),
        "tours": tours,
        "cpu_seconds": round(took[0], 3),
        "seconds": round(took[1], 3),
    }


def table(data: Path, seeds: int, plans: Sequence[tuple[str, float]]) -> dict[str, object]:
    """Return the gaps of every plan (solver, seconds) on every instance, in percent of the reference."""
    rows = {}
    for entry in json.loads((data / "bks_small16.json").read_text()):
        coords = np.array(json.loads((data / f"{entry['instance']}.json").read_text())["coords"], dtype=float)
        gaps = {}
        for solver, limit in plans:
            found = [run(coords, entry["m"], limit, seed, solver)["makespan"] for seed in range(seeds)]
            gaps[f"{solver} {limit:g} s"] = round(100 * (float(np.median(found)) / entry["reference"] - 1), 3)  # type: ignore[arg-type]
        rows[f"{entry['instance']} m={entry['m']}"] = gaps
    names = [f"{solver} {limit:g} s" for solver, limit in plans]
    columns = {name: np.array([row[name] for row in rows.values()]) for name in names}
    return {
        "gap_percent": rows,
        "mean": {name: round(float(c.mean()), 3) for name, c in columns.items()},
        "worst": {name: round(float(c.max()), 3) for name, c in columns.items()},
        "seeds": seeds,
    }


def main() -> None:
    """Read the arguments and print JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("instance", type=Path, nargs="?")
    parser.add_argument("--salesmen", type=int, default=3)
    parser.add_argument("--time-limit", type=float, default=5.0, help="CPU seconds")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--solver", choices=list(SOLVERS), default="ours")
    parser.add_argument("--json", action="store_true", help="print one line, tours too")
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--data", type=Path, default=Path(__file__).parents[2] / "shared" / "data" / "mtsp")
    parser.add_argument("--plans", default="ours:1,ours:5,pyvrp:5,ortools:5", help="SOLVER:SECONDS, ... of the table")
    given = parser.parse_args()
    if given.table:
        plans = [(p.split(":")[0], float(p.split(":")[1])) for p in given.plans.split(",")]
        print(json.dumps(table(given.data, given.seeds, plans), indent=1))
        return
    if given.instance is None:
        parser.error("give INSTANCE.json, or --table")
    coords = np.array(json.loads(given.instance.read_text())["coords"], dtype=float)
    figures = {"instance": given.instance.stem} | run(coords, given.salesmen, given.time_limit, given.seed, given.solver)
    if given.json:
        print(json.dumps(figures))
    else:
        print(json.dumps({k: v for k, v in figures.items() if k != "tours"}, indent=1))


if __name__ == "__main__":
    main()
