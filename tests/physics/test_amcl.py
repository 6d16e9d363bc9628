"""The particle filter: right where the answer is known, consistent, and able to find itself again."""

import math
import runpy
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from scipy.stats import chi2

from quarterdeck.physics.amcl import (
    Belief,
    FilterParams,
    believe_at,
    estimate,
    lostness,
    move,
    needed,
    resample,
    weakest,
    weigh_fix,
    weigh_heading,
    weigh_scan,
)
from quarterdeck.physics.lidar import beam_angles, cast, edge_grid
from quarterdeck.physics.likelihood import distance_field

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "localisation.py"


@pytest.fixture(scope="module")
def bench() -> SimpleNamespace:
    """The benchmark's trials, of which the tests run a few."""
    return SimpleNamespace(**runpy.run_path(str(BENCHMARK)))


def test_it_is_a_kalman_filter_where_that_is_exact() -> None:
    """One beam square to a wall, no doubt of the heading: mean and deviation are the closed form's, for 20 steps."""
    params = replace(
        FilterParams(), hit=0.2, random_part=0.0, along=0.1, across=0.0, drift=0.0, turn=0.0, gyro=0.0, least=20_000
    )
    params = replace(params, most=params.least)
    field = distance_field([shapely.box(10, -50, 12, 50)], (-5, -5, 10, 5), 0.1)
    rng = np.random.default_rng(11)
    belief = believe_at(np.zeros(3), (0.3, 0.0, 0.0), params, rng)
    truth, mean, variance = 0.1, 0.0, 0.3**2
    for step in (0.5, -0.3, 0.4, 0.7, 0.0) * 4:
        truth += step + 0.1 * math.sqrt(abs(step)) * rng.standard_normal()
        told = 10 - truth + 0.2 * rng.standard_normal()
        belief = move(belief, np.array([step, 0.0, 0.0]), 0.5, params, rng)
        belief = weigh_scan(belief, field, np.zeros(1), np.array([told]), params)
        mean, variance = mean + step, variance + 0.1**2 * abs(step)
        gain = variance / (variance + 0.2**2)
        mean, variance = mean + gain * (10 - told - mean), (1 - gain) * variance
        got = belief.weights @ belief.particles[:, 0]
        spread = math.sqrt(belief.weights @ (belief.particles[:, 0] - got) ** 2)
        assert got == pytest.approx(mean, abs=0.1 * math.sqrt(variance))
        assert spread == pytest.approx(math.sqrt(variance), rel=0.08)
        belief = resample(belief, params, rng)


def test_a_fix_is_a_kalman_update() -> None:
    """A position fix on a normal belief gives the closed form's mean and deviation."""
    params = replace(FilterParams(), least=50_000, most=50_000)
    belief = believe_at(np.array([1.0, 2.0, 0.0]), (0.5, 1.0, 0.1), params, np.random.default_rng(5))
    after = weigh_fix(belief, np.array([1.4, 1.0]), 0.8)
    for axis, (prior, deviation, told) in enumerate(((1.0, 0.5, 1.4), (2.0, 1.0, 1.0))):
        gain = deviation**2 / (deviation**2 + 0.8**2)
        values = after.particles[:, axis]
        mean = after.weights @ values
        assert mean == pytest.approx(prior + gain * (told - prior), abs=0.02)
        assert after.weights @ (values - mean) ** 2 == pytest.approx((1 - gain) * deviation**2, rel=0.05)


def test_a_heading_fix_is_a_kalman_update_across_the_half_turn() -> None:
    """A compass that tells of -179 degrees pulls a belief of 179 over the half turn, as far as the closed form says."""
    params = replace(FilterParams(), least=50_000, most=50_000)
    here, deviation = np.array([0.0, 0.0, math.radians(179)]), (0.1, 0.1, math.radians(1))
    belief = believe_at(here, deviation, params, np.random.default_rng(5))
    after = weigh_heading(belief, math.radians(-179), math.radians(2))
    assert math.degrees(estimate(after).pose[2]) % 360 == pytest.approx(179 + 2 * 1 / (1 + 4), abs=0.05)


def test_a_fix_far_from_all_particles_takes_them_along() -> None:
    """Particles that no longer explain the fixes are shifted onto them instead of being believed."""
    belief = believe_at(np.zeros(3), (0.1, 0.1, 0.1), FilterParams(), np.random.default_rng(1))
    after = estimate(weigh_fix(belief, np.array([50.0, -20.0]), 1.0))
    assert after.pose[:2] == pytest.approx([50, -20], abs=0.1)


