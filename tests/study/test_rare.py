"""Tails of the tilt error by importance sampling."""

from dataclasses import replace

import numpy as np
import pytest
from study_helpers import grid, make_study, run_rare

from accelstudy.adjustment.calibration import calibrate
from accelstudy.basics.units import MGON
from accelstudy.leveling.distribution import TiltDistribution
from accelstudy.study.cells import rare_cells, study_cells
from accelstudy.study.monte_carlo.followed import cell_tilt_error, tilts
from accelstudy.study.rare import LEAST, RareTilts, rare_tilts

LEVELING = {"max_tilt_gon": 50.0, "attitudes": 20}
TAILS = [1e-2, 1e-4, 1e-6]


def cell_of(approach, sigma=0.002, replicates=5000):
    study = make_study(grids=[grid(replicates=replicates, approaches=approach)])
    (cell,) = study_cells(study)
    return replace(cell, compiled=False, noise=replace(cell.noise, sigma_force=sigma))


@pytest.mark.parametrize("approach", ["gravity", "robot"])
def test_tails_of_small_noise_are_those_of_the_linear_distribution(approach):
    cell = cell_of(approach)
    tilt = cell_tilt_error(cell, LEVELING)
    exact = TiltDistribution(tilt, cell.linear_theory.covariance).quantile(1 - np.array(TAILS))
    found = rare_tilts(cell, 1, LEVELING, TAILS)
    value, error, equivalent, effective = found.quantile(TAILS)
    assert np.all(error < 0.01 * value)
    # BOTH_ERROR and the second order of the errors are below a thousandth.
    assert np.all(np.abs(value - exact) < 4 * error + 1e-3 * exact)
    assert abs(found.weights.mean() - 1) < 4 * found.weights.std() / np.sqrt(5000)
    assert np.all(equivalent * TAILS > 0.8 * effective)
    assert np.all(effective > LEAST)


def test_large_noise_agrees_with_plain_simulation():
    cell = cell_of("gravity", 0.3)
    value, error, *_ = rare_tilts(cell, 1, LEVELING, TAILS).quantile([1e-2])
    observed = cell.ideal.draw(cell.noise, 20_000, np.random.default_rng(2))
    result = calibrate(cell.estimated_model, cell.conditions, observed)
    plain = tilts(cell_tilt_error(cell, LEVELING), result.parameters[result.converged])
    for bound, uncertain, sample in zip(value[:, 0], error[:, 0], plain, strict=True):
        near = np.mean((sample > bound - uncertain) & (sample <= bound + uncertain)) / 2
        allowed = 4 * np.hypot(np.sqrt(1e-2 / sample.size), near)
        assert abs(np.mean(sample > bound) - 1e-2) < allowed


def test_more_replicates_extend_the_ones_that_are_there():
    few, many = (rare_tilts(cell_of("gravity", replicates=n), 1, LEVELING, TAILS)
                 for n in (1000, 1100))  # fmt: skip
    np.testing.assert_array_equal(few.tilts, many.tilts[:, :1000])
    np.testing.assert_array_equal(few.weights, many.weights[:1000])


def test_a_tail_that_too_few_calibrations_reach_is_not_known():
    size = np.arange(1.0, 1001)
    value, *others = RareTilts(np.tile(size, (3, 1)), np.ones(1000)).quantile([0.2, 0.04])
    np.testing.assert_allclose(value[:, 0], 801)
    assert all(np.isnan(each[:, 1]).all() for each in (value, *others))
    nothing = RareTilts(np.full((3, 10), np.nan), np.ones(10))
    assert all(np.isnan(each).all() for each in nothing.quantile([0.2]))


def test_the_table_has_the_cells_that_can_be_estimated(tmp_path):
    study = make_study(
        grids=[grid(schemes=["mclaren-24", "faces-6"], approaches="gravity")],
        leveling=LEVELING,
        rare={"replicates": 1000, "shares": [0.1, 0.3]},
    )
    table = run_rare(tmp_path, study)
    cells = rare_cells(study, study_cells(study))
    assert set(table["cell"]) == {cells[0].name}
    assert [*table["name"].unique()] == ["roll", "pitch", "both"]
    assert set(table["n_replicates"]) == {1000}
    value, *_ = rare_tilts(cells[0], 1, LEVELING, [0.1, 0.3]).quantile([0.1, 0.3])
    np.testing.assert_allclose(table["value_mgon"], value.ravel() / MGON)


def test_failures_count_with_their_weights():
    tilt = np.tile([1.0, 2.0, np.nan, 3.0], (3, 1))
    share, _ = RareTilts(tilt, np.array([1.0, 0.5, 2.0, 0.5])).failed
    assert share == 0.5
