"""The mission: a route for each vehicle. Every planner ends in it; simulation, export and replanning start from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from shapely import LineString

from quarterdeck.geo.frame import Frame
from quarterdeck.geo.scenario import Casualty, Site, Task, Vehicle
from quarterdeck.mission.reason import Reason

Leg = Literal["start", "transit", "survey", "turn", "takeoff", "landing"]


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A place on a route. `x`, `y` metres in the frame, `z` metres above ground (0 on land and at sea).

    `leg` is the kind of the leg that ENDS here (the first waypoint of a route is `start`), `speed` the speed on it in m/s.
    `hold` is seconds waited here, `time` seconds since the mission's start at arrival, `task` the id of what is done here.
    `ground` is the metres of the ground beneath above mean sea level, None where no terrain was given.
    """

    x: float
    y: float
    z: float = 0.0
    leg: Leg = "transit"
    speed: float = 0.0
    hold: float = 0.0
    time: float = 0.0
    task: str | None = None
    ground: float | None = None


@dataclass(frozen=True, slots=True)
class Route:
    """What one vehicle does, in order. `energy` is watt-hours; `duration` seconds from the mission's start to its end."""

    vehicle: str
    waypoints: tuple[Waypoint, ...]
    energy: float = 0.0

    @property
    def xyz(self) -> np.ndarray:
        """(n, 3) positions in metres."""
        return np.array([(w.x, w.y, w.z) for w in self.waypoints], dtype=float).reshape(-1, 3)

    @property
    def survey(self) -> np.ndarray:
        """(n,) bool: the leg that ends at the waypoint covers."""
        return np.array([w.leg == "survey" for w in self.waypoints], dtype=bool)

    @property
    def length(self) -> float:
        """Metres along the route."""
        return float(np.linalg.norm(np.diff(self.xyz, axis=0), axis=1).sum())

    @property
    def duration(self) -> float:
        """Seconds from the mission's start to the end of the last hold."""
        return self.waypoints[-1].time + self.waypoints[-1].hold if self.waypoints else 0.0


def unbroken(points: np.ndarray, chosen: np.ndarray) -> list[np.ndarray]:
    """Return the (m, d) line of each unbroken run of `chosen` (n,) legs of (n, d) `points`; leg i ends at point i."""
    edges = np.flatnonzero(np.diff(np.r_[0, chosen.astype(np.int8), 0]))
    return [points[max(a - 1, 0) : b] for a, b in edges.reshape(-1, 2) if b - max(a - 1, 0) >= 2]


@dataclass(frozen=True, slots=True)
class Guard:
    """A place in metres from which all within `range` metres and in sight is seen. By their order a mission's guards are
    the tasks `guard-0`, `guard-1`, ... of its routes: `vehicle` passes it as the one after `turn` others; None for a spare
    one, for which robots of longer range see. `seen`: that is done.
    """

    x: float
    y: float
    range: float
    vehicle: str | None = None
    turn: int | None = None
    seen: bool = False


@dataclass(frozen=True, slots=True)
class Layer:
    """Something to draw beside the routes, such as a division, guards or trees: shapely `geometries` in metres.

    `properties` go to GeoJSON with each; there is one mapping a geometry.
    """

    name: str
    geometries: tuple[Any, ...]
    properties: tuple[Mapping[str, Any], ...]


def undone_layer(areas: Sequence[tuple[Any, str]]) -> Layer:
    """Return the layer `undone`: areas, shapely in metres, that are not covered or seen, each with why."""
    look = {"stroke": "#d62728", "fill": "#d62728", "fill-opacity": 0.3}
    told = tuple({"why": why, "m2": round(float(area.area), 3), **look} for area, why in areas)
    return Layer("undone", tuple(area for area, _ in areas), told)


@dataclass(frozen=True, slots=True)
class Mission:
    """A plan, whatever made it. `routes` are in the order of `vehicles`.

    `method` and `parameters` say how it was made, `figures` what it comes to, `bounds` what nothing could beat. `reasons`
    say, one line each, why it is infeasible; it is feasible when there are none. `spacing` is the track spacing in metres
    (None where nothing is covered by swaths). `layers` are for the eye. The `guards` of a plan of guards, lines that were
    `surveyed` before it began, and survey lines `left_out` because nobody could do them, are what replanning starts from.
    `lost` are vehicles that were given up, as they were then: where they were last, with the energy that they had.
    """

    name: str
    frame: Frame
    site: Site
    vehicles: tuple[Vehicle, ...]
    routes: tuple[Route, ...]
    method: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0
    spacing: float | None = None
    tasks: tuple[Task, ...] = ()
    casualties: tuple[Casualty, ...] = ()
    figures: Mapping[str, Any] = field(default_factory=dict)
    bounds: Mapping[str, Any] = field(default_factory=dict)
    reasons: tuple[Reason, ...] = ()
    layers: tuple[Layer, ...] = ()
    guards: tuple[Guard, ...] = ()
    surveyed: tuple[LineString, ...] = ()
    left_out: tuple[LineString, ...] = ()
    input_hash: str = ""
    version: str = ""
    lost: tuple[Vehicle, ...] = ()

    @property
    def feasible(self) -> bool:
        """Whether every vehicle can do its route."""
        return not self.reasons

    def vehicle(self, id: str) -> Vehicle:  # noqa: A002 - the field's own name
        """Return a vehicle by id."""
        return next(v for v in self.vehicles if v.id == id)

    def layer(self, name: str) -> Layer:
        """Return the layer of a name; an empty one where there is none."""
        return next((layer for layer in self.layers if layer.name == name), Layer(name, (), ()))
