"""A weighted graph as arrays: what the triangulation, the Reduced-CDT and the trees on it are walked on."""

from dataclasses import dataclass

import networkx as nx
import numpy as np


@dataclass(frozen=True, slots=True)
class Graph:
    """An undirected graph in compressed rows: neighbours of vertex v are `indices[starts[v]:starts[v + 1]]`, ascending.

    `points` (n, 2) metres, `starts` (n + 1,), `indices` and `lengths` (2 m,); every edge is there from both its ends.
    """

    points: np.ndarray
    starts: np.ndarray
    indices: np.ndarray
    lengths: np.ndarray

    @property
    def edges(self) -> np.ndarray:
        """(m, 2) int: every edge once, smaller vertex first, in order."""
        rows = np.repeat(np.arange(len(self.points)), np.diff(self.starts))
        return np.column_stack([rows, self.indices])[rows < self.indices]

    @property
    def weight(self) -> float:
        """Metres of all edges together."""
        return float(self.lengths.sum() / 2)

    def networkx(self) -> nx.Graph:
        """Return the graph for networkx: nodes have `pos`, edges `length`; vertices without an edge are left out."""
        graph = nx.Graph()
        lengths = np.linalg.norm(np.diff(self.points[self.edges], axis=1)[:, 0], axis=1)
        graph.add_weighted_edges_from(zip(*self.edges.T.tolist(), lengths.tolist(), strict=True), weight="length")
        nx.set_node_attributes(graph, {v: tuple(self.points[v].tolist()) for v in graph}, "pos")
        return graph


def graph_of(points: np.ndarray, edges: np.ndarray, lengths: np.ndarray | None = None) -> Graph:
    """Return the graph of (n, 2) points and (m, 2) edges; lengths are Euclidean where not given, (m,) metres."""
    edges = np.asarray(edges, dtype=np.int64).reshape(-1, 2)
    if lengths is None:
        lengths = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    rows, columns = np.concatenate([edges, edges[:, ::-1]]).T
    order = np.lexsort((columns, rows))
    starts = np.searchsorted(rows[order], np.arange(len(points) + 1))
    both = np.concatenate([lengths, lengths])[order].astype(float)
    return Graph(np.asarray(points, dtype=float), starts, np.ascontiguousarray(columns[order]), both)
