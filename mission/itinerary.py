"""From who visits what in which order to routes: real driving times, waits for what must come first, service, home."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from quarterdeck.geo.scenario import Task, Vehicle
from quarterdeck.mission.mission import Leg, Route
from quarterdeck.mission.timing import timed_route
from quarterdeck.mission.travel import Travel


@dataclass(frozen=True, slots=True)
class Visit:
    """One task done: seconds since the mission's start at which the vehicle is there, begins and has finished."""

    task: str
    vehicle: str
    arrival: float
    start: float
    finish: float


def itineraries(
    vehicles: Sequence[Vehicle],
    tasks: Sequence[Task],
    rows: Sequence[Sequence[int]],
    travel: Travel,
    before: Mapping[int, Sequence[int]],
) -> tuple[tuple[Route, ...], tuple[Visit, ...]]:
    """Return each vehicle's route and all visits, earliest first.

    `rows` are the task indices of each vehicle in order, `before` the tasks that must be finished before one starts. Nobody
    leaves late to save a wait: a vehicle waits at the task. Raises ValueError if the rows wait for each other for ever.
    """
    lines = [_line(r, row, vehicles[r], travel) for r, row in enumerate(rows)]
    bare = [timed_route(v, line.points, line.legs) for v, line in zip(vehicles, lines, strict=True)]
    clock = [0.0] * len(rows)  # how much later than without waits and service
    place = [0] * len(rows)
    visits: dict[int, Visit] = {}
    holds = [[0.0] * len(line.points) for line in lines]
    while any(place[r] < len(row) for r, row in enumerate(rows)):
        moved = False
        for r, row in enumerate(rows):
            while place[r] < len(row) and all(first in visits for first in before.get(row[place[r]], ())):
                index, task = lines[r].stops[place[r]], row[place[r]]
                arrival = bare[r].waypoints[index].time + clock[r]
                ready = max([tasks[task].window[0], *(visits[first].finish for first in before.get(task, ()))])
                start = max(arrival, ready)
                finish = start + tasks[task].service_time
                visits[task] = Visit(tasks[task].id, vehicles[r].id, arrival, start, finish)
                holds[r][index] = finish - arrival
                clock[r] += finish - arrival
                place[r] += 1
                moved = True
        if not moved:
            raise ValueError("the rows wait for each other")
    routes = []
    for r, (vehicle, line) in enumerate(zip(vehicles, lines, strict=True)):
        names: list[str | None] = [None] * len(line.points)
        for index, task in zip(line.stops, rows[r], strict=True):
            names[index] = tasks[task].id
        routes.append(timed_route(vehicle, line.points, line.legs, holds=holds[r], tasks=names))
    return tuple(routes), tuple(sorted(visits.values(), key=lambda v: (v.start, v.task)))


@dataclass(frozen=True, slots=True)
class _Line:
    points: np.ndarray  # (q, 3) metres
    legs: list[Leg]
    stops: list[int]  # the index of the point at which each task of the row is done


def _line(r: int, row: Sequence[int], vehicle: Vehicle, travel: Travel) -> _Line:
    n, k = travel.out.shape[1], travel.out.shape[0]
    z = vehicle.altitude if vehicle.domain == "aerial" else 0.0
    points = [np.array([*vehicle.start, 0.0])]
    legs: list[Leg] = ["start"]
    stops: list[int] = []
    chain = [n + r, *row, n + k + r]
    if not row and travel.idle[r] == 0.0:
        return _Line(np.array(points), legs, stops)
    if z:
        points.append(np.array([*vehicle.start, z]))
        legs.append("takeoff")
    for i, j in pairwise(chain):
        path = travel.path(r, i, j)[1:]
        points += [np.array([x, y, z]) for x, y in path]
        legs += ["transit"] * len(path)
        if j < n:
            stops.append(len(points) - 1)
    if z:
        points.append(np.array([*points[-1][:2], 0.0]))
        legs.append("landing")
    return _Line(np.array(points), legs, stops)
