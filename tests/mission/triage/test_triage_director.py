"""Properties of triage missions: nobody lost, nobody twice, no word out of range, the plan always the priority TSP's."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

from quarterdeck.geo.scenario import Casualty, Scenario
from quarterdeck.mission.priority_tsp import priority_order
from quarterdeck.mission.triage import board, director
from quarterdeck.mission.triage import outcome as outcome_module
from quarterdeck.mission.triage.director import triage
from quarterdeck.mission.triage.generate import generate, paper_team
from quarterdeck.mission.triage.machines import MACHINES, START, as_markdown
from quarterdeck.mission.triage.outcome import Outcome, run_triage
from quarterdeck.mission.triage.records import Medic
from quarterdeck.mission.triage.settings import METHODS, RANK, Settings
from quarterdeck.mission.triage.sight import track_at
from quarterdeck.mission.world import Fault

Size = tuple[int, int, int]
SEEDS = st.integers(0, 10_000)
METHOD = st.sampled_from(sorted(METHODS))
TEAM = st.sampled_from([(3, 1, 1), (1, 1, 1), (2, 2, 1), (3, 1, 2), (4, 2, 2)])
OPTIONS = st.sampled_from(
    [
        Settings(),
        Settings(knows_medic=False),
        Settings(rendezvous="moving"),
        Settings(rendezvous="round-robin"),
        Settings(order="nearest", helpers=2, fatigue=0.2),
        Settings(order="first-come", clusters=1),
        Settings(confidence=0.7, position_error=1.0),
        Settings(position_error=4.0),
        Settings(medic_sees=0.0),
        Settings(talk=6.0, ugv_sees=5.0),
    ]
)


def case(seed: int, team: Size = (3, 1, 1), most: int = 14) -> Scenario:
    ugvs, uavs, medics = team
    return generate(paper_team(ugvs=ugvs, uavs=uavs, medics=medics), seed, casualties=(0, most), clustered=seed % 2 == 0)


@given(SEEDS, METHOD, TEAM, OPTIONS)
@hypothesis_settings(deadline=None, max_examples=60)
def test_every_casualty_is_treated_exactly_once(seed: int, method: str, team: Size, options: Settings) -> None:
    """Whatever the method, the team and the options, all are found, told and treated once, in that order of time."""
    o = run_triage(case(seed, team), method, options, seed=seed)
    assert o.reasons == ()
    treated = [e.about for e in o.log if e.what == "treated"]
    assert sorted(treated) == sorted(c.id for c in o.scenario.casualties)
    for f in o.fates:
        assert f.found is not None
        assert f.delivered is not None
        assert f.found <= f.reported <= f.delivered <= f.reached <= f.treated  # type: ignore[operator]
        assert f.category == f.colour


@given(SEEDS, METHOD, TEAM, OPTIONS)
@hypothesis_settings(deadline=None, max_examples=40)
def test_no_word_passes_out_of_range(seed: int, method: str, team: Size, options: Settings) -> None:
    """Each message is between two who are within communication range at that moment, by their tracks."""
    o = run_triage(case(seed, team), method, options)
    reach = np.inf if METHODS[method].everywhere else options.talk
    for e in o.log:
        if e.what in ("handed", "delivered"):
            a, b = (track_at(o.run.tracks[n], np.array([e.time]))[0] for n in (e.who, e.whom))
            assert np.hypot(*(a - b)) <= reach + 1e-5


@given(SEEDS, METHOD)
@hypothesis_settings(deadline=None, max_examples=30)
def test_ugvs_resume_where_they_left_and_search_everything(seed: int, method: str) -> None:
    """Where a UGV comes back is where it left its path; at the end its sensor has passed all of the field."""
    o = run_triage(case(seed), method)
    for name in o.team.ugvs:
        moves = [e for e in o.log if e.who == name and e.what == "state"]
        left = None
        for before, e in zip([None, *moves], moves, strict=False):
            if e.about == "continued explore" and (before is None or before.about == "explore"):
                left = (e.x, e.y)
            if e.about == "explore":
                assert (e.x, e.y) == pytest.approx(left, abs=1e-6)
    gx, gy = np.meshgrid(np.arange(0, 80.1, 1.0), np.arange(0, 50.1, 1.0))
    field = np.column_stack([gx.ravel(), gy.ravel()])
    points = [track_at(t, np.arange(0, t[-1, 0], 0.2)) for t in (o.run.tracks[name] for name in o.team.ugvs)]
    nearest, _ = KDTree(np.concatenate(points)).query(field)
    assert nearest.max() <= 3.0


@given(SEEDS, st.sampled_from(["relay", "no-relay", "constant"]), TEAM)
@hypothesis_settings(deadline=None, max_examples=25)
def test_the_medics_order_is_the_priority_tsp_at_every_instant(seed: int, method: str, team: Size) -> None:
    """At each call of the director, each medic's queue is as long as the priority TSP from where he stands."""
    checked = []

    def watched(*args: Any) -> Any:
        direct = triage(*args)

        def watch(time: float, states: Any, events: Any, memory: Any) -> Any:
            commands, after = direct(time, states, events, memory)
            for name, record in after.agents.items():
                if isinstance(record, Medic) and record.queue:
                    rest = record.queue[1:] if record.state == "treat" else record.queue
                    points = np.array([(states[name].x, states[name].y), *((r.x, r.y) for r in rest)])
                    ranks = np.array([RANK[r.sort] for r in rest], dtype=int)
                    apart = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
                    length = float(sum(apart[i, i + 1] for i in range(len(rest))))
                    assert ranks.tolist() == sorted(ranks.tolist())
                    assert length == pytest.approx(priority_order(apart, ranks).length, abs=1e-6)
                    checked.append(len(rest))
            return commands, after

        return watch

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(outcome_module, "triage", watched)
        run_triage(case(seed, team), method)