@pytest.mark.parametrize("bins", [2, 5, 20, 100, 400])
def test_the_number_of_particles_is_the_chi_squares(bins: int) -> None:
    """KLD sampling asks for chi2(k - 1, 1 - delta) / (2 epsilon) particles, to a percent or two (Wilson and Hilferty)."""
    params = replace(FilterParams(), least=1, most=10**9)
    assert needed(bins, params) == pytest.approx(chi2.ppf(0.99, bins - 1) / (2 * params.error), rel=0.03)


def test_resampling_keeps_the_mean_and_adapts_the_number() -> None:
    """Drawing anew changes neither mean nor deviation much; a belief spread wide needs more particles than a narrow one."""
    rng, params = np.random.default_rng(2), FilterParams()
    counts = []
    for spread in (0.05, 5.0):
        particles = rng.standard_normal((4000, 3)) * (spread, spread, 0.1)
        weights = np.exp(-4 * (particles[:, 0] / spread - 0.5) ** 2)
        belief = Belief(particles, weights / weights.sum())
        after = resample(belief, params, rng)
        counts.append(len(after.weights))
        before = belief.weights @ belief.particles[:, 0]
        assert after.particles[:, 0].mean() == pytest.approx(before, abs=0.1 * spread)
    assert params.least == counts[0] < counts[1]


def test_it_is_consistent(bench: SimpleNamespace) -> None:
    """Where its assumptions hold, its covariance tells its error: the mean NEES is within the 99.9 % region of
    chi-square.
    """
    runs, steps = 12, np.arange(12, 40, 6)  # steps apart, so that errors are nearly independent
    nees = np.array([bench.trial(seed, steps=40, **bench.matched())["nees"][steps] for seed in range(runs)])
    low, high = chi2.ppf([0.0005, 0.9995], 3 * nees.size) / nees.size
    assert low < nees.mean() < high


def test_it_recovers_from_kidnapping(bench: SimpleNamespace) -> None:
    """A robot put elsewhere, or that never knew where it was, finds itself within 30 s; before, it knows to centimetres."""
    for seed in (1, 2, 3):
        error = bench.trial(seed, kidnap=True, steps=65)["error"]
        assert error[:65].max() < 0.2
        assert bench.recovered(error, 65)
    assert bench.recovered(bench.trial(4, lost=True, steps=65)["error"], 0)


def test_a_robot_that_is_not_lost_does_not_believe_so() -> None:
    """Scans that fit leave the running means alike; a scan that does not fit parts them."""
    boxes = [shapely.box(5, 5, 9, 7), shapely.box(-4, 8, -2, 15), shapely.box(2, -9, 4, -3)]
    grid, field = edge_grid(boxes), distance_field(boxes, (-20, -20, 20, 20))
    params, rng, angles = FilterParams(), np.random.default_rng(0), beam_angles(90)
    belief = believe_at(np.zeros(3), (0.05, 0.05, 0.02), params, rng)
    here = cast(grid, np.zeros((1, 3)), angles, 30.0)[0]
    for _ in range(10):
        belief = resample(weigh_scan(belief, field, angles, here, params), params, rng)
    assert lostness(belief) < 0.05
    elsewhere = cast(grid, np.array([[-10.0, -5.0, 1.0]]), angles, 30.0)[0]
    for _ in range(4):
        belief = weigh_scan(belief, field, angles, elsewhere, params)
    assert lostness(belief) > 0.2


def test_open_water_is_unobservable_and_a_corridor_is_along_itself() -> None:
    """With nothing in range the scan tells nothing; between two long walls it does not tell how far along; in a room it
    does.
    """
    params, angles, pose = FilterParams(), beam_angles(180), np.zeros(3)

    def told(boxes: list[shapely.Polygon]) -> float:
        field = distance_field(boxes, (-30, -30, 30, 30), 0.2)
        return weakest(pose, field, angles, cast(edge_grid(boxes), pose[None], angles, 30.0)[0], params)

    assert math.isinf(told([shapely.box(500, 500, 501, 501)]))
    corridor = [shapely.box(-200, 2, 200, 3), shapely.box(-200, -3, 200, -2)]
    assert told(corridor) > 10.0
    assert told([*corridor, shapely.box(5, -2, 6, -1), shapely.box(-7, 1, -6, 2)]) < params.weak
