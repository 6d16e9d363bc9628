"""How rovers stand on ground that is not flat, and whether they can get everywhere on it."""

import numpy as np

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.terrain import Terrain
from quarterdeck.mission.mission import Mission


def stand(
    terrain: Terrain, xy: np.ndarray, heading: np.ndarray, length: np.ndarray, width: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the height (k,) metres, pitch (k,) and roll (k,) radians of vehicles at (k, 2) that rest on the ground at the
    middle of their four sides; nose up and port side up are positive. NaN where the terrain is not known.
    """
    ahead = np.column_stack([np.cos(heading), np.sin(heading)])
    aport = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    half, side = length[:, None] / 2 * ahead, width[:, None] / 2 * aport
    nose, tail, port, star = (terrain.height(xy + d) for d in (half, -half, side, -side))
    return (nose + tail) / 2, np.arctan2(nose - tail, length), np.arctan2(port - star, width)


def steepness(pitch: np.ndarray, roll: np.ndarray) -> np.ndarray:
    """Return (k,) radians: how steep the ground is, whichever way it falls."""
    return np.arctan(np.hypot(np.tan(pitch), np.tan(roll)))


def check_terrain(terrain: Terrain, mission: Mission) -> None:
    """Raise InputError if a ground vehicle's route leaves the terrain."""
    for route in mission.routes:
        vehicle = mission.vehicle(route.vehicle)
        if vehicle.domain != "ground" or not len(route.waypoints):
            continue
        xy = route.xyz[:, :2]
        steps = np.maximum(1, np.ceil(np.hypot(*np.diff(xy, axis=0).T) / terrain.cell)).astype(int)
        legs = zip(xy[:-1], xy[1:], steps, strict=True)
        places = np.concatenate([xy[:1], *(np.linspace(a, b, n + 1)[1:] for a, b, n in legs)])
        off = np.flatnonzero(np.isnan(terrain.height(places)))
        if len(off):
            x, y = places[off[0]]
            raise InputError(
                f"terrain: not known at x {x:.1f} m, y {y:.1f} m on the route of {vehicle.id!r}; "
                "give one that covers it, in metres of the plan's frame"
            )
