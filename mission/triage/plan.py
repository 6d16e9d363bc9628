"""The triage mission as a PLAN: what everybody does before anything is found, and all that its director starts from."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.models import load_model
from quarterdeck.geo.scenario import Scenario, Vehicle
from quarterdeck.geo.version import VERSION
from quarterdeck.mission.director import Director
from quarterdeck.mission.mission import Mission, Route, Waypoint
from quarterdeck.mission.reason import Reason
from quarterdeck.mission.timing import shortfalls, timed_route
from quarterdeck.mission.triage.director import triage
from quarterdeck.mission.triage.outcome import Outcome, run_team
from quarterdeck.mission.triage.records import Stand
from quarterdeck.mission.triage.search import Search
from quarterdeck.mission.triage.settings import METHODS, Settings, as_parameters
from quarterdeck.mission.triage.stand import read_stand
from quarterdeck.mission.triage.team import Team, make_team
from quarterdeck.mission.world import Fault

METHOD = "triage"  # of a mission; which of the paper's four is among its parameters


def plan_triage(
    scenario: Scenario,
    method: str = "relay",
    settings: Settings | None = None,
    *,
    seed: int = 0,
    search: Search | None = None,
) -> Mission:
    """Return the mission of a method on a scenario, medics walking as vehicles do.

    Its routes are the UGVs' search paths, the UAVs' way to the rendezvous, and the medics' starts; its director changes
    them as casualties are found. `search` gives the UGVs other paths than their tours. Raises InputError as `make_team`
    does.
    """
    settings = settings or Settings()
    team = make_team(scenario, method, settings, search, bodies=True)
    walker = load_model("walker")
    if settings.medic_speed > walker.max_speed:
        raise InputError(f"a medic of {settings.medic_speed:g} m/s runs; on foot give at most {walker.max_speed:g}")
    robots = tuple(v for v in scenario.vehicles if v.id in team.ugvs or v.id in team.uavs)
    medics = tuple(on_foot(name, xy, settings) for name, xy in team.medics.items())
    vehicles = (*medics, *robots)  # where two are about to start, the first goes first: persons before robots
    routes = tuple(_route(v, team) for v in vehicles)
    reasons = [line for v, r in zip(vehicles, routes, strict=True) for line in shortfalls(v, r)]
    if team.search.missed > 0:
        reasons.append(Reason(f"{team.search.missed:,.0f} m2 of the field cannot be seen from where the UGVs can go"))
    return Mission(
        name=scenario.name,
        frame=scenario.frame,
        site=scenario.site,
        vehicles=vehicles,
        routes=routes,
        method=METHOD,
        parameters={"method": method, "medics": list(team.medics), "missed": team.search.missed}
        | {"settings": as_parameters(settings)},
        seed=seed,
        casualties=scenario.casualties,
        figures={
            "length": sum(r.length for r in routes),
            "makespan": max(r.duration for r in routes),
            "energy": sum(r.energy for r in routes),
        },
        reasons=tuple(reasons),
        input_hash=scenario.input_hash,
        version=VERSION,
    )


def on_foot(name: str, place: tuple[float, float], settings: Settings) -> Vehicle:
    """Return a medic as a vehicle."""
    walker = load_model("walker")
    sight = max(settings.medic_sees, 1.0)  # who bends over somebody sees him
    return Vehicle(name, walker, place, speed=settings.medic_speed, clearance=walker.clearance, range=sight)


def settings_of(mission: Mission) -> Settings:
    """Return the settings that a triage mission was planned with."""
    return Settings(**mission.parameters["settings"])


def scenario_of(mission: Mission) -> Scenario:
    """Return the scenario of a triage mission, its rendezvous where the UAVs' routes end.

    Who was given up belongs to it still: the others go on without him, as they would if they had missed him by themselves.
    """
    medics, members = set(mission.parameters["medics"]), (*mission.vehicles, *mission.lost)
    ends = {r.vehicle: (r.waypoints[-1].x, r.waypoints[-1].y) for r in mission.routes}
    return Scenario(
        name=mission.name,
        frame=mission.frame,
        site=mission.site,
        vehicles=tuple(v for v in members if v.id not in medics),
        casualties=mission.casualties,
        medics=tuple((v.id, v.start) for v in members if v.id in medics),
        rendezvous=tuple((v.id, ends[v.id]) for v in mission.vehicles if v.domain == "aerial" and v.id in ends),
        input_hash=mission.input_hash,
    )


def team_of(mission: Mission) -> Team:
    """Return the team of a triage mission; its UGVs' searches are those of their routes, or of how far it has come."""
    given = mission.parameters.get("stand")
    return team_at(mission, None if given is None else read_stand(given, mission))


def team_at(mission: Mission, stand: Stand | None) -> Team:
    """Return the team of a triage mission that has come as far as a stand."""
    scenario, method, settings = scenario_of(mission), mission.parameters["method"], settings_of(mission)
    ugvs = [v.id for v in scenario.vehicles if v.domain == "ground"]
    routes = {r.vehicle: r.xyz[1:, :2] for r in mission.routes}
    paths = tuple(np.array(stand.paths[u]) if stand else routes[u] for u in ugvs)
    search = Search(paths, float(mission.parameters["missed"]))
    team = make_team(scenario, method, settings, search, bodies=True, stand=stand)
    return replace(team, paces={v.id: v.speed for v in (*mission.vehicles, *mission.lost) if v.id in team.medics})


def director_of(mission: Mission) -> Director:
    """Return the director of a triage mission, for either world."""
    return triage(team_of(mission), METHODS[mission.parameters["method"]], settings_of(mission))


def run_plan(mission: Mission, faults: Sequence[Fault] = ()) -> Outcome:
    """Run a triage mission in the fast world."""
    method, settings = mission.parameters["method"], settings_of(mission)
    return run_team(scenario_of(mission), team_of(mission), method, settings, seed=mission.seed, faults=faults)


def _route(vehicle: Vehicle, team: Team) -> Route:
    x, y = vehicle.start
    if vehicle.id in team.ugvs:
        path = [(w.x, w.y, 0.0) for w in team.ugvs[vehicle.id].path]
        return timed_route(vehicle, np.array([(x, y, 0.0), *path]), ["start", *["survey"] * len(path)])  # type: ignore[list-item]
    if vehicle.id in team.uavs:
        robot = team.uavs[vehicle.id]
        way = [(*corner, robot.z) for corner in team.in_air(vehicle.start, robot.home[0][1])]
        points = np.array([(x, y, 0.0), (x, y, robot.z), *way])
        return timed_route(vehicle, points, ["start", "takeoff", *["transit"] * len(way)])  # type: ignore[list-item]
    return Route(vehicle.id, (Waypoint(x, y, leg="start"),))
