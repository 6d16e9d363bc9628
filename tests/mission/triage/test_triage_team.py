"""What a triage scenario must have, each lack told in one line."""

from dataclasses import replace
from pathlib import Path

import pytest
from shapely import LineString, MultiPolygon, box

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.scenario import Casualty, Obstacle, Scenario, Site
from quarterdeck.mission.triage.generate import generate, paper_team
from quarterdeck.mission.triage.outcome import run_triage
from quarterdeck.mission.triage.settings import METHODS, Settings
from quarterdeck.mission.triage.team import make_team
from quarterdeck.mission.world import Fault


def walled() -> Scenario:
    """The paper's field with a wall from the north and a block."""
    base = paper_team()
    obstacles = (Obstacle("wall", box(38, 30, 42, 50)), Obstacle("block", box(10, 10, 20, 18), frozenset({"ground"})))
    return replace(base, site=Site(base.site.areas, base.site.operating, obstacles))


@pytest.mark.parametrize(("method", "rendezvous"), [*((m, "fixed") for m in sorted(METHODS)), ("relay", "round-robin")])
def test_obstacles_are_gone_around(method: str, rendezvous: str) -> None:
    """With obstacles all are found and treated, and nobody's track crosses one."""
    scenario = generate(walled(), 5, casualties=(10, 10))
    o = run_triage(scenario, method, Settings(rendezvous=rendezvous))
    assert o.reasons == ()
    for name, track in o.run.tracks.items():
        domain = "aerial" if name.startswith("uav") else "ground"
        blocked = [b.polygon.buffer(-0.01) for b in scenario.site.obstacles if domain in b.blocks]
        assert len(track) < 2 or not any(LineString(track[:, 1:]).intersects(b) for b in blocked)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: replace(s, vehicles=s.vehicles[3:]), "no UGV"),
        (lambda s: replace(s, vehicles=s.vehicles[:3]), "needs a UAV"),
        (lambda s: replace(s, medics=()), "no medic"),
        (lambda s: replace(s, rendezvous=(("r", (90.0, 25.0)),)), "rendezvous 'r' is 10.0 m outside"),
        (lambda s: replace(s, casualties=(Casualty("c", (40.0, 40.0), "red"),)), "casualty 'c' is inside obstacle 'wall'"),
        (lambda s: replace(s, casualties=(Casualty("c", (-1.0, 40.0), "red"),)), "casualty 'c' is outside"),
        (lambda s: replace(s, medics=(("ugv1", (40.0, 25.0)),)), "'ugv1' is given twice"),
        (lambda s: replace(s, casualties=(Casualty("c", (5.0, 5.0), "red"),) * 2), "'c' is given twice"),
        (lambda s: replace(s, site=Site((), MultiPolygon([box(0, 0, 80, 50)]))), "no field"),
    ],
)
def test_what_lacks_is_one_clear_line(change, words) -> None:  # type: ignore[no-untyped-def]
    """Each lack is an InputError that names it."""
    with pytest.raises(InputError, match=words) as error:
        run_triage(change(walled()))
    assert "\n" not in str(error.value)


def test_a_search_begins_on_the_ugvs_own_side_of_a_wall() -> None:
    """The nearest place of the tour lies behind a fence: the UGV drives around to it."""
    base = paper_team(ugvs=1)
    fence = Obstacle("fence", box(39.0, 0.0, 39.2, 45.0))
    scenario = replace(base, site=Site(base.site.areas, base.site.operating, (fence,)))
    scenario = replace(scenario, vehicles=tuple(replace(v, start=(38.4, 20.0)) for v in base.vehicles))
    path = make_team(scenario, "no-relay", Settings()).search.paths[0]
    assert LineString([(38.4, 20.0), *path]).distance(fence.polygon) > 0.4


def test_all_of_the_sample_is_searched() -> None:
    """A detour to what tours leave out takes the UGV off the leg that it is put into: that is made up for."""
    scenario = read_scenario(Path(__file__).parents[3] / "data" / "triage_drill.geojson")
    for bodies in (False, True):
        assert make_team(scenario, "relay", Settings(), bodies=bodies).search.missed == 0


def test_no_uav_is_needed_without_a_relay() -> None:
    """A scenario without UAV runs by the methods that use none."""
    scenario = generate(paper_team(uavs=0), 1)
    assert run_triage(scenario, "no-relay").reasons == ()
    assert run_triage(scenario, "constant").reasons == ()


def test_a_fault_of_nobody_is_refused() -> None:
    """A misspelt name in --fail is told."""
    with pytest.raises(InputError, match="ugv9"):
        run_triage(paper_team(), faults=[Fault("ugv9", 1.0)])


@pytest.mark.parametrize(
    "wrong", [{"talk": 0.0}, {"confidence": 2.0}, {"clusters": 0}, {"order": "x"}, {"rendezvous": "x"}]
)
def test_wrong_settings_are_refused(wrong: dict) -> None:
    """Each setting is checked where it is made."""
    with pytest.raises(InputError):
        Settings(**wrong)
