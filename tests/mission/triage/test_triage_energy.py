"""Robots of a triage mission come home on what their batteries have, and what is left undone is told."""

from dataclasses import replace

import numpy as np
import pytest

from quarterdeck.geo.scenario import Scenario
from quarterdeck.mission.timing import RESERVE
from quarterdeck.mission.triage.generate import generate, paper_team
from quarterdeck.mission.triage.outcome import Outcome, run_triage
from quarterdeck.mission.world import Fault


def drill(uav: float = 90.0, ugv: float = 270.0, **limits: float) -> Scenario:
    """Return a generated case whose robots have batteries, watt-hours."""
    case = generate(paper_team(), 2)
    given = {"aerial": uav, "ground": ugv}
    return replace(case, vehicles=tuple(replace(v, battery=given[v.domain], **limits) for v in case.vehicles))


def used(outcome: Outcome, name: str) -> float:
    """Return the watt-hours along a track, worked out from it."""
    vehicle = outcome.team.ugvs[name].vehicle if name in outcome.team.ugvs else outcome.team.uavs[name].vehicle
    step = np.diff(outcome.run.tracks[name], axis=0)
    speed = np.hypot(step[:, 1], step[:, 2]) / np.maximum(step[:, 0], 1e-9)
    return float((vehicle.model.power(speed) * step[:, 0]).sum() / 3600.0)


LOST, MUTE = (Fault("ugv1", 60.0),), (Fault("medic1", 40.0),)


@pytest.mark.parametrize(
    ("uav", "ugv", "faults"), [(9.0, 270.0, ()), (90.0, 9.0, ()), (8.0, 12.0, ()), (90.0, 14.0, LOST), (9.0, 16.0, MUTE)]
)
def test_whoever_runs_short_comes_home_with_the_reserve(uav: float, ugv: float, faults: tuple[Fault, ...]) -> None:
    """Of a battery that does not last, no robot uses more than 80 %, and it ends where it started."""
    outcome = run_triage(drill(uav, ugv), faults=faults)
    turned = {e.who for e in outcome.log if e.what == "turns home"}
    assert turned
    for name in turned:
        robot = outcome.team.ugvs.get(name) or outcome.team.uavs[name]
        assert outcome.run.tracks[name][-1, 1:] == pytest.approx(robot.vehicle.home, abs=1e-6)
        assert 0.5 * robot.vehicle.battery < used(outcome, name) <= (1 - RESERVE) * robot.vehicle.battery


def test_what_is_left_for_want_of_energy_is_told() -> None:
    """UGVs that turn home say how much is not searched, and whom they told nobody of; with charge all is done."""
    assert run_triage(drill()).reasons == ()
    short = run_triage(drill(ugv=9.0))
    lines = [r for r in short.reasons if "turned home for want of energy" in r]
    assert len(lines) == 3
    assert any(r.endswith("m2 of the field were not searched") for r in short.reasons)
    missing = [f.id for f in short.fates if f.state != "treated"]
    assert missing
    assert all(any(f"casualty {c} " in r for r in short.reasons) for c in missing)


def test_endurance_counts_as_the_battery_does() -> None:
    """No robot is out for longer than 80 % of its endurance."""
    outcome = run_triage(drill(endurance=200.0))
    assert {e.who for e in outcome.log if e.what == "turns home"} >= set(outcome.team.ugvs)
    for name in outcome.team.ugvs:
        track = outcome.run.tracks[name]
        assert track[np.flatnonzero(np.diff(track[:, 1:], axis=0).any(axis=1))[-1] + 1, 0] <= 160.0 + 1e-6


def test_a_relay_that_has_flown_home_loses_no_reported_casualty() -> None:
    """The UAV turns home with reports on board, or before it is told: the UGVs bring them to the medic themselves."""
    outcome = run_triage(drill(uav=6.0))
    assert "uav1" in {e.who for e in outcome.log if e.what == "turns home"}
    assert outcome.reasons == ()