@st.composite
def faults(draw: Any, names: list[str]) -> list[Fault]:
    """Up to four faults: robots that stop, radios that fall silent for ever or for a while, at any time."""
    made = []
    for _ in range(draw(st.integers(1, 4))):
        time, kind = draw(st.floats(0, 500)), draw(st.sampled_from(["stop", "mute"]))
        spell = draw(st.sampled_from([10.0, 200.0, np.inf])) if kind == "mute" else np.inf
        made.append(Fault(draw(st.sampled_from(names)), time, kind, time + spell))
    return made


@given(SEEDS, METHOD, TEAM, st.data())
@hypothesis_settings(deadline=None, max_examples=80)
def test_a_failure_never_loses_a_reported_casualty(seed: int, method: str, team: Size, data: Any) -> None:
    """Whoever fails, whenever, even several: who is not treated is told with the reason, and where one UGV that others hear
    is left, all are treated.
    """
    scenario = case(seed, team)
    names = [*(v.id for v in scenario.vehicles), *(m for m, _ in scenario.medics)]
    befalling = data.draw(faults(names))
    options = data.draw(st.sampled_from([Settings(), Settings(knows_medic=False), Settings(rendezvous="round-robin")]))
    o = run_triage(scenario, method, options, faults=befalling)
    assert not o.run.reason
    for f in o.fates:
        assert f.treated is not None or any(f"casualty {f.id} " in reason for reason in o.reasons)
    gone = {f.actor for f in befalling if f.until == np.inf}
    taken_over = options.rendezvous == "fixed" and method != "no-relay"  # there the medic may know of nobody to send
    if taken_over and not set(o.team.ugvs) <= gone:
        assert o.reasons == ()


def test_a_lost_ugvs_section_is_taken_over_from_the_last_word_of_it() -> None:
    """A UGV is lost with finds on board: another searches the rest of its section, finds them again, and tells."""
    scenario = case(7)
    calm = run_triage(scenario)
    lost = next(f for f in calm.fates if f.found_by == "ugv2" and f.reported - f.found > 20.0)  # type: ignore[operator]
    o = run_triage(scenario, faults=[Fault("ugv2", lost.found + 10.0)])  # type: ignore[operator]
    again = [e.who for e in o.log if e.what == "found" and e.about == lost.id]
    assert [e.about for e in o.log if e.what == "takes over"] == ["ugv2"]
    assert again[0] == "ugv2"
    assert len(again) > 1
    assert o.reasons == ()


