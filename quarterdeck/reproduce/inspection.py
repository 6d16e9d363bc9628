"""The inspection paper's case studies beside ours: every plan there is, the paper's algorithm, our search; with pictures.

Positions, depots and speed are from the authors' repository (UVA-BezzoRobotics-AMRLab/multi_jackal_amcl), not the
paper. The distances are theirs on their map with --distances, else those of our own hall of like geometry.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    import numpy as np

    from quarterdeck.geo.scenario import Scenario
    from quarterdeck.mission.mission import Mission
    from quarterdeck.mission.tours.problem import Problem

ROBOTS, TASKS = 2, 5
SEEDS = 10  # of the paper's algorithm


@dataclass(frozen=True, slots=True)
class Case:
    """Priorities and service times by task, (first, then) pairs, and the rows that the paper publishes (None: a figure)."""

    priority: dict[int, int] = field(default_factory=dict)
    service: dict[int, float] = field(default_factory=dict)
    after: tuple[tuple[int, int], ...] = ()
    published: tuple[tuple[int, ...], ...] | None = None


CASES = {
    "none": Case(published=((0, 3), (2, 4, 1))),
    "priority": Case(priority={2: 3, 4: 3}, published=((4, 0, 3), (2, 1))),
    "time": Case(service={0: 20, 1: 20, 2: 20, 3: 20, 4: 60}, published=((3, 0, 1), (2, 4))),
    "precedence": Case(after=((1, 2), (0, 4)), published=((3, 0, 4), (1, 2))),
    "mixed": Case(priority={0: 3, 2: 1}, service={4: 30}, after=((1, 3),), published=((0, 1, 3), (2, 4))),
}


@click.command(short_help="Case studies of tasks with priority, time and precedence.")
@click.option("--distances", metavar="FILE.json", help='{"dist": 7 x 7}: tasks 0-4, then the two depots, in metres.')
@click.option("-o", "--output", metavar="FOLDER", help="Write a picture of each case there, on our own hall.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON on standard output.")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(min=0), help="Seed of all that is random.")
@click.option("--force", is_flag=True, help="Overwrite existing files.")
def command(distances: str | None, output: str | None, as_json: bool, seed: int, force: bool) -> None:
    """Compare the paper's published plans with the best of all plans under its eq. 4-6, and with what we find."""
    rows = results(read_distances(distances), seed)
    if as_json:
        click.echo(json.dumps(rows, indent=1))
    else:
        _print(rows, "the authors' map" if distances else "our own hall")
    if output is not None:
        _draw(Path(output), seed, force=force)


def read_distances(source: str | None) -> np.ndarray:
    """Return (7, 7) metres between tasks 0-4 and the two depots, from a file or measured on our own hall.

    Raises InputError if the file is not such a matrix.
    """
    import numpy as np

    from quarterdeck.geo.errors import InputError
    from quarterdeck.mission.travel import travel

    if source is None:
        return travel(hall()).ways[0].steps[:7, :7]
    try:
        matrix = np.array(json.loads(Path(source).read_text(encoding="utf-8"))["dist"], dtype=float)
    except (OSError, ValueError, KeyError, TypeError, ArithmeticError, RecursionError) as error:
        raise InputError(f'{source}: cannot be read ({error}); it must hold {{"dist": 7 x 7 metres}}') from None
    if matrix.shape != (7, 7) or not np.allclose(matrix, matrix.T) or not (matrix >= 0).all():
        raise InputError(f"{source}: dist must be 7 x 7 metres, symmetric and from 0")
    return matrix


def hall() -> Scenario:
    """Return our own site of like geometry."""
    from quarterdeck.geo.reader import read_scenario

    with as_file(files("quarterdeck") / "data" / "inspection_hall.geojson") as path:
        return read_scenario(path)


