"""The UGV: explore, continued explore, deliver, wait, return (Fig. 3); seek, when the UAV does not come."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from math import hypot, inf

from quarterdeck.mission.mission import Waypoint
from quarterdeck.mission.triage import medic, uav
from quarterdeck.mission.triage.board import compare_in_range, due, overdue, write_own
from quarterdeck.mission.triage.chase import chase, meeting_time, predict
from quarterdeck.mission.triage.desk import Desk
from quarterdeck.mission.triage.records import XY, Report, Section, Uav, Ugv

_REPORTING = ("deliver", "wait", "seek")
_OUTSIDE = 3.0  # times as far from the middle of a rendezvous as its place there
_DRIFT = 0.4  # m that a UAV with a body may hover off its place: who waits on the edge of its range is not heard


def saw(desk: Desk, name: str, report: Report) -> None:
    """It sees a casualty: noted if new; an urgent one makes it look around there, up to N of them, and report."""
    me: Ugv = desk.agents[name]
    if report.id in me.known:
        return
    desk.note(name, "found", report.id)
    desk.change(name, known=me.known | {report.id}, reports=(*me.reports, report))
    urgent = report.sort in desk.policy.urgent and desk.settings.rendezvous != "round-robin"
    if not urgent or me.state not in ("explore", "continued explore", "return"):
        desk.fire(name, "casualty seen")
        return
    if me.state == "continued explore":
        desk.change(name, around=(*me.around, report), gathered=me.gathered + 1)
        if me.gathered + 1 < desk.settings.clusters:
            desk.fire(name, "urgent casualty seen")
        elif desk.fire(name, "N urgent ones gathered"):
            _report(desk, name)
        return
    if me.state == "explore":
        desk.change(name, left=desk.here(name), rest=me.rest + desk.states[name].reached)
    desk.change(name, around=(), gathered=1)
    if desk.settings.clusters == 1:  # nothing to look for: the first is the last
        desk.fire(name, "urgent casualty seen")
        desk.fire(name, "N urgent ones gathered")
        _report(desk, name)
    elif desk.fire(name, "urgent casualty seen"):
        _drive_to(desk, name, (report.x, report.y))


def arrived(desk: Desk, name: str) -> None:
    """It has come to the end of what it was told to drive."""
    me: Ugv = desk.agents[name]
    if me.state == "explore":
        desk.change(name, searched=True, left=desk.here(name), rest=len(desk.team.ugvs[me.section].path))
        desk.note(name, "searched", me.section)
        if desk.fire(name, "section searched"):
            _report(desk, name)
    elif me.state == "return":
        if desk.fire(name, "back where it left"):
            resume(desk, name)
    elif me.state == "continued explore" and me.around:
        last = me.around[-1]
        desk.change(name, around=())
        desk.fire(name, "centre reached, urgent ones left")
        _drive_to(desk, name, (last.x, last.y))
    elif me.state == "continued explore":
        if desk.fire(name, "centre reached, none left"):
            _report(desk, name)
    elif me.state == "deliver":
        if desk.fire(name, "nobody there"):
            _wait(desk, name)
    elif me.state == "done":
        stand_by(desk, name)
    elif me.state == "home":
        desk.send(name, ())
    elif me.state == "wait":
        desk.change(name, relay_lost=desk.policy.receiver == "uav", sweeps=0)
        if desk.fire(name, "patience over"):
            _look_for_medic(desk, name)
    elif me.state == "seek":
        if me.sweeps < desk.settings.sweeps:
            desk.fire(name, "not found")
            desk.change(name, sweeps=me.sweeps + 1)
            desk.search_field(name, desk.team.ugvs[name].speed)
        else:
            desk.change(name, unreachable=me.unreachable | set(desk.team.medics))
            _give_up(desk, name)


def meets_uav(desk: Desk, name: str, other: str) -> bool:
    """Hand over to a UAV and hear from it what the medics have. Return whether anything was said."""
    me: Ugv = desk.agents[name]
    it: Uav = desk.agents[other]
    passing = desk.settings.rendezvous == "round-robin"
    if desk.policy.receiver != "uav" or it.state == "home" or (me.state not in (*_REPORTING, "home") and not passing):
        return False
    carried = it.closed | it.told | {r.id for r, _ in it.load}
    news = tuple(r for r in me.reports if r.id not in carried)
    left = tuple(r for r in me.reports if r.id not in it.closed)
    told = me.told | (it.told & {r.id for r in left})
    desk.change(
        name,
        reports=left,
        told=told,
        known=me.known | it.closed,
        relay_lost=False,
        beliefs=uav.fresher(dict(me.beliefs or {}), dict(it.beliefs or {})),
    )
    over = me.searched and not [r for r in left if r.id not in told]
    visits = {**(it.visits or {}), name: (desk.time, -1 if over else _index(desk, name), desk.here(name))}
    desk.change(other, visits=visits)
    for r in news:
        desk.note(name, "handed", r.id, whom=other)
    said = bool(news)
    if news:
        uav.receive(desk, other, news)
    elif passing and it.target == name and it.state != "deliver":
        desk.change(other, target="", misses={**(it.misses or {}), name: 0})
        uav.go_home(desk, other)
        said = True
    return _after_handing(desk, name, said=said) or said


def meets_medic(desk: Desk, name: str, other: str) -> bool:
    """Report to a medic himself: without a relay, or when it is lost or its battery low, or who could not be told before.

    Return whether anything was said.
    """
    me: Ugv = desk.agents[name]
    direct = desk.policy.receiver == "medic" and (me.state in _REPORTING or desk.policy.everywhere)
    late = bool(me.reports) and (bool(me.told) or me.state == "home")
    if not direct and not (me.relay_lost and me.state in _REPORTING) and not late:
        return False
    for r in me.reports:
        desk.note(name, "delivered", r.id, whom=other)
    medic.learn(desk, other, me.reports)
    beliefs = {**(me.beliefs or {}), other: medic.belief(desk, other)}
    known, unreachable = me.known | desk.agents[other].known, me.unreachable - {other}
    desk.change(name, reports=(), told=frozenset(), known=known, unreachable=unreachable, beliefs=beliefs)
    return _after_handing(desk, name, said=bool(me.reports)) or bool(me.reports)


def aim_again(desk: Desk) -> None:
    """A medic has changed his plan: UGVs who know where he is and drive to him change course."""
    for name, record in desk.agents.items():
        if isinstance(record, Ugv) and record.state == "deliver" and record.moving and name not in desk.out:
            _look_for_medic(desk, name)


def resume(desk: Desk, name: str) -> None:
    """Search on along the path from the first waypoint not reached."""
    me: Ugv = desk.agents[name]
    path = desk.team.ugvs[me.section].path[me.rest :]
    if path:
        desk.send(name, path)
    else:
        _drive(desk, name, [desk.here(name)])


def turn_home(desk: Desk, name: str) -> None:
    """Drive home on what the battery has left; who has something to report waits for a while at the rendezvous first."""
    me: Ugv = desk.agents[name]
    rest, left = _index(desk, name), desk.here(name) if me.state == "explore" else me.left
    desk.change(name, rest=rest, left=left, around=())
    if not desk.fire(name, "battery low"):
        return
    speed = desk.team.ugvs[name].speed
    corners = _to_depot(desk, name) if me.reports else []
    waiting = [Waypoint(x, y, speed=speed) for x, y in corners]
    if waiting:
        waiting[-1] = replace(waiting[-1], hold=desk.settings.linger)
    onward = way_home(desk, name, corners)
    desk.send(name, [*waiting, *(Waypoint(x, y, speed=speed) for x, y in onward)])


def way_home(desk: Desk, name: str, corners: Sequence[XY] | None = None) -> list[XY]:
    """Return the way home from where `corners` end; without any, by way of the rendezvous."""
    vehicle = desk.team.ugvs[name].vehicle
    via = _to_depot(desk, name) if corners is None else []
    here = (via or corners or [desk.here(name)])[-1]
    return [*via, *(desk.team.on_ground(here, desk.stand(name, vehicle.home)) if vehicle.returns else [here])]


def restart(desk: Desk, name: str) -> None:
    """Set out again for what it was doing, from where it is."""
    onward: dict[str, Callable[[Desk, str], None]] = {
        "explore": resume,
        "return": _back,
        "deliver": _report,
        "wait": _wait,
        "seek": _look_for_medic,
        "continued explore": arrived,
        "home": lambda desk, name: _drive(desk, name, way_home(desk, name, [])),
    }
    onward.get(desk.agents[name].state, stand_by)(desk, name)


def stand_by(desk: Desk, name: str) -> None:
    """Done with its section, it takes over one that is overdue; else it waits where others come, until one could be."""
    write_own(desk, name)
    if desk.settings.rendezvous == "round-robin" or name in desk.mute:
        desk.send(name, ())
        return
    compare_in_range(desk, name)
    me: Ugv = desk.agents[name]
    if late := overdue(desk, me.board):
        _take_over(desk, name, late[0])
        return
    here, speed = desk.here(name), desk.team.ugvs[name].speed
    soon = min(due(desk, s, me.board) for s in me.board)
    meeting = desk.policy.receiver == "uav" or desk.policy.everywhere  # elsewhere it will hear of nobody: a medic calls it
    hears = desk.reach - _DRIFT * (desk.team.ugvs[name].standoff > 0)
    near = min(_length([here, desk.middle(d)]) for d in desk.team.depots) <= hears
    hold = soon - desk.time if meeting and soon < inf else 0.0
    if (near and hold <= 0) or not ((meeting and soon < inf) or me.reports):
        desk.send(name, ())
    else:
        corners = [here] if near else _to_depot(desk, name)
        desk.drive(name, corners, speed, hold=max(hold, 0.0))


def _take_over(desk: Desk, name: str, section: str) -> None:
    """Search what is left of a section whose UGV is lost, from where the last word has it."""
    me: Ugv = desk.agents[name]
    entry = me.board[section]
    desk.note(name, "takes over", section)
    board = {**me.board, section: Section(desk.time, entry.rest, entry.place, name)}
    left = _past(desk, section, entry)
    desk.change(name, section=section, rest=entry.rest, left=left, searched=False, sweeps=0, board=board)
    desk.fire(name, "section overdue")
    _back(desk, name)


def _past(desk: Desk, section: str, entry: Section) -> XY:
    """Return where to go on: as far past the place of the last word as one keeps off a body, for who is lost lies there."""
    robot = desk.team.ugvs[section]
    if not 0 <= entry.rest < len(robot.path):
        return entry.place
    (x, y), ahead = entry.place, robot.path[entry.rest]
    part = min(1.0, robot.standoff / max(hypot(ahead.x - x, ahead.y - y), 1e-9))
    return x + part * (ahead.x - x), y + part * (ahead.y - y)


def _to_depot(desk: Desk, name: str) -> list[XY]:
    """Return the way to its place at the nearest depot."""
    here, ways = desk.here(name), desk.team.on_ground
    corners: list[XY] = []
    for place in _berth(desk, name, min(desk.team.depots, key=lambda d: _length([here, d]))):
        corners += ways(corners[-1] if corners else here, place)
    return corners


def _after_handing(desk: Desk, name: str, *, said: bool) -> bool:
    """Go back to the path or, when it is searched, wait for the receipt of all that was handed over."""
    me: Ugv = desk.agents[name]
    if me.state not in _REPORTING:
        return False
    if not me.searched:
        desk.fire(name, "handed over")
        _back(desk, name)
        return True
    if all(r.id in me.told for r in me.reports):
        desk.fire(name, "receipt in hand")
        stand_by(desk, name)
        return True
    if me.state != "wait" or said:
        desk.fire(name, "handed over, receipt due")
        _wait(desk, name)
        return True
    return False


def _index(desk: Desk, name: str) -> int:
    me: Ugv = desk.agents[name]
    return me.rest + desk.states[name].reached if me.state == "explore" and name not in desk.commands else me.rest


def _report(desk: Desk, name: str) -> None:
    """Go to whom it reports: the rendezvous, or a medic; in a round robin wait to be visited."""
    me: Ugv = desk.agents[name]
    desk.change(name, around=(), gathered=0, sweeps=0)
    if desk.policy.receiver == "medic" or me.relay_lost:
        must_look = me.relay_lost or not desk.settings.knows_medic
        if me.searched and must_look and not me.reports and not desk.policy.everywhere:
            desk.fire(name, "receipt in hand")  # an empty list is not worth a search for a medic
            stand_by(desk, name)
        elif me.unreachable >= set(desk.team.medics):
            _give_up(desk, name)
        else:
            _look_for_medic(desk, name)
    elif desk.settings.rendezvous == "round-robin":
        _drive(desk, name, [desk.here(name)])
    else:
        _drive(desk, name, _to_rendezvous(desk, name))


def _to_rendezvous(desk: Desk, name: str) -> list[XY]:
    """Return the way to the nearest rendezvous, as it will be when the UGV is there."""
    here, speed, ways = desk.here(name), desk.team.ugvs[name].speed, desk.team.on_ground
    options = []
    for robot in desk.team.uavs.values():
        place = robot.home[0][1]
        for since, later in robot.home:
            path = [here, *ways(here, later)]
            arrival = desk.time + _length(path) / speed
            if since <= arrival:
                place = later
        path, at = [here], here
        for corner in _berth(desk, name, place):
            path += ways(at, corner)
            at = corner
        options.append((_length(path), path[1:]))
    return list(min(options)[1])


def _berth(desk: Desk, name: str, rendezvous: XY) -> list[XY]:
    """Return the way into its own place at a rendezvous: straight from outside, so that nobody who waits is in the way."""
    if desk.team.ugvs[name].berth == (0.0, 0.0):
        return [rendezvous]
    return [desk.berth(name, rendezvous, far) for far in (_OUTSIDE, 1.0)]


def _wait(desk: Desk, name: str) -> None:
    """Wait where the UAV will come: at the rendezvous, or in a round robin where it stands; not at all without a UAV."""
    direct = desk.policy.receiver == "medic" or desk.agents[name].relay_lost
    visited = direct or desk.settings.rendezvous == "round-robin"
    corners = [desk.here(name)] if visited else _to_rendezvous(desk, name)
    desk.drive(name, corners, desk.team.ugvs[name].speed, hold=0.0 if direct else desk.settings.patience)


def _look_for_medic(desk: Desk, name: str) -> None:
    """Drive to where a medic is believed, or known, to be when it gets there; then along his queue, and wait at its end."""
    me: Ugv = desk.agents[name]
    knows = desk.policy.receiver == "medic" and desk.settings.knows_medic
    here, speed = desk.here(name), desk.team.ugvs[name].speed
    beliefs = {m: medic.belief(desk, m) for m in desk.team.medics} if knows else me.beliefs or {}
    courses = {m: predict(b, desk.team.on_foot) for m, b in beliefs.items() if m not in me.unreachable}
    target = min(courses, key=lambda m: (meeting_time(courses[m], here, speed, desk.time), m))
    corners = chase(courses[target], here, speed, desk.time, desk.team.on_ground)
    desk.drive(name, corners, speed, hold=desk.settings.linger)


def _give_up(desk: Desk, name: str) -> None:
    """Say that its casualties cannot be delivered; search on, for a medic may yet come by."""
    me: Ugv = desk.agents[name]
    for r in me.reports:
        if r.id not in me.told:
            desk.note(name, "undeliverable", r.id)
    desk.change(name, told=me.told | {r.id for r in me.reports})
    if me.searched:
        desk.fire(name, "all over, nobody to report to")
        stand_by(desk, name)
    else:
        desk.fire(name, "nobody to report to")
        _back(desk, name)


def _back(desk: Desk, name: str) -> None:
    left = desk.agents[name].left
    _drive(desk, name, desk.team.on_ground(desk.here(name), left))


def _drive_to(desk: Desk, name: str, place: XY) -> None:
    """Drive to a casualty, or as near as it may."""
    (x, y), (hx, hy), off = place, desk.here(name), desk.team.ugvs[name].standoff
    if off > 0:
        part = min(off / max(hypot(hx - x, hy - y), 1e-9), 1.0)
        place = (x + part * (hx - x), y + part * (hy - y))
    _drive(desk, name, desk.team.on_ground(desk.here(name), desk.stand(name, place)))


def _drive(desk: Desk, name: str, corners: Sequence[XY]) -> None:
    desk.drive(name, corners, desk.team.ugvs[name].speed)


def _length(path: list[XY]) -> float:
    return sum(((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2) ** 0.5 for a, b in pairwise(path))
