"""Triage in PyBullet: the same state machines, on vehicles that turn and slip, and whose sight ends at walls."""

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from shapely import box

from quarterdeck.exporters.triage_picture import telling_moments
from quarterdeck.geo.deadline import limited
from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.scenario import Casualty, Obstacle, Scenario, Site
from quarterdeck.geo.terrain import Terrain
from quarterdeck.mission.changes import Changes
from quarterdeck.mission.check import check_mission
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.planfile import plan_text, read_plan
from quarterdeck.mission.recorded import read_state
from quarterdeck.mission.replan import replan
from quarterdeck.mission.tracks import Record
from quarterdeck.mission.triage.carry_on import planned_stand
from quarterdeck.mission.triage.generate import generate, paper_team
from quarterdeck.mission.triage.plan import plan_triage, run_plan
from quarterdeck.physics.report import report_schema
from quarterdeck.physics.sightings import Lookout

pytest.importorskip("pybullet", reason="PyBullet is not installed")


def yard(seed: int = 1, casualties: int = 4) -> Scenario:
    """Two UGVs, a UAV and a medic on 30 x 20 m."""
    return generate(paper_team(ugvs=2, size=(30.0, 20.0)), seed, casualties=(casualties, casualties))


def planned(scenario: Scenario, tmp_path) -> Mission:  # type: ignore[no-untyped-def]
    """Return the mission as a PLAN file brings it back."""
    path = tmp_path / "plan.geojson"
    path.write_text(plan_text(plan_triage(scenario)), encoding="utf-8")
    return read_plan(path)


