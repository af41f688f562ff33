"""The distribution of the tilt error of normal estimates, against closed forms and draws."""

import numpy as np
import pytest
from scipy import stats

from accelstudy.leveling.distribution import TiltDistribution
from accelstudy.leveling.error import TiltError

P = np.array([0.025, 0.25, 0.5, 0.75, 0.95, 0.975, 0.999])


def distribution(quadratic, covariance=None, constant=(0.0, 0.0), linear=None):
    u = len(quadratic[0])
    linear = np.zeros((2, u)) if linear is None else linear
    tilt = TiltError(np.zeros(u), np.array(constant), linear, np.array(quadratic))
    return TiltDistribution(tilt, np.eye(u) if covariance is None else covariance)


def drawn(of, count=100_000):
    rng = np.random.default_rng(5)
    estimates = rng.multivariate_normal(np.zeros(len(of.covariance)), of.covariance, count)
    each = of.tilt.rms(estimates).T
    return np.vstack([each, each.max(axis=0)])


def test_one_error_of_each_angle():
    """Roll and pitch are |normal|, and independent: both stay below q with Φ(q) = (1 + √p)/2."""
    found = distribution([np.diag([1.0, 0.0]), np.diag([0.0, 4.0])]).quantile(P)
    single = stats.norm.ppf((1 + P) / 2)
    np.testing.assert_allclose(found[:2], [single, 2 * single], rtol=1e-6)
    same = distribution([np.diag([1.0, 0.0]), np.diag([0.0, 1.0])]).quantile(P)
    both = stats.norm.ppf((1 + np.sqrt(P)) / 2)
    np.testing.assert_allclose(same[2][P >= 0.25], both[P >= 0.25], rtol=1e-3)
    np.testing.assert_allclose(same[2][P < 0.25], both[P < 0.25], rtol=5e-3)


def test_a_chi_squared():
    """Four equal errors: the mean square of roll is χ² with four degrees of freedom."""
    of = distribution([np.diag([1.0] * 4), np.diag([0.25] * 4)])
    found = of.quantile(P)
    np.testing.assert_allclose(found[0], stats.chi.ppf(P, 4), rtol=1e-6)
    np.testing.assert_allclose(found[2], found[0], rtol=1e-3)
    np.testing.assert_allclose(of.mean_squares, [4.0, 1.0])


def random_forms(u, seed):
    rng = np.random.default_rng(seed)
    forms = []
    for _ in range(2):
        root = rng.standard_normal((u, u)) * np.logspace(0, -1.5, u)
        forms.append(root @ root.T)
    covariance = np.cov(rng.standard_normal((u, 3 * u)))
    return forms, covariance


@pytest.mark.parametrize(("u", "seed"), [(3, 1), (6, 2), (9, 3), (15, 4)])
def test_quantiles_are_those_of_draws(u, seed):
    forms, covariance = random_forms(u, seed)
    of = distribution(forms, covariance)
    found, sample = of.quantile(P), drawn(of)
    for name, values, quantiles in zip(("roll", "pitch", "both"), sample, found, strict=True):
        share = np.searchsorted(np.sort(values), quantiles) / len(values)
        limit = 4.5 * np.sqrt(P * (1 - P) / len(values))
        if name == "both":  # by its number of directions
            limit += np.where(P < 0.25, 0.06 * P, 2e-3 * (1 - P))
        assert (np.abs(share - P) < limit).all()
    np.testing.assert_allclose(np.mean(sample[:2] ** 2, axis=1), of.mean_squares, rtol=0.01)


@pytest.mark.parametrize("offset", [0.3, 3.0])
def test_with_an_offset(offset):
    """An effect that the model lacks: the reference itself is off."""
    forms, covariance = random_forms(6, 7)
    rng = np.random.default_rng(8)
    # As of offsets in 50 attitudes with slopes: no linear form without its constant.
    slopes = rng.standard_normal((2, 50, 6))
    away = offset * rng.standard_normal((2, 50))
    forms = np.einsum("aku,akw->auw", slopes, slopes) / 50
    linear = np.einsum("ak,aku->au", away, slopes) / 50
    of = distribution(forms, covariance, np.mean(away**2, axis=1), linear)
    found, sample = of.quantile(P), drawn(of)
    for values, quantiles in zip(sample, found, strict=True):
        apart = np.abs(quantiles / np.quantile(values, P) - 1)
        assert (apart < np.where(P < 0.25, 0.1, 0.02)).all()


@pytest.mark.parametrize("offset", [0.0, 1e-3])
def test_rare_small_errors(offset):
    """Of one large error and many small ones the scaled χ², where the search starts, is far off."""
    p, sizes = np.array([0.001, 0.005]), np.array([1.0, *[0.01] * 8])
    forms, constant = [np.diag(sizes), np.diag(sizes[::-1])], (offset, offset)
    of = distribution(forms, None, constant, np.sqrt(offset) * np.sqrt([sizes, sizes[::-1]]) / 3)
    np.testing.assert_allclose(of.quantile(p)[2], np.quantile(drawn(of)[2], p), rtol=0.1)
