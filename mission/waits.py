"""Who sets out later, lest it meets another on its way: found by the same reckoning as `mission.check` finds meetings."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.check import Way, always, closest, met, way_of
from quarterdeck.mission.mission import Mission, Route
from quarterdeck.mission.timing import shortfalls

STEP, LONGEST = 5.0, 600.0  # s: waits that are tried


def waits(mission: Mission) -> dict[str, float]:
    """Return the seconds that vehicles wait where they are, by id, so that nobody meets anybody on the way.

    One after the other each waits as little as it can for those before it. Empty where nobody meets, or no waits help.
    """
    found: dict[str, float] = {}
    ways = [(mission.vehicle(r.vehicle), way_of(r)) for r in mission.routes]
    for i, route in enumerate(mission.routes):
        vehicle = ways[i][0]
        others = [*ways[:i], *ways[i + 1 :]]
        for wait in np.arange(0.0, LONGEST + STEP, STEP).tolist():
            later = waiting(vehicle, route, wait)
            way = way_of(later)
            if any(met(one, before, vehicle, way) for one, before in ways[:i]):
                continue
            if not wait or not (shortfalls(vehicle, later) or _in_the_way(vehicle, way, wait, others)):
                break
        else:
            return {}
        ways[i] = vehicle, way
        if wait:
            found[vehicle.id] = wait
    return found


def waiting(vehicle: Vehicle, route: Route, wait: float) -> Route:
    """Return the route begun `wait` seconds later, the vehicle waiting where it is."""
    first, *others = route.waypoints
    later = (replace(first, hold=first.hold + wait), *(replace(w, time=w.time + wait) for w in others))
    return Route(route.vehicle, later, route.energy + vehicle.model.power_idle * wait / 3600.0)


def parted(mission: Mission) -> Mission:
    """Return a survey in which vehicles wait, and a note tells it, so that nobody meets anybody on the way."""
    found = waits(mission)
    if not found:
        return mission
    routes = tuple(
        waiting(mission.vehicle(r.vehicle), r, found[r.vehicle]) if r.vehicle in found else r for r in mission.routes
    )
    notes = [f"{v} waits {wait:.0f} s where it is, lest it meets another on its way" for v, wait in found.items()]
    figures = {
        "makespan": max(r.duration for r in routes),
        "energy": sum(r.energy for r in routes),
        "notes": [*mission.figures.get("notes", ()), *notes],
    }
    return replace(mission, routes=routes, figures={**mission.figures, **figures})


def _in_the_way(vehicle: Vehicle, way: Way, wait: float, others: Sequence[tuple[Vehicle, Way]]) -> bool:
    """Whether another comes too near while a vehicle waits and gets clear: a check does not look at where routes begin."""
    until = np.append(way[0][way[0] <= wait], wait + (vehicle.clearance + vehicle.model.length) / vehicle.speed)
    leaving = until, np.column_stack([np.interp(until, way[0], column) for column in way[1].T])
    for other, its in others:
        room = (vehicle.model.length + other.model.length) / 2
        gap, _ = closest(leaving, its, always, always)
        if gap < min(room, float(np.linalg.norm(its[1][0] - way[1][0]))):
            return True
    return False
