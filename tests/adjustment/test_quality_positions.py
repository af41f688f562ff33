"""Tests of positions: p-values and family-wise error as claimed, and outliers found.

Claims of probability are held against a seeded Monte Carlo, with limits of 4.5 standard errors.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from quality_helpers import (
    BOTH,
    GRAVITY,
    NINE,
    ROBOT,
    SIGMA,
    STANDARD_ERRORS,
    draw,
    solutions,
    with_error,
)
from scipy.stats import kstest

from accelstudy.adjustment import calibrate
from accelstudy.adjustment.quality import holm, position_tests, solve, suspects
from accelstudy.basics.units import STANDARD_GRAVITY


def test_holm():
    p = np.array([0.01, np.nan, 0.04, 0.03, 0.9])
    np.testing.assert_allclose(holm(p), [0.04, np.nan, 0.09, 0.09, 0.9])
    assert np.isnan(holm(np.full(3, np.nan))).all()


NULL = 500


@pytest.fixture(scope="module")
def null_tests():
    """Tests of 500 sessions without a gross error, at the poles too."""
    return {
        approach.name: [
            position_tests(s)
            for s in solutions(approach, draw(5, "faces-edges-18", replicates=NULL))
        ]
        for approach in (GRAVITY, ROBOT)
    }


@BOTH
@pytest.mark.parametrize("kind", ["p_known", "p_unknown"])
def test_p_values_are_uniform_without_a_gross_error(null_tests, approach, kind):
    p = np.array([getattr(t, kind) for t in null_tests[approach.name]])
    assert not np.isnan(p).any()
    for position in (0, 4, 11):
        assert kstest(p[:, position], "uniform").pvalue > 1e-4
    # The p-values of one session are correlated, those of different sessions are not.
    rejected = np.mean(p < 0.05, axis=1)
    limit = STANDARD_ERRORS * rejected.std() / math.sqrt(NULL)
    assert rejected.mean() == pytest.approx(0.05, abs=limit)


@BOTH
@pytest.mark.parametrize("sigma_known", [True, False])
def test_the_family_wise_error_is_controlled(null_tests, approach, sigma_known):
    """18 tests at 0.05 each would reject something in half of the sessions."""
    tests = null_tests[approach.name]
    alpha = 0.1
    error = np.mean([np.min(t.p_adjusted(sigma_known)) < alpha for t in tests])
    limit = STANDARD_ERRORS * math.sqrt(alpha * (1 - alpha) / NULL)
    assert alpha / 3 < error < alpha + limit
    raw = [np.min(t.p_known if sigma_known else t.p_unknown) < alpha for t in tests]
    assert np.mean(raw) > 0.5


@BOTH
def test_the_number_of_conditions_is_that_of_the_dof(null_tests, approach):
    t = null_tests[approach.name][0]
    assert (t.dof == approach.n_conditions).all()
    assert t.gross_errors.shape == (18, approach.n_conditions)
    np.testing.assert_allclose(t.w**2, t.statistic)
    assert (t.w.min() < 0) == (approach is GRAVITY)


@BOTH
def test_studentised_and_tau_are_one_test(null_tests, approach):
    """τ²/r and F/(F + (r − q)/q)/q are the same share of Ω (Pope 1976)."""
    t, q = null_tests[approach.name][0], approach.n_conditions
    r = 18 * q - 9
    share = q * t.studentised / (q * t.studentised + r - q)
    np.testing.assert_allclose(q * t.tau**2 / r, share, rtol=1e-10)


@BOTH
def test_studentised_statistic_is_that_of_a_fit_without_the_position(approach):
    observed = draw(8)
    tests, q = position_tests(solve(NINE, approach, observed)), approach.n_conditions
    for position in (0, 9):
        rest = calibrate(NINE, approach, observed.take(np.delete(np.arange(24), position)))
        expected = tests.statistic[position] / q / rest.variance_posteriori[0]
        assert tests.studentised[position] == pytest.approx(expected, rel=2e-3)


def test_scaling_all_variances_changes_only_the_test_with_known_sigma():
    observed = draw(8)
    scaled = replace(
        observed, sigma_force=3 * observed.sigma_force, sigma_angle=3 * observed.sigma_angle
    )
    a, b = (position_tests(solve(NINE, ROBOT, o)) for o in (observed, scaled))
    np.testing.assert_allclose(b.p_unknown, a.p_unknown, rtol=1e-5)
    np.testing.assert_allclose(b.statistic, a.statistic / 9, rtol=1e-5)


@BOTH
@pytest.mark.parametrize("position", [0, 7, 23])
@pytest.mark.parametrize("sigma_known", [True, False])
def test_an_outlier_of_ten_sigma_is_found(approach, position, sigma_known):
    observed = draw(9)
    radial = observed.forces[0, position] / STANDARD_GRAVITY
    wrong = with_error(observed, position, 10 * SIGMA * radial)
    (found,) = suspects(NINE, approach, wrong, sigma_known=sigma_known)
    assert found.position == position
    assert found.p_value < 0.05
    assert np.linalg.norm(found.gross_error) == pytest.approx(10 * SIGMA, abs=4 * SIGMA)
    tests = position_tests(solve(NINE, approach, wrong))
    assert tests.worst(sigma_known) == position
    assert suspects(NINE, approach, observed, alpha=1e-3, sigma_known=sigma_known) == ()


def test_two_outliers_are_removed_one_at_a_time():
    observed = draw(9)
    wrong = with_error(observed, 4, [0.1, 0, 0])
    wrong = with_error(wrong, 17, [0, -0.05, 0.05])
    found = suspects(NINE, ROBOT, wrong)
    assert sorted(s.position for s in found) == [4, 17]
    assert len(suspects(NINE, ROBOT, wrong, most=1)) == 1
