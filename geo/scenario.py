"""What a scenario is: the site, its vehicles, tasks and casualties, all in metres of one local frame."""

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from shapely import MultiPolygon, Polygon
from shapely.ops import unary_union

from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import VehicleModel

Domain = Literal["surface", "ground", "aerial"]
DOMAINS: tuple[Domain, ...] = ("surface", "ground", "aerial")
CEILING = 120.0  # m above ground: EU 2019/947, UAS.OPEN.010; 14 CFR 107.51 allows 400 feet, 121.9 m


@dataclass(frozen=True, slots=True)
class Obstacle:
    """A place that is never covered; the domains in `blocks` may not cross it either. `height` in metres."""

    id: str
    polygon: Polygon
    blocks: frozenset[str] = frozenset(DOMAINS)
    height: float = 10.0


@dataclass(frozen=True, slots=True)
class Area:
    """A part of the site to be covered; areas of a higher `priority` are covered first."""

    id: str
    polygon: MultiPolygon
    priority: int = 0


@dataclass(frozen=True, slots=True)
class Site:
    """Where vehicles work (`areas`), where they may move (`operating`) and what is in the way."""

    areas: tuple[Area, ...]
    operating: MultiPolygon
    obstacles: tuple[Obstacle, ...] = ()

    @property
    def area(self) -> MultiPolygon:
        """The union of the areas, obstacles not yet taken out."""
        return as_multipolygon(unary_union([a.polygon for a in self.areas]))

    @property
    def coverable(self) -> MultiPolygon:
        """The area minus every obstacle: what is to be covered."""
        return as_multipolygon(self.area.difference(unary_union([o.polygon for o in self.obstacles])))

    def navigable(self, domain: str, clearance: float = 0.0) -> MultiPolygon:
        """Return where a vehicle's reference point may be: the operating area minus what blocks it, less `clearance`."""
        blocking = unary_union([o.polygon for o in self.obstacles if domain in o.blocks])
        if clearance > 0:
            # GEOS rounds the number of chords of an arc, so that one may span up to 1.5 of the 22.5 degrees asked for;
            # widened by its sagitta it never cuts the clearance.
            blocking = blocking.buffer(clearance / math.cos(1.5 * math.pi / 16), quad_segs=4)
        return as_multipolygon(self.operating.difference(blocking))


@dataclass(frozen=True, slots=True)
class Sensor:
    """What a vehicle surveys with. `swath` is the width of what one pass sees, in metres; None where it follows
    from `parameters` (a camera's focal length and altitude, a sonar's opening angle and depth).
    """

    kind: Literal["swath", "camera", "sonar"]
    swath: float | None = None
    parameters: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A vehicle as the scenario gives it, its model's figures filled in.

    `start` and `end` are (x, y) metres; `end` None means back to `start`; where it does not return it stays where its
    last track ends. `share` is the part of the area it covers, None
    where shares are to follow from speeds. `speed` m/s, `turn_radius`, `clearance` and `range` (how far it sees) metres,
    `endurance` seconds, `battery` watt-hours, `altitude` metres above ground (aerial only); all of its flight stays
    below `ceiling` metres above ground and `ceiling_amsl` above mean sea level; `can` its capabilities,
    `heading` radians in which it is under way at its start (None: it lies still).
    """

    id: str
    model: VehicleModel
    start: tuple[float, float]
    end: tuple[float, float] | None = None
    share: float | None = None
    speed: float = 1.0
    turn_radius: float = 0.0
    clearance: float = 0.0
    endurance: float = float("inf")
    battery: float = float("inf")
    altitude: float = 0.0
    sensor: Sensor | None = None
    range: float | None = None
    can: frozenset[str] = frozenset()
    returns: bool = True
    ceiling: float = CEILING
    ceiling_amsl: float = float("inf")
    heading: float | None = None

    @property
    def domain(self) -> Domain:
        """The element it moves in."""
        return self.model.domain

    @property
    def home(self) -> tuple[float, float]:
        """Where its route ends."""
        return self.start if self.end is None else self.end


@dataclass(frozen=True, slots=True)
class Precedence:
    """A task that has to be finished first; `same_robot`: and by the same robot, as a thing that is carried."""

    task: str
    mode: Literal["finish_to_start", "same_robot"] = "finish_to_start"


@dataclass(frozen=True, slots=True)
class Task:
    """A place to visit. `priority` 0..3, `service_time` seconds, `window` the earliest and latest start in seconds."""

    id: str
    position: tuple[float, float]
    priority: int = 0
    service_time: float = 0.0
    after: tuple[Precedence, ...] = ()
    needs: frozenset[str] = frozenset()
    domain: str | None = None
    window: tuple[float, float] = (0.0, float("inf"))


@dataclass(frozen=True, slots=True)
class Casualty:
    """A casualty, unknown to the robots until seen; `colour` is the sort that a robot would give it."""

    id: str
    position: tuple[float, float]
    colour: Literal["red", "yellow", "green", "grey", "black"]


@dataclass(frozen=True, slots=True)
class Scenario:
    """One scenario, as read from GeoJSON. `spacing` is the distance between neighbouring tracks in metres, if given.

    `input_hash` is the SHA-256 of the file's bytes; `medics` and `rendezvous` are (x, y) points by id,
    `soundings` x, y and depth in metres.
    """

    name: str
    frame: Frame
    site: Site
    vehicles: tuple[Vehicle, ...]
    tasks: tuple[Task, ...] = ()
    casualties: tuple[Casualty, ...] = ()
    medics: tuple[tuple[str, tuple[float, float]], ...] = ()
    rendezvous: tuple[tuple[str, tuple[float, float]], ...] = ()
    spacing: float | None = None
    input_hash: str = ""
    soundings: tuple[tuple[float, float, float], ...] = ()

    @property
    def starts(self) -> np.ndarray:
        """(k, 2) start positions in metres."""
        return np.array([v.start for v in self.vehicles], dtype=float).reshape(-1, 2)


def as_multipolygon(geometry: object) -> MultiPolygon:
    """Return the polygonal part of any shapely geometry as a MultiPolygon (empty where there is none)."""
    if isinstance(geometry, Polygon):
        return MultiPolygon([geometry] if not geometry.is_empty else [])
    if isinstance(geometry, MultiPolygon):
        return geometry
    parts = [p for g in getattr(geometry, "geoms", ()) for p in as_multipolygon(g).geoms]
    return MultiPolygon(parts)
