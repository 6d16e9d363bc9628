"""`quarterdeck reproduce guards`: the figures, properties, theorems and complexities of fault-tolerant-cdt, on our maps.

The paper has no table of results and prints its environment as a picture alone, so there are no numbers to match: what can
be checked is what it claims.
"""

import json
import time
from itertools import permutations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from shapely import MultiPolygon

STATED = {
    "guards": "O(n^2 log n^2)",
    "representation": "O((n+m)^3)",
    "multi-prims": "O(R (n'+m) log(n'+m))",
    "cst": "O(R (n'+m)^2)",
}
SIZES = (100, 200, 400, 800)
NOTES = """\
Follows the paper: its properties and theorems, whatever the order of losses.
Does not follow: Lemma 1 as printed. A link of the reduced graph may run through vertices that no tree has, and Definition 1
  counts no bridge there; counted by paths free of guards, every tree has one. Its map is printed as a picture and its
  results not at all, so there are no numbers to match: the room is ours. Table I states worst cases, which smaller
  exponents do not contradict."""


@click.command(short_help="Limited visibility, any failures: figures, properties, theorems, complexities.")
@click.argument("maps", nargs=-1, type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--range", "reach", default=20.0, show_default=True, type=click.FloatRange(min=0, min_open=True),
              help="Metres that a robot sees.")  # fmt: skip
@click.option("--robots", default=3, show_default=True, type=click.IntRange(min=2, max=10), help="Robots; the first fails.")
@click.option("-o", "--output", type=click.Path(path_type=Path), help="A PNG file for the counterparts of Figs 1 to 5.")
@click.option("--force", is_flag=True, help="Overwrite it.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of tables.")
def command(maps: tuple[Path, ...], reach: float, robots: int, output: Path | None, force: bool, as_json: bool) -> None:
    """Check the claims of the guards paper on MAPS (GeoJSON in metres; default a room like its own); draw its figures."""
    from quarterdeck.geo.scenario import as_multipolygon
    from quarterdeck.reproduce.guard_maps import ROOM, read_map

    rooms = {path.stem: read_map(path) for path in maps} or {"room": as_multipolygon(ROOM)}
    claims = [check_claims(name, room, reach, robots) for name, room in rooms.items()]
    complexity = measured_complexity()
    if output is not None:
        from quarterdeck.geo.files import write_file
        from quarterdeck.reproduce.guard_figures import figures

        write_file(output, figures(next(iter(rooms.values())), reach, robots), force=force)
    if as_json:
        click.echo(json.dumps({"claims": claims, "complexity": complexity}))
        return
    for claim in claims:
        click.echo(f"{claim['map']}: {claim['guards']} guards at {reach:g} m, {robots} robots")
        for words in claim["lines"]:
            click.echo(f"  {words}")
    click.echo(f"Table I, CPU time over {', '.join(map(str, SIZES))} vertices, fitted exponent")
    for row in complexity:
        stated, measured = f"stated {row['stated']:<24}", f"measured n^{row['exponent']:.2f}"
        click.echo(f"  {row['stage']:<16} {stated} {measured}  ({row['seconds']} s)")
    click.echo(NOTES)


