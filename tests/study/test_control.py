"""Estimates with linear theory as control variate: right, with the errors they state, never worse.

The formulas are checked against plain regressions, the estimates against many plain replicates, and
the standard errors against the scatter over seeds.
"""

from dataclasses import replace
from functools import reduce
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from study_helpers import LEVELING, grid, make_cells, plain, run_study

from accelstudy.study.monte_carlo.averaged import PRODUCT
from accelstudy.study.monte_carlo.control import Control
from accelstudy.study.monte_carlo.distributions import (
    EDGES,
    PROBABILITIES,
    Controlled,
    Sample,
    apart_by_quantile,
    simulated_cell,
)
from accelstudy.study.monte_carlo.followed import ERROR, TILT, cell_tilt_error
from accelstudy.study.monte_carlo.replicates import simulate
from accelstudy.study.monte_carlo.statistics import Moments, Statistics

STANDARD_ERRORS = 4.5


def cell_of(sigma=0.002, approach="gravity", replicates=1000, **keys):
    """The paper's set-up with the noise of forces and angles scaled."""
    (cell,) = make_cells(grid(approaches=approach, replicates=replicates), **keys).values()
    factor = sigma / cell.noise.sigma_force
    angle = factor * cell.noise.sigma_angle
    return replace(cell, noise=replace(cell.noise, sigma_force=sigma, sigma_angle=angle))


def numbers_of(cell, seed=1):
    """Errors of replicates, converged or not, and those of linear theory."""
    control = Control.of(cell, cell_tilt_error(cell, LEVELING))
    pair = simulate(cell, seed, control)
    truth = cell.true_values
    return pair.simulated.estimates - truth, pair.linear.estimates - truth, pair.simulated.converged


# --- formulas ------------------------------------------------------------------------------------


def test_a_mean_is_that_of_the_regression_on_linear_theory():
    cell = cell_of(0.1, replicates=400)
    found, *_ = simulated_cell(cell, 1, LEVELING)
    errors, linear, _ = numbers_of(cell)
    for i in range(9):
        x, y = errors[:, i], linear[:, i]
        slope = np.cov(x, y)[0, 1] / y.var(ddof=1)
        rest = x - slope * y
        assert found.bias.value[i] == pytest.approx(rest.mean(), rel=1e-6, abs=1e-12)
        assert found.bias.error[i] == pytest.approx(rest.std(ddof=1) / 20, rel=1e-4)
        assert found.bias.gain[i] == pytest.approx(x.var() / rest.var(), rel=1e-4)
        assert found.bias.plain[i] == pytest.approx(x.mean(), rel=1e-9)
        assert found.sd.plain[i] == pytest.approx(x.std(ddof=1), rel=1e-9)


def test_where_calibrations_fail_the_mean_is_a_ratio():
    """By influence: x of those that converged, y of all."""
    cell = cell_of(1.5, replicates=1000)
    found, *_ = simulated_cell(cell, 1, LEVELING)
    errors, linear, converged = numbers_of(cell)
    assert 3 < (~converged).sum() < 300
    for i in range(9):
        plain = errors[converged, i].mean()
        influence = np.where(converged, errors[:, i] - plain, 0.0)
        y = linear[:, i]
        slope = np.cov(influence, y)[0, 1] / y.var(ddof=1)
        rest = influence - slope * y
        share = converged.mean()
        assert found.bias.plain[i] == pytest.approx(plain, rel=1e-9)
        assert found.bias.value[i] == pytest.approx(plain - slope * y.mean() / share, rel=1e-6)
        error = rest.std(ddof=1) / np.sqrt(len(y)) / share
        assert found.bias.error[i] == pytest.approx(error, rel=1e-4)


