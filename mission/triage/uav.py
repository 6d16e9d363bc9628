"""The UAV: rendezvous, deliver, return (Fig. 4). It carries lists to the medics, predicting where they are."""

from dataclasses import replace

import numpy as np

from quarterdeck.mission.mission import Waypoint
from quarterdeck.mission.triage import medic
from quarterdeck.mission.triage.chase import chase, intercept, meeting_time, predict
from quarterdeck.mission.triage.desk import Desk
from quarterdeck.mission.triage.records import XY, Belief, Report, Uav
from quarterdeck.mission.triage.settings import RANK

_MISSES = 3  # visits of a round robin in which a UGV was not found, after which it is taken for lost


def receive(desk: Desk, name: str, reports: tuple[Report, ...]) -> None:
    """A UGV hands over casualties: each is meant for the medic who would be there first."""
    me: Uav = desk.agents[name]
    load = me.load
    for r in sorted(reports, key=lambda r: (RANK[r.sort], r.at, r.id)):
        load = (*load, (r, _choose(desk, me, load, r)))
    desk.change(name, load=load)
    if desk.fire(name, "list received"):
        _fly_to_medic(desk, name)


def arrived(desk: Desk, name: str) -> None:
    """At the rendezvous it hovers; where the medic should have been and was not found, it searches on."""
    me: Uav = desk.agents[name]
    if me.state == "home":
        desk.send(name, ())
    elif me.state != "deliver":
        desk.fire(name, "arrived")
        _hover(desk, name)
    elif me.sweeps < desk.settings.sweeps:
        desk.fire(name, "not found")
        desk.change(name, sweeps=me.sweeps + 1)
        desk.search_field(name, desk.team.uavs[name].speed)
    else:
        lost = me.unreachable | {me.target}
        me = replace(me, unreachable=lost, load=())
        load = tuple((r, _choose(desk, me, (), r)) for r, _ in desk.agents[name].load)
        desk.change(name, unreachable=lost, load=load)
        if lost >= set(desk.team.medics):
            _give_up(desk, name)
        elif desk.fire(name, "given up, another medic left"):
            _fly_to_medic(desk, name)


def meets_medic(desk: Desk, name: str, other: str) -> bool:
    """Hand a medic what is meant for him, or could not be told before; he shows his queue.

    Return whether anything was said.
    """
    me: Uav = desk.agents[name]
    if me.state != "deliver" and not me.load:
        return False
    mine = tuple(r for r, to in me.load if to == other or r.id in me.told)
    if not mine and me.target != other:
        return False
    for r in mine:
        desk.note(name, "delivered", r.id, whom=other)
    medic.learn(desk, other, mine)
    closed = me.closed | desk.agents[other].known
    left = tuple((r, to) for r, to in me.load if r.id not in closed)
    beliefs = {**(me.beliefs or {}), other: medic.belief(desk, other)}
    told, unreachable = me.told - closed, me.unreachable - {other}
    desk.change(name, load=left, closed=closed, told=told, unreachable=unreachable, beliefs=beliefs, target="")
    if left and desk.fire(name, "delivered, another medic's left"):
        _fly_to_medic(desk, name)
    elif desk.fire(name, "all delivered"):
        go_home(desk, name)
    return True


def meets_uav(desk: Desk, one: str, other: str) -> None:
    """Two UAVs share what has been delivered, and the fresher belief of each medic."""
    a, b = desk.agents[one], desk.agents[other]
    closed = a.closed | b.closed
    beliefs = fresher(a.beliefs or {}, b.beliefs or {})
    for name in (one, other):
        desk.change(name, closed=closed, beliefs=beliefs)


def fresher(one: "dict[str, Belief]", other: "dict[str, Belief]") -> "dict[str, Belief]":
    """Return of each medic the belief that is younger."""
    return {m: max(one[m], other[m], key=lambda b: b.time) for m in one}


def go_home(desk: Desk, name: str) -> None:
    """Fly to the rendezvous and follow it where it moves; in a round robin, to the next UGV."""
    if desk.settings.rendezvous == "round-robin" and (ugv := _next_ugv(desk, name)):
        _fly_to_ugv(desk, name, ugv)
        return
    robot = desk.team.uavs[name]
    stay = [p for i, p in enumerate(robot.home) if i + 1 == len(robot.home) or robot.home[i + 1][0] > desk.time]
    waypoints, at = [], desk.here(name)
    for from_time, place in stay:
        place = desk.berth(name, place)
        corners = desk.team.in_air(at, place)
        waypoints += [Waypoint(x, y, robot.z, speed=robot.speed, time=from_time) for x, y in corners]
        at = place
    desk.send(name, waypoints)


def restart(desk: Desk, name: str) -> None:
    """Set out again for what it was doing, from where it is; what was meant for a medic who is gone goes to another."""
    me: Uav = desk.agents[name]
    load = tuple((r, _choose(desk, me, (), r)) if to in me.unreachable else (r, to) for r, to in me.load)
    desk.change(name, load=load)
    if me.state == "home":
        _land(desk, name)
    elif me.state == "deliver":
        _fly_to_medic(desk, name)
    else:
        go_home(desk, name)