def test_a_triage_plan_is_driven_as_the_fast_world_expects(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """Each casualty is found, delivered and treated once, in that order, in both worlds, told side by side."""
    from quarterdeck.physics.simulate import simulate

    mission = planned(yard(), tmp_path)
    assert check_mission(mission) == ()
    run = simulate(mission)
    assert run.report.figures["finished"] == 4
    assert not [reason for reason in run.report.reasons if "casualty" in reason]
    assert run.triage is not None
    for fate in run.triage.driven.fates:
        assert fate.found <= fate.delivered <= fate.reached < fate.treated  # type: ignore[operator]
    treated = [e.about for e in run.triage.driven.log if e.what == "treated"]
    assert sorted(treated) == sorted(c.id for c in mission.casualties)
    fast, driven = run.report.triage["figures"]["time"]  # type: ignore[index]
    assert fast == pytest.approx(run_plan(mission).end, abs=1e-3)
    assert fast < driven < 2.0 * fast
    jsonschema.Draft202012Validator(report_schema()).validate(json.loads(run.report.to_json()))


def test_a_run_that_is_stopped_is_told_as_stopped_beside_the_whole_of_the_fast_world(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """The stop is told once, the mission's time is that of the stop, and pictures end there; the fast world is not cut."""
    from quarterdeck.physics.simulate import simulate

    mission = planned(yard(), tmp_path)
    with limited() as limit:
        run = simulate(mission, progress=lambda done, _: setattr(limit, "interrupted", done >= 20.0))
    assert run.triage is not None
    assert [r for r in run.report.reasons if "stopped at" in r or "not over" in r] == [
        "the run was stopped at 20 s of the mission (interrupted)"
    ]
    assert run.report.triage["figures"]["time"] == [pytest.approx(run_plan(mission).end, abs=1e-3), 20.0]  # type: ignore[index]
    moments = telling_moments(run.triage.driven)
    assert moments == sorted(moments, key=lambda m: m[0])
    assert moments[-1] == (20.0, "the run was cut short")
    assert not [words for _, words in moments if "all that could be searched" in words]


@pytest.mark.parametrize("fault", ["ugv1@15", "uav1@20", "medic1@25"])
def test_who_fails_in_pybullet_takes_no_reported_casualty_along(fault: str, tmp_path) -> None:  # type: ignore[no-untyped-def]
    """A UGV, the UAV or the medic's device fails: what was reported is treated, or told with its reason."""
    from quarterdeck.physics.simulate import simulate

    run = simulate(planned(yard(3, 6), tmp_path), faults=[fault])
    assert run.triage is not None
    for fate in run.triage.driven.fates:
        if fate.reported is not None:
            assert fate.treated is not None or fate.undeliverable
        if fate.state != "treated":
            assert any(f"casualty {fate.id} " in reason for reason in run.report.reasons)


def test_the_tracks_of_a_run_tell_what_was_searched_and_whom_a_medic_stood_by(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """Measured from its tracks alone a run has the same finds and treatments; no route is held against anybody."""
    from quarterdeck.physics.observed import report_tracks
    from quarterdeck.physics.simulate import simulate

    mission = planned(yard(), tmp_path)
    run = simulate(mission)
    assert run.triage is not None
    logs = run.trace.tracks()
    report = report_tracks(mission, Record(logs, (), (), None), settings={"tracks": [], "start": None}).report
    assert report.triage is not None
    for told, fate in zip(report.triage["casualties"], run.triage.driven.fates, strict=True):
        assert told["found"][1] == pytest.approx(fate.found, abs=1.5)
        assert told["treated"][1] == pytest.approx(fate.treated, abs=6.0)
    assert report.figures["coverage_driven"] > 0.98
    assert report.reasons == ()
    jsonschema.Draft202012Validator(report_schema()).validate(json.loads(report.to_json()))
    alone = tuple(track for track in logs if track.vehicle != "medic1")
    reasons = report_tracks(mission, Record(alone, (), (), None)).report.reasons
    assert sum("was not treated, by the tracks" in r for r in reasons) == 4


def test_a_mission_goes_on_from_the_report_of_a_run(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """A run is stopped; replanned from its report, without the UAV, all are treated and what was found stays found."""
    from quarterdeck.physics.observed import with_state
    from quarterdeck.physics.simulate import simulate

    mission = planned(yard(), tmp_path)
    run = simulate(mission, duration=40.0)
    assert run.triage is not None
    path = tmp_path / "report.json"
    path.write_text(with_state(mission, run, run.trace.tracks()).to_json(), encoding="utf-8")
    jsonschema.Draft202012Validator(report_schema()).validate(json.loads(path.read_text(encoding="utf-8")))
    progress = read_state(mission, str(path))
    for changes in (Changes(), Changes(lost=frozenset({"uav1"}))):
        later = replan(mission, progress, changes)
        outcome = run_plan(later)
        assert outcome.reasons == ()
        for before, after in zip(run.triage.driven.fates, outcome.fates, strict=True):
            assert before.found is None or after.found == pytest.approx(before.found, abs=1e-3)
            assert before.treated is None or after.treated == pytest.approx(before.treated, abs=1e-3)
    assert any(f.found is not None for f in run.triage.driven.fates)
    again = simulate(later, duration=5.0)  # without the UAV
    assert again.trace.vehicles == tuple(v.id for v in later.vehicles)
    assert "uav1" not in again.trace.vehicles


@pytest.mark.parametrize("faults", [(), ("medic1@60",)])
def test_the_sample_drill_is_driven_to_its_end(faults: tuple[str, ...]) -> None:
    """Nobody stands in another's way for good, hulls stay apart, and every casualty of the sample is treated."""
    from quarterdeck.physics.simulate import simulate

    site = read_scenario(Path(__file__).parents[2] / "data" / "triage_drill.geojson")
    run = simulate(plan_triage(site), faults=faults, duration=1200.0)
    assert run.triage is not None
    assert all(f.treated is not None for f in run.triage.driven.fates)
    assert all(v.finished for v in run.report.vehicles)
    assert run.report.figures["separation"] > 0.0
    assert run.trace.time[-1] < 1000.0


def test_a_uav_that_fails_where_it_hovers_falls_on_nobody() -> None:
    """Two UAVs hover at the rendezvous, where a medic stands: each comes down, and touches no one."""
    from quarterdeck.physics.simulate import simulate

    site = generate(paper_team(ugvs=1, uavs=2, size=(24.0, 16.0)), 1, casualties=(1, 1))
    starts = {"uav1": (6.0, 12.0), "uav2": (18.0, 12.0)}
    site = replace(site, vehicles=tuple(replace(v, start=starts.get(v.id, v.start)) for v in site.vehicles))
    away = Casualty("c1", (23.0, 15.0), "green")
    mission = plan_triage(replace(site, casualties=(away,), rendezvous=(("r", (12.0, 8.0)),)))
    run = simulate(mission, faults=("uav2@14", "uav1@16"), duration=20.0)
    assert [round(float(z), 1) for z in run.trace.z[-1]] == [0.0] * 4
    assert not run.trace.contact[:, [run.trace.vehicles.index(v) for v in ("medic1", "ugv1")]].any()
    assert run.report.figures["separation"] > 0.0


def test_rough_ground_is_climbed_and_seen_over(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """On hills of 1.5 m all are found and treated; UGVs and medic stand on the ground, and it takes them more energy."""
    from quarterdeck.physics.simulate import simulate

    mission = planned(yard(), tmp_path)
    (west, south, *_) = mission.site.operating.bounds
    x, y = np.meshgrid(np.arange(0.0, 32.0), np.arange(0.0, 22.0))
    hills = Terrain((west - 1, south - 1), 1.0, 1.5 * np.sin(x / 4.0) * np.cos(y / 3.0))
    flat, rough = simulate(mission), simulate(mission, terrain=hills)
    assert rough.triage is not None
    assert all(f.treated is not None for f in rough.triage.driven.fates)
    rolling = [i for i, v in enumerate(mission.vehicles) if v.domain == "ground"]
    assert np.ptp(rough.trace.ground[:, rolling]) > 1.0
    assert sum(v.energy for v in rough.report.vehicles if v.domain == "ground") > sum(
        v.energy for v in flat.report.vehicles if v.domain == "ground"
    )


def test_nobody_is_seen_behind_a_wall_or_a_hill() -> None:
    """A casualty 2 m away is seen in the open, not through a wall, over a low one, and not behind a crest."""
    base = paper_team(ugvs=1, size=(30.0, 20.0))
    scenario = replace(base, casualties=(Casualty("c", (17.0, 1.0), "red"),))
    wall = Obstacle("wall", box(15.9, 0.0, 16.1, 3.0), height=2.0)

    def seen(scenario: Scenario, terrain: Terrain | None = None) -> bool:
        mission = plan_triage(scenario)
        look = Lookout(mission, terrain)
        position = np.array([v.start for v in mission.vehicles])
        position[look.ids.index("ugv1")] = 15.0, 1.0
        events = look.step(position, np.ones(len(position), bool))
        return ("seen", "ugv1") in {(e.kind, e.vehicle) for e in events}

    def walled(obstacle: Obstacle) -> Scenario:
        return replace(scenario, site=Site(base.site.areas, base.site.operating, (obstacle,)))

    assert seen(scenario)
    assert not seen(walled(wall))
    assert seen(walled(replace(wall, height=0.2)))
    x = np.arange(-10.0, 41.0, 0.5)
    crest = Terrain((-10.0, -10.0), 0.5, np.tile(np.maximum(1.0 - np.abs(x - 16.0), 0.0), (81, 1)))
    assert not seen(scenario, crest)
    assert seen(scenario, Terrain((-10.0, -10.0), 0.5, np.zeros((81, 101))))


def test_who_took_over_before_a_run_is_no_moment_of_it(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """Of a drill that goes on after a section was taken over, also by one that is lost since, nothing of that is told."""
    from quarterdeck.physics.simulate import simulate

    drill = planned(read_scenario(Path(__file__).parents[2] / "data" / "triage_drill.geojson"), tmp_path)
    progress = planned_stand(drill, 450.0, stopped={"ugv1": 20.0})
    assert progress.stand is not None
    assert "ugv3" in {e.who for e in progress.stand.memory.log if e.what == "takes over"}
    for lost in ({"ugv1"}, {"ugv1", "ugv3"}):
        assert simulate(replan(drill, progress, Changes(lost=frozenset(lost))), duration=2.0).moments == ()