def test_failures_that_hang_on_the_noise_are_no_bias():
    """What fails is what would have been large: the mean of the rest is not that of all."""
    values, errors = [], []
    for seed in range(300):
        rng = np.random.default_rng(seed)
        y = rng.standard_normal((500, 1))
        converged = y[:, 0] < 1.5
        x = np.where(converged[:, None], y + 0.01 * rng.standard_normal(y.shape) + 0.3, 0.0)
        block = SimpleNamespace(converged=converged)
        moments = Moments.of(x, y, converged)
        found = Statistics(None, block, moments, np.zeros(1))._means
        values.append(found.value[0])
        errors.append(found.error[0])
        assert found.gain[0] >= 1
    true = 0.3 - stats.norm.pdf(1.5) / stats.norm.cdf(1.5)
    assert np.mean(values) == pytest.approx(true, abs=STANDARD_ERRORS * np.std(values) / 17)
    assert np.std(values) == pytest.approx(np.mean(errors), rel=0.2)


def test_merged_moments_are_those_of_all():
    """Though the means are far from zero, and the differences small."""
    rng = np.random.default_rng(3)
    y = 1e3 + rng.standard_normal((100, 3))
    x = y + 1e-4 * rng.standard_normal((100, 3))
    converged = np.arange(100) != 7
    parts = (np.split(each, [10, 40, 93]) for each in (x, y, converged))
    total = reduce(Moments.merged, map(Moments.of, *parts))
    whole = Moments.of(x, y, converged)
    assert total.size == 100
    for name in ("difference", "linear", "squares", "linear_converged"):
        np.testing.assert_allclose(getattr(total, name), getattr(whole, name), rtol=1e-7)
    centred = y - y.mean(axis=0)
    np.testing.assert_allclose(total.squares[2], (centred**2).sum(axis=0), rtol=1e-10)
    np.testing.assert_allclose(total.difference, (x - y).mean(axis=0), rtol=1e-7)


@pytest.mark.parametrize("apart", [1e-4, 1e-2, 0.3, 3.0])
def test_quantiles_of_a_normal_sum(apart):
    """x = y + ε, whose quantiles are known: as far off as is stated."""
    known = stats.norm.ppf(PROBABILITIES)
    edges, chosen = stats.norm.ppf(EDGES), np.flatnonzero(np.abs(PROBABILITIES - 0.5) <= 0.475)
    true = stats.norm.ppf(PROBABILITIES[chosen]) * np.hypot(1, apart)
    rng = np.random.default_rng(6)
    z, gains = [], []
    for _ in range(200):
        y = rng.standard_normal(1000)
        x = y + apart * rng.standard_normal(1000)
        sums = apart_by_quantile(x - y, y, edges)
        found = Controlled(Sample(x), 1000, linear=Sample(y), known=known, apart=sums).quantile(
            chosen
        )
        z.append((found.value - true) / found.error)
        gains.append(found.gain)
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    assert (rms < 1.25).all()
    assert (rms > 0.5).all()
    assert np.min(gains) >= 1
    assert np.median(gains) > {1e-4: 1e4, 1e-2: 50, 0.3: 2, 3.0: 1}[apart] * 0.99


# --- the estimates -------------------------------------------------------------------------------


@pytest.mark.parametrize("noise", [0.02, 0.3])
@pytest.mark.parametrize("approach", ["gravity", "robot"])
def test_stated_errors_are_those_over_seeds(noise, approach):
    cell = cell_of(noise, approach, replicates=150)
    levels = np.array([0.5, 0.95])
    values, errors = [], []
    for seed in range(40):
        found, bounds, _ = simulated_cell(cell, seed, LEVELING, levels)
        correlation = found.correlation
        tilt = bounds[TILT, "roll"].quantile(np.arange(2))
        below = np.tril_indices(9, -1)
        each = [
            (found.bias.value, found.bias.error),
            (found.sd.value, found.sd.error),
            (correlation.value[below], correlation.error[below]),
            (found.factor.value, found.factor.error),
            (found.tilt_rms.value, found.tilt_rms.error),
            (tilt.value, tilt.error),
        ]
        values.append([x for x, _ in each])
        errors.append([e for _, e in each])
    for kind, (low, high) in enumerate([(0.8, 1.2)] * 3 + [(0.6, 1.45)] * 3):
        scatter = np.std([v[kind] for v in values], axis=0, ddof=1)
        stated = np.sqrt(np.mean([np.square(e[kind]) for e in errors], axis=0))
        assert low < np.sqrt(np.mean((scatter / stated) ** 2)) < high, kind


