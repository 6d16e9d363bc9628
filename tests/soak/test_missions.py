"""Missions of every kind in which random things go wrong: nobody touches anything, what was to be done is done or told."""

import runpy
from pathlib import Path

import pytest

pytest.importorskip("pybullet", reason="PyBullet is not installed")
attempt = runpy.run_path(str(Path(__file__).parents[2] / "benchmarks" / "missions.py"))["attempt"]
# The last: a drill, ranges of radios, a swath that GEOS made cross itself, drills whose members stood in others' ways.
SEEDS = (*range(8), 1008, 1010, 1089, 1145, 1262)


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_done_is_lost_and_nobody_is_hurt(seed):
    """The mission is recovered; if not, `python benchmarks/missions.py --seed N` replays it."""
    assert attempt(seed)["wrong"] == []