def results(dist: np.ndarray, seed: int) -> list[dict[str, Any]]:
    """Return each case's figures: fitness of the published plan, of the best of all plans, of the paper's GA and ours."""
    import numpy as np

    from quarterdeck.mission.tours.exact import enumerate_plans
    from quarterdeck.mission.tours.paper import paper_search
    from quarterdeck.mission.tours.schedule import schedule
    from quarterdeck.mission.tours.search import search

    found = []
    for name, case in CASES.items():
        literal, ours = problem_of(case, dist, paper=True), problem_of(case, dist, paper=False)
        _, _, optimum, plans = enumerate_plans(literal)
        start, done = np.empty(TASKS), np.empty(ROBOTS)
        theirs = None
        if case.published is not None:
            seq, length = np.zeros((ROBOTS, TASKS), np.int64), np.array([len(r) for r in case.published])
            for r, row in enumerate(case.published):
                seq[r, : len(row)] = row
            theirs = schedule(literal, seq, length, start, done)[0]
        genetic = [paper_search(literal, seed=s).objective for s in range(seed, seed + SEEDS)]
        mine = search(literal, iterations=10, seed=seed)
        operator = search(ours, iterations=10, seed=seed)
        found.append(
            {
                "case": name,
                "published": case.published,
                "published_fitness": theirs,
                "plans": plans,
                "optimum": optimum,
                "paper_ga": genetic,
                "paper_ga_reached": sum(g <= optimum * (1 + 1e-9) for g in genetic),
                "ours": mine.objective,
                "operator_rows": operator.rows,
                "operator_makespan": float(operator.done.max()),
                "operator_optimal": bool(operator.objective <= enumerate_plans(ours)[2] * (1 + 1e-9)),
            }
        )
    return found


def problem_of(case: Case, dist: np.ndarray, *, paper: bool) -> Problem:
    """Return a case as the search's arrays, at 1 m/s: literally, or with the operator's objective and precedence."""
    import numpy as np

    from quarterdeck.mission.assign import WEIGHTS
    from quarterdeck.mission.tours.problem import problem

    level = np.array([case.priority.get(i, 0) for i in range(TASKS)])
    return problem(
        dist[:TASKS, :TASKS],
        dist[TASKS:, :TASKS],
        dist[TASKS:, :TASKS],
        service=np.array([case.service.get(i, 0.0) for i in range(TASKS)]),
        level=level.astype(float),
        weight=None if paper else np.array(WEIGHTS)[level],
        after=[(a, b, paper) for a, b in case.after],
        paper=paper,
    )


def _print(rows: list[dict[str, Any]], where: str) -> None:
    from rich.console import Console
    from rich.table import Table

    screen = Console(width=124, highlight=False)
    table = Table(title=f"Case studies on {where}: fitness under eq. 4-6, seconds", title_justify="left")
    for column in ("case", "published"):
        table.add_column(column, no_wrap=True)
    for column in ("fitness", "best plan", "paper's GA", "ours"):
        table.add_column(column, justify="right")
    table.add_column("operator's", no_wrap=True)
    table.add_column("makespan", justify="right")
    for row in rows:
        table.add_row(
            row["case"],
            _rows(row["published"]),
            f"{row['published_fitness']:.2f}",
            f"{row['optimum']:.2f}",
            f"{row['paper_ga_reached']} of {SEEDS}",
            f"{row['ours']:.2f}",
            _rows(row["operator_rows"]),
            f"{row['operator_makespan']:.2f}",
        )
    screen.print(table)
    other = [r["case"] for r in rows if abs(r["published_fitness"] - r["optimum"]) > 1e-6]
    screen.print(
        f"{len(rows) - len(other)} of {len(rows)} published plans are the best of all plans under the paper's objective on "
        f"{where}{' (not: ' + ', '.join(other) + ')' if other else ''}; some are tied, so "
        f"compare fitness, not order. The paper's GA is told by how many of {SEEDS} seeds reach the best: under precedence "
        "little may cross over and nothing mutates. The operator's plan counts urgency in seconds, and lets any robot do "
        "what comes after and wait for it; its makespan is real time.",
    )


