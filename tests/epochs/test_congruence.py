"""The congruence test beside simulated differences, and what it says has changed."""

import numpy as np
import pytest
from scipy import stats

from accelstudy.epochs.congruence import LEVEL, POWER, Epochs, noncentrality

N = 1000
STANDARD_ERRORS = 3.3
P = 9


def cofactors(rng, n, p=P):
    """Inverse normal matrix of n random rows, with parameters of unequal size."""
    rows = rng.standard_normal((n, p)) * np.geomspace(1, 1e5, p)
    return np.linalg.inv(rows.T @ rows)


def differences(rng, covariance, n=N):
    return rng.standard_normal((n, len(covariance))) @ np.linalg.cholesky(covariance).T


def estimated(rng, dof, n=N):
    """Estimates of a variance of 1; exact ones if it was stated."""
    return np.ones(n) if np.isinf(dof) else rng.chisquare(dof, n) / dof


def tolerance(share, n=N):
    return STANDARD_ERRORS * np.sqrt(share * (1 - share) / n)


@pytest.mark.parametrize(("dof", "noise"), [
    ((np.inf, np.inf), (1.0, 1.0)), ((15, 15), (1.0, 1.0)), ((9, 30), (3.0, 1.0)),
    ((30, 9), (0.3, 1.0)), ((15, np.inf), (5.0, 1.0)),
])  # fmt: skip
def test_the_level_is_kept_with_noise_of_any_kind(dof, noise):
    rng = np.random.default_rng(1)
    true = [s**2 * cofactors(rng, n) for s, n in zip(noise, (40, 25), strict=True)]
    each = zip(differences(rng, sum(true)), *(estimated(rng, r) for r in dof), strict=True)
    rejected = [not Epochs(d, (v * true[0], w * true[1]), dof).test().congruent for d, v, w in each]
    assert np.mean(rejected) == pytest.approx(LEVEL, abs=tolerance(LEVEL))


@pytest.mark.parametrize("dof", [np.inf, 15])
def test_a_detectable_change_is_found_as_often_as_is_said(dof):
    """With equal designs the test is that of one F variable, whose power is known."""
    rng = np.random.default_rng(2)
    q = cofactors(rng, 40)
    change = np.zeros(P)
    change[3] = Epochs(change, (q, q), (np.inf, np.inf)).detectable()[3]
    drawn = differences(rng, 2 * q) + change
    variances = (estimated(rng, dof) + estimated(rng, dof)) / 2
    found = [not Epochs(d, (v * q, v * q), (dof, dof)).test().congruent
             for d, v in zip(drawn, variances, strict=True)]  # fmt: skip
    size = noncentrality(P, np.inf)
    nu = 2 * dof
    expected = POWER if np.isinf(dof) else stats.ncf.sf(stats.f.isf(LEVEL, P, nu), P, nu, size)
    assert np.mean(found) == pytest.approx(expected, abs=tolerance(expected))


def test_the_parameter_that_changed_is_named_and_no_other():
    rng = np.random.default_rng(3)
    q = cofactors(rng, 40), cofactors(rng, 25)
    none, one, two = np.zeros((3, P))
    one[4] = 3 * Epochs(none, q, (np.inf, np.inf)).detectable()[4]
    two[[0, 4]] = 3 * Epochs(none, q, (np.inf, np.inf)).detectable()[[0, 4]]
    n = 200
    for true, said in ((none, ()), (one, (4,)), (two, (0, 4))):
        right = [
            Epochs(d, q, (np.inf, np.inf)).changed() == said
            for d in true + differences(rng, sum(q), n)
        ]
        assert np.mean(right) >= 1 - LEVEL - tolerance(LEVEL, n)


def test_parameters_that_cannot_be_told_apart_are_named_together():
    correlation = np.eye(3)
    correlation[0, 1] = correlation[1, 0] = -0.999
    covariance = correlation / 2
    epochs = Epochs(np.array([0.2, 0.0, 0.3]), (covariance, covariance), (np.inf, np.inf))
    (found,) = epochs.changed()
    assert epochs.instead_of(found, (found,)) == (1 - found,)
