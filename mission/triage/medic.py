"""The medic: idle, plan, go, treat (Fig. 5). His queue is planned anew at every new casualty, in the method's order."""

from math import hypot, inf

import numpy as np
from shapely import box

from quarterdeck.geo.scenario import as_multipolygon
from quarterdeck.mission.mission import Waypoint
from quarterdeck.mission.priority_tsp import priority_order
from quarterdeck.mission.triage.board import due, overdue
from quarterdeck.mission.triage.chase import LEGS, expanding_square
from quarterdeck.mission.triage.desk import Desk
from quarterdeck.mission.triage.records import Belief, Medic, Report
from quarterdeck.mission.triage.settings import RANK

_LOOKS = 3  # times that he searches, each wider, around where a casualty was told to be


def saw(desk: Desk, name: str, report: Report, category: str) -> None:
    """He sees a casualty: he sorts it as a robot would and, close as he is, knows its category."""
    me: Medic = desk.agents[name]
    desk.change(name, examined={**(me.examined or {}), report.id: category})
    if report.id not in me.known:
        desk.note(name, "found", report.id)
        learn(desk, name, (report,))
    elif any(r.id == report.id and (r.x, r.y) != (report.x, report.y) for r in me.queue):
        queue = tuple(report if r.id == report.id else r for r in me.queue)
        desk.change(name, queue=queue, heading_for="")  # a robot's word was off: now he sees where the casualty is
        if me.state == "go":
            desk.fire(name, "casualty learnt")
        _plan(desk, name)


def learn(desk: Desk, name: str, reports: tuple[Report, ...]) -> None:
    """He takes new casualties into his queue and plans; while he treats, for afterwards."""
    me: Medic = desk.agents[name]
    new = tuple({r.id: r for r in reports if r.id not in me.known and r.id not in me.treated}.values())
    if not new:
        return
    desk.change(name, queue=me.queue + new, known=me.known | {r.id for r in new})
    row = desk.fire(name, "casualty learnt")
    if row is not None:
        _plan(desk, name)


def treated(desk: Desk, name: str, casualty: str) -> None:
    """A treatment is over."""
    me: Medic = desk.agents[name]
    desk.note(name, "treated", casualty, whom=_category(me, casualty))
    green = _category(me, casualty) == "green" and me.helpers < desk.settings.helpers
    desk.change(name, treated=(*me.treated, casualty), moving=False, helpers=me.helpers + green)
    desk.fire(name, "treated")
    _strike_off(desk, name, casualty)


def arrived(desk: Desk, name: str) -> None:
    """He stands where he was told: treats, unless somebody else has, which he sees; if nobody is there, he looks around."""
    me: Medic = desk.agents[name]
    if me.state == "fetch":
        desk.heard(name)
    if me.state in ("fetch", "call"):
        desk.fire(name, "arrived")
    if me.state in ("fetch", "call", "idle"):
        stay(desk, name)
    if me.state != "go":
        return
    report = me.queue[0]
    if report.id not in (me.examined or {}) and report.id not in desk.tags:
        if me.looked < _LOOKS:
            desk.fire(name, "arrived, nobody there")
            desk.change(name, looked=me.looked + 1)
            _look_around(desk, name, report, 4.0 ** (me.looked + 1))
        else:
            desk.fire(name, "looked around in vain")
            desk.note(name, "not there", report.id)
            _strike_off(desk, name, report.id)
        return
    if report.id in desk.tags:
        desk.fire(name, "arrived, already treated")
        _strike_off(desk, name, report.id)
        return
    desk.fire(name, "arrived")
    seconds = desk.settings.treat[_category(me, report.id)] / (1.0 + desk.settings.help_gain * me.helpers)
    desk.tags |= {report.id}
    desk.note(name, "treatment", report.id)
    desk.change(name, treat_until=desk.time + seconds, heading_for="")
    x, y = desk.here(name)
    desk.send(name, [Waypoint(x, y, hold=seconds, task=report.id)])


def stay(desk: Desk, name: str) -> None:
    """Nothing to treat: he stays. Where UGVs report to him, he has one that is done take over a section that is overdue."""
    me: Medic = desk.agents[name]
    if desk.policy.receiver != "medic" or desk.policy.everywhere or name in desk.mute:
        desk.send(name, ())
        return
    busy = {e.by for e in me.board.values() if e.rest >= 0}
    free = {e.by: e.place for e in me.board.values() if e.rest < 0 and e.by not in busy | me.called}
    if free and overdue(desk, me.board):
        here = desk.here(name)
        ugv = min(free, key=lambda u: (hypot(free[u][0] - here[0], free[u][1] - here[1]), u))
        desk.change(name, called=me.called | {ugv}, heading_for="")
        desk.fire(name, "section overdue")
        desk.drive(name, desk.team.on_foot(here, desk.stand(name, free[ugv])), _speed(desk, name))
        return
    later = [t for s in me.board if desk.time + 1e-6 < (t := due(desk, s, me.board)) < inf]
    if later:
        desk.drive(name, [desk.here(name)], _speed(desk, name), hold=min(later) - desk.time)
    else:
        desk.send(name, ())


def restart(desk: Desk, name: str) -> None:
    """Set out again for what he was doing, from where he is."""
    me: Medic = desk.agents[name]
    if me.state == "treat":
        x, y = desk.here(name)
        desk.send(name, [Waypoint(x, y, hold=max(me.treat_until - desk.time, 0.0), task=me.queue[0].id)])
    elif me.state in ("go", "plan"):
        desk.change(name, heading_for="")
        _plan(desk, name)
    elif me.state == "fetch":
        _fetch(desk, name)
    else:
        desk.change(name, state="idle")
        stay(desk, name)


