"""The triage director in PyBullet: the same state machines, on vehicles that accelerate, turn and slip."""

from typing import Any

import pytest

from quarterdeck.mission.triage.generate import generate, paper_team
from quarterdeck.mission.triage.live import live_triage
from quarterdeck.mission.triage.settings import Settings

pytest.importorskip("pybullet", reason="PyBullet is not installed")


def test_all_casualties_are_found_told_and_treated_in_pybullet() -> None:
    """Two UGVs, a UAV and a medic on 30 x 20 m finish: each casualty found, delivered and treated once, in that order."""
    from quarterdeck.physics.simulate import simulate

    scenario = generate(paper_team(ugvs=2, size=(30.0, 20.0)), 1, casualties=(4, 4))
    mission, director = live_triage(scenario, "relay", Settings(talk=4.0))
    last: list[Any] = []

    def watched(*call: Any) -> Any:
        commands, memory = director(*call)
        last[:] = [memory]
        return commands, memory

    simulate(mission, director=watched, duration=600.0)
    memory = last[0].inner
    when = {(e.what, e.about): e.time for e in reversed(memory.log)}
    for casualty in scenario.casualties:
        assert when["found", casualty.id] <= when["treatment", casualty.id] < when["treated", casualty.id]
    assert [e.about for e in memory.log if e.what == "treated"].count("c1") == 1
    assert memory.agents["ugv1"].state == memory.agents["ugv2"].state == "done"
    assert memory.agents["medic1"].state == "idle"
