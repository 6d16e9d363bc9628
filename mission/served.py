"""Which tasks were done, by where vehicles were and for how long."""

from collections.abc import Sequence

import numpy as np

from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.mission import Mission, Waypoint
from quarterdeck.mission.track import Track

REACH = 2.0  # m, or the vehicle's length: so near to a task it is done
EARLY = 1.0  # s by which a service may fall short: logs are no finer


def served_tasks(mission: Mission, tracks: Sequence[Track]) -> dict[str, tuple[float, str]]:
    """Return when each task, or guard's stop, was done, seconds since the mission's start, and by which vehicle.

    Done is what a vehicle that can do it stayed near for as long as its route holds there, after all that it comes after.
    """
    stops = {w.task: w for r in mission.routes for w in r.waypoints if w.task is not None}
    tasks = {t.id: t for t in mission.tasks}
    done: dict[str, tuple[float, str]] = {}
    waiting = list(stops)
    while waiting:
        ready = [i for i in waiting if i not in tasks or not {a.task for a in tasks[i].after} & {*waiting} - {i}]
        if not ready:
            break
        for name in ready:
            waiting.remove(name)
            task = tasks.get(name)
            after = [a for a in task.after if a.task in stops] if task else []
            if any(a.task not in done for a in after):
                continue
            since = max((done[a.task][0] for a in after), default=0.0)
            bound = {done[a.task][1] for a in after if a.mode == "same_robot"}
            found = []
            for track in tracks:
                vehicle = mission.vehicle(track.vehicle)
                able = task is None or (task.needs <= vehicle.can and task.domain in {None, vehicle.domain})
                if able and bound <= {vehicle.id}:
                    found += [(t, vehicle.id) for t in _stayed(track, vehicle, stops[name], since)]
            if found:
                done[name] = min(found)
    return done


def _stayed(track: Track, vehicle: Vehicle, stop: Waypoint, since: float) -> list[float]:
    """Return when, if ever, the vehicle had first stayed near the stop for its hold, from `since` on."""
    reach = max(REACH, vehicle.model.length)
    a, b = track.xy[:-1], track.xy[1:]
    if not len(a):
        return []
    span, off = b - a, np.array([stop.x, stop.y]) - a
    part = np.einsum("ij,ij->i", off, span) / np.maximum(np.einsum("ij,ij->i", span, span), 1e-12)
    near = np.linalg.norm(off - np.clip(part, 0.0, 1.0)[:, None] * span, axis=1) <= reach
    near &= ~track.broken[1:] & (track.time[1:] >= since)
    edges = np.flatnonzero(np.diff(np.r_[0, near.astype(np.int8), 0])).reshape(-1, 2)
    for first, last in edges.tolist():
        came, left = max(float(track.time[first]), since), float(track.time[last])
        if left - came >= stop.hold - EARLY:
            return [came + min(stop.hold, left - came)]
    return []