def check_claims(name: str, room: "MultiPolygon", reach: float, robots: int) -> dict[str, Any]:
    """Return what holds of Properties 1 and 2, Lemma 1 and Theorems 1 and 2 on a map."""
    import numpy as np

    from quarterdeck.coverage.cst import constrained_tour, doubled, revised_tour, tour_length
    from quarterdeck.coverage.guards.certificate import uncovered_by_shadows
    from quarterdeck.coverage.recovery import printed_supportive
    from quarterdeck.reproduce.guard_maps import paper_network, scenario_on

    starts = scenario_on(room, robots).starts
    net = paper_network(room, reach, starts)
    points, forest = net.cdt.points, net.forest
    lengths = []
    for robot in range(robots):
        tours = (
            revised_tour(forest.parents[robot], forest.chosen[robot], points),
            constrained_tour(forest.parents[robot], forest.chosen[robot], net.cdt),
            doubled(forest.parents[robot], points),
        )
        lengths.append([tour_length(tour, points) for tour in tours])
    revised, cst, double = np.array(lengths).T
    first = (revised <= cst + 1e-9).all() and (cst <= double + 1e-9).all()
    access = max(float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum()) for way in net.access)
    unseen = uncovered_by_shadows(room, room, points[net.guards], np.full(len(net.guards), reach)).area
    visited = {v for robot in range(robots) for v in constrained_tour(forest.parents[robot], forest.chosen[robot], net.cdt)}
    alone = [r for r in range(robots) if not printed_supportive(net.reduced, forest, np.arange(robots) == r)]
    orders = list(permutations(range(robots)))[:120]
    kept = sum(_survives(net, order) for order in orders)
    bound, driven = 2 * net.reduced.weight, cst.max() + 2 * access
    order = f"longest {revised.max():.1f}, {cst.max():.1f}, {double.max():.1f} m"
    within = f"longest tour {cst.max():.1f} m, 2 weight(G) = {bound:.1f} m; with the ways to the graph {driven:.1f} m"
    missed = len(set(net.guards.tolist()) - visited)
    lines = [
        f"Property 1  Revised-DMST <= CST <= Double-MST over guards: {'holds' if first else 'FAILS'}; {order}",
        f"Property 2  {'holds' if cst.max() <= bound else 'FAILS'}: {within}",
        f"Lemma 1     as printed: {len(alone)} of {robots} trees have no supportive tree; by guard-free paths: none",
        f"Theorem 1   all orders of {robots - 1} losses, {len(orders)} tried: {kept} leave no guard unowned",
        f"Theorem 2   unseen {unseen:.3g} of {room.area:.1f} m2; guards on no tour: {missed}",
    ]
    return {"map": name, "guards": len(net.guards), "lines": lines, "orders": len(orders), "orders_kept": kept,
            "property_1": bool(first), "unseen": unseen, "without_bridge_as_printed": len(alone)}  # fmt: skip


def _survives(net: Any, order: tuple[int, ...]) -> bool:
    """Whether the last robot owns every guard when the others are lost in this order."""
    import numpy as np

    from quarterdeck.coverage.recovery import recover

    forest, lost = net.forest, np.zeros(len(order), dtype=np.bool_)
    nothing = np.zeros(len(net.cdt.points), dtype=np.bool_)
    for robot in order[:-1]:
        lost[robot] = True
        forest = recover(net.reduced, net.guards, forest, seen=nothing, lost=lost).forest
    return set(forest.chosen[order[-1]].tolist()) >= set(net.guards.tolist())


def measured_complexity() -> list[dict[str, Any]]:
    """Return CPU seconds of each stage over rooms of growing size, and the exponent of n that fits."""
    import numpy as np

    from quarterdeck.coverage.cst import constrained_tour
    from quarterdeck.coverage.forest import multi_prims
    from quarterdeck.coverage.graph import graph_of
    from quarterdeck.coverage.guards.pieces import paper_guards
    from quarterdeck.coverage.guards.space import Space
    from quarterdeck.coverage.reduced import reduced_cdt
    from quarterdeck.geo.triangulation import triangulate
    from quarterdeck.reproduce.guard_maps import random_room

    seconds: dict[str, list[float]] = {stage: [] for stage in STATED}
    for size in (SIZES[0], *SIZES):  # the first run compiles
        room = random_room(size, seed=0)
        times = [time.process_time()]
        guards = paper_guards(Space(room, room, room), 20.0)
        times.append(time.process_time())
        mesh = triangulate(room, guards)
        cdt = graph_of(mesh.vertices, mesh.edges)
        reduced = reduced_cdt(cdt, mesh.points)
        times.append(time.process_time())
        forest = multi_prims(reduced, mesh.points, mesh.points[:3])
        times.append(time.process_time())
        for robot in range(3):
            constrained_tour(forest.parents[robot], forest.chosen[robot], cdt)
        times.append(time.process_time())
        for stage, used in zip(STATED, np.diff(times).tolist(), strict=True):
            seconds[stage].append(used)
    rows = []
    for stage, all_used in seconds.items():
        warm = all_used[1:]
        exponent = float(np.polyfit(np.log(SIZES), np.log(np.maximum(warm, 1e-6)), 1)[0])
        shown = ", ".join(f"{s:.3f}" for s in warm)
        rows.append({"stage": stage, "stated": STATED[stage], "exponent": round(exponent, 2), "seconds": shown})
    return rows
