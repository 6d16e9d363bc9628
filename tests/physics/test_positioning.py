"""Odometry, GNSS and the Kalman filter: noise as promised, and a filter that knows its error."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from quarterdeck.physics.positioning import (
    GNSS,
    ODOMETRY,
    OdometryModel,
    add_motion,
    body_motion,
    correct,
    draw_faults,
    fixes,
    lasting_deviation,
    measure_motion,
    motion_deviation,
    predict,
    step_slow,
)

coordinate = st.floats(-1e4, 1e4)
pose = st.tuples(coordinate, coordinate, st.floats(-3.1, 3.1)).map(lambda p: np.array([p]))


@given(before=pose, after=pose)
def test_a_motion_leads_from_the_one_pose_to_the_other(before: np.ndarray, after: np.ndarray) -> None:
    """What `body_motion` takes apart, `add_motion` puts together."""
    again = add_motion(before, body_motion(before, after))
    np.testing.assert_allclose(again[:, :2], after[:, :2], atol=1e-7)
    np.testing.assert_allclose(np.exp(1j * again[:, 2]), np.exp(1j * after[:, 2]), atol=1e-9)


def test_odometry_noise_does_not_depend_on_how_often_it_is_read() -> None:
    """Ten metres in ten readings are as uncertain as in a thousand."""
    model = OdometryModel(scale=0.0)
    for parts in (10, 1000):
        steps = np.tile([[10 / parts, 0.0, 0.5 / parts]], (parts, 1))
        assert np.sqrt((motion_deviation(steps, 10 / parts, model) ** 2).sum(axis=0)) == pytest.approx(
            [0.02 * 10**0.5, 0.01 * 10**0.5, (0.005**2 * 10 + 0.02**2 * 0.5 + 0.0005**2 * 10) ** 0.5]
        )


def test_gnss_errors_have_their_deviations_and_their_memory() -> None:
    """The slow part keeps its deviation for ever and forgets by 1/e in its memory; fixes add the white part."""
    model, rng = GNSS["single"], np.random.default_rng(3)
    slow = model.slow * rng.standard_normal((40_000, 2))
    later = slow
    for _ in range(30):
        later = step_slow(later, model.memory / 30, model, rng)
    assert later.std() == pytest.approx(model.slow, rel=0.02)
    assert (slow * later).mean() / model.slow**2 == pytest.approx(np.exp(-1), abs=0.02)
    assert (fixes(np.zeros((40_000, 3)), later, model, rng) - later).std() == pytest.approx(model.white, rel=0.02)


@pytest.mark.parametrize("domain", sorted(ODOMETRY))
def test_the_kalman_filter_is_consistent(domain: str) -> None:
    """Over 300 vehicles with white fixes, the error that the covariance tells is the error made: mean NEES about 3."""
    count, rng = 300, np.random.default_rng(4)
    model = OdometryModel(
        **{f: getattr(ODOMETRY[domain], f) for f in ("along", "across", "drift", "turn", "gyro")}, scale=0.0
    )
    deviation = np.array([0.3, 0.3, 0.02])
    truth = np.column_stack([rng.uniform(-50, 50, (count, 2)), rng.uniform(-np.pi, np.pi, count)])
    believed = truth + deviation * rng.standard_normal((count, 3))
    covariance = np.tile(np.diag(deviation**2), (count, 1, 1))
    everybody = np.ones(count, bool)
    for _ in range(50):
        motion = np.column_stack([np.full(count, 1.0), np.zeros(count), rng.normal(0, 0.1, count)])
        truth = add_motion(truth, motion)
        told = measure_motion(motion, 1.0, model, np.zeros((count, 3)), rng)
        believed, covariance = predict(believed, covariance, told, 1.0, model)
        fix = truth + deviation * rng.standard_normal((count, 3))
        believed, covariance = correct(believed, covariance, fix, deviation, everybody)
    error = believed - truth
    error[:, 2] = (error[:, 2] + np.pi) % (2 * np.pi) - np.pi
    nees = np.einsum("ki,kij,kj->k", error, np.linalg.inv(covariance), error)
    low, high = chi2.ppf([0.0005, 0.9995], 3 * count) / count
    assert low < nees.mean() < high


def test_without_fixes_the_doubt_grows_and_only_those_who_measure_gain() -> None:
    """Dead reckoning at sea loses track within the deviation it tells; a fix helps the one vehicle that has it."""
    model, rng = ODOMETRY["surface"], np.random.default_rng(5)
    faults = draw_faults(2000, model, rng)
    truth = believed = np.zeros((2000, 3))
    covariance = np.zeros((2000, 3, 3))
    for _ in range(30):
        motion = np.tile([[1.5, 0.0, 0.0]], (2000, 1))
        truth = add_motion(truth, motion)
        believed, covariance = predict(believed, covariance, measure_motion(motion, 1.0, model, faults, rng), 1.0, model)
    assert (believed - truth)[:, 0].std() == pytest.approx(np.hypot(0.1 * 30, 0.01 * 45), rel=0.1)
    seen = np.arange(2000) == 7
    after, surer = correct(believed, covariance, truth, np.array([0.1, 0.1, np.inf]), seen)
    assert np.abs(after[7, :2] - truth[7, :2]).max() < np.abs(believed[7, :2] - truth[7, :2]).max()
    np.testing.assert_array_equal(after[~seen], believed[~seen])
    assert np.trace(surer[7]) < np.trace(covariance[7])


def test_an_hour_of_fixes_tells_what_the_lasting_deviation_says() -> None:
    """The mean of many fixes is as wrong as that of as many independent ones with the lasting deviation."""
    model, rng, count = GNSS["single"], np.random.default_rng(3), 6000
    slow, total = model.slow * rng.standard_normal((500, 2)), np.zeros((500, 2))
    for _ in range(count):
        slow = step_slow(slow, model.interval, model, rng)
        total += fixes(np.zeros((500, 2)), slow, model, rng)
    assert (total / count).std() == pytest.approx(lasting_deviation(model) / np.sqrt(count), rel=0.1)
