"""Who turns home, and when: as with every other method, the reserve is kept whatever there is still to do.

A robot works out what the way home takes, by way of the rendezvous where it may have something to tell. What it can do
without, it loses at most twice as fast as it works: by what it uses, and by what it moves away. So it looks again when half
of that is gone, and what it asks of its planner stays little.
"""

from math import inf

import numpy as np

from quarterdeck.mission.timing import RESERVE, timed_route
from quarterdeck.mission.triage import uav, ugv
from quarterdeck.mission.triage.desk import Desk
from quarterdeck.mission.triage.records import Uav, Ugv
from quarterdeck.mission.triage.team import Robot

_LEAST = 10.0  # s in hand: then it turns
_ROOM = {Ugv: ugv, Uav: uav}


def watch_energy(desk: Desk) -> None:
    """Let each robot that has no more in hand than it takes to come home turn home, with what it has to tell."""
    for name, robot in desk.robots.items():
        if name in desk.out or desk.agents[name].state == "home" or desk.time + 1e-6 < desk.look.get(name, 0.0):
            continue
        seconds = _in_hand(desk, name, robot)
        if seconds <= _LEAST:
            desk.note(name, "turns home")
            _ROOM[type(desk.agents[name])].turn_home(desk, name)
            seconds = inf
        desk.look = {**desk.look, name: desk.time + seconds / 2}


def _in_hand(desk: Desk, name: str, robot: Robot) -> float:
    """Return the seconds for which a robot can go on at its speed and then come home with the reserve in hand."""
    vehicle, state = robot.vehicle, desk.states[name]
    battery, endurance = (1 - RESERVE) * vehicle.battery, (1 - RESERVE) * vehicle.endurance
    if min(battery, endurance) == inf:
        return inf
    corners = _ROOM[type(desk.agents[name])].way_home(desk, name)
    points = np.array([(state.x, state.y, robot.z), *((x, y, robot.z) for x, y in corners), (*corners[-1], 0.0)])
    home = timed_route(vehicle, points, ["transit"] * len(points))
    power = max(vehicle.model.power(vehicle.speed), vehicle.model.power_idle)
    wait = desk.settings.linger if isinstance(desk.agents[name], Ugv) else 0.0
    by_battery = (battery - state.energy_used - home.energy) * 3600.0 / power - wait
    return min(by_battery, endurance - (desk.time - desk.team.began) - home.duration - wait)
