"""The director that executes a schedule of tasks: drive, wait for what must come first, serve, come home.

The plan's times are expectations; what releases a waiting vehicle is that its predecessors are done, whenever that is.
If the vehicle that was to do one is lost, the task is not skipped: who waits for it goes on waiting at its place until a
new plan comes, and when nobody moves any more, goes home with what is left undone. A task to which there is no way any
more is left out, with all that comes after it, and the vehicle goes on to its next one.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from quarterdeck.mission.director import Command, Director, Event, State, fixed
from quarterdeck.mission.mission import Mission, Waypoint
from quarterdeck.mission.triage.plan import METHOD, director_of


@dataclass(frozen=True, slots=True)
class _Stage:
    """A part of a route: the way to a task and its service, or the way home (`task` None)."""

    way: tuple[Waypoint, ...]
    task: str | None
    service: Waypoint | None


@dataclass(frozen=True, slots=True)
class Memory:
    """What the director knows: how many stages each vehicle was `sent` to do, which vehicles are `waiting` at their next
    task.

    `done` are the tasks served, `lost` the vehicles, `abandoned` the tasks that nobody will do any more, with the reason
    for each; `stranded` the vehicles that have no way home.
    """

    sent: Mapping[str, int]
    waiting: frozenset[str] = frozenset()
    done: frozenset[str] = frozenset()
    lost: frozenset[str] = frozenset()
    abandoned: Mapping[str, str] = field(default_factory=dict)
    stranded: frozenset[str] = frozenset()


def inspection(mission: Mission) -> Director:
    """Return the director of an assigned mission, for either world."""
    stages = {route.vehicle: _stages(route.waypoints, mission) for route in mission.routes}
    before = {task.id: frozenset(a.task for a in task.after) for task in mission.tasks}
    opens = {task.id: task.window[0] for task in mission.tasks}

    def direct(
        time: float, states: Mapping[str, State], events: tuple[Event, ...], memory: Any
    ) -> tuple[dict[str, Command], Memory]:
        known = memory if memory is not None else Memory(dict.fromkeys(stages, 0))
        done = known.done | {e.subject for e in events if e.kind == "served" and e.subject in before}
        last = {e.vehicle: e.kind for e in events if e.kind in ("lost", "returned")}
        lost = frozenset(v for v in known.lost | last.keys() if last.get(v) != "returned")
        away = lost | {v for v in stages if not states[v].alive}
        sent, waiting = dict(known.sent), set(known.waiting)
        abandoned, stranded = dict(known.abandoned), set(known.stranded)
        for e in events:
            if e.kind == "unreachable" and e.vehicle in stages:
                own = stages[e.vehicle]
                task = e.subject or (own[sent[e.vehicle]].task if e.vehicle in waiting else None)
                if task is None:
                    stranded.add(e.vehicle)
                else:  # what it was sent to do from there on is open again
                    abandoned[task] = f"{e.vehicle} found no way to it"
                    sent[e.vehicle] = next(n for n, s in enumerate(own) if s.task == task)
        abandoned = _with_successors(abandoned, before)
        commands: dict[str, Command] = {}
        for vehicle in stages:
            if (memory is None or states[vehicle].idle) and vehicle not in away:
                way, sent[vehicle], wait = _onward(vehicle, sent[vehicle], vehicle in waiting, done, abandoned, time)
                (waiting.add if wait else waiting.discard)(vehicle)
                if way or not states[vehicle].idle:  # a plan that begins in mid-course ends what was under way
                    commands[vehicle] = Command(way)
        known = Memory(sent, frozenset(waiting), done, lost, abandoned, frozenset(stranded))
        if not commands and waiting - away and all(states[v].idle for v in stages if v not in lost):
            return _give_up(known, states, away)
        return commands, known

    def _onward(
        vehicle: str, first: int, there: bool, done: frozenset[str], abandoned: Mapping[str, str], time: float
    ) -> tuple[tuple[Waypoint, ...], int, bool]:
        """Return all that can be done from stage `first` on without waiting, the next stage, and whether to wait for it."""
        way: tuple[Waypoint, ...] = ()
        for i, stage in enumerate(stages[vehicle][first:], first):
            way += () if there and i == first else stage.way
            if stage.task is None or stage.service is None:
                return way, i + 1, False
            if stage.task in abandoned or stage.task in done:
                continue
            if not before[stage.task] <= done:
                return way, i, True
            if opens[stage.task] > time:  # when it will be there is not known: it drives there, then waits by the clock
                if not (there and i == first):
                    return way, i, True
                way += (replace(stage.service, task=None, hold=opens[stage.task] - time),)
            way += (stage.service,)
            done |= {stage.task}
        return way, len(stages[vehicle]), False

    def _give_up(memory: Memory, states: Mapping[str, State], away: frozenset[str]) -> tuple[dict[str, Command], Memory]:
        """Send home, by the way it came, whoever waits for what nobody will do."""
        commands, sent, abandoned = {}, dict(memory.sent), dict(memory.abandoned)
        for vehicle in sorted(memory.waiting - away):
            own, here = stages[vehicle], sent[vehicle]
            for task in [s.task for s in own[here:] if s.task is not None]:
                lacking = ", ".join(repr(t) for t in sorted(before[task] - memory.done))
                abandoned.setdefault(task, f"{vehicle} waited for {lacking} in vain" if lacking else f"{vehicle} went home")
            start = next(route.waypoints[0] for route in mission.routes if route.vehicle == vehicle)
            way = [
                replace(w, hold=0.0, task=None, time=0.0) for w in [start, *(w for s in own[: here + 1] for w in s.way)]
            ][-2::-1]
            commands[vehicle] = Command(_grounded(way) if states[vehicle].z else tuple(way))
            sent[vehicle] = len(own)
        return commands, replace(memory, sent=sent, waiting=frozenset(), abandoned=abandoned)

    return direct


def default_director(mission: Mission) -> Director:
    """Return the director that a mission is meant for: triage, its schedule where tasks were assigned, else its routes."""
    if mission.method == METHOD:
        return director_of(mission)
    return inspection(mission) if mission.method == "assign" else fixed(mission)


def _with_successors(gone: Mapping[str, str], before: Mapping[str, frozenset[str]]) -> dict[str, str]:
    """Return the tasks that will not be done, with reasons, and all that comes after them."""
    out = dict(gone)
    while True:
        after = {t: f"comes after {min(b & out.keys())!r}" for t, b in before.items() if t not in out and b & out.keys()}
        if not after:
            return out
        out |= after


def _stages(waypoints: tuple[Waypoint, ...], mission: Mission) -> list[_Stage]:
    service = {task.id: task.service_time for task in mission.tasks}
    stages, way = [], []  # type: list[_Stage], list[Waypoint]
    for planned in waypoints[1:]:
        waypoint = replace(planned, time=0.0)  # a plan's arrival; in a command it would be a departure to wait for
        if waypoint.task is None:
            way.append(waypoint)
            continue
        way.append(replace(waypoint, hold=0.0, task=None))
        stages.append(_Stage(tuple(way), waypoint.task, replace(waypoint, hold=service[waypoint.task])))
        way = []
    return [*stages, _Stage(tuple(way), None, None)] if way else stages


def _grounded(way: list[Waypoint]) -> tuple[Waypoint, ...]:
    """Return an aerial way home at the height it was flown, landing at its end."""
    flown = [w for w in way if w.z > 0]
    return (*flown, replace(way[-1], leg="landing")) if flown else tuple(way)
