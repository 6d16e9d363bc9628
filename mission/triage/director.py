"""The triage director: what every UGV, UAV and medic does next (Weaver et al. 2025, Sec. V).

A world reports what somebody sees, whom he meets, what is served, who is lost and who is idle. In the rooms `ugv`, `uav`
and `medic` that becomes events of the machines in `machines`, whose rows say what is done and what comes next. A record of
`records` is what one member knows; only `_talk` moves knowledge between two, and only when they are in range.
"""

from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations
from typing import Any

from quarterdeck.mission.director import Command, Director, Event, State
from quarterdeck.mission.triage import medic, uav, ugv
from quarterdeck.mission.triage.board import compare_boards, first_board
from quarterdeck.mission.triage.desk import Desk
from quarterdeck.mission.triage.energy import watch_energy
from quarterdeck.mission.triage.records import Belief, Medic, Memory, Report, Uav, Ugv
from quarterdeck.mission.triage.settings import Policy, Settings
from quarterdeck.mission.triage.team import Team


def triage(team: Team, policy: Policy, settings: Settings) -> Director:
    """Return the director of a team.

    Its events: `seen` by a UGV or medic (subject the casualty; data `x`, `y`, `sort`, for medics
    `category`, for robots `error`, how far off they take it to be), `met`
    (two in range), `served` (a medic's treatment is over), `lost` (data `kind`: stop, or mute: only the device failed),
    `returned` (the device works again). A team with a stand goes on from there; the director's times count from the
    mission's beginning, the world's from the stand.
    """
    began = team.began
    gone = {name: State(x, y, alive=False) for name, (x, y) in team.gone.items()}

    def direct(
        time: float, states: Mapping[str, State], events: tuple[Event, ...], memory: Memory | None
    ) -> tuple[dict[str, Command], Any]:
        known = memory or (team.stand.memory if team.stand else None)
        desk = Desk(team, policy, settings, time + began, {**states, **gone} if gone else states, known)
        if memory is None:
            if team.stand:
                desk.commands = {name: Command(left) for name, left in team.stand.left.items() if name not in gone}
                watch_energy(desk)
            else:
                _begin(desk)
            return _answer(desk)
        for event in events:
            _notice(desk, event)
        for name in desk.agents:
            if not desk.states[name].alive:
                desk.lose(name, "stop")
        for name in tuple(desk.agents):
            if desk.agents[name].moving and desk.states[name].idle and name not in desk.commands and name not in desk.out:
                _ROOM[type(desk.agents[name])].arrived(desk, name)
        _talk(desk, {(e.vehicle, e.subject) for e in events if e.kind == "met"})
        watch_energy(desk)
        return _answer(desk)

    return direct


def _answer(desk: Desk) -> tuple[dict[str, Command], Memory]:
    """Return commands and memory, what times the world reads of them in its own."""
    commands, memory, began = desk.commands, desk.memory(), desk.team.began
    if began:
        memory = replace(memory, wake=memory.wake - began)
        commands = {
            name: Command(tuple(replace(w, time=max(w.time - began, 0.0)) if w.time else w for w in c.waypoints))
            for name, c in commands.items()
        }
    return commands, memory


_ROOM = {Ugv: ugv, Uav: uav, Medic: medic}


def _begin(desk: Desk) -> None:
    """All know where the medics start, and that they have nothing to do yet."""
    team, settings = desk.team, desk.settings
    treat = settings.treat["red"]
    beliefs = {m: Belief(0.0, *xy, settings.medic_speed, treat) for m, xy in team.medics.items()}
    board = first_board(team)
    for name in team.ugvs:
        desk.agents[name] = Ugv(name, board, beliefs=beliefs)
        ugv.resume(desk, name)
    for name in team.uavs:
        visits = {u: (0.0, 0, r.start) for u, r in team.ugvs.items()}
        desk.agents[name] = Uav(board, beliefs=beliefs, visits=visits, misses={})
        uav.go_home(desk, name)
    for name, xy in team.medics.items():
        desk.agents[name] = Medic(board, last=xy)
        medic.stay(desk, name)


def _notice(desk: Desk, event: Event) -> None:
    """Turn what a world reports into what its observer knows."""
    if event.kind == "lost":
        desk.lose(event.vehicle, event.data.get("kind", "stop"))
        if event.vehicle in desk.mute - desk.out and event.vehicle in desk.team.medics:
            medic.device_failed(desk, event.vehicle)
    elif event.kind == "returned":
        desk.heard(event.vehicle)
        if event.vehicle in desk.team.medics:
            medic.device_works(desk, event.vehicle)
        elif event.vehicle in desk.team.ugvs and desk.agents[event.vehicle].state == "done":
            ugv.stand_by(desk, event.vehicle)
    elif event.vehicle in desk.out:
        return
    elif event.kind == "seen" and event.subject not in desk.tags:
        record = desk.agents[event.vehicle]
        data = event.data
        report = Report(event.subject, data["x"], data["y"], data["sort"], event.vehicle, desk.time)
        if isinstance(record, Medic):
            medic.saw(desk, event.vehicle, report, data["category"])
        elif isinstance(record, Ugv):
            dx, dy = data.get("error", (0.0, 0.0))
            ugv.saw(desk, event.vehicle, replace(report, x=report.x + dx, y=report.y + dy))
    elif event.kind == "served" and isinstance(desk.agents[event.vehicle], Medic):
        medic.treated(desk, event.vehicle, event.subject)


def _compare(desk: Desk, a: str, b: str) -> None:
    """Let two in range compare boards; a UGV that is done may learn that it is needed, or that nobody is missing.

    It looks once at what it knows: in a crowd of k each would else look at the same k squared times in a call.
    """
    called = any(desk.agents[name].state == "call" for name in (a, b))
    before = {name: desk.agents[name].board for name in (a, b)}
    compare_boards(desk, a, b)
    for name, board in before.items():
        it = desk.agents[name]
        if not isinstance(it, Ugv) or it.state != "done":
            continue
        if called or (it.board is not board and it.board != desk.looked.get(name)):
            ugv.stand_by(desk, name)
            desk.looked[name] = desk.agents[name].board


def _talk(desk: Desk, met: set[tuple[str, str]]) -> None:
    """Let all who are in range, or have been since the last call, exchange what they have to, until nobody has news."""
    able = [n for n in desk.agents if n not in desk.out | desk.mute]
    pairs = [p for p in combinations(able, 2) if p in met or desk.distance(*p) <= desk.reach]
    for a, b in pairs:
        _compare(desk, a, b)
    pending = bool(pairs)
    while pending:
        pending = False
        for a, b in pairs:  # UGVs come before UAVs, UAVs before medics
            one, other = desk.agents[a], desk.agents[b]
            if isinstance(one, Ugv) and isinstance(other, Uav):
                pending |= ugv.meets_uav(desk, a, b)
            elif isinstance(one, Ugv) and isinstance(other, Medic):
                pending |= ugv.meets_medic(desk, a, b)
            elif isinstance(one, Uav) and isinstance(other, Medic):
                pending |= uav.meets_medic(desk, a, b)
            elif isinstance(one, Uav) and isinstance(other, Uav):
                uav.meets_uav(desk, a, b)
            elif isinstance(one, Medic) and isinstance(other, Medic):
                medic.meets_medic(desk, a, b)
    if desk.replanned and desk.policy.receiver == "medic" and desk.settings.knows_medic:
        ugv.aim_again(desk)