def turn_home(desk: Desk, name: str) -> None:
    """Fly home on what the battery has left, and land. It tells a medic who comes by; UGVs keep what it has not told."""
    if desk.fire(name, "battery low"):
        _land(desk, name)


def _land(desk: Desk, name: str) -> None:
    robot = desk.team.uavs[name]
    way = [Waypoint(x, y, robot.z, speed=robot.speed) for x, y in way_home(desk, name)]
    desk.send(name, [*way, replace(way[-1], z=0.0, leg="landing")])


def way_home(desk: Desk, name: str) -> list[XY]:
    """Return the way home through the air."""
    vehicle, here = desk.team.uavs[name].vehicle, desk.here(name)
    return list(desk.team.in_air(here, vehicle.home)) if vehicle.returns else [here]


def _hover(desk: Desk, name: str) -> None:
    """Keep to the place; in a round robin, go on to the next UGV: if one should have been here, it was not."""
    me: Uav = desk.agents[name]
    if me.target:
        misses = dict(me.misses or {})
        misses[me.target] = misses.get(me.target, 0) + 1
        desk.change(name, misses=misses, target="")
    if desk.settings.rendezvous == "round-robin" and _next_ugv(desk, name):
        go_home(desk, name)
    else:
        desk.change(name, moving=False)


def _next_ugv(desk: Desk, name: str) -> str:
    """Return the UGV whose last visit is longest ago, of those not known to have finished or be lost; none: empty."""
    me: Uav = desk.agents[name]
    left = [(t, u) for u, (t, k, _) in (me.visits or {}).items() if k >= 0 and (me.misses or {}).get(u, 0) < _MISSES]
    longest = min(left, default=(0.0, ""))
    return longest[1] if longest[0] < desk.time or desk.time == 0.0 else ""  # one that has just been visited can wait


def _fly_to_ugv(desk: Desk, name: str, ugv: str) -> None:
    """Meet a UGV on its path, where it must be if nothing has befallen it; wait for it there."""
    me: Uav = desk.agents[name]
    time, reached, at = (me.visits or {})[ugv]
    robot = desk.team.ugvs[ugv]
    rest = [at, *((w.x, w.y) for w in robot.path[reached:])]
    seconds = np.concatenate([[0.0], np.hypot(*np.diff(np.array(rest), axis=0).T).cumsum() / robot.speed])
    knots = np.column_stack([time + seconds, np.array(rest)])
    desk.change(name, target=ugv)
    speed = desk.team.uavs[name].speed
    corners = intercept(knots, desk.here(name), speed, desk.time, desk.team.in_air)
    desk.drive(name, corners, speed, hold=desk.settings.patience)


def _fly_to_medic(desk: Desk, name: str) -> None:
    """Fly to where the nearest medic is that something is meant for, then along his queue, and wait at its end."""
    me: Uav = desk.agents[name]
    robot = desk.team.uavs[name]
    meant = sorted({to for _, to in me.load} - me.unreachable)
    if not meant:
        _give_up(desk, name)
        return
    here = desk.here(name)
    courses = {m: predict((me.beliefs or {})[m], desk.team.on_foot) for m in meant}
    target = min(meant, key=lambda m: (meeting_time(courses[m], here, robot.speed, desk.time), m))
    desk.change(name, target=target, sweeps=0)
    corners = chase(courses[target], here, robot.speed, desk.time, desk.team.in_air)
    desk.drive(name, corners, robot.speed, hold=desk.settings.linger, halt=robot.halt)


def _give_up(desk: Desk, name: str) -> None:
    """Say so: no medic can be told; the list is kept, for one may yet come by."""
    me: Uav = desk.agents[name]
    for r, _ in me.load:
        if r.id not in me.told:
            desk.note(name, "undeliverable", r.id)
    desk.change(name, told=me.told | {r.id for r, _ in me.load}, target="")
    desk.fire(name, "nobody to report to")
    go_home(desk, name)


def _choose(desk: Desk, me: Uav, load: tuple[tuple[Report, str], ...], report: Report) -> str:
    """Return the medic who would reach a casualty first, by what is known of his queue and meant for him already."""
    medics = [m for m in desk.team.medics if m not in me.unreachable] or list(desk.team.medics)
    if len(medics) == 1:
        return medics[0]

    def arrival(name: str) -> float:
        b = (me.beliefs or {})[name]
        stops = [*b.stops, *((r.x, r.y, RANK[r.sort]) for r, to in load if to == name)]
        before = sorted((s for s in stops if s[2] <= RANK[report.sort]), key=lambda s: s[2])
        knots = predict(replace(b, stops=(*before, (report.x, report.y, 0))), desk.team.on_foot)
        return float(max(knots[-1, 0] - b.treat, desk.time))

    return min(medics, key=lambda m: (arrival(m), m))
