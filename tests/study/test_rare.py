"""Tails of the tilt error by importance sampling."""

from dataclasses import replace

import numpy as np
import pytest
from study_helpers import grid, make_study

from accelstudy.adjustment.calibration import calibrate
from accelstudy.adjustment.linear_theory import LinearTheory
from accelstudy.leveling.distribution import TiltDistribution
from accelstudy.simulation.sessions import session
from accelstudy.study.cells import study_cells
from accelstudy.study.monte_carlo.followed import cell_tilt_error, tilts
from accelstudy.study.rare import RareTilts, rare_tilts

LEVELING = {"max_tilt_gon": 50.0, "attitudes": 20}
TAILS = [1e-2, 1e-4, 1e-6]


def cell_of(approach, sigma=0.002):
    study = make_study(grids=[grid(replicates=1000, approaches=approach)])
    (cell,) = study_cells(study)
    return replace(cell, compiled=False, noise=replace(cell.noise, sigma_force=sigma))


def ideal_of(cell):
    return session(
        cell.simulated_model,
        cell.simulated_model.vector(cell.truth),
        cell.positions.directions,
        cell.gravity,
        cell.hold,
    )


@pytest.mark.parametrize("approach", ["gravity", "robot"])
def test_tails_of_small_noise_are_those_of_the_linear_distribution(approach):
    cell = cell_of(approach)
    ideal = ideal_of(cell)
    theory = LinearTheory.of(cell.estimated_model, cell.conditions, ideal.observations(cell.noise))
    tilt = cell_tilt_error(cell, LEVELING)
    exact = TiltDistribution(tilt, theory.covariance).quantile(1 - np.array(TAILS))
    found = rare_tilts(cell, 1, LEVELING, TAILS, range(10))
    value, error, _ = found.quantile(TAILS)
    assert np.all(error < 0.01 * value)
    # BOTH_ERROR and the second order of the errors are below a thousandth.
    assert np.all(np.abs(value - exact) < 4 * error + 1e-3 * exact)
    assert abs(found.weights.mean() - 1) < 4 * found.weights.std() / np.sqrt(5000)


def test_large_noise_agrees_with_plain_simulation():
    cell = cell_of("gravity", 0.3)
    value, error, _ = rare_tilts(cell, 1, LEVELING, TAILS, range(10)).quantile([1e-2])
    tilt = cell_tilt_error(cell, LEVELING)
    observed = ideal_of(cell).draw(cell.noise, 20_000, np.random.default_rng(2))
    result = calibrate(cell.estimated_model, cell.conditions, observed)
    plain = tilts(tilt, result.parameters[result.converged])
    for bound, uncertain, sample in zip(value[:, 0], error[:, 0], plain, strict=True):
        near = np.mean((sample > bound - uncertain) & (sample <= bound + uncertain)) / 2
        allowed = 4 * np.hypot(np.sqrt(1e-2 / sample.size), near)
        assert abs(np.mean(sample > bound) - 1e-2) < allowed


def test_blocks_do_not_depend_on_how_they_are_grouped():
    cell = cell_of("gravity")
    whole = rare_tilts(cell, 1, LEVELING, TAILS, range(3))
    parts = [rare_tilts(cell, 1, LEVELING, TAILS, one) for one in (range(1), range(1, 3))]
    np.testing.assert_array_equal(whole.tilts, np.hstack([part.tilts for part in parts]))
    np.testing.assert_array_equal(whole.weights, np.hstack([part.weights for part in parts]))


def test_failures_count_with_their_weights():
    tilt = np.tile([1.0, 2.0, np.nan, 3.0], (3, 1))
    count, share, _ = RareTilts(tilt, np.array([1.0, 0.5, 2.0, 0.5])).failed
    assert (count, share) == (1, 0.5)
