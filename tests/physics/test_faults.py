"""Faults: read, drawn, and doing to the vehicles what they say."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from quarterdeck.cli import main
from quarterdeck.geo.errors import InputError
from quarterdeck.mission.director import Command, Event
from quarterdeck.mission.mission import Waypoint
from quarterdeck.mission.planfile import plan_text
from quarterdeck.physics.faults import KINDS, Fault, active, next_change, parse_fault, read_faults
from quarterdeck.physics.simulate import simulate

FLEET = ("usv-1", "usv-2", "tug:3")


def test_faults_are_read() -> None:
    """A vehicle lost, one without GNSS for two minutes, an id with a colon."""
    assert parse_fault("usv-2@600", FLEET) == Fault("lost", "usv-2", 600.0)
    assert parse_fault("gnss:usv-1@300-420.5", FLEET) == Fault("gnss", "usv-1", 300.0, 420.5)
    assert parse_fault("tug:3@5", FLEET) == Fault("lost", "tug:3", 5.0)
    assert parse_fault("comms:tug:3@5", FLEET) == Fault("comms", "tug:3", 5.0)


@given(
    kind=st.sampled_from(sorted(KINDS)),
    vehicle=st.sampled_from(FLEET[:2]),
    start=st.integers(0, 9999),
    length=st.none() | st.integers(1, 999),
)
def test_a_fault_says_what_it_was_read_from(kind: str, vehicle: str, start: int, length: int | None) -> None:
    """Writing and reading come to the same."""
    fault = Fault(kind, vehicle, start, math.inf if length is None or kind == "lost" else start + length)
    assert parse_fault(str(fault), FLEET) == fault


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("usv-4@600", "no vehicle 'usv-4'; did you mean 'usv-"),
        ("submarine@600", "known: usv-1, usv-2, tug:3"),
        ("gps:usv-1@3", "unknown kind 'gps'"),
        ("usv-1", "expected [KIND:]VEHICLE@SECONDS"),
        ("usv-1@3.4.5", "times must be seconds"),
        ("gnss:usv-1@30-20", "before it begins"),
        ("usv-1@30-40", "does not come back"),
        ("random:many", "whole number"),
    ],
)
def test_a_wrong_fault_is_one_clear_line(text: str, told: str) -> None:
    """The line names the fault, what is wrong with it and what would be right."""
    with pytest.raises(InputError) as error:
        read_faults([text], FLEET, 100.0, 0)
    assert told in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.usefixtures("needs_pybullet")
def test_a_fault_for_an_unknown_vehicle_is_one_clear_line(mow, tmp_path, capfd) -> None:
    """From the command line: exit status 2, the nearest name, nothing simulated."""
    path = tmp_path / "plan.geojson"
    path.write_text(plan_text(mow("husky")), encoding="utf-8")
    with pytest.raises(SystemExit) as stop:
        main(["simulate", str(path), "--fail", "husky-2@10"])
    assert stop.value.code == 2
    (line,) = capfd.readouterr().err.strip().splitlines()
    assert "no vehicle 'husky-2'; did you mean 'husky-1'?" in line


@given(count=st.integers(0, 60), seed=st.integers(0, 2**32 - 1))
def test_random_faults_repeat_and_leave_somebody(count: int, seed: int) -> None:
    """The same seed draws the same schedule, in time, within the mission; not everybody is lost, nobody twice."""
    faults = read_faults([f"random:{count}"], FLEET, 500.0, seed)
    assert faults == read_faults([f"random:{count}"], FLEET, 500.0, seed)
    assert len(faults) == count
    assert all(0 <= f.start <= 500 and f.start < f.end for f in faults)
    assert [f.start for f in faults] == sorted(f.start for f in faults)
    lost = [f.vehicle for f in faults if f.kind == "lost"]
    assert len(lost) == len(set(lost)) < len(FLEET)


def test_faults_begin_and_end() -> None:
    """Each is active from its start until before its end; the next change is the next of either."""
    faults = read_faults(["gnss:usv-1@10-20", "usv-2@15"], FLEET, 0.0, 0)
    assert [active(faults, FLEET, t)["gnss"][0] for t in (9.9, 10, 19.9, 20)] == [False, True, True, False]
    assert [next_change(faults, t) for t in (0, 10, 15, 20)] == [10, 15, 20, math.inf]
    assert active(faults, FLEET, 1e6)["lost"].tolist() == [False, True, False]


@pytest.fixture
def needs_pybullet() -> None:
    """Skip where there is no PyBullet."""
    pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")


@pytest.mark.usefixtures("needs_pybullet")
def test_a_lost_vessel_drifts_and_fails_the_verdict(mow) -> None:
    """With no power it goes where the water goes; the report says who was lost, the others finish."""
    run = simulate(mow("otter", count=2, spacing=40.0), faults=["otter-1@60"], current=(0.0, 0.5), duration=400.0)
    lost, other = run.report.vehicles
    assert lost.lost
    assert not lost.finished
    assert other.finished
    assert not other.lost
    late = run.trace.time > 100
    assert np.diff(run.trace.y[late, 0]).mean() == pytest.approx(0.05, rel=0.05)
    assert run.report.settings["faults"] == ["otter-1@60"]


@pytest.mark.usefixtures("needs_pybullet")
def test_a_lost_quad_falls_and_a_lost_rover_stands(mow) -> None:
    """The one is on the ground within seconds and stays, the other stops where it was."""
    quad = simulate(mow("survey-quad", spacing=40.0), faults=["survey-quad-1@30"], duration=60.0).trace
    assert quad.z[quad.time < 29.9].max() > 20
    assert quad.z[-1, 0] < 0.1
    assert 32.5 < quad.time[-1] < 36  # 40 m of free fall take 2.9 s, a little more with drag
    rover = simulate(mow("husky", count=2, spacing=5.0), faults=["husky-1@20"], duration=40.0).trace
    assert rover.x[rover.time < 20, 0].max() > 10
    assert np.ptp(rover.x[rover.time > 23, 0]) < 1e-6


@pytest.mark.usefixtures("needs_pybullet")
def test_a_quad_with_half_a_rotor_crashes_and_stays_there(mow) -> None:
    """One rotor of four at half power cannot be balanced: it tumbles down, is out, and does not slide away."""
    run = simulate(mow("survey-quad", spacing=40.0), faults=["thruster:survey-quad-1@30"])
    assert run.report.vehicles[0].aground
    assert run.trace.time[-1] < 60
    assert run.trace.x.max() < 500


@pytest.mark.usefixtures("needs_pybullet")
def test_a_quad_that_sinks_slowly_does_not_skid_on(mow) -> None:
    """From a metre up it comes down gently: over the ground it goes a metre or two, not on along its route."""
    run = simulate(mow("crazyflie", spacing=2.0), faults=["thruster:crazyflie-1@20"])
    down = int(np.argmax((run.trace.time > 20.0) & (run.trace.z[:, 0] <= 0.0)))
    place = np.column_stack([run.trace.x[:, 0], run.trace.y[:, 0]])
    assert run.report.vehicles[0].aground
    assert np.hypot(*(place[-1] - place[down])) < 2.0


@pytest.mark.usefixtures("needs_pybullet")
def test_half_power_is_slower_but_arrives(mow) -> None:
    """A rover with half its left wheels' speed still follows its legs, and takes longer."""
    mission = mow("husky", spacing=5.0, length=40.0)
    whole, half = simulate(mission), simulate(mission, faults=["thruster:husky-1@0"], limits={"delay": 5})
    assert half.report.passed, half.report.reasons
    assert half.report.figures["time"] > 1.3 * whole.report.figures["time"]


