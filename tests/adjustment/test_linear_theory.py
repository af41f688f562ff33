"""Linear theory of a set-up: derivative of the calibration, covariance, and Ω."""

from dataclasses import replace

import numpy as np
import pytest
from usual import GRAVITY, NINE

from accelstudy.adjustment import calibrate
from accelstudy.adjustment.linear_theory import LinearTheory
from accelstudy.approaches import get_approach
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import Errors, Noise, session

TRUTH = np.array([0.05, 0.01, -0.03, 2e-4, -1e-4, 3e-4, 2e-4, -4e-4, 7e-4])
SCHEME = get_scheme("mclaren-24")
CASES = [
    ("gravity", Noise()),
    ("robot", Noise()),
    ("gravity", Noise(sigma_gravity=1e-3)),
    ("robot", Noise(sigma_gravity=1e-4, gravity_error=2e-3)),
    ("robot", Noise(sigma_angle=0.0)),
]


def theory_of(name, noise, model=NINE, simulated=NINE, truth=TRUTH):
    ideal = session(simulated, truth, SCHEME.directions)
    approach = get_approach(name)
    return ideal, approach, LinearTheory.of(model, approach, ideal.observations(noise))


def errors_of(theory, approach, errors):
    observed = errors.force
    if approach.uses_angles:
        observed = np.concatenate([observed, errors.angle], axis=-1)
    return theory.errors(observed, errors.gravity)


@pytest.mark.parametrize(("name", "noise"), CASES)
def test_errors_are_the_derivative_of_the_calibration(name, noise):
    """Half the noise leaves a quarter of what linear theory lacks."""
    ideal, approach, theory = theory_of(name, noise)
    rng = np.random.default_rng(1)
    errors = ideal.errors(noise, 40, rng)
    apart = []
    for factor in (1.0, 0.5):
        parts = (factor * e for e in (errors.force, errors.angle, errors.gravity))
        scaled = Errors(*parts)
        found = calibrate(NINE, approach, ideal.disturb(scaled, noise, rng))
        expected, omega = errors_of(theory, approach, scaled)
        apart.append((found.parameters - theory.reference - expected) / theory.sigma)
        np.testing.assert_allclose(found.omega, omega, rtol=0.02, atol=1e-9)
    spread = [np.sqrt(np.mean(each**2)) for each in apart]
    assert spread[0] < 5e-3
    assert spread[1] / spread[0] == pytest.approx(0.25, abs=0.05)


@pytest.mark.parametrize(("name", "noise"), CASES)
def test_covariance_is_that_of_the_adjustment_and_of_the_errors(name, noise):
    ideal, approach, theory = theory_of(name, noise)
    cofactors = calibrate(NINE, approach, ideal.observations(noise)).cofactors[0]
    scale = np.outer(theory.sigma, theory.sigma)
    if not noise.gravity_error:
        np.testing.assert_allclose(theory.covariance / scale, cofactors / scale, atol=1e-7)
    found, omega = errors_of(
        theory, approach, ideal.errors(noise, 40_000, np.random.default_rng(2))
    )
    empirical = np.cov(found.T) / scale
    assert np.abs(empirical - theory.covariance / scale).max() < 4.5 * np.sqrt(2 / 40_000)
    freedom = theory.redundancy + theory.misfit
    spread = np.sqrt((2 * theory.redundancy + 4 * theory.misfit) / 40_000)
    assert omega.mean() == pytest.approx(freedom, abs=4.5 * spread)
    assert omega.var() == pytest.approx(2 * theory.redundancy + 4 * theory.misfit, rel=0.08)


def test_a_misfit_counts_in_omega():
    """A sensor with a quadratic term that the model lacks, 100 times as large as the noise."""
    simulated = get_model("bias-scale-nonorthogonality-quadratic")
    truth = np.concatenate([TRUTH, [4e-3, -2e-3, 2e-3]])
    ideal, approach, theory = theory_of("gravity", Noise(), NINE, simulated, truth)
    assert theory.misfit > 100
    assert np.abs((theory.reference - TRUTH) / theory.sigma).max() > 3
    rng = np.random.default_rng(3)
    errors = ideal.errors(Noise(), 400, rng)
    found = calibrate(NINE, approach, ideal.disturb(errors, Noise(), rng))
    expected, omega = errors_of(theory, approach, errors)
    np.testing.assert_allclose(found.omega, omega, rtol=0.05)
    for i, column in enumerate((found.parameters - theory.reference).T):
        assert np.corrcoef(column, expected[:, i])[0, 1] > 0.999


def test_what_has_no_calibration_has_no_linear_theory():
    ideal = session(NINE, TRUTH, SCHEME.directions)
    observed = ideal.observations(Noise())
    hopeless = observed.forces.copy()
    hopeless[0, 3] = np.nan

    assert LinearTheory.of(NINE, GRAVITY, replace(observed, forces=hopeless)) is None
