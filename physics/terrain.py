"""How vehicles stand on ground that is not flat, and whether they can get everywhere on it."""

from collections.abc import Sequence

import numpy as np

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Vehicle
from quarterdeck.geo.terrain import Terrain
from quarterdeck.mission.mission import Mission
from quarterdeck.physics.fleet import Fleet, Rovers
from quarterdeck.physics.rover import climb_parameters
from quarterdeck.physics.world import GAP, HEIGHT, World

ASIDE = 50.0  # m about the ground routes in which PyBullet has the terrain


class Footing:
    """How the k vehicles of a run stand: `ground` (k,) metres beneath each, `pitch` and `roll` radians, and `lift`, metres
    from the plan's heights, which are above ground, to PyBullet's.

    `rolling` (k,) bool are those on the ground, which climb at most `steepest` (k,) radians. Vessels have the water at 0;
    aerial vehicles fly above the ground, as their plan has it. Until it is settled on a terrain all is flat, at 0.
    """

    def __init__(self, vehicles: Sequence[Vehicle]) -> None:
        self.rolling = np.array([v.domain == "ground" for v in vehicles])
        self.aerial = np.array([v.domain == "aerial" for v in vehicles])
        self.size = np.array([(v.model.length, v.model.width) for v in vehicles])
        self.steepest = np.full(len(vehicles), np.inf)
        self.ground, self.pitch, self.roll, self.lift = (np.zeros(len(vehicles)) for _ in range(4))

    def lay(self, terrain: Terrain, mission: Mission, fleet: Fleet, world: World, position: np.ndarray) -> None:
        """Lay the ground about the ways of the rovers, now at `position` (k, 3), in the world; note how steep they climb.

        Raises InputError if PyBullet cannot hold so much of it.
        """
        for squad in fleet.squads:
            if isinstance(squad, Rovers):
                squad.climb = np.array([climb_parameters(v.model) for v in squad.vehicles])
                self.steepest[squad.index] = squad.climb["gradeability"]
        if self.rolling.any():
            ways = [r.xyz[:, :2] for r in mission.routes if mission.vehicle(r.vehicle).domain == "ground"]
            places = np.concatenate([position[self.rolling, :2], *ways])
            (west, south), (east, north) = (places.min(axis=0) - ASIDE).tolist(), (places.max(axis=0) + ASIDE).tolist()
            part = terrain.crop((west, south, east, north))
            if part is not None:
                world.add_terrain(part)

    def settle(self, terrain: Terrain, xy: np.ndarray, heading: np.ndarray) -> dict[int, str]:
        """Take over the ground at (k, 2) metres; return which vehicles cannot be there, and why.

        Where the ground is not known it stays as it was.
        """
        height, pitch, roll = stand(terrain, xy, heading, *self.size.T)
        steep = steepness(pitch, roll)
        over = np.where(self.aerial, terrain.height(xy), np.where(self.rolling, height, 0.0))
        self.ground = np.where(np.isnan(over), self.ground, over)
        self.pitch, self.roll = (np.where(self.rolling, np.nan_to_num(a), 0.0) for a in (pitch, roll))
        gap = (HEIGHT["ground"] / 2 + GAP) / np.cos(np.nan_to_num(steep))
        self.lift = self.ground + np.where(self.rolling, gap, 0.0)
        return {
            i: "the terrain is not known"
            if np.isnan(steep[i])
            else f"the ground is {np.degrees(steep[i]):.1f} degrees steep, it climbs {np.degrees(self.steepest[i]):.0f}"
            for i in np.flatnonzero(self.rolling & ((steep > self.steepest) | np.isnan(steep))).tolist()
        }


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
