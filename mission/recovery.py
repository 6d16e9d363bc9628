"""The director that recovers: it follows the plan until a vehicle is lost or comes back, falls behind, or finds no way to
where it should be, and then replans for all.

It knows what was last heard: of a vehicle that is silent it knows neither where it is nor whether it works, nor can it
tell it of a new plan. Silent for longer than the delay, it is given up, and stays in the others' way where it was last.
When it is heard again, what it has done meanwhile counts, and it takes a part of what is left.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from math import dist, inf
from typing import Any

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Obstacle, Vehicle
from quarterdeck.mission.changes import Changes, changed_site, changed_tasks, check_changes
from quarterdeck.mission.contact import within_range
from quarterdeck.mission.director import Command, Director, Event, State
from quarterdeck.mission.guard_recovery import prepare
from quarterdeck.mission.inspection import default_director
from quarterdeck.mission.lateness import course, looked, measured_pace
from quarterdeck.mission.mission import Mission, Route, Waypoint
from quarterdeck.mission.progress import Progress, surveyed
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.recovery_memory import Memory, undone
from quarterdeck.mission.replan import replan
from quarterdeck.mission.told import Telling, passed
from quarterdeck.mission.triage.plan import METHOD
from quarterdeck.mission.wrecks import obstacles_found, wreck_of

DRIFTED = 0.5  # lengths from where one who was given up is thought to lie: only farther off is it worth a new plan
Tell = Callable[[float, Mission], None]


def recovering(
    mission: Mission, *, delay: float = 0.0, tell: Tell | None = None, changes: Sequence[tuple[float, Changes]] = ()
) -> Director:
    """Return the director that replans (`mission.replan.replan`) `delay` seconds after a loss is heard of.

    Who is heard of again within the delay was a false alarm; who comes back later takes a part of what is left. Who falls
    behind its plan for long (`mission.lateness`) is planned with the speed that it makes, and goes on as fast as it can:
    should it be faster again, it is planned so. Where a robot finds no way to a task, what it found becomes an obstacle of
    the new plan, and the task goes to who can reach it. `tell` gets the time and each new plan. A loss that nobody is left
    to recover from changes nothing until somebody comes back. A triage team sees to its losses itself. Vehicles with a
    `range` are heard within it alone (`mission.contact`), except in guards plans, where it is how far they see. `changes`
    are heeded each at its second of the mission.

    Raises InputError for changes as `asked_for` does.
    """
    wishes = sorted(changes, key=lambda change: change[0])
    asked_for(mission, [wish for _, wish in wishes])
    if mission.method == METHOD:
        return default_director(mission)
    first = {v.id: v for v in mission.vehicles}
    if mission.method == "guards":
        prepare(mission)

    def direct(
        time: float, states: Mapping[str, State], events: tuple[Event, ...], memory: Any
    ) -> tuple[dict[str, Command], Any]:
        now: Memory = memory or Memory(mission, default_director(mission), {r.vehicle: r for r in mission.routes})
        last = {e.vehicle: e.kind for e in events if e.kind in ("lost", "returned")}  # of both in one second
        heard = {v for v, kind in last.items() if kind == "returned"}
        missed = {v: due for v, due in (now.missed or {}).items() if v not in heard}
        missed |= {v: time + delay for v, kind in last.items() if kind == "lost" and v not in now.given_up}
        due = frozenset(v for v, when in missed.items() if when <= time)
        back = now.given_up & heard
        plan = {r.vehicle: r for r in now.mission.routes}
        served = {
            e.subject: e.vehicle
            for e in events
            # Guards' numbers hold for one plan: what was seen unheard by an earlier one is seen again.
            if e.kind == "served" and (mission.method != "guards" or now.following.get(e.vehicle) is plan.get(e.vehicle))
        }
        moved = _moved(now, first, states, events)
        barred = [e for e in events if e.kind == "unreachable" and (e.vehicle, e.subject) not in now.barred and e.subject]
        now = replace(
            now,
            missed={v: when for v, when in missed.items() if v not in due},
            given_up=(now.given_up | due) - back,
            served=served | dict(now.served),
            barred=now.barred | {(e.vehicle, e.subject) for e in barred},
            untried=now.untried - {v for v, s in states.items() if s.alive and time > now.since},
            serving={**now.serving, **_at_work(now, time, states)},
            sighted={v: place for v, place in {**now.sighted, **moved}.items() if v not in heard},
            courses={v: looked(c, first[v], states[v], time) for v, c in now.courses.items()},
        )
        speeds = _speeds(now, first)
        stale = {v for v in heard & plan.keys() if now.following.get(v) is not plan[v]}  # replanned while it was silent
        asked = [wish for when, wish in wishes[now.wishes :] if when <= time]
        now = replace(now, wishes=now.wishes + len(asked))
        if due & plan.keys() or back or stale or barred or speeds or asked or moved:
            found = obstacles_found([e.data["found"] for e in barred])
            after = _replanned(now, mission, time, states, found, speeds, asked, moved.keys(), tell)
            if after.mission is not now.mission:
                events = tuple(e for e in events if e not in barred)
            now = after
        events = tuple(e for e in events if e.kind not in ("lost", "returned"))  # whoever waits for the silent waits on
        commands, inner = now.director(time - now.since, states, events, now.inner)
        sent = {v: c.waypoints for v, c in commands.items() if states[v].alive}
        slow = {v.id: v for v in now.mission.vehicles}
        courses = {**now.courses, **{v: course(slow[v], states[v], way, time) for v, way in sent.items()}}
        looks = (c.look for v, c in courses.items() if states[v].alive and not (states[v].idle and v not in sent))
        wake = min([*(now.missed or {}).values(), *looks, *(when for when, _ in wishes[now.wishes :])], default=inf)
        now = replace(now, inner=inner, sent={**now.sent, **sent}, courses=courses, wake=wake)
        return {v: _at_best(c, first[v], slow.get(v, first[v])) for v, c in commands.items()}, now

    ranged = mission.method != "guards" and any(v.range is not None for v in mission.vehicles)
    return within_range(direct, mission) if ranged else direct


def _moved(
    now: Memory, first: Mapping[str, Vehicle], states: Mapping[str, State], events: Sequence[Event]
) -> dict[str, tuple[float, float]]:
    """Return where those who were given up are seen, who lie elsewhere than is known."""
    found = {}
    for e in events:
        if e.kind == "held" and e.subject in now.given_up:
            here = e.data["x"], e.data["y"]
            known = now.sighted.get(e.subject, (states[e.subject].x, states[e.subject].y))
            if dist(here, known) > DRIFTED * first[e.subject].model.length:
                found[e.subject] = here
    return found


def _at_work(now: Memory, time: float, states: Mapping[str, State]) -> dict[str, tuple[str, float]]:
    """Return the task that each vehicle is at, of those that are heard and at one, and since when."""
    found = {}
    for name, state in states.items():
        task = next((w.task for w in now.sent.get(name, ())[state.reached :][:1] if state.alive), None)
        if task is not None:
            before, since = now.serving.get(name, ("", time))
            found[name] = (task, since if task == before else time)
    return found


def _speeds(now: Memory, first: Mapping[str, Vehicle]) -> dict[str, float]:
    """Return the speeds in m/s of vehicles that are slower or faster than the plan has them."""
    found = {}
    for vehicle in now.mission.vehicles:
        if vehicle.id in now.courses and vehicle.id not in now.given_up:
            speed = min(vehicle.speed * measured_pace(now.courses[vehicle.id], vehicle), first[vehicle.id].speed)
            if speed != vehicle.speed:
                found[vehicle.id] = speed
    return found


def _at_best(command: Command, first: Vehicle, planned: Vehicle) -> Command:
    """Return the command of a vehicle that is planned to be slow: to go as fast as it can."""
    if planned.speed == first.speed:
        return command
    return Command(tuple(replace(w, speed=w.speed * first.speed / planned.speed) for w in command.waypoints))


def _replanned(
    now: Memory,
    first: Mission,
    time: float,
    states: Mapping[str, State],
    found: tuple[Obstacle, ...],
    speeds: Mapping[str, float],
    asked: Sequence[Changes],
    moved: Collection[str],
    tell: Tell | None,
) -> Memory:
    """Return the memory with a new plan for all who are not given up, or, where nobody is left, the old one."""
    planned = {v.id for v in now.mission.vehicles}
    working = {v.id for v in first.vehicles} - now.given_up
    if not working:
        return now
    progress = _progress(now, time, states)
    lie = {v: (s.x, s.y) for v, s in states.items()} | dict(now.sighted)
    berths = [v.home for v in first.vehicles]
    afloat = (working | set(moved)) & now.wrecks.keys()
    unmarked = sorted(now.given_up - (now.wrecks.keys() - afloat))
    others = [lie[v] for v in sorted(working)]
    new = {v: w for v in unmarked if (w := wreck_of(first.vehicle(v), lie[v], berths, others)) is not None}
    changes = Changes(
        lost=frozenset(planned & now.given_up),
        back=dict.fromkeys(sorted(working - planned)),
        speeds={v: speed for v, speed in speeds.items() if v in working & planned},
        obstacles=(*new.values(), *found),
        gone=frozenset(now.wrecks[v] for v in afloat) | (now.found if found else frozenset()),
    )
    own = len(changes.obstacles)
    for wish in asked:
        changes |= wish
    try:
        after = replan(now.mission, progress, changes, anew=True)
    except InputError as error:
        return replace(now, undone=(*now.undone, Reason(f"no new plan at {time:.0f} s: {error}", "plan")))
    if tell:
        tell(time, after)
    told = {r.vehicle: r for r in after.routes if states[r.vehicle].alive}
    # A plan numbers what is new and has the name of something else.
    ids = [o.id for o in after.site.obstacles[len(after.site.obstacles) - len(changes.obstacles) :]]
    over = {v: Route(v, (Waypoint(s.x, s.y, s.z, "start"),)) for v, s in states.items() if v in changes.lost}
    reliefs = {**now.reliefs, **{v: _telling(now, time, states[v], route, after) for v, route in over.items()}}
    left = (*now.undone, *undone(now.inner), *(r for r in after.reasons if r.kind == "undone"))
    return replace(
        now,
        mission=after,
        director=default_director(after),
        following={**now.following, **told},
        since=time,
        inner=None,
        tracks=progress.tracks,
        served={} if after.method == "guards" else now.served,  # its layer says what is seen
        used={v: s.energy_used for v, s in states.items()},
        undone=tuple(dict.fromkeys(left)),
        untried=now.untried | told.keys(),
        sent={v: way for v, way in now.sent.items() if v not in told},
        serving={v: work for v, work in now.serving.items() if v not in told},
        courses={v: c for v, c in now.courses.items() if v not in told},
        wrecks={v: i for v, i in now.wrecks.items() if v not in afloat} | dict(zip(new, ids, strict=False)),
        found=frozenset(ids[len(new) : own]) if found else now.found,
        tellings=(*now.tellings, *(_telling(now, time, states[v], route, after) for v, route in told.items())),
        reliefs={v: relief for v, relief in reliefs.items() if v in now.given_up},
    )


def _progress(now: Memory, time: float, states: Mapping[str, State]) -> Progress:
    """Return how far the plan followed has come, with what was surveyed before it."""
    used = now.used or {}
    tracks = list(now.tracks)
    for name, route in now.following.items() if now.mission.spacing is not None else ():
        state = states[name]
        reached = 1 if name in now.untried else min(state.reached + 1, len(route.waypoints))
        tracks += surveyed(route, reached, (state.x, state.y, state.z))
    return Progress(
        time=time - now.since,
        positions={v: (s.x, s.y, s.z) for v, s in states.items()},
        energy={v: s.energy_used - used.get(v, 0.0) for v, s in states.items()},
        tracks=tuple(tracks),
        served=frozenset(now.served),
        servers=now.served,
        headings={v: s.heading for v, s in states.items()},
        begun={task: (v, time - since if states[v].alive else 0.0) for v, (task, since) in now.serving.items()},
    )


def _telling(now: Memory, time: float, state: State, route: Route, plan: Mission) -> Telling:
    """Return that a vehicle is told a route of a new plan, with how far it has come on the one that it had."""
    had, place = now.following[route.vehicle], (state.x, state.y, state.z)
    if route.vehicle in now.untried:
        reached = 1
    elif plan.method == "assign":  # its commands are parts of the route
        reached = passed(had, now.sent.get(route.vehicle, ()), state.reached)
    else:
        reached = min(state.reached + 1, len(had.waypoints))
    return Telling(time, route, place, reached, state.energy_used, plan.guards)


def asked_for(mission: Mission, wishes: Sequence[Changes]) -> Mission:
    """Return the mission with the site and the tasks that are asked for after changes in a run, one after the other.

    Raises InputError if one names what is not there then, or is about vehicles: in a run these change by faults.
    """
    for wish in wishes:
        if mission.method == METHOD:
            raise InputError("a plan of triage takes no changes in a run: its team knows what is asked from the start")
        about = sorted(
            {*wish.lost, *wish.back, *wish.speeds, *wish.batteries, *wish.endurances, *(v.id for v in wish.joined)}
        )
        if about:
            raise InputError(
                f"vehicle {about[0]!r}: in a run vehicles change by faults (--fail ID@S, thruster:ID@S), not by changes"
            )
        check_changes(mission, wish)
        mission = replace(mission, site=changed_site(mission.site, wish), tasks=changed_tasks(mission.tasks, wish))
    return mission
