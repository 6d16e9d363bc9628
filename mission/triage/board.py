"""The board: what each member knows of how far the sections are searched. Who meets compares; the younger word counts.

A section that is overdue has lost its UGV, as far as anybody can know: one that is done takes over what is left of it, from
where the last word has it. What the lost one had found since, and told nobody, lies there and is found again.
"""

from collections.abc import Mapping
from itertools import pairwise
from math import hypot, inf

from quarterdeck.mission.triage.desk import Desk
from quarterdeck.mission.triage.records import Section, Ugv
from quarterdeck.mission.triage.team import Team

_SLACK = 1.5  # times the seconds of an undisturbed search, and the patience: then a section is overdue


def first_board(team: Team) -> dict[str, Section]:
    """Return what all know at the start."""
    return {name: Section(0.0, 0, robot.start, name) for name, robot in team.ugvs.items()}


def compare_boards(desk: Desk, one: str, other: str) -> None:
    """Let two in range have the younger word of each section."""
    for name in (one, other):
        if isinstance(desk.agents[name], Ugv):
            write_own(desk, name)
    a, b = desk.agents[one].board, desk.agents[other].board
    if a is not b:
        both = {s: x if x is (y := b[s]) or _word(x) >= _word(y) else y for s, x in a.items()}
        for name in (one, other):
            desk.change(name, board=both)


def _word(entry: Section) -> tuple[float, bool]:
    """Return what the younger word, or of one moment the last of a section, has more of."""
    return entry.time, entry.rest < 0


def compare_in_range(desk: Desk, name: str) -> None:
    """Let a member compare boards with everybody who hears it."""
    for other in desk.agents:
        if other != name and other not in desk.out | desk.mute and desk.distance(name, other) <= desk.reach:
            compare_boards(desk, name, other)


def due(desk: Desk, section: str, board: Mapping[str, Section]) -> float:
    """Return the second from which on a section is overdue; infinity if it is searched.

    Where UGVs must look for the medic it never is: those that found nobody are done without a word.
    """
    entry = board[section]
    looking = desk.policy.receiver == "medic" and not desk.policy.everywhere and not desk.settings.knows_medic
    if entry.rest < 0 or looking:
        return inf
    robot = desk.team.ugvs[section]
    way = [entry.place, *((w.x, w.y) for w in robot.path[entry.rest :])]
    length = sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(way))
    return entry.time + _SLACK * length / robot.speed + desk.settings.patience


def overdue(desk: Desk, board: Mapping[str, Section]) -> list[str]:
    """Return the sections that are overdue, the longest first."""
    when = {s: due(desk, s, board) for s in board}
    return sorted((s for s in board if when[s] <= desk.time + 1e-6), key=lambda s: (when[s], s))


def write_own(desk: Desk, name: str) -> None:
    """A UGV writes on its own board how far it is: no further than to where a medic is known to have all that it found."""
    me: Ugv = desk.agents[name]
    mine = me.board[me.section]
    if me.state == "done":
        rest, place = -1, desk.here(name)
    elif mine.by != name:  # it was taken for lost
        return
    elif me.reports:
        rest, place = mine.rest, mine.place
    elif me.state == "explore":
        done = desk.states[name].reached if name not in desk.commands else 0
        rest, place = me.rest + done, desk.here(name)
    else:
        rest, place = me.rest, me.left or desk.here(name)
    if mine.rest >= 0 and (mine.time < desk.time or rest < 0):
        desk.change(name, board={**me.board, me.section: Section(desk.time, rest, place, name)})
