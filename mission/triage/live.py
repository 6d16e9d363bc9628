"""Triage where nobody says who sees whom: a world that only knows poses, such as PyBullet, and the director on top.

The fast world tells its director of sightings and meetings in closed form; here they are found from where everybody was
and is at two calls, in between which they moved straight. Sight has no walls.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Scenario, Vehicle
from quarterdeck.mission.director import Command, Director, Event, State
from quarterdeck.mission.mission import Mission, Route, Waypoint
from quarterdeck.mission.triage.director import triage
from quarterdeck.mission.triage.settings import METHODS, Settings
from quarterdeck.mission.triage.team import make_team, targets
from quarterdeck.mission.world import Actor, Target


@dataclass(frozen=True, slots=True)
class Seen:
    """Memory: the inner director's, who has seen what, who is in range of whom, and where all were at the last call."""

    inner: Any
    sights: frozenset[tuple[str, str]]
    contacts: frozenset[tuple[str, str]]
    at: Mapping[str, tuple[float, float]]


def live_triage(
    scenario: Scenario, method: str = "relay", settings: Settings | None = None, *, seed: int = 0
) -> tuple[Mission, Director]:
    """Return the mission in which medics walk as vehicles do, and the director that runs the state machines in it."""
    settings = settings or Settings()
    team = make_team(scenario, method, settings)
    walker = load_model("walker")
    medics = [
        Vehicle(name, walker, xy, speed=settings.medic_speed, clearance=walker.clearance)
        for name, xy in team.medics.items()
    ]
    vehicles = (*(v for v in scenario.vehicles if v.id in team.ugvs or v.id in team.uavs), *medics)
    mission = Mission(
        name=scenario.name,
        frame=scenario.frame,
        site=scenario.site,
        vehicles=vehicles,
        routes=tuple(Route(v.id, (Waypoint(*v.start, leg="start"),)) for v in vehicles),
        method=f"triage {method}",
        seed=seed,
        casualties=scenario.casualties,
        input_hash=scenario.input_hash,
    )
    policy = METHODS[method]
    reach = float("inf") if policy.everywhere else settings.talk
    inner = triage(team, policy, settings)
    return mission, observing(inner, team.actors(settings), targets(scenario, settings, seed), reach)


def observing(director: Director, actors: Sequence[Actor], spots: Sequence[Target], reach: float) -> Director:
    """Return the director that adds to a world's events who has `seen` which target and who has `met` whom, once each."""
    places = np.array([(s.x, s.y) for s in spots], dtype=float).reshape(-1, 2)

    def direct(
        time: float, states: Mapping[str, State], events: tuple[Event, ...], memory: Seen | None
    ) -> tuple[dict[str, Command], Any]:
        known = memory or Seen(None, frozenset(), frozenset(), {n: (s.x, s.y) for n, s in states.items()})
        now = {n: (s.x, s.y) for n, s in states.items()}
        if memory is None:  # nothing is noticed before everybody has begun
            commands, inner = director(time, states, events, None)
            return commands, Seen(inner, known.sights, known.contacts, now)
        sights, noticed = set(known.sights), list(events)
        for a in actors:
            if not states[a.id].alive or a.sees <= 0:
                continue
            for k in map(int, np.flatnonzero(_nearest(np.array(known.at[a.id]), np.array(now[a.id]), places) <= a.sees)):
                target = spots[k]
                if (a.id, target.id) not in sights:
                    sights.add((a.id, target.id))
                    noticed.append(Event("seen", a.id, target.id, {"x": target.x, "y": target.y, **target.data}))
        contacts = set()
        for a, b in combinations(actors, 2):
            was = np.subtract(known.at[a.id], known.at[b.id])
            away = np.subtract(now[a.id], now[b.id])
            if states[a.id].alive and states[b.id].alive and _nearest(was, away, np.zeros((1, 2)))[0] <= reach:
                if (a.id, b.id) not in known.contacts:
                    noticed.append(Event("met", a.id, b.id))
                contacts.add((a.id, b.id))
        commands, inner = director(time, states, tuple(noticed), known.inner)
        return commands, Seen(inner, frozenset(sights), frozenset(contacts), now)

    return direct


def _nearest(before: np.ndarray, after: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return (m,) metres from (m, 2) places to the straight way between two points (2,)."""
    step = after - before
    along = np.clip((places - before) @ step / max(float(step @ step), 1e-12), 0.0, 1.0)
    return np.hypot(*(places - before - along[:, None] * step).T)
