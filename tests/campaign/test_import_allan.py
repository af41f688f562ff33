"""The Allan deviation, and what it says about the mean of a hold."""

import numpy as np
import pytest
from scipy import stats

from accelstudy.adjustment.quality import global_test
from accelstudy.campaign.importing.allan import (
    accuracy_of_mean,
    averaging_factors,
    pooled_deviation,
)

N = 2**16
STEP = 0.01


def white(seed=1, n=N):
    return 0.02 * np.random.default_rng(seed).standard_normal(n)


def allan_deviation(values, step):
    """Allan deviation of one record, (n,) or (n, channels)."""
    return pooled_deviation([values.reshape(len(values), -1)], step)


def test_definition():
    x = np.random.default_rng(1).standard_normal(40)
    curve = allan_deviation(x, STEP)
    for tau, found in zip(curve.tau, curve.pooled, strict=True):
        m = round(tau / STEP)
        means = np.convolve(x, np.ones(m) / m, "valid")
        assert found**2 == pytest.approx(0.5 * np.mean((means[m:] - means[:-m]) ** 2))
    assert averaging_factors(20) == [1, 2, 3, 4, 5, 6, 7, 8, 10, 11, 13, 16, 19]
    assert averaging_factors(0) == []


@pytest.mark.parametrize("duration", [0.5, 2.0, 5.0])
def test_white_noise_is_found_white(duration):
    records = [white(seed, 3 * 500).reshape(-1, 3) for seed in range(30)]
    n = round(duration / STEP)
    accuracy = accuracy_of_mean(pooled_deviation(records, STEP), duration, 0.02, n)
    assert accuracy.white == pytest.approx(0.02 / np.sqrt(n))
    assert accuracy.ratio == pytest.approx(1, abs=0.2)
    assert (accuracy.slope is None) == (duration < 2.15)


def test_coloured_noise_is_not():
    """The sigma is that of the means of real holds: half the variance of their differences."""
    noise = 0.02 * np.random.default_rng(3).standard_normal(N) + np.convolve(
        white(4, N + 399), np.ones(400) / 20, "valid"
    )
    duration, n = 3.0, 300
    curve = allan_deviation(noise, STEP)
    accuracy = accuracy_of_mean(curve, duration, noise.std(), n)
    means = noise[: N // n * n].reshape(-1, n).mean(axis=1)
    assert accuracy.allan == pytest.approx(np.sqrt(np.mean(np.diff(means) ** 2) / 2), rel=0.15)
    assert accuracy.ratio > 5


@pytest.mark.parametrize("walk", [0.0, 0.1])
def test_degrees_of_freedom_are_those_of_the_scatter(walk):
    """Within the averaging times of the data ν = 2 / var(log σ²): 200 logs at 20 Hz, 26 holds."""
    rng, accuracies = np.random.default_rng(7), []
    for _ in range(200):
        noise = rng.standard_normal((2, 26, 80))
        holds = noise[0] + walk * np.cumsum(noise[1], axis=1)
        curve = pooled_deviation([*holds[..., None]], 0.05)
        sd = np.sqrt(np.mean(holds.var(axis=1)))
        accuracies.append(accuracy_of_mean(curve, 0.5, sd, 80))
    seen = 2 / np.var([2 * np.log(accuracy.allan) for accuracy in accuracies])
    # For white noise it is 1.3 times as much, by Greenhall & Riley (2003); twice is no harm.
    assert 0.45 < accuracies[0].dof / seen < 1.3


@pytest.mark.parametrize("ratio", [0.2, 1.0, 3.0])
def test_a_sigma_with_degrees_of_freedom_is_tested_by_the_f_distribution(ratio):
    below, above = stats.f(17, 9).cdf(ratio), stats.f(17, 9).sf(ratio)
    found = global_test(17 * ratio, 17, sigma_dof=9).p_value
    assert found == pytest.approx(2 * min(below, above))
