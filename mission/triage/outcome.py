"""One triage mission in the fast world, and what became of every casualty."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Scenario
from quarterdeck.mission.triage.director import triage
from quarterdeck.mission.triage.records import Entry, Memory, Stand
from quarterdeck.mission.triage.search import Search
from quarterdeck.mission.triage.settings import METHODS, Settings
from quarterdeck.mission.triage.sight import seen_by
from quarterdeck.mission.triage.team import Team, field_of, make_team, targets
from quarterdeck.mission.world import MOST_TIME, Fault, Run, run_world


@dataclass(frozen=True, slots=True)
class Fate:
    """What became of a casualty. Times in seconds from the mission's start, None where it did not happen.

    `sort` is what the robots took it for, `category` what the medic confirmed; `reported` is when a UAV or medic was first
    told or a medic saw it, `delivered` when a medic knew, `reached` when his treatment began. `undeliverable`: told so.
    """

    id: str
    x: float
    y: float
    colour: str
    sort: str | None = None
    category: str | None = None
    found: float | None = None
    found_by: str | None = None
    reported: float | None = None
    reported_by: str | None = None
    delivered: float | None = None
    delivered_by: str | None = None
    reached: float | None = None
    treated: float | None = None
    treated_by: str | None = None
    undeliverable: bool = False

    @property
    def state(self) -> str:
        """One word for where it stands at the end."""
        if self.treated is not None:
            return "treated"
        if self.undeliverable:
            return "undeliverable"
        return "delivered" if self.delivered is not None else "found" if self.found is not None else "not found"


@dataclass(frozen=True, slots=True)
class Outcome:
    """A mission that has been run. `end` is when the last casualty was treated or the last UGV finished its search or, of a
    run that was cut short, when that was. `faults` are what befell it.

    `reasons` say, one line each, what could not be done; there are none if all was searched, found and treated. `told` is
    where the robots say that casualties are, which is off by their position error.
    """

    scenario: Scenario
    method: str
    settings: Settings
    seed: int
    team: Team
    fates: tuple[Fate, ...]
    log: tuple[Entry, ...]
    run: Run
    end: float
    reasons: tuple[str, ...]
    told: Mapping[str, tuple[float, float]]
    faults: tuple[Fault, ...] = ()


def run_triage(
    scenario: Scenario,
    method: str = "relay",
    settings: Settings | None = None,
    *,
    seed: int = 0,
    faults: Sequence[Fault] = (),
    search: Search | None = None,
) -> Outcome:
    """Run a method on a scenario in the fast world and return what became of every casualty.

    `seed` decides only what robots sort and measure wrongly, where the settings say that they do; `search` gives the UGVs
    other paths than their tours. Raises InputError as `make_team` does, or if a fault names nobody of the team.
    """
    settings = settings or Settings()
    return run_team(scenario, make_team(scenario, method, settings, search), method, settings, seed=seed, faults=faults)


def run_team(
    scenario: Scenario, team: Team, method: str, settings: Settings, *, seed: int = 0, faults: Sequence[Fault] = ()
) -> Outcome:
    """Run a team that has been made in the fast world; see `run_triage`. What fails of a medic is his device."""
    names = [*team.ugvs, *team.uavs, *team.medics]
    for fault in faults:
        known = {*names, *(v.id for v in scenario.vehicles)}
        if fault.actor not in known:
            raise InputError(f"--fail {fault.actor}: nobody has this name; use one of {', '.join(sorted(known))}")
    there = {*names} - team.gone.keys()
    faults = [f for f in faults if f.actor in there]
    faults = [replace(f, kind="mute") if f.actor in team.medics and f.kind == "stop" else f for f in faults]
    run = run_members(scenario, team, method, settings, seed=seed, faults=faults)
    return replace(judge(scenario, team, method, settings, run, seed=seed), faults=tuple(faults))


def run_members(
    scenario: Scenario,
    team: Team,
    method: str,
    settings: Settings,
    *,
    seed: int,
    faults: Sequence[Fault] = (),
    until: float = MOST_TIME,
) -> Run:
    """Run a team in the fast world for `until` seconds at the most; see `run_world`."""
    actors = team.actors(settings)
    # What UGVs have to tell each other, they tell while they wait together: the moment of their meeting is nothing.
    pairs = [(i, j) for i, j in combinations(range(len(actors)), 2) if actors[j].id not in team.ugvs]
    seen = targets(scenario, settings, seed)
    director = triage(team, METHODS[method], settings)
    return run_world(director, actors, seen, pairs, reach_of(method, settings), faults=faults, until=until)


def reach_of(method: str, settings: Settings) -> float:
    """Return how far two members of a team hear each other, metres."""
    return float("inf") if METHODS[method].everywhere else settings.talk


def judge(scenario: Scenario, team: Team, method: str, settings: Settings, run: Run, *, seed: int) -> Outcome:
    """Return what became of every casualty in a run, in whichever world: `run.memory` is the director's."""
    seen = targets(scenario, settings, seed)
    memory: Memory = run.memory
    if team.stand is not None:
        run = _since_the_beginning(run, team.stand)
    fates = _fates(scenario, memory.log, {t.id: t.data for t in seen})
    searched = [e.time for e in memory.log if e.what == "state" and e.whom == "section searched"]
    end = run.end if run.reason else max([0.0, *searched, *(f.treated for f in fates if f.treated is not None)])
    told = {t.id: (t.x + t.data["error"][0], t.y + t.data["error"][1]) for t in seen}
    reasons = _reasons(scenario, team, fates, memory, run)
    return Outcome(scenario, method, settings, seed, team, fates, memory.log, run, end, reasons, told)


