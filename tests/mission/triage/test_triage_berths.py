"""Where members with bodies wait at a rendezvous: nobody under a UAV, everybody heard."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely import box

from quarterdeck.geo.scenario import Obstacle, Scenario, Site
from quarterdeck.mission.triage.generate import paper_team
from quarterdeck.mission.triage.settings import Settings
from quarterdeck.mission.triage.team import Team, make_team


def waiting(scenario: Scenario, talk: float) -> tuple[Team, np.ndarray, np.ndarray]:
    """Return the team, (g, 2) UGVs' and (u, 2) UAVs' places at the rendezvous, in metres from it."""
    team = make_team(scenario, "relay", Settings(talk=talk), bodies=True)
    ugvs, uavs = (np.array([r.berth for r in kind.values()]) + team.beside for kind in (team.ugvs, team.uavs))
    return team, ugvs, uavs


def apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the metres between places."""
    return np.linalg.norm(one[:, None] - other, axis=-1)


@pytest.mark.parametrize("talk", [2.0, 6.0])
@pytest.mark.parametrize("uavs", [1, 2])
@pytest.mark.parametrize("ugvs", [1, 2, 3, 4, 5])
def test_nobody_waits_below_a_uav_and_all_hear_it(ugvs: int, uavs: int, talk: float) -> None:
    """A UAV that fails falls beside UGVs, other UAVs and who stands at the rendezvous; each UGV is in range of each UAV."""
    _, ground, air = waiting(paper_team(ugvs=ugvs, uavs=uavs), talk)
    assert np.linalg.norm(air, axis=1).min() > 1.1
    assert np.linalg.norm(ground, axis=1).min() > 0.6
    assert apart(ground, air).min() > 0.75  # hulls of 0.5 m
    assert uavs == 1 or apart(air[:1], air[1:]).min() > 0.55
    assert apart(ground, air).max() < talk - 0.1


def test_what_is_in_the_way_is_kept_clear_of() -> None:
    """By a wall, in the corner of the site, all wait where they may be, or the nearest to it."""
    base = paper_team(ugvs=3, uavs=2)
    wall = Obstacle("wall", box(1.0, 3.0, 30.0, 3.5))
    scenario = replace(base, site=Site(base.site.areas, base.site.operating, (wall,)), rendezvous=(("r", (8.0, 2.3)),))
    team, ground, air = waiting(scenario, 4.0)
    places = np.array([8.0, 2.3]) + np.concatenate([ground, air])
    assert shapely.contains_xy(team.ground.buffer(1e-6), *places.T).all()


def test_points_meet_at_the_rendezvous() -> None:
    """In the fast world, where nobody has a body, all meet at one place, as in the paper."""
    team = make_team(paper_team(), "relay", Settings())
    assert team.beside == (0.0, 0.0)
    assert {r.berth for r in (*team.ugvs.values(), *team.uavs.values())} == {(0.0, 0.0)}
