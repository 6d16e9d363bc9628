"""Missions made by hand, so that the exporters are tested without a planner."""

import math
from itertools import pairwise

import pytest
from shapely import MultiPolygon, Point, box

from quarterdeck.geo.frame import Frame
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Area, Obstacle, Sensor, Site, Task, Vehicle
from quarterdeck.mission.mission import Mission, Route, Waypoint


def lawnmower(x: float, y: float, width: float, lines: int, step: float, speed: float, z: float = 0.0) -> list[Waypoint]:
    """Return survey lines eastwards and westwards from (x, y), joined by turns."""
    made: list[Waypoint] = []
    for line in range(lines):
        ends = (x, x + width) if line % 2 == 0 else (x + width, x)
        made.append(Waypoint(ends[0], y + line * step, z, "turn" if made else "transit", speed))
        made.append(Waypoint(ends[1], y + line * step, z, "survey", speed))
    return made


def timed(vehicle: Vehicle, waypoints: list[Waypoint]) -> Route:
    """Return the route with arrival times by speed and distance, and its energy."""
    time, done = 0.0, [waypoints[0]]
    for a, b in pairwise(waypoints):
        time += a.hold + math.dist((a.x, a.y, a.z), (b.x, b.y, b.z)) / b.speed
        done.append(Waypoint(b.x, b.y, b.z, b.leg, b.speed, b.hold, time, b.task))
    return Route(vehicle.id, tuple(done), energy=time * vehicle.model.power(vehicle.speed) / 3600.0)


def fleet(count: int = 5, frame: Frame | None = None, names: list[str] | None = None, lines: int = 6) -> Mission:
    """Return a mission of `count` USVs, each on its own strip north of the last, with an island east of the tracks."""
    model = load_model("otter")
    names = names or [f"usv{i + 1}" for i in range(count)]
    height = 20.0 * lines
    vehicles, routes = [], []
    for i, name in enumerate(names):
        start = (0.0, i * height)
        vehicle = Vehicle(name, model, start, speed=1.5, clearance=5.0, turn_radius=5.0)
        home = Waypoint(*start, 0.0, "start")
        legs = lawnmower(20.0, i * height + 10.0, 300.0, lines, 20.0, 1.5)
        routes.append(timed(vehicle, [home, *legs, Waypoint(*start, 0.0, "transit", 1.0)]))
        vehicles.append(vehicle)
    area = box(10.0, 0.0, 330.0, count * height)
    site = Site(
        (Area("bay", MultiPolygon([area])),),
        MultiPolygon([box(-50.0, -50.0, 500.0, count * height + 50.0)]),
        (Obstacle("island", Point(400.0, count * height / 2).buffer(30.0)),),
    )
    return Mission(
        "five boats",
        frame or Frame(121.6, 38.9),
        site,
        tuple(vehicles),
        tuple(routes),
        "stc",
        spacing=20.0,
        input_hash="ab" * 32,
    )


def drones(count: int = 3) -> Mission:
    """Return a camera survey by `count` quadrotors at 40 m with a tower in a corner, pictures every 7.5 m."""
    model = load_model("survey-quad")
    sensor = Sensor("camera", 30.0, {"trigger_distance": 7.5})
    vehicles, routes = [], []
    for i in range(count):
        start = (0.0, i * 120.0)
        vehicle = Vehicle(f"quad{i + 1}", model, start, speed=8.0, clearance=5.0, altitude=40.0, sensor=sensor)
        up = Waypoint(*start, 40.0, "takeoff", 2.5)
        legs = lawnmower(20.0, i * 120.0 + 10.0, 200.0, 4, 30.0, 8.0, 40.0)
        back = Waypoint(*start, 40.0, "transit", 8.0)
        down = Waypoint(*start, 0.0, "landing", 1.5)
        routes.append(timed(vehicle, [Waypoint(*start, 0.0, "start"), up, *legs, back, down]))
        vehicles.append(vehicle)
    site = Site(
        (Area("field", MultiPolygon([box(10.0, 0.0, 230.0, count * 120.0)])),),
        MultiPolygon([box(-50.0, -50.0, 300.0, count * 120.0 + 50.0)]),
        (Obstacle("tower", box(250.0, 10.0, 270.0, 30.0)),),
    )
    return Mission("field survey", Frame(-3.2, 55.9), site, tuple(vehicles), tuple(routes), "stc", spacing=30.0)


def inspection() -> Mission:
    """Return one UGV that visits three tasks and waits at each."""
    model = load_model("husky")
    vehicle = Vehicle("husky", model, (0.0, 0.0), speed=1.0, clearance=0.8)
    tasks = tuple(Task(f"t{i}", (20.0 * i, 15.0), service_time=30.5) for i in range(1, 4))
    stops = [Waypoint(*t.position, 0.0, "transit", 1.0, t.service_time, task=t.id) for t in tasks]
    route = timed(vehicle, [Waypoint(0.0, 0.0, 0.0, "start"), *stops, Waypoint(0.0, 0.0, 0.0, "transit", 1.0)])
    site = Site((), MultiPolygon([box(-10.0, -10.0, 80.0, 40.0)]), (Obstacle("shed", box(30.0, -8.0, 40.0, 0.0)),))
    return Mission("yard", Frame(8.5, 47.4), site, (vehicle,), (route,), "assign", tasks=tasks)


@pytest.fixture(scope="session")
def boats() -> Mission:
    """Five boats on five strips."""
    return fleet()


@pytest.fixture(scope="session")
def quads() -> Mission:
    """Three quadrotors with cameras."""
    return drones()


@pytest.fixture(scope="session")
def ugv() -> Mission:
    """One inspecting UGV."""
    return inspection()


@pytest.fixture(scope="session")
def make_fleet() -> object:
    """The function that makes a fleet of any size, place and names."""
    return fleet
