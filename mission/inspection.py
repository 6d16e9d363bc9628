"""The director that executes a schedule of tasks: drive, wait for what must come first, serve, come home.

The plan's times are expectations; what releases a waiting vehicle is that its predecessors are done, whenever that is.
If the vehicle that was to do one is lost, the task is not skipped: who waits for it goes on waiting at its place until a
new plan comes, and when nobody moves any more, goes home with what is left undone.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from quarterdeck.mission.director import Command, Director, Event, State, fixed
from quarterdeck.mission.mission import Mission, Waypoint


@dataclass(frozen=True, slots=True)
class _Stage:
    """A part of a route: the way to a task and its service, or the way home (`task` None)."""

    way: tuple[Waypoint, ...]
    task: str | None
    service: Waypoint | None


@dataclass(frozen=True, slots=True)
class Memory:
    """What the director knows: `stage` and `serving` of each vehicle, tasks `done`, vehicles `lost`, tasks `abandoned`.

    `serving` is true once the service of the stage is commanded.
    """

    stage: Mapping[str, int]
    serving: Mapping[str, bool]
    done: frozenset[str] = frozenset()
    lost: frozenset[str] = frozenset()
    abandoned: frozenset[str] = frozenset()


def inspection(mission: Mission) -> Director:
    """Return the director of an assigned mission, for either world."""
    stages = {route.vehicle: _stages(route.waypoints, mission) for route in mission.routes}
    before = {task.id: frozenset(a.task for a in task.after) for task in mission.tasks}
    opens = {task.id: task.window[0] for task in mission.tasks}

    def direct(
        time: float, states: Mapping[str, State], events: tuple[Event, ...], memory: Any
    ) -> tuple[dict[str, Command], Memory]:
        if memory is None:
            memory = Memory(dict.fromkeys(stages, 0), dict.fromkeys(stages, False))
            return _departures(time, memory, list(stages))
        done = memory.done | {e.subject for e in events if e.kind == "served" and e.subject in before}
        lost = memory.lost | {e.vehicle for e in events if e.kind == "lost"}
        lost |= {v for v in stages if not states[v].alive}
        stage, serving = dict(memory.stage), dict(memory.serving)
        commands: dict[str, Command] = {}
        leaving = []
        for vehicle, own in stages.items():
            here = stage[vehicle]
            if vehicle in lost or here >= len(own):
                continue
            task = own[here].task
            if serving[vehicle] and task in done:
                stage[vehicle], serving[vehicle] = here + 1, False
                leaving.append(vehicle)
            elif states[vehicle].idle and not serving[vehicle] and task is not None and before[task] <= done:
                commands[vehicle] = Command(_service(own[here], opens[task], time))
                serving[vehicle] = True
        memory = Memory(stage, serving, done, lost, memory.abandoned)
        more, memory = _departures(time, memory, leaving)
        commands |= more
        if not commands and all(_at_rest(v, states, memory) for v in stages if v not in lost):
            return _give_up(memory, states)
        return commands, memory

    def _departures(time: float, memory: Memory, leaving: list[str]) -> tuple[dict[str, Command], Memory]:
        """Send vehicles to their next task, and have it served at once where nothing need be waited for."""
        commands, serving = {}, dict(memory.serving)
        for vehicle in leaving:
            if memory.stage[vehicle] >= len(stages[vehicle]):
                continue
            own = stages[vehicle][memory.stage[vehicle]]
            way = own.way
            if own.task is not None and before[own.task] <= memory.done and opens[own.task] <= time:
                way += _service(own, opens[own.task], time)
                serving[vehicle] = True
            commands[vehicle] = Command(way)
        return commands, replace(memory, serving=serving)

    def _at_rest(vehicle: str, states: Mapping[str, State], memory: Memory) -> bool:
        own, here = stages[vehicle], memory.stage[vehicle]
        waiting = here < len(own) and own[here].task is not None and not memory.serving[vehicle]
        return states[vehicle].idle and (waiting or here >= len(own) or own[here].task is None)

    def _give_up(memory: Memory, states: Mapping[str, State]) -> tuple[dict[str, Command], Memory]:
        """Send home, by the way it came, whoever waits for what nobody will do."""
        commands, stage, abandoned = {}, dict(memory.stage), set(memory.abandoned)
        for vehicle, own in stages.items():
            here = stage[vehicle]
            if vehicle in memory.lost or here >= len(own) or own[here].task is None:
                continue
            abandoned |= {s.task for s in own[here:] if s.task is not None}
            back = [w for s in own[: here + 1] for w in (*s.way, *((s.service,) if s.service else ()))][::-1]
            start = next(route.waypoints[0] for route in mission.routes if route.vehicle == vehicle)
            way = [replace(w, hold=0.0, task=None) for w in [*back, start]]
            commands[vehicle] = Command(tuple(way) if not states[vehicle].z else _grounded(way))
            stage[vehicle] = len(own)
        return commands, replace(memory, stage=stage, abandoned=frozenset(abandoned))

    return direct


def default_director(mission: Mission) -> Director:
    """Return the director that a mission is meant for: its schedule where tasks were assigned, else its fixed routes."""
    return inspection(mission) if mission.method == "assign" else fixed(mission)


def _stages(waypoints: tuple[Waypoint, ...], mission: Mission) -> list[_Stage]:
    service = {task.id: task.service_time for task in mission.tasks}
    stages, way = [], []  # type: list[_Stage], list[Waypoint]
    for waypoint in waypoints[1:]:
        if waypoint.task is None:
            way.append(waypoint)
            continue
        way.append(replace(waypoint, hold=0.0, task=None))
        stages.append(_Stage(tuple(way), waypoint.task, replace(waypoint, hold=service[waypoint.task])))
        way = []
    return [*stages, _Stage(tuple(way), None, None)] if way else stages


def _service(stage: _Stage, opens: float, time: float) -> tuple[Waypoint, ...]:
    """Return the waypoints that serve a task: first a wait where its window is not open yet."""
    service = stage.service
    if service is None:
        return ()
    return (*((replace(service, task=None, hold=opens - time),) if opens > time else ()), service)


def _grounded(way: list[Waypoint]) -> tuple[Waypoint, ...]:
    """Return an aerial way home at the height it was flown, landing at its end."""
    flown = [w for w in way if w.z > 0]
    return (*flown, replace(way[-1], leg="landing")) if flown else tuple(way)