def _rows(rows: tuple[tuple[int, ...], ...] | None) -> str:
    return " ".join("-".join(map(str, row)) or "." for row in rows or ())


def case_mission(name: str, seed: int, objective: str) -> Mission:
    """Return a case planned on our own hall."""
    from quarterdeck.geo.scenario import Precedence
    from quarterdeck.mission.assign import assign

    case, site = CASES[name], hall()
    tasks = tuple(
        replace(
            task,
            priority=case.priority.get(i, 0),
            service_time=case.service.get(i, 0.0),
            after=tuple(Precedence(site.tasks[a].id) for a, b in case.after if b == i),
        )
        for i, task in enumerate(site.tasks)
    )
    return assign(replace(site, tasks=tasks), objective=objective, seed=seed, iterations=30)  # type: ignore[arg-type]


def _draw(folder: Path, seed: int, *, force: bool) -> None:
    import io

    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib.figure import Figure

    from quarterdeck.geo.files import write_file
    from quarterdeck.geo.palette import colours

    for name, case in CASES.items():
        figure = Figure(figsize=(13, 5.6), layout="tight")
        axes = figure.subplots(1, 2)
        for ax, objective in zip(axes, ("paper", "operator"), strict=True):
            mission = case_mission(name, seed, objective)
            for polygon in mission.site.operating.geoms:
                ax.plot(*polygon.exterior.xy, color="0.4", lw=1)
            for obstacle in mission.site.obstacles:
                ax.fill(*obstacle.polygon.exterior.xy, color="0.75", ec="0.5")
            for route, colour in zip(mission.routes, colours(len(mission.routes)), strict=True):
                x, y = route.xyz[:, 0], route.xyz[:, 1]
                order = "-".join(w.task for w in route.waypoints if w.task) or "stays"
                ax.plot(x, y, color=colour, lw=2, label=f"{route.vehicle}: {order}, home at {route.duration:.0f} s")
                ax.plot(x[0], y[0], "s", color=colour, ms=10, zorder=7)
                for a, b in zip(route.xyz[:-1], route.xyz[1:], strict=True):
                    middle, step = (a + b) / 2, (b - a) * 0.01
                    if abs(step).max() > 0.01:
                        ax.annotate("", (middle + step)[:2], (middle - step)[:2],
                                    arrowprops={"arrowstyle": "-|>", "color": colour})  # fmt: skip
            starts = {v["task"]: v["start"] for v in mission.figures["schedule"]}
            for i, task in enumerate(mission.tasks):
                ax.plot(*task.position, "o", color="white", mec="black", ms=8, zorder=5)
                said = f"{task.id}" + f" p{task.priority}" * bool(task.priority)
                said += f" {task.service_time:.0f} s" * bool(task.service_time)
                said += "".join(f" after t{a}" for a, b in case.after if b == i)
                ax.annotate(
                    f"{said}\nat {starts[task.id]:.0f} s",
                    task.position,
                    (6, 6),
                    textcoords="offset points",
                    fontsize=9,
                    zorder=6,
                    bbox={"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.8},
                )
            ax.set_aspect("equal")
            ax.set_xlabel("east, m")
            ax.set_ylabel("north, m")
            ax.set_title(f"{name}: {'eq. 4-6 of the paper' if objective == 'paper' else 'what the operator wants'}")
            ax.legend(loc="upper left", fontsize=9, ncols=2, bbox_to_anchor=(0.0, -0.1), frameon=False, borderpad=0)
        buffer = io.BytesIO()
        figure.savefig(buffer, dpi=110)
        write_file(folder / f"inspection_{name}.png", buffer.getvalue(), force=force)
        click.echo(f"wrote {folder / f'inspection_{name}.png'}", err=True)
