"""Certificates and Reduced-CDTs in bulk: `python benchmarks/guard_proofs.py --rooms 1000 --graphs 10000 --json`.

Rooms are squares less random triangles, their largest part; guards are the paper's, pruned. The uncovered part is found by
shadows, which share nothing with the planner's own way. Graphs are Delaunay graphs of random points, their Reduced-CDT
weighed against Algorithm 1 as it is printed: Floyd-Warshall first, then one guard after the other.
"""

import argparse
import json
import time

import numpy as np
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import floyd_warshall
from scipy.spatial import Delaunay

from quarterdeck.coverage.graph import Graph, graph_of
from quarterdeck.coverage.guards.certificate import mend, uncovered, uncovered_by_shadows
from quarterdeck.coverage.guards.fewer import needless
from quarterdeck.coverage.guards.pieces import paper_guards
from quarterdeck.coverage.guards.space import Space
from quarterdeck.coverage.reduced import reduced_cdt
from quarterdeck.geo.frame import Frame
from quarterdeck.geo.scenario import as_multipolygon
from quarterdeck.geo.triangulation import triangulate
from quarterdeck.geo.visibility import visibility_polygons
from quarterdeck.reproduce.guard_maps import random_room


def prove_rooms(count: int, rng: np.random.Generator) -> dict[str, float]:
    """Return the largest uncovered share of the rooms, by both routes."""
    worst = by_shadows = 0.0
    for _ in range(count):
        shape = shapely.box(0, 0, 100, 100)
        for _ in range(int(rng.integers(1, 12))):
            shape = shape.difference(shapely.Polygon(rng.uniform(0, 100, 2) + rng.uniform(-25, 25, (3, 2))))
        room = as_multipolygon(max(shapely.get_parts(shape), key=lambda p: p.area))
        space, mesh, reach = Space(room, room, room, Frame(0.0, 0.0)), triangulate(room), float(rng.uniform(8, 40))
        guards, hidden = mend(space, mesh, paper_guards(space, reach), reach)
        guards = guards[~needless(room, visibility_polygons(mesh, guards, reach))]
        rest = uncovered(space, visibility_polygons(mesh, guards, reach))
        worst = max(worst, (rest.area + hidden.area) / room.area)
        rest = uncovered_by_shadows(room, room, guards, np.full(len(guards), reach))
        by_shadows = max(by_shadows, rest.area / room.area)
    return {"rooms": count, "worst_uncovered": worst, "worst_by_shadows": by_shadows}


def large_room() -> dict[str, float]:
    """Return the CPU seconds of guards and certificate for a room of 1,000 vertices."""
    room = random_room(1000, seed=0)
    space = Space(room, room, room)
    mesh, guards = triangulate(room), paper_guards(space, 10.0)
    began = time.process_time()
    rest = uncovered(space, visibility_polygons(mesh, guards, 10.0))
    return {
        "vertices": len(mesh.vertices),
        "uncovered": rest.area,
        "certificate_seconds": round(time.process_time() - began, 2),
    }


def random_graph(rng: np.random.Generator, n: int) -> Graph:
    """Return the Delaunay graph of random points."""
    points = rng.uniform(0, 100, (n, 2))
    triangles = Delaunay(points).simplices
    return graph_of(points, np.unique(np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0))


def printed_weight(graph: Graph, guards: np.ndarray) -> float:
    """Return the weight of Algorithm 1 as printed."""
    matrix = csr_array((graph.lengths, graph.indices, graph.starts), shape=(len(graph.points),) * 2)
    distance, before = floyd_warshall(matrix, directed=False, return_predecessors=True)
    among = distance[np.ix_(guards, guards)] + np.diag(np.full(len(guards), np.inf))
    i, j = np.unravel_index(np.argmin(among), among.shape)
    inside, weight, path = {int(guards[i])}, 0.0, (int(guards[i]), int(guards[j]))
    left = {int(g) for g in guards} - inside
    while left:
        v = path[1]
        weight += float(distance[path])
        while v not in inside:
            inside.add(v)
            v = int(before[path[0], v])
        left -= inside
        rows, columns = sorted(inside), sorted(left)
        if columns:
            a, b = np.unravel_index(np.argmin(distance[np.ix_(rows, columns)]), (len(rows), len(columns)))
            path = (rows[a], columns[b])
    return weight


def prove_graphs(count: int, rng: np.random.Generator) -> dict[str, float]:
    """Return the largest relative difference of weights, and the CPU seconds for 5,000 vertices."""
    worst = 0.0
    for _ in range(count):
        graph = random_graph(rng, int(rng.integers(4, 80)))
        guards = rng.permutation(len(graph.points))[: int(rng.integers(2, len(graph.points) + 1))]
        expected = printed_weight(graph, guards)
        worst = max(worst, abs(reduced_cdt(graph, guards).weight - expected) / expected)
    graph = random_graph(rng, 5000)
    began = time.process_time()
    reduced_cdt(graph, np.arange(0, 5000, 2))
    return {"graphs": count, "worst_weight": worst, "seconds_5000_vertices": round(time.process_time() - began, 3)}


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rooms", type=int, default=100)
    parser.add_argument("--graphs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    rng = np.random.default_rng(args.seed)
    result = {
        "certificates": prove_rooms(args.rooms, rng),
        "large": large_room(),
        "reduced": prove_graphs(args.graphs, rng),
    }
    print(json.dumps(result) if args.json else "\n".join(f"{k}: {v}" for k, v in result.items()))


if __name__ == "__main__":
    main()
