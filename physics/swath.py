"""What was driven on survey legs: the lines that coverage is measured by."""

import numpy as np
import shapely
from shapely import LineString

from quarterdeck.mission.mission import unbroken
from quarterdeck.physics.paths import LEGS
from quarterdeck.physics.trace import Trace

TOLERANCE = 0.02  # m: driven tracks are thinned by no more than this before they are widened


def driven_tracks(trace: Trace) -> list[np.ndarray]:
    """Return the (n, 2) lines in metres that were driven on survey legs, thinned."""
    tracks: list[LineString] = []
    for i in range(len(trace.vehicles)):
        surveying = trace.kind[:, i] == LEGS.index("survey")
        tracks += [LineString(line) for line in unbroken(np.column_stack([trace.x[:, i], trace.y[:, i]]), surveying)]
    return [shapely.get_coordinates(track) for track in shapely.simplify(tracks, TOLERANCE, preserve_topology=False)]
