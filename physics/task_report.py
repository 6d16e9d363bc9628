"""Tasks as planned and as driven: who was there when, began when, left when, and why one was not served."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from quarterdeck.mission.mission import Mission
from quarterdeck.mission.reason import Reason
from quarterdeck.physics.trace import Trace

BEAT = 1.0  # s: how exactly it is known when a task was done
STANDS = 0.15  # m: a vehicle that moves less has stayed where it is


@dataclass(frozen=True, slots=True)
class Service:
    """One task's service: the vehicle, and seconds since the mission's start at which it came, began and left.

    What it stood there before it began, it `waited`: for predecessors, or for its window to open.
    """

    vehicle: str
    arrival: float
    begin: float
    leave: float
    waited: float


@dataclass(frozen=True, slots=True)
class TaskReport:
    """A task as `planned` and as `driven`; None where it was not. `reason` says why it was not served ("": it was).

    `fast` is the second at which it was served in the fast world, if it was.
    """

    id: str
    planned: Service | None
    driven: Service | None
    reason: str
    fast: float | None = None


def task_reports(
    mission: Mission, trace: Trace, served: Mapping[str, float], servers: Mapping[str, str], undone: Sequence[Reason]
) -> tuple[TaskReport, ...]:
    """Return a report for each task of a mission, in its order.

    `served` are the seconds at which tasks were done, `servers` by which vehicles; `undone` says why others were not.
    """
    why = {r.about: r.why for r in undone if r.kind == "undone"}
    planned = {w.task: (r.vehicle, w) for r in mission.routes for w in r.waypoints if w.task is not None}
    out = []
    for task in mission.tasks:
        plan = drive = None
        if task.id in planned:
            vehicle, w = planned[task.id]
            leave = w.time + w.hold
            plan = Service(vehicle, w.time, leave - task.service_time, leave, w.hold - task.service_time)
        if task.id in served and servers.get(task.id) in trace.vehicles:
            vehicle, leave = servers[task.id], served[task.id]
            begin = max(leave - task.service_time, 0.0)
            arrival = min(_came(trace, trace.vehicles.index(vehicle), leave), begin)
            if begin - arrival <= BEAT:
                begin, leave = arrival, arrival + task.service_time
            drive = Service(vehicle, arrival, begin, leave, begin - arrival)
        reason = "" if task.id in served else why.get(task.id, "nobody came to it before the run ended")
        out.append(TaskReport(task.id, plan, drive, reason))
    return tuple(out)


def _came(trace: Trace, vehicle: int, leave: float) -> float:
    """Return since when the vehicle has been where it is at `leave` seconds."""
    last = max(int(np.searchsorted(trace.time, leave, side="right")) - 1, 0)
    x, y, z = trace.x[: last + 1, vehicle], trace.y[: last + 1, vehicle], trace.z[: last + 1, vehicle]
    elsewhere = np.flatnonzero((x - x[-1]) ** 2 + (y - y[-1]) ** 2 + (z - z[-1]) ** 2 > STANDS**2)
    return float(trace.time[elsewhere[-1] + 1]) if len(elsewhere) else 0.0
