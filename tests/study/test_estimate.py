"""Estimates with linear theory as control variate: right, and as far off as they state."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from study_helpers import NINE, PAPER_SENSOR, grid, make_cells, plain
from usual import STANDARD_ERRORS

from accelstudy.study.estimate import (
    PROBABILITIES,
    controlled,
    controlled_quantiles,
    correlation,
    mean,
    ratio,
    rms,
    sd,
)
from accelstudy.study.statistics import TILT, simulated_statistics

OFTEN = 200
"""Samples over which errors are compared with the scatter, to 5 %."""


def cell_of(sigma=0.002, approach="gravity", replicates=1000, **keys):
    """The paper's set-up with the noise of forces and angles scaled."""
    (cell,) = make_cells(grid(approaches=approach, replicates=replicates), **keys).values()
    factor = sigma / cell.noise.sigma_force
    angle = factor * cell.noise.sigma_angle
    return replace(cell, noise=replace(cell.noise, sigma_force=sigma, sigma_angle=angle))


# --- one estimator for every statistic -----------------------------------------------------------

SIGMA = np.array([1.0, 2.0, 0.5])
ROOT = np.linalg.cholesky(np.array([[1.0, 0.6, 0.0], [0.6, 1.0, -0.3], [0.0, -0.3, 1.0]]))
KNOWN = {
    "mean": (mean, np.zeros(3)),
    "share": (mean, np.full(3, 0.95)),
    "sd": (sd, SIGMA),
    "rms": (rms, SIGMA),
    "correlation": (correlation, np.array([0.6, 0.0, -0.3])),
    "ratio": (lambda x: ratio(mean(np.abs(x)), sd(x)), np.sqrt(2 / np.pi) * SIGMA / SIGMA),
}
"""Statistics of the normal y = SIGMA · ROOT · z, of which the ratio is E|y| / sd(y)."""


def numbers(kind, x):
    """The numbers of which `kind` is a statistic."""
    inside = np.abs(x) <= stats.norm.ppf(0.975) * SIGMA
    return inside.astype(float) if kind == "share" else x


def estimated(statistic, x, y, known, converged=None):
    """The estimate of numbers (R, k) of calibrations and of linear theory."""
    converged = np.ones(len(y), bool) if converged is None else converged
    return controlled(converged, np.asarray(known), statistic(x.T), statistic(y.T))


def samples(n, apart, kind, seeds=OFTEN):
    """Estimates of x = y + apart · ε for many samples: (values, errors, gains)."""
    statistic, known = KNOWN[kind]
    found = []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        y = rng.standard_normal((n, 3)) @ ROOT.T * SIGMA
        x = y + apart * SIGMA * rng.standard_normal((n, 3))
        found.append(estimated(statistic, numbers(kind, x), numbers(kind, y), known))
    return (
        np.array([getattr(each, name) for each in found]) for name in ("value", "error", "gain")
    )


def expected(kind, apart):
    """The statistics of x."""
    wider = np.hypot(1, apart)
    rho = np.array([0.6, 0.0, -0.3]) / wider**2
    share = np.full(3, 2 * stats.norm.cdf(stats.norm.ppf(0.975) / wider) - 1)
    of = {"sd": SIGMA * wider, "rms": SIGMA * wider, "correlation": rho, "share": share}
    return of.get(kind, KNOWN[kind][1])


@pytest.mark.parametrize(("kind", "n", "apart"), [
    *((kind, *each) for kind in KNOWN for each in [(100, 0.1), (1000, 3.0)]),
    *((kind, 20, 0.01) for kind in KNOWN if kind != "share"),  # of 20, often all are inside
])  # fmt: skip
def test_every_statistic_is_as_far_off_as_it_states(kind, n, apart):
    values, errors, gains = samples(n, apart, kind)
    scatter = values.std(axis=0, ddof=1)
    if kind == "share":  # of few differences an error may be 0
        scatter, errors = np.hypot(scatter, 1 / n), np.hypot(errors, 1 / n)
    ratio = np.sqrt(np.mean((scatter / np.sqrt(np.mean(errors**2, axis=0))) ** 2))
    assert 0.85 < ratio < 1.15
    # Off by no more than the scatter of the mean, and a little that only few replicates have.
    off = np.abs(values.mean(axis=0) - expected(kind, apart))
    assert (off < STANDARD_ERRORS * scatter / np.sqrt(OFTEN) + 0.3 * scatter / np.sqrt(n)).all()
    if apart < 1 and kind != "share":
        assert np.median(gains) > 0.1 / apart**2


def test_a_mean_is_that_of_the_regression_on_linear_theory():
    rng = np.random.default_rng(2)
    y = rng.standard_normal((400, 1))
    x = 0.8 * y + 0.1 * rng.standard_normal((400, 1)) + 0.3
    found = estimated(mean, x, y, np.zeros(1))
    slope = np.cov(x[:, 0], y[:, 0])[0, 1] / y.var(ddof=1)
    assert found.value[0] == pytest.approx((x - slope * y).mean(), rel=1e-9)
    assert found.error[0] == pytest.approx((x - slope * y).std(ddof=1) / 20, rel=0.01)


