"""Nothing that a user feeds it breaks it: damaged input gives a right result or one clear line, never anything else."""

import resource
import runpy
import signal
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from quarterdeck.coverage.shares import shares
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.reader import find_problems, read_scenario
from quarterdeck.mission.cover import cover
from quarterdeck.mission.planfile import plan_text, read_plan

mutated = runpy.run_path(str(Path(__file__).with_name("mutate.py")))["mutated"]
DATA = Path(__file__).parents[2] / "data"
DEADLINE = 60  # s for one input; CI's machines are slow


@contextmanager
def deadline(seconds):
    """Raise TimeoutError in the middle of what hangs."""

    def stop(*_):
        raise TimeoutError(f"took more than {seconds} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def allowed(action):
    """Run an action; an InputError of one line is as good as a result."""
    refusal = ""
    try:
        with deadline(DEADLINE):
            return action()
    except InputError as error:
        refusal = str(error)
    assert refusal
    assert "\n" not in refusal
    assert len(refusal) < 1000
    return None


@pytest.mark.parametrize("site", ["west_ant_island", "farm_survey"])
def test_damaged_sites(site, tmp_path, soak_cases):
    """A damaged site is read or refused; one that reads is listed without problems, and has finite figures."""
    data = (DATA / f"{site}.geojson").read_bytes()
    path = tmp_path / "site.geojson"
    read = 0
    for case in range(soak_cases):
        path.write_bytes(mutated(data, np.random.default_rng(case)))
        scenario = allowed(lambda: read_scenario(path))
        problems = find_problems(path)
        assert (scenario is None) == bool(problems), f"case {case}"
        if scenario is not None:
            read += 1
            assert np.isfinite(scenario.starts).all(), f"case {case}"
    assert read > 0.02 * soak_cases


def test_damaged_sites_are_planned_or_refused(tmp_path, soak_cases):
    """What reads is planned with finite figures, or refused in one line; memory stays below 2 GB."""
    data = (DATA / "west_ant_island.geojson").read_bytes()
    path = tmp_path / "site.geojson"
    for case in range(soak_cases // 10):
        path.write_bytes(mutated(data, np.random.default_rng(10**6 + case)))
        scenario = allowed(lambda: read_scenario(path))
        if scenario is None or allowed(lambda s=scenario: shares(s.vehicles) if s.vehicles else None) is None:
            continue
        mission = allowed(lambda s=scenario: cover(s, spacing=200.0))
        if mission is not None:
            assert np.isfinite(mission.figures["poc"]), f"case {case}"
            assert all(np.isfinite(r.xyz).all() for r in mission.routes), f"case {case}"
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < 2_000_000


def test_damaged_plans(tmp_path, soak_cases):
    """A damaged PLAN is read or refused in one line."""
    scenario = read_scenario(DATA / "plant_yard.geojson")
    data = plan_text(cover(scenario)).encode("utf-8")
    path = tmp_path / "plan.geojson"
    for case in range(soak_cases // 4):
        path.write_bytes(mutated(data, np.random.default_rng(2 * 10**6 + case)))
        allowed(lambda: read_plan(path))
