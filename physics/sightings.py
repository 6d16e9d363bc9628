"""Who sees which casualty, and who comes within talking range, in the simulated world: by range and line of sight."""

from itertools import combinations

import numpy as np
import shapely
from shapely import STRtree

from quarterdeck.geo.terrain import Terrain
from quarterdeck.mission.director import Event
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.triage.outcome import reach_of
from quarterdeck.mission.triage.plan import METHOD, scenario_of, settings_of, team_of
from quarterdeck.mission.triage.team import targets

EYES = {"ugv": 0.8, "medic": 1.6}  # m above ground: a camera on a small mast; a person's, bent over a little
LYING = 0.3  # m: so high above ground is what is seen of a casualty
ON_THE_SPOT = 1.0  # m: so near a medic notices whoever lies there, as short-sighted as he may be
EDGE = 0.01  # m: a sight line may touch a wall that it runs along


class Lookout:
    """The eyes and radios of a triage team. Ranges are measured on the plan, sight lines in space.

    `seen` (k, m) bool: a vehicle of k has seen a casualty of m; `near` (p,) bool: a pair of members is in range.
    """

    def __init__(self, mission: Mission, terrain: Terrain | None) -> None:
        team, settings, scenario = team_of(mission), settings_of(mission), scenario_of(mission)
        self.ids, self.terrain = [v.id for v in mission.vehicles], terrain
        self.targets = targets(scenario, settings, mission.seed)
        self.spots = np.array([(t.x, t.y) for t in self.targets], float).reshape(-1, 2)
        sees = {a.id: a.sees for a in team.actors(settings)}
        sees |= {m: max(sees[m], ON_THE_SPOT) for m in team.medics}
        self.sees = np.array([sees[i] for i in self.ids])
        self.eyes = np.array([EYES["medic" if i in team.medics else "ugv"] for i in self.ids])
        self.seen = np.zeros((len(self.ids), len(self.targets)), bool)
        self.reach = reach_of(mission.parameters["method"], settings)
        order = [i for i in (*team.ugvs, *team.uavs, *team.medics) if i in self.ids]  # who is given up is not there
        pairs = [(self.ids.index(a), self.ids.index(b)) for a, b in combinations(order, 2) if b not in team.ugvs]
        self.pairs = np.array(pairs, int).reshape(-1, 2)
        self.near = np.zeros(len(pairs), bool)
        solid = [o for o in mission.site.obstacles if "ground" in o.blocks]
        self.walls = np.array([o.polygon for o in solid], object)
        ground = [max(terrain.range(o.polygon.bounds)[1], 0.0) if terrain is not None else 0.0 for o in solid]
        self.tops = np.array([g + o.height for g, o in zip(ground, solid, strict=True)])
        self.tree = STRtree(self.walls)

    def step(self, position: np.ndarray, present: np.ndarray) -> list[Event]:
        """Return what is newly seen and who has newly met, from (k, 2) metres and who is `present` (k,)."""
        events = []
        away = np.hypot(*(position[:, None] - self.spots[None]).transpose(2, 0, 1))
        for i, m in np.argwhere((away <= self.sees[:, None]) & present[:, None] & ~self.seen):
            if self.clear(position[i], float(self.eyes[i]), self.spots[m]):
                self.seen[i, m] = True
                target = self.targets[m]
                events.append(Event("seen", self.ids[i], target.id, {"x": target.x, "y": target.y, **target.data}))
        one, other = self.pairs.T
        apart = np.hypot(*(position[one] - position[other]).T)
        near = (apart <= self.reach) & present[one] & present[other]
        events += [Event("met", self.ids[i], self.ids[j]) for i, j in self.pairs[near & ~self.near]]
        self.near = near
        return events

    def clear(self, here: np.ndarray, eyes: float, spot: np.ndarray) -> bool:
        """Return whether eyes so many metres above (2,) see what lies at (2,): no wall and no ground is in between."""
        base = np.zeros(2) if self.terrain is None else np.nan_to_num(self.terrain.height(np.array([here, spot])))
        start, end = base[0] + eyes, base[1] + LYING
        length = max(float(np.hypot(*(spot - here))), 1e-9)
        line = shapely.LineString([here, spot])
        for k in self.tree.query(line, predicate="intersects"):
            inside = line.intersection(self.walls[k].buffer(-EDGE))
            if not inside.is_empty:
                along = np.hypot(*(shapely.get_coordinates(inside) - here).T) / length
                if (start + along * (end - start)).min() < self.tops[k]:
                    return False
        if self.terrain is None:
            return True
        part = np.linspace(0.0, 1.0, 2 + int(2 * length / self.terrain.cell))[1:-1, None]
        ground = self.terrain.height(here + part * (spot - here))
        return not bool((ground > start + part[:, 0] * (end - start)).any())


def look_out(mission: Mission, terrain: Terrain | None) -> Lookout | None:
    """Return the lookout of a triage mission; None for any other."""
    return Lookout(mission, terrain) if mission.method == METHOD else None
