"""The director that recovers: it follows the plan until a vehicle is lost or comes back, or finds no way to where it
should be, and then replans for all.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from shapely import MultiPolygon, Point

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Obstacle, as_multipolygon
from quarterdeck.mission.changes import Changes
from quarterdeck.mission.director import Command, Director, Event, State
from quarterdeck.mission.inspection import Memory as Inspected
from quarterdeck.mission.inspection import default_director
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.progress import Progress, surveyed
from quarterdeck.mission.replan import replan
from quarterdeck.mission.triage.plan import METHOD

FOUND = "found-"  # how the ids begin of what robots have found
ROOM = 3.0  # lengths kept from a vehicle that stands still, as vehicles keep from each other


@dataclass(frozen=True, slots=True)
class _Memory:
    """What is remembered: the plan followed and since when, what was done before it, who is missed and until when to wait.

    `used` is each vehicle's watt-hours at `since`; `tracks` and `served` are all that was done before that plan. `barred`
    are vehicles and the tasks to which they found no way, `undone` what earlier plans told could not be done.
    """

    mission: Mission
    director: Director
    since: float = 0.0
    inner: Any = None
    tracks: tuple[np.ndarray, ...] = ()
    served: frozenset[str] = frozenset()
    used: Mapping[str, float] | None = None
    missed: tuple[tuple[float, str], ...] = ()
    barred: frozenset[tuple[str, str]] = frozenset()
    undone: tuple[str, ...] = ()


def recovering(mission: Mission, *, delay: float = 0.0, tell: Callable[[float, Mission], None] | None = None) -> Director:
    """Return the director that replans (`mission.replan.replan`) `delay` seconds after a loss is heard of.

    Who is heard of again within the delay was a false alarm; who comes back later takes a part of what is left. Where a
    robot finds no way to a task, what it found becomes an obstacle of the new plan, and the task goes to who can reach it.
    `tell` gets the time and each new plan. A loss that nobody is left to recover from changes nothing. A triage team sees
    to its losses itself.
    """
    if mission.method == METHOD:
        return default_director(mission)

    def direct(
        time: float, states: Mapping[str, State], events: tuple[Event, ...], memory: Any
    ) -> tuple[dict[str, Command], Any]:
        now: _Memory = memory or _Memory(mission, default_director(mission))
        planned = {v.id for v in now.mission.vehicles}
        heard = {e.vehicle for e in events if e.kind == "returned"}
        missed = tuple(m for m in now.missed if m[1] not in heard)
        missed += tuple((time + delay, e.vehicle) for e in events if e.kind == "lost" and e.vehicle in planned)
        served = now.served | {e.subject for e in events if e.kind == "served"}
        now = replace(now, missed=missed, served=served)
        lost = frozenset(v for due, v in missed if due <= time and v not in heard)
        back = [v for v in mission.vehicles if v.id in heard and v.id not in planned]
        barred = [e for e in events if e.kind == "unreachable" and (e.vehicle, e.subject) not in now.barred and e.subject]
        now = replace(now, barred=now.barred | {(e.vehicle, e.subject) for e in barred})
        if lost or back or barred:
            found = _found([e.data["found"] for e in barred])
            after = _replanned(now, time, states, lost, [(v.id, mission) for v in back], found, tell)
            if after.mission is not now.mission:
                events = tuple(e for e in events if e not in barred)
            now = after
        commands, inner = now.director(time - now.since, states, events, now.inner)
        return commands, replace(now, inner=inner)

    return direct


def _replanned(
    now: _Memory,
    time: float,
    states: Mapping[str, State],
    lost: frozenset[str],
    back: list[tuple[str, Mission]],
    found: tuple[Obstacle, ...],
    tell: Callable[[float, Mission], None] | None,
) -> _Memory:
    """Return the memory with a new plan, or, where nobody is left, the old one."""
    used = now.used or {}
    tracks = list(now.tracks)
    for route in now.mission.routes:
        state = states[route.vehicle]
        if now.mission.spacing is not None:
            tracks += surveyed(route, min(state.reached + 1, len(route.waypoints)), (state.x, state.y, state.z))
    progress = Progress(
        time=time - now.since,
        positions={v: (s.x, s.y, s.z) for v, s in states.items()},
        energy={v: s.energy_used - used.get(v, 0.0) for v, s in states.items()},
        tracks=tuple(tracks),
        served=now.served,
    )
    joined = tuple(
        replace(first.vehicle(v), start=(states[v].x, states[v].y), end=first.vehicle(v).home) for v, first in back
    )
    kept = replace(now, missed=tuple(m for m in now.missed if m[1] not in lost))
    try:
        gone = frozenset(o.id for o in now.mission.site.obstacles if o.id.startswith(FOUND)) if found else frozenset()
        wrecks = tuple(w for v in sorted(lost) if (w := _wreck(now.mission, v, states)) is not None)
        after = replan(now.mission, progress, Changes(lost=lost, joined=joined, obstacles=(*wrecks, *found), gone=gone))
    except InputError:  # nobody is left
        return kept
    if tell:
        tell(time, after)
    return replace(
        kept,
        mission=after,
        director=default_director(after),
        since=time,
        inner=None,
        tracks=tuple(tracks),
        used={v: s.energy_used for v, s in states.items()},
        undone=tuple(
            dict.fromkeys((*kept.undone, *undone(kept.inner), *(r for r in after.reasons if r.startswith("task "))))
        ),
    )


def undone(memory: Any) -> tuple[str, ...]:
    """Return, one line each, what a director's `memory` says will not be done, and why."""
    if isinstance(memory, _Memory):
        return tuple(dict.fromkeys((*memory.undone, *undone(memory.inner))))
    if isinstance(memory, Inspected):
        told = [f"task {task!r}: {why}" for task, why in memory.abandoned.items()]
        return (*told, *(f"{vehicle}: found no way home" for vehicle in sorted(memory.stranded)))
    return ()


def _found(found: list[MultiPolygon]) -> tuple[Obstacle, ...]:
    """Return all that robots found as obstacles for vehicles on the ground."""
    parts = as_multipolygon(shapely.union_all(found)).geoms
    return tuple(Obstacle(f"{FOUND}{n}", part, frozenset({"ground"})) for n, part in enumerate(parts, start=1))


def _wreck(mission: Mission, lost: str, states: Mapping[str, State]) -> Obstacle | None:
    """Return the lost vehicle as an obstacle where it was last, if it stands in nobody's start, way home or air."""
    vehicle, state = mission.vehicle(lost), states[lost]
    if vehicle.domain == "aerial":
        return None
    wreck = Point(state.x, state.y).buffer(ROOM * vehicle.model.length)
    for other in mission.vehicles:
        here = states[other.id]
        near = min(wreck.distance(Point(here.x, here.y)), wreck.distance(Point(other.home)))
        if other.id != lost and near <= other.clearance:
            return None
    return Obstacle(f"wreck of {lost}", wreck, frozenset({vehicle.domain}))