def test_what_linear_theory_does_not_know_stays_plain():
    """Its constants tell nothing either, as of 19 replicates or fewer."""
    rng = np.random.default_rng(3)
    x = 1 + 0.1 * rng.standard_normal((50, 2))
    for theory, known in ((x, [np.nan, np.nan]), (np.ones((50, 2)), [1.0, 1.0])):
        found = estimated(mean, x, theory, known)
        assert (found.gain == 1).all()
        np.testing.assert_allclose(found.value, x.mean(axis=0))
        np.testing.assert_allclose(found.error, x.std(axis=0, ddof=1) / np.sqrt(50))
    assert (estimated(mean, x[:19], x[:19], np.ones(2)).gain == 1).all()


@pytest.mark.parametrize("statistic", [mean, sd])
def test_failures_that_hang_on_the_noise_are_no_bias(statistic):
    """What fails is what would have been large: the statistic of the rest is not that of all."""
    truncated = stats.truncnorm(-np.inf, 1.5)
    true, known = {mean: (truncated.mean(), 0.0), sd: (truncated.std(), 1.0)}[statistic]
    values, errors = [], []
    for seed in range(OFTEN):
        rng = np.random.default_rng(seed)
        y = rng.standard_normal((500, 1))
        converged = y[:, 0] < 1.5
        x = y[converged] + 0.01 * rng.standard_normal((converged.sum(), 1))
        found = estimated(statistic, x, y, [known], converged)
        values.append(found.value[0])
        errors.append(found.error[0])
        assert found.gain[0] > 0.95
    scatter = np.std(values)
    assert np.mean(values) == pytest.approx(
        true, abs=STANDARD_ERRORS * scatter / np.sqrt(OFTEN) + 1e-3
    )
    assert scatter == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=0.15)


@pytest.mark.parametrize("apart", [1e-4, 1e-2, 0.3, 3.0])
def test_quantiles_of_a_normal_sum(apart):
    """x = y + ε, whose quantiles are known: as far off as is stated."""
    levels = PROBABILITIES[np.abs(PROBABILITIES - 0.5) <= 0.475]
    known = stats.norm.ppf(levels)
    rng = np.random.default_rng(6)
    z, gains = [], []
    for _ in range(OFTEN):
        y = rng.standard_normal(1000)
        x = y + apart * rng.standard_normal(1000)
        found = controlled_quantiles(levels, np.ones(1000, bool), known, 0, x[None], y[None])[0]
        z.append((found.value - known * np.hypot(1, apart)) / found.error)
        gains.append(found.gain)
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    assert (rms < 1.25).all()
    assert (rms > 0.5).all()
    assert np.min(gains) >= 1
    assert np.median(gains) > {1e-4: 1e4, 1e-2: 50, 0.3: 2, 3.0: 1}[apart] * 0.99


# --- the statistics of cells ---------------------------------------------------------------------

STATISTICS = ("bias", "sd", "sd_ratio", "correlation", "variance_factor", "tilt_rms")


QUADRATIC = {"quadratic_scale": {"value": [200, -100, 300], "unit": "ppm"}}
LACKING = {"simulated_effects": [NINE, "quadratic_scale"], "sensor": PAPER_SENSOR | QUADRATIC}
DISTURBED = {"noise": {"effects": ["heavy_tails(nu=3)"]}}


@pytest.mark.parametrize(("noise", "approach", "keys", "gain"), [
    (0.002, "gravity", {}, 1e5),
    (0.3, "robot", {}, 10),
    # Linear theory is taken where the noise-free session is calibrated, not at the truth.
    (0.002, "gravity", LACKING, 1000),
    # The control is the normal noise on which effects act; its distribution stays known.
    (0.002, "gravity", DISTURBED, 1),
    (0.002, "gravity", {"noise": {"effects": ["quantisation"]}}, 1),
])  # fmt: skip
def test_few_controlled_replicates_say_what_many_plain_ones_do(noise, approach, keys, gain):
    few = simulated_statistics(cell_of(noise, approach, 400, **keys), 1)
    many = plain(cell_of(noise, approach, 4000, **keys), 2)
    assert (few.control, many.control) == ("linear", "none")
    limit = 6 if keys is DISTURBED else STANDARD_ERRORS  # heavy tails of squares
    for name in STATISTICS:
        one, other = few[name], many[name]
        assert (other.gain == 1).all()
        assert (one.gain > 0.9).all()
        z = (one.value - other.value) / np.hypot(one.error, other.error)
        assert np.abs(z).max() < limit, name
    assert few["sd"].gain.min() > gain * 0.9
    for name in ("roll", "pitch", "both"):
        one, other = few.quantile(TILT, name, 0.95), many.quantile(TILT, name, 0.95)
        assert abs(one.value - other.value) < limit * np.hypot(one.error, other.error)


def test_few_replicates_have_no_control():
    """A coefficient of a handful of replicates would fit them."""
    few = simulated_statistics(cell_of(replicates=19), 1)
    assert few.control == "none"
    assert (few["sd"].gain == 1).all()
    assert np.isnan(few.quantile(TILT, "both", 0.5).error)
