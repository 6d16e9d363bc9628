"""What has happened of a mission so far: where everyone is, what is covered and served, what it has used."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf

import numpy as np
from shapely import LineString

from quarterdeck.geo.errors import InputError
from quarterdeck.mission.mission import Mission, Route, unbroken
from quarterdeck.mission.timing import RESERVE
from quarterdeck.mission.triage.records import Stand


@dataclass(frozen=True, slots=True)
class Progress:
    """The state of a mission `time` seconds after its start.

    `positions` are (x, y, z) metres by vehicle, `energy` watt-hours used by vehicle, `tracks` (n, 2) lines in metres along
    which survey legs were driven, `served` the ids of tasks done. `along` says how far along its route each vehicle is, as
    the seconds at which it would be there by the plan; None: as planned, at `time`. `headings` are radians by vehicle,
    where they are known, `servers` who did a task, where it may be another vehicle than planned. `begun` are the tasks that
    are under way: by whom, and for how many seconds; None: as planned, where who is to be there is. `stand` is what the
    director of a triage mission has in mind; there `tracks` are the UGVs' whole ways. `lost` are vehicles known to be lost.
    """

    time: float
    positions: Mapping[str, tuple[float, float, float]]
    energy: Mapping[str, float] = field(default_factory=dict)
    tracks: tuple[np.ndarray, ...] = ()
    served: frozenset[str] = frozenset()
    along: Mapping[str, float] | None = None
    headings: Mapping[str, float] = field(default_factory=dict)
    servers: Mapping[str, str] = field(default_factory=dict)
    begun: Mapping[str, tuple[str, float]] | None = None
    stand: Stand | None = None
    lost: frozenset[str] = frozenset()


def planned_progress(mission: Mission, time: float, *, stopped: Mapping[str, float] | None = None) -> Progress:
    """Return the progress at `time` if all went as planned, except that vehicles in `stopped` did nothing from then on.

    Raises InputError if `time` is negative, or a vehicle in `stopped` is unknown.
    """
    if not time >= 0:
        raise InputError(f"time {time:g} s must not be negative")
    ends = ends_at(mission, time, stopped or {})
    positions, energy = {}, {}
    tracks: list[np.ndarray] = []
    served: set[str] = set()
    for route in mission.routes:
        vehicle = mission.vehicle(route.vehicle)
        at = _place(route, ends[route.vehicle])
        positions[vehicle.id] = at[1]
        energy[vehicle.id] = route.energy * min(1.0, ends[vehicle.id] / route.duration) if route.duration else 0.0
        tracks += surveyed(route, *at)
        served |= {w.task for w in route.waypoints if w.task and w.time + w.hold <= ends[vehicle.id]}
    return Progress(time, positions, energy, tuple(tracks), frozenset(served))


def ends_at(mission: Mission, time: float, stopped: Mapping[str, float]) -> dict[str, float]:
    """Return the seconds up to which each vehicle counts at `time`; those in `stopped` did nothing since (infinity: now).

    Raises InputError if one in `stopped` is unknown, or stopped before the mission or later than `time`.
    """
    ends = {v.id: time for v in mission.vehicles}
    for name, end in stopped.items():
        if name not in ends:
            raise InputError(f"unknown vehicle {name!r}; the plan has {', '.join(ends)}")
        if not end >= 0:
            raise InputError(f"vehicle {name!r}: lost since {end:g} s; seconds since the mission's start are not negative")
        if time < end < inf:
            raise InputError(
                f"vehicle {name!r}: lost since {end:g} s, but it is {time:g} s now; leave that second out, or wait"
            )
        ends[name] = min(time, end)
    return ends


def _place(route: Route, time: float) -> tuple[int, tuple[float, float, float]]:
    """Return the number of waypoints reached at `time`, and where the vehicle is."""
    arrivals = np.array([w.time for w in route.waypoints])
    departures = arrivals + np.array([w.hold for w in route.waypoints])
    reached = int(np.searchsorted(arrivals, time, side="right"))
    xyz = route.xyz
    if reached == len(xyz) or time <= departures[reached - 1]:
        x, y, z = xyz[reached - 1]
    else:
        part = (time - departures[reached - 1]) / (arrivals[reached] - departures[reached - 1])
        x, y, z = xyz[reached - 1] + part * (xyz[reached] - xyz[reached - 1])
    return reached, (float(x), float(y), float(z))


def with_surveyed(mission: Mission, tracks: Sequence[np.ndarray]) -> tuple[LineString, ...]:
    """Return what was surveyed before a mission began, by earlier plans too, with (n, 2) tracks that were driven since."""
    return tuple({line.wkb: line for line in (*mission.surveyed, *(LineString(t) for t in tracks if len(t) > 1))}.values())


def surveyed(route: Route, reached: int, position: tuple[float, float, float]) -> list[np.ndarray]:
    """Return the (n, 2) lines along which a route has surveyed when it stands at `position` after `reached` waypoints."""
    points = np.vstack([route.xyz[:reached, :2], position[:2]])
    survey = np.append(
        route.survey[:reached], reached < len(route.waypoints) and route.survey[min(reached, len(route.survey) - 1)]
    )
    return unbroken(points, survey)


def budget_left(whole: float, used: float) -> float:
    """Return the budget, watt-hours or seconds, of a vehicle that has used a part of it.

    It is such that a plan that keeps `RESERVE` of it keeps as much as one that keeps `RESERVE` of the `whole`.
    """
    return max(0.0, whole - used / (1 - RESERVE))