@pytest.mark.usefixtures("needs_pybullet")
def test_a_mute_vehicle_is_not_heard_and_hears_nothing_new(mow) -> None:
    """The director is told of a loss and a return; in between the state is the last heard, and commands wait."""
    seen: list[tuple[float, str]] = []
    states_seen: list[tuple[float, float, bool]] = []

    def director(time, states, events, memory):
        seen.extend((time, e.kind) for e in events if isinstance(e, Event))
        states_seen.append((time, states["husky-1"].x, states["husky-1"].alive))
        if memory is None:
            return {"husky-1": Command((Waypoint(30.0, 0.0),))}, "away"
        if time >= 10 and memory == "away":
            return {"husky-1": Command((Waypoint(0.0, 0.0),))}, "home"
        return {}, memory

    run = simulate(mow("husky"), director=director, faults=["comms:husky-1@5-20"], duration=60.0)
    assert seen == [(5.0, "lost"), (20.0, "returned")]
    mute = [(x, alive) for t, x, alive in states_seen if 5 <= t < 20]
    assert len(set(mute)) == 1
    assert not mute[0][1]
    turn = run.trace.time[np.argmax(run.trace.x[:, 0])]
    assert 20 <= turn < 26


@pytest.mark.usefixtures("needs_pybullet")
def test_a_run_is_not_over_while_somebody_is_to_be_heard_again(mow) -> None:
    """Who is silent when all have arrived can still tell and be told: the run goes on until it is heard."""
    heard: list[tuple[float, str]] = []

    def director(time, states, events, memory):
        heard.extend((time, e.kind) for e in events if e.kind != "lost")
        return ({} if memory else {"husky-1": Command((Waypoint(2.0, 0.0, task="t"),))}), True

    run = simulate(mow("husky"), director=director, faults=["comms:husky-1@1-30"], duration=60.0)
    assert sorted(heard) == [(30.0, "returned"), (30.0, "served")]
    assert run.trace.time[-1] < 32.0


def test_an_empty_battery_stops_a_vehicle_and_is_told(mow) -> None:  # type: ignore[no-untyped-def]
    """A rover with a third of the energy that its route needs stops on the way; the others go on."""
    mission = mow("husky", count=2)
    first, second = mission.vehicles
    flat = replace(mission, vehicles=(replace(first, battery=mission.routes[0].energy / 3), second))
    report = simulate(flat).report
    assert [v.lost for v in report.vehicles] == [True, False]
    assert [v.finished for v in report.vehicles] == [False, True]
    assert report.vehicles[0].length < 0.6 * report.vehicles[1].length
    assert [r for r in report.reasons if r.startswith(f"{first.id}: battery empty at")]