def device_failed(desk: Desk, name: str) -> None:
    """He can hear nobody any more: when he has treated all whom he knows of, he goes for the spare device."""
    if desk.fire(name, "device dead"):
        _fetch(desk, name)


def device_works(desk: Desk, name: str) -> None:
    """He hears again, and has no need of the spare device."""
    if desk.fire(name, "heard again"):
        stay(desk, name)


def _fetch(desk: Desk, name: str) -> None:
    """Walk to the nearest depot: the rendezvous or, without one, where a medic started. There the spare devices are."""
    here = desk.here(name)
    place = min(desk.team.depots, key=lambda d: (hypot(d[0] - here[0], d[1] - here[1]), d))
    desk.change(name, heading_for="")
    desk.drive(name, desk.team.on_foot(here, desk.stand(name, place)), _speed(desk, name))


def _look_around(desk: Desk, name: str, report: Report, sigmas: float) -> None:
    """Search outwards from where the casualty was told to be."""
    side = 2.0 * max(sigmas * desk.settings.position_error, desk.settings.medic_sees)
    x, y = report.x, report.y
    around = as_multipolygon(desk.team.foot.intersection(box(x - side / 2, y - side / 2, x + side / 2, y + side / 2)))
    spacing = LEGS * max(desk.settings.medic_sees, 0.1)
    ways = desk.team.on_foot
    corners = [*ways(desk.here(name), (x, y)), *expanding_square((x, y), around, spacing, ways)]
    desk.drive(name, corners, _speed(desk, name))


def meets_medic(desk: Desk, one: str, other: str) -> None:
    """Two medics tell each other whom they have treated, and what each will do, so that none walks for nothing."""
    a, b = desk.agents[one], desk.agents[other]
    for name, me, them in ((one, a, b), (other, b, a)):
        over = {*them.treated, *([them.queue[0].id] if them.state == "treat" else [])}
        busy = me.queue[0].id if me.state in ("go", "treat") and me.queue else ""
        if drop := {r.id for r in me.queue if r.id in over and r.id != busy}:
            desk.change(name, queue=tuple(r for r in me.queue if r.id not in drop))
            _plan(desk, name)


def belief(desk: Desk, name: str) -> Belief:
    """Return what one knows who meets the medic now and is shown his queue."""
    me: Medic = desk.agents[name]
    treating = me.state == "treat"
    stops = tuple((r.x, r.y, RANK[r.sort]) for r in (me.queue[1:] if treating else me.queue))
    busy = max(0.0, me.treat_until - desk.time) if treating else 0.0
    seconds = desk.settings.treat["red"] / (1.0 + desk.settings.help_gain * me.helpers)
    return Belief(desk.time, *desk.here(name), _speed(desk, name), seconds, busy, stops)


def _category(me: Medic, casualty: str) -> str:
    return (me.examined or {}).get(casualty, "red")


def _speed(desk: Desk, name: str) -> float:
    me: Medic = desk.agents[name]
    return desk.team.pace(name, desk.settings) * max(0.5, 1.0 - desk.settings.fatigue * me.walked / 100.0)


def _strike_off(desk: Desk, name: str, casualty: str) -> None:
    me: Medic = desk.agents[name]
    desk.change(name, queue=tuple(r for r in me.queue if r.id != casualty), heading_for="")
    _plan(desk, name)


def _plan(desk: Desk, name: str) -> None:
    """Put the queue in order and, unless he is treating, walk to the first."""
    me: Medic = desk.agents[name]
    treating = me.state == "treat"
    head, rest = (me.queue[:1], me.queue[1:]) if treating else ((), me.queue)
    queue = head + _in_order(desk, name, rest)
    desk.change(name, queue=queue)
    desk.replanned.add(name)
    if treating:
        return
    if not queue:
        if name in desk.mute:
            desk.fire(name, "nothing left, device dead")
            _fetch(desk, name)
        elif desk.fire(name, "nothing left"):
            stay(desk, name)
        return
    desk.fire(name, "path planned")
    if queue[0].id == me.heading_for:
        return
    here = desk.here(name)
    walked = me.walked + ((here[0] - me.last[0]) ** 2 + (here[1] - me.last[1]) ** 2) ** 0.5
    desk.change(name, heading_for=queue[0].id, walked=walked, last=here, looked=0)
    corners = desk.team.on_foot(here, desk.stand(name, (queue[0].x, queue[0].y)))
    desk.drive(name, corners, _speed(desk, name))


def _in_order(desk: Desk, name: str, reports: tuple[Report, ...]) -> tuple[Report, ...]:
    """Return the reports as the method's medic would take them from where he is."""
    order = desk.settings.order or desk.policy.order
    if len(reports) < 2 or order == "first-come":
        return reports
    points = np.array([desk.here(name), *((r.x, r.y) for r in reports)])
    distance = desk.team.distances(points)
    if order == "priority":
        ranks = np.array([RANK[r.sort] for r in reports])
        return tuple(reports[i] for i in priority_order(distance, ranks).order)
    at, left, chosen = 0, list(range(1, len(points))), []
    while left:
        at = min(left, key=lambda j: (distance[at, j], j))
        left.remove(at)
        chosen.append(reports[at - 1])
    return tuple(chosen)