def test_a_medic_whose_device_fails_fetches_another_at_the_rendezvous() -> None:
    """He treats those he knows of, walks to the rendezvous, hears again, and all are treated."""
    o = run_triage(case(7), faults=[Fault("medic1", 60.0)])
    heard = next(e for e in o.log if e.what == "heard again")
    assert np.hypot(heard.x - 40.0, heard.y - 25.0) < 0.1
    assert o.reasons == ()


def test_nobody_is_taken_for_lost_who_is_not() -> None:
    """Without a fault no section is ever taken over, in any method."""
    for method in METHODS:
        for seed in range(8):
            assert not [e for e in run_triage(case(seed), method).log if e.what == "takes over"]


def test_a_lost_uav_is_replaced_by_the_ugvs_themselves() -> None:
    """The UAV falls with a list on board: its UGV waits, gets no receipt, and tells the medic itself."""
    o = run_triage(case(7), "relay", faults=[Fault("uav1", 60.0)])
    assert any(e.what == "state" and e.about == "seek" for e in o.log)
    assert o.reasons == ()


def test_a_second_medic_is_told_what_the_first_cannot_hear() -> None:
    """A medic's device fails at once: everything goes to the other, and nothing is undeliverable."""
    o = run_triage(case(4, (3, 1, 2)), "relay", faults=[Fault("medic1", 0.0)])
    assert not any(f.undeliverable for f in o.fates)
    assert all(f.treated is not None for f in o.fates)


def test_two_hundred_casualties_and_all_red_and_none() -> None:
    """The ends of the range of sizes."""
    team = paper_team()
    many = run_triage(generate(team, 1, casualties=(200, 200)))
    assert all(f.state == "treated" for f in many.fates)
    red = generate(team, 2)
    red = replace(red, casualties=tuple(Casualty(c.id, c.position, "red") for c in red.casualties))
    assert all(f.state == "treated" for f in run_triage(red).fates)
    none = run_triage(team)
    assert none.fates == ()
    assert none.reasons == ()
    assert none.end > 0


def test_the_same_seed_gives_the_same_mission() -> None:
    """Log and tracks repeat to the bit."""

    def once() -> Outcome:
        return run_triage(case(11), "relay", Settings(confidence=0.5), seed=3)

    a, b = once(), once()
    assert a.log == b.log
    assert all(np.array_equal(a.run.tracks[n], b.run.tracks[n]) for n in a.run.tracks)


@pytest.mark.parametrize("kind", sorted(MACHINES))
def test_each_machine_is_connected_and_deterministic(kind: str) -> None:
    """One row for a state and event, every state reachable from the first, and drawn with all its rows."""
    rows = MACHINES[kind]
    assert len({(r.state, r.event) for r in rows}) == len(rows)
    reached = {START[kind]}
    for _ in rows:
        reached |= {r.next for r in rows if r.state in reached}
    assert reached == {s for r in rows for s in (r.state, r.next)}
    drawn = as_markdown(kind)
    assert drawn.count("-->") == sum(not r.extra for r in rows) + 1
    assert drawn in (Path(__file__).parents[3] / "docs" / "triage-machines.md").read_text(encoding="utf-8"), "run make docs"


def test_a_crowd_compares_no_more_than_it_has_to(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of k UGVs in range of each other every pair compares, and each that is done with all: k squared, not its square."""
    counts: list[int] = []
    own_compare, own_direct = board.compare_boards, director._answer

    def counted(*arguments: Any) -> None:
        counts[-1] += 1
        own_compare(*arguments)

    def begun(*arguments: Any) -> Any:
        counts.append(0)
        return own_direct(*arguments)

    monkeypatch.setattr(board, "compare_boards", counted)
    monkeypatch.setattr(director, "compare_boards", counted)
    monkeypatch.setattr(director, "_answer", begun)
    k = 12
    crowd = generate(paper_team(ugvs=k, size=(30.0, 20.0)), 1, casualties=(2, 2))
    assert not run_triage(crowd, "relay", Settings(talk=60.0)).reasons
    assert max(counts) <= 3 * (k + 2) ** 2
