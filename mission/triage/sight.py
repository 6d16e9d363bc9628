"""What of the field has been seen: all that UGVs have passed within their range."""

from collections.abc import Mapping
from math import inf

import numpy as np
import shapely
from shapely import LineString, MultiPolygon

from quarterdeck.geo.scenario import as_multipolygon
from quarterdeck.mission.triage.team import Team

_THINNED = 0.1  # m that a track may lose where it is drawn with fewer corners


def seen_by(team: Team, tracks: Mapping[str, np.ndarray], until: float = inf, *, surely: bool = False) -> MultiPolygon:
    """Return what the UGVs of a team have seen until a second: by their (n, 3) tracks of seconds, x, y, and before.

    Its edge is drawn to a decimetre; what lies within is `surely` seen where that is taken off it.
    """
    swaths = [*([team.stand.seen] if team.stand else [])]
    for name, robot in team.ugvs.items():
        if name not in tracks:
            continue
        track = tracks[name]
        moment = min(until, float(track[-1, 0]))
        path = np.vstack([track[track[:, 0] <= moment, 1:], track_at(track, np.array([moment]))])
        swaths.append(
            LineString(np.vstack([path, path[-1:]])).simplify(_THINNED).buffer(robot.sees - 2 * _THINNED * surely)
        )
    return as_multipolygon(shapely.union_all(swaths, grid_size=1e-3))


def track_at(track: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return (m, 2) positions on a track (n, 3) at (m,) times."""
    return np.column_stack([np.interp(times, track[:, 0], track[:, 1]), np.interp(times, track[:, 0], track[:, 2])])