def _since_the_beginning(run: Run, stand: Stand) -> Run:
    """Return a run that goes on from a stand with its times from the mission's beginning, and those who are gone in it."""
    tracks = {name: track + np.array([stand.time, 0.0, 0.0]) for name, track in run.tracks.items()}
    tracks |= {name: np.array([(stand.time, x, y)] * 2) for name, (x, y) in stand.gone.items()}
    return replace(run, tracks=tracks, end=stand.time + run.end)


def _fates(scenario: Scenario, log: Sequence[Entry], data: Mapping[str, Mapping[str, str]]) -> tuple[Fate, ...]:
    first: dict[tuple[str, str], Entry] = {}
    for entry in log:
        first.setdefault((entry.what, entry.about), entry)
    medics = {m for m, _ in scenario.medics}
    fates = []
    for c in scenario.casualties:
        found, handed, delivered, treatment, treated = (
            first.get((what, c.id)) for what in ("found", "handed", "delivered", "treatment", "treated")
        )
        own = next((e for e in log if e.what == "found" and e.about == c.id and e.who in medics), None)
        told = min((e for e in (delivered, own) if e), key=lambda e: e.time, default=None)
        reported = min((e for e in (handed, delivered, own) if e), key=lambda e: e.time, default=None)
        fates.append(
            Fate(
                c.id,
                *c.position,
                colour=c.colour,
                sort=data[c.id]["sort"] if found else None,
                category=treated.whom if treated else None,
                found=found.time if found else None,
                found_by=found.who if found else None,
                reported=reported.time if reported else None,
                reported_by=reported.who if reported else None,
                delivered=told.time if told else None,
                delivered_by=told.who if told else None,
                reached=treatment.time if treatment else None,
                treated=treated.time if treated else None,
                treated_by=treated.who if treated else None,
                undeliverable=told is None and ("undeliverable", c.id) in first,
            )
        )
    return tuple(fates)


def _reasons(scenario: Scenario, team: Team, fates: Sequence[Fate], memory: Memory, run: Run) -> tuple[str, ...]:
    reasons = [run.reason] if run.reason else []
    log = [e for e in memory.log if team.stand is None or e.time >= team.stand.shared_out]  # before, sections were others
    searched, taken = ({e.about for e in log if e.what == what} for what in ("searched", "takes over"))
    searched |= {e.about for e in log if e.what == "shared out"}
    home = {e.who: e.time for e in memory.log if e.what == "turns home"}
    for name in team.ugvs:
        if name not in searched and (name in memory.out or name in home):
            went = "stopped" if name in memory.out else f"turned home for want of energy at {home[name]:,.0f} s,"
            then = "who took it over did not finish it" if name in taken else "nobody took it over"
            reasons.append(f"{name} {went} before its section was searched, and {then}")
    if not searched >= team.ugvs.keys():
        left = field_of(scenario).difference(seen_by(team, run.tracks)).area - team.search.missed
        reasons += [f"{left:,.0f} m2 of the field were not searched"] if left >= 0.5 else []
    if team.uavs and home.keys() >= team.uavs.keys() - memory.out and any(f.state == "found" for f in fates):
        reasons += [f"{name} turned home for want of energy at {home[name]:,.0f} s" for name in team.uavs if name in home]
    if team.search.missed > 0:
        reasons.append(f"{team.search.missed:,.0f} m2 of the field cannot be seen from where the UGVs can go")
    for fate in fates:
        if fate.state == "not found":
            reasons.append(f"casualty {fate.id} ({fate.colour}) was not found")
        elif fate.state == "found":
            told = f"{fate.reported_by}, which told no medic" if fate.reported else f"{fate.found_by}, who told nobody"
            verb = "reported to" if fate.reported else "found by"
            reasons.append(f"casualty {fate.id} ({fate.colour}) was {verb} {told}")
        elif fate.state == "undeliverable":
            reasons.append(f"casualty {fate.id} ({fate.colour}) could not be told to any medic")
        elif fate.state == "delivered":
            reasons.append(f"casualty {fate.id} ({fate.colour}) was not treated")
    return tuple(reasons)
