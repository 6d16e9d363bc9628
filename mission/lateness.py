"""Who falls behind: how fast a vehicle gets on with what it was told, by where it is heard to be."""

from dataclasses import dataclass, replace
from itertools import pairwise
from math import dist

import numpy as np

from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.director import State
from quarterdeck.mission.mission import Route, Waypoint
from quarterdeck.mission.timing import commanded_route

WINDOW = 20.0  # s between looks
WINDOWS = 3  # looks in a row: giving way, gusts and noise are over sooner
SLOW = 0.75  # of the planned pace: who gets on slower in each of them is slow, whoever is as much faster is fast
STANDS = 0.1  # of it: who gets on slower still does not drive; that is not a matter of speed
WORTH = 60.0  # s that a vehicle comes too late or too early, for which a new plan is worth its trouble


@dataclass(frozen=True, slots=True)
class Course:
    """What a vehicle was told at `since`, s: a `route` timed from then on, and what was `seen` of it at the last looks.

    `seen` are rows of the time, the seconds of the route that the vehicle had behind it, and its x and y in metres.
    """

    route: Route
    since: float
    seen: tuple[tuple[float, float, float, float], ...] = ()

    @property
    def look(self) -> float:
        """When to look next."""
        return (self.seen[-1][0] if self.seen else self.since) + WINDOW


def course(vehicle: Vehicle, state: State, waypoints: tuple[Waypoint, ...], time: float) -> Course:
    """Return the course of a vehicle that at `time` is told to go along `waypoints` from where it is."""
    return Course(commanded_route(vehicle, (state.x, state.y, state.z), waypoints), time)


def looked(course: Course, vehicle: Vehicle, state: State, time: float) -> Course:
    """Return the course with what is seen at `time`, where that is due. While it holds or is silent nothing is seen."""
    if time < course.look:
        return course
    end = next(iter(course.route.waypoints[state.reached + 1 : state.reached + 2]), None)
    holds = end is not None and end.hold > 0 and dist((end.x, end.y), (state.x, state.y)) <= 2 * vehicle.model.length
    if not state.alive or state.idle or end is None or holds:
        return replace(course, since=time, seen=())
    return replace(course, seen=(*course.seen, (time, done(course.route, state), state.x, state.y))[-WINDOWS - 1 :])


def done(route: Route, state: State) -> float:
    """Return the seconds of a route that are behind a vehicle, by the waypoints that it has reached and where it is."""
    if state.reached + 1 >= len(route.waypoints):
        return route.duration
    start, end = route.waypoints[state.reached : state.reached + 2]
    length = dist((start.x, start.y, start.z), (end.x, end.y, end.z))
    left = dist((end.x, end.y, end.z), (state.x, state.y, state.z))
    drive = length / end.speed if end.speed > 0 else 0.0  # what is left of the leg's time is for the turn before it
    return end.time - drive * (min(1.0, left / length) if length > 0 else 0.0)


def measured_pace(course: Course, vehicle: Vehicle) -> float:
    """Return at what part of its planned pace a vehicle gets on; 1 where that is not worth a new plan.

    It is its best of the last looks: a fault may have come or gone within the others. Who drives about at its speed, as
    around something in its way, is not slow.
    """
    if len(course.seen) <= WINDOWS:
        return 1.0
    paces, drives = [], []
    for (t0, done0, x0, y0), (t1, done1, x1, y1) in pairwise(course.seen):
        paces.append((done1 - done0) / (t1 - t0))
        drives.append(max(paces[-1], float(np.hypot(x1 - x0, y1 - y0)) / (vehicle.speed * (t1 - t0))))
    slow, fast = STANDS < max(drives) < SLOW, min(paces) > 1.0 / SLOW
    if not (slow or fast):
        return 1.0
    pace = max(drives) if slow else max(paces)
    left = course.route.duration - course.seen[-1][1]
    return pace if abs(left / pace - left) >= WORTH else 1.0
