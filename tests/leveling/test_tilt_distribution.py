"""The distribution of the tilt error of normal estimates, against closed forms and draws."""

import numpy as np
import pytest
from scipy import stats

from accelstudy.leveling.distribution import TiltDistribution
from accelstudy.leveling.error import TiltError

P, DRAWN = np.array([0.025, 0.25, 0.5, 0.75, 0.95, 0.975, 0.999]), 100_000
NOISE = 4.5 * np.sqrt(P * (1 - P) / DRAWN)
"""Of the shares of so many draws."""


def distribution(quadratic, covariance=None, constant=(0.0, 0.0), linear=None):
    u = len(quadratic[0])
    linear = np.zeros((2, u)) if linear is None else linear
    tilt = TiltError(np.zeros(u), np.array(constant), linear, np.array(quadratic))
    return TiltDistribution(tilt, np.eye(u) if covariance is None else covariance)


def drawn(of, count=DRAWN):
    rng = np.random.default_rng(5)
    estimates = rng.multivariate_normal(np.zeros(len(of.covariance)), of.covariance, count)
    each = of.tilt.rms(estimates).T
    return np.vstack([each, each.max(axis=0)])


def test_one_error_of_each_angle():
    """Roll and pitch are |normal|, and independent: both stay below q with Φ(q) = (1 + √p)/2."""
    found = distribution([np.diag([1.0, 0.0]), np.diag([0.0, 4.0])]).quantile(P)
    single = stats.norm.ppf((1 + P) / 2)
    np.testing.assert_allclose(found[:2], [single, 2 * single], rtol=1e-4)
    same = distribution([np.diag([1.0, 0.0]), np.diag([0.0, 1.0])]).quantile(P)
    np.testing.assert_allclose(same[2], stats.norm.ppf((1 + np.sqrt(P)) / 2), rtol=1e-4)


def test_a_chi_squared():
    """Four equal errors: the mean square of roll is χ² with four degrees of freedom."""
    of = distribution([np.diag([1.0] * 4 + [0.0] * 4), np.diag([0.0] * 4 + [1.0] * 4)])
    found = of.quantile(P)
    np.testing.assert_allclose(found[0], stats.chi.ppf(P, 4), rtol=1e-4)
    np.testing.assert_allclose(found[2], stats.chi.ppf(np.sqrt(P), 4), rtol=1e-4)
    np.testing.assert_allclose(of.mean_squares, [4.0, 4.0])


def slopes(u, seed):
    """Slopes of roll and of pitch in 50 attitudes; few errors change both, (2, 50, u)."""
    rng = np.random.default_rng(seed)
    of = rng.standard_normal((2, 50, u)) * np.logspace(0, -1.5, u)
    of[0, :, ::2] *= 0.3
    of[1, :, 1::2] *= 0.3
    return of, np.cov(rng.standard_normal((u, 3 * u)))


@pytest.mark.parametrize(("u", "seed"), [(6, 2), (9, 3), (15, 4)])
@pytest.mark.parametrize("offset", [0.0, 0.3, 3.0])
def test_quantiles_are_those_of_draws(u, seed, offset):
    """With an effect that the model lacks the reference itself is off in each attitude."""
    of_errors, covariance = slopes(u, seed)
    away = offset * np.random.default_rng(8).standard_normal((2, 50))
    forms = np.einsum("aku,akw->auw", of_errors, of_errors) / 50
    linear = np.einsum("ak,aku->au", away, of_errors) / 50
    of = distribution(forms, covariance, np.mean(away**2, axis=1), linear)
    sample, stated = drawn(of), of.relative_error(P)
    for values, quantiles, error in zip(sample, of.quantile(P), stated, strict=True):
        low, high = (np.quantile(values, p) for p in (P - NOISE, P + NOISE))
        assert ((quantiles > low * (1 - 4 * error)) & (quantiles < high * (1 + 4 * error))).all()
    assert (stated[:, P >= 0.5] < 0.02).all()
    np.testing.assert_allclose(np.mean(sample[:2] ** 2, axis=1), of.mean_squares, rtol=0.01)