@pytest.mark.parametrize(("noise", "approach"), [(0.002, "gravity"), (0.3, "robot")])
def test_few_controlled_replicates_say_what_many_plain_ones_do(noise, approach):
    few, *_ = simulated_cell(cell_of(noise, approach, 200), 1, LEVELING)
    many, _ = plain(cell_of(noise, approach, 20_000), 2)
    assert few.control == "linear"
    assert many.control == "none"
    for name in ("bias", "sd", "tilt_rms", "factor"):
        one, other = getattr(few, name), getattr(many, name)
        assert (other.gain == 1).all()
        assert (one.error < other.error).all()
        z = (one.value - other.value) / np.hypot(one.error, other.error)
        assert np.abs(z).max() < STANDARD_ERRORS, name


def test_plain_averages_stand_beside():
    cell = cell_of(0.1, replicates=300)
    found, bounds, _ = simulated_cell(cell, 1, LEVELING)
    alone, without = plain(cell, 1)
    for name in ("bias", "sd", "tilt_rms", "factor"):
        one, other = getattr(found, name), getattr(alone, name)
        np.testing.assert_allclose(one.plain, other.value, rtol=1e-3, atol=1e-9)
        assert (other.gain == 1).all()
        assert np.median(one.gain) > 10
    one, other = bounds[TILT, "both"].at(0.95), without[TILT, "both"].at(0.95)
    assert float(one.plain) == pytest.approx(float(other.value), rel=1e-12)


def test_few_replicates_have_no_control(tmp_path):
    """A coefficient of a handful of replicates would fit them."""
    tables = run_study(tmp_path, grids=[grid(replicates=19)])
    assert set(tables["cells"]["control"]) == {"none"}
    assert (tables["summary"]["sd_gain"] == 1).all()
    assert tables["quantiles"]["value_se"].isna().all()


@pytest.mark.parametrize("effect", ["heavy_tails(nu=3)", "quantisation", "coloured_noise"])
def test_noise_effects_only_lower_the_gain(effect):
    """The control is the normal noise on which they act; its distribution stays known."""
    keys = {"noise": {"effects": [effect]}}
    few, *_ = simulated_cell(cell_of(replicates=400, **keys), 1, LEVELING)
    many, _ = plain(cell_of(replicates=20_000, **keys), 2)
    assert (few.sd.gain >= 1).all()
    z = (few.sd.value - many.sd.value) / np.hypot(few.sd.error, many.sd.error)
    assert np.abs(z).max() < 6  # heavy tails of squares
    z = (few.bias.value - many.bias.value) / np.hypot(few.bias.error, many.bias.error)
    assert np.abs(z).max() < STANDARD_ERRORS


def test_a_model_that_lacks_an_effect_keeps_its_gain():
    """Linear theory is taken where the noise-free session is calibrated, not at the truth."""
    cell = cell_of(simulated_effects=["bias", "scale", "nonorthogonality", "quadratic_scale"])
    found, bounds, _ = simulated_cell(cell, 1, LEVELING)
    assert found.sd.gain.min() > 1000
    assert found.tilt_rms.gain.min() > 100
    many, alone = plain(replace(cell, replicates=20_000), 2)
    for one, other in ((found.bias, many.bias), (found.sd, many.sd), (found.factor, many.factor)):
        z = (one.value - other.value) / np.hypot(one.error, other.error)
        assert np.abs(z).max() < STANDARD_ERRORS
    for name in ("roll", "pitch", "both"):
        one, other = bounds[TILT, name].at(0.95), alone[TILT, name].at(0.95)
        assert abs(one.value - other.value) < STANDARD_ERRORS * np.hypot(one.error, other.error)


def test_products_are_about_the_centre():
    """The first block tells where the mean is, so that a bias does not count as spread."""
    cell = cell_of(0.3, replicates=1000)
    control = Control.of(cell, cell_tilt_error(cell, LEVELING))
    found, *_ = simulated_cell(cell, 1, LEVELING)
    mean = found.mean(ERROR).value / control.theory.sigma
    assert np.abs(mean).max() < 0.02
    squares = found.mean(PRODUCT).value[np.cumsum(np.arange(1, 10)) - 1]
    np.testing.assert_allclose(np.sqrt(squares), found.sd.value, rtol=1e-3)
