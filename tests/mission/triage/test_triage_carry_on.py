"""A triage mission from now on: what is found, told and treated stays so, and everybody goes on from where he is."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from shapely import MultiPolygon, box

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.reader import read_scenario
from quarterdeck.geo.scenario import Area, Obstacle
from quarterdeck.mission.changes import Changes
from quarterdeck.mission.mission import Mission
from quarterdeck.mission.planfile import plan_text, read_plan
from quarterdeck.mission.replan import replan
from quarterdeck.mission.timing import RESERVE
from quarterdeck.mission.triage.carry_on import planned_stand
from quarterdeck.mission.triage.plan import on_foot, plan_triage, run_plan, settings_of
from quarterdeck.mission.triage.settings import Settings

DRILL = Path(__file__).parents[3] / "data" / "triage_drill.geojson"
TIMES = ("found", "reported", "delivered", "reached", "treated")


def as_file(mission: Mission, folder: Path) -> Mission:
    """Return a mission as its PLAN file brings it back."""
    path = folder / "plan.geojson"
    path.write_text(plan_text(mission), encoding="utf-8")
    return read_plan(path)


@pytest.fixture(scope="module")
def drill(tmp_path_factory: pytest.TempPathFactory) -> Mission:
    """The sample drill, as a PLAN."""
    return as_file(plan_triage(read_scenario(DRILL)), tmp_path_factory.mktemp("drill"))


@pytest.mark.parametrize("time", [0.0, 20.0, 80.0, 150.0, 250.0, 400.0])
def test_without_a_change_the_same_mission_goes_on(drill: Mission, tmp_path: Path, time: float) -> None:
    """From any moment on, and from one after it, each is found, told of, reached and treated when he would have been."""
    whole = run_plan(drill)
    after = as_file(replan(drill, planned_stand(drill, time)), tmp_path)
    later = as_file(replan(after, planned_stand(after, 33.0)), tmp_path)
    for mission in (after, later):
        for now, before in zip(run_plan(mission).fates, whole.fates, strict=True):
            for name in TIMES:
                assert getattr(now, name) == pytest.approx(getattr(before, name), abs=1e-3)
    assert after.vehicle("ugv1").start == pytest.approx(planned_stand(drill, time).positions["ugv1"][:2], abs=1e-3)


@pytest.mark.parametrize(
    ("settings", "method"),
    [(Settings(rendezvous="moving"), "relay"), (Settings(rendezvous="round-robin"), "relay"), (Settings(), "no-relay"),
     (Settings(), "constant"), (Settings(position_error=1.0, confidence=0.7), "no-priority")],
)  # fmt: skip
def test_every_method_goes_on_as_it_was(settings: Settings, method: str, tmp_path: Path) -> None:
    """Moving rendezvous, round robin, no relay, constant communication, errors of sight: all is as it was after 120 s."""
    mission = as_file(plan_triage(read_scenario(DRILL), method, settings), tmp_path)
    after = as_file(replan(mission, planned_stand(mission, 120.0)), tmp_path)
    for now, before in zip(run_plan(after).fates, run_plan(mission).fates, strict=True):
        assert now.treated == pytest.approx(before.treated, abs=1e-2)


LOST_LATE = Changes(lost=frozenset({"ugv2"}), since={"ugv2": 30.0})
CHANGES = {
    "a UGV is lost": (80.0, Changes(lost=frozenset({"ugv2"}))),
    "a UGV has been lost for long": (150.0, LOST_LATE),
    "two UGVs are lost": (60.0, Changes(lost=frozenset({"ugv1", "ugv3"}))),
    "the UAV is lost": (80.0, Changes(lost=frozenset({"uav1"}))),
    "the UAV is lost with reports on board": (96.0, Changes(lost=frozenset({"uav1"}))),
    "a UGV is slow": (80.0, Changes(speeds={"ugv1": 1.0})),
    "the medic is slow": (80.0, Changes(speeds={"medic1": 0.5})),
    "an obstacle appears": (80.0, Changes(obstacles=(Obstacle("wreck", box(5, -12, 12, -8)),))),
    "one stands at the rendezvous": (
        150.0,
        Changes(obstacles=(Obstacle("wreck", box(-1.5, -1.5, 1.5, 1.5), frozenset({"ground"})),)),
    ),
    "an obstacle goes": (80.0, Changes(gone=frozenset({"collapsed-hall"}))),
    "an area is added": (80.0, Changes(areas=(Area("more", MultiPolygon([box(40, 0, 50, 15)])),))),
}


@pytest.mark.parametrize("name", CHANGES)
def test_after_a_change_all_are_still_found_and_treated(drill: Mission, tmp_path: Path, name: str) -> None:
    """Whatever is different: what was done stays done, and the rest is searched and treated by those who are left."""
    time, changes = CHANGES[name]
    progress = planned_stand(drill, time, stopped=changes.since)
    after = as_file(replan(drill, progress, changes), tmp_path)
    before, outcome = run_plan(drill), run_plan(after)
    assert outcome.reasons == ()
    assert all(f.treated is not None for f in outcome.fates)
    for was, now in zip(before.fates, outcome.fates, strict=True):
        for moment in TIMES:
            if not changes.since and getattr(was, moment) < time:
                assert getattr(now, moment) == pytest.approx(getattr(was, moment), abs=1e-3)
    assert {v.id for v in after.lost} == changes.lost
    assert after.parameters["stand"]["time"] == time


def test_losses_at_any_time_lose_nobody_of_whom_a_medic_or_a_survivor_was_told(drill: Mission, tmp_path: Path) -> None:
    """Every 25 s each member is lost in turn; whoever was reported is treated, found or not anew."""
    for time in range(10, 360, 25):
        lost = ("ugv1", "ugv2", "ugv3", "uav1")[time // 25 % 4]
        after = replan(drill, planned_stand(drill, float(time)), Changes(lost=frozenset({lost})))
        outcome = run_plan(as_file(after, tmp_path))
        assert outcome.reasons == (), (time, lost)


def test_a_lost_medics_casualties_go_to_the_other(drill: Mission, tmp_path: Path) -> None:
    """A second medic joins and the first is lost: whom only he knew of are treated; without a second it is refused."""
    second = on_foot("medic2", (5.0, 5.0), settings_of(drill))
    progress = planned_stand(drill, 200.0)
    queue = [r.id for r in progress.stand.memory.agents["medic1"].queue]  # type: ignore[union-attr]
    assert queue
    changes = Changes(lost=frozenset({"medic1"}), joined=(second,), medics=frozenset({"medic2"}))
    outcome = run_plan(as_file(replan(drill, progress, changes), tmp_path))
    assert outcome.reasons == ()
    assert {f.treated_by for f in outcome.fates if f.id in queue} == {"medic2"}
    with pytest.raises(InputError, match="medic 'medic1' is lost and no other is left"):
        replan(drill, progress, Changes(lost=frozenset({"medic1"})))


def test_who_joins_or_comes_back_takes_a_part(drill: Mission, tmp_path: Path) -> None:
    """A UGV, a UAV and a medic join; a UGV that was given up comes back and searches again."""
    joined = [
        replace(drill.vehicle("ugv1"), id="ugv9", start=(0.0, 10.0)),
        replace(drill.vehicle("uav1"), id="uav9", start=(0.0, 12.0)),
        on_foot("medic9", (5.0, 5.0), settings_of(drill)),
    ]
    for vehicle in joined:
        medics = frozenset({vehicle.id} & {"medic9"})
        after = as_file(replan(drill, planned_stand(drill, 80.0), Changes(joined=(vehicle,), medics=medics)), tmp_path)
        outcome = run_plan(after)
        assert outcome.reasons == ()
        assert outcome.run.length(vehicle.id) > 5.0
    without = as_file(replan(drill, planned_stand(drill, 80.0), Changes(lost=frozenset({"ugv2"}))), tmp_path)
    again = as_file(replan(without, planned_stand(without, 30.0), Changes(back={"ugv2": None})), tmp_path)
    outcome = run_plan(again)
    assert outcome.reasons == ()
    assert outcome.run.length("ugv2") > 20.0
    assert again.lost == ()


def test_the_energy_that_is_left_counts(drill: Mission, tmp_path: Path) -> None:
    """After a replan a UGV turns home when both parts together have used up its battery but for the reserve."""
    low = replace(drill, vehicles=tuple(replace(v, battery=9.0) if v.id == "ugv1" else v for v in drill.vehicles))
    progress = planned_stand(low, 100.0)
    after = as_file(replan(low, progress), tmp_path)
    left = after.vehicle("ugv1").battery
    assert (1 - RESERVE) * left == pytest.approx((1 - RESERVE) * 9.0 - progress.energy["ugv1"], abs=0.01)
    turned = [[e.time for e in run_plan(m).log if e.what == "turns home" and e.who == "ugv1"] for m in (low, after)]
    assert len(turned[0]) == 1
    assert turned[1] == pytest.approx(turned[0], abs=10.0)


def test_without_any_ugv_the_rest_of_the_field_is_told(drill: Mission, tmp_path: Path) -> None:
    """All UGVs are lost: medic and UAV finish what is known, and how much is not searched is told in square metres."""
    changes = Changes(lost=frozenset({"ugv1", "ugv2", "ugv3"}))
    after = as_file(replan(drill, planned_stand(drill, 80.0), changes), tmp_path)
    assert any("m2 of the field are not searched, and no UGV is left" in str(r) for r in after.reasons)
    known = {f.id for f in run_plan(drill).fates if f.reported is not None and f.reported < 80.0}
    outcome = run_plan(after)
    assert known <= {f.id for f in outcome.fates if f.treated is not None}
    assert any("m2 of the field were not searched" in r for r in outcome.reasons)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (Changes(priorities={"field": 3}), "all of the field is searched alike"),
        (Changes(withdrawn=frozenset({"t1"})), "unknown area or task 't1'"),
        (Changes(lost=frozenset({"ugv7"})), "unknown vehicle 'ugv7'"),
    ],
)
def test_what_means_nothing_to_triage_is_refused_in_its_words(drill: Mission, changes: Changes, words: str) -> None:
    """One line that says why."""
    with pytest.raises(InputError, match=words):
        replan(drill, planned_stand(drill, 80.0), changes)


def test_a_damaged_stand_is_one_clear_line(drill: Mission, tmp_path: Path) -> None:
    """Whatever is missing or of another type in how far the mission has come, it is an InputError, not a traceback."""
    document = json.loads(plan_text(replan(drill, planned_stand(drill, 80.0))))
    stand = document["features"][0]["properties"]["parameters"]["stand"]
    path = tmp_path / "damaged.geojson"
    for key, value in (
        ("time", "x"),
        ("time", None),
        ("memory", None),
        ("left", {"ugv1": [1]}),
        ("seen", {"type": "Point"}),
        ("paths", {}),
    ):
        document["features"][0]["properties"]["parameters"]["stand"] = stand | {key: value}
        path.write_text(json.dumps(document), encoding="utf-8")
        with pytest.raises(InputError, match="damaged"):
            run_plan(read_plan(path))
