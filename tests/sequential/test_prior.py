"""What is known before the first position counts like observations of the parameters."""

import numpy as np
import pytest
from usual import GRAVITY, NINE, ROBOT

from accelstudy.adjustment import calibrate, gauss_helmert
from accelstudy.adjustment.calibration import CalibrationProblem
from accelstudy.basics.errors import InputError
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.sequential.advisor import Prior
from accelstudy.simulation.sessions import Noise, session

VALUES = {"b_x": 0.05, "b_y": -0.02, "s_x": 2e-4, "s_z": 1e-3, "alpha_yz": 1e-3, "alpha_zx": -2e-3}
N, SESSIONS = 24, 6


@pytest.fixture(autouse=True)
def converged_to_the_end(monkeypatch):
    """The adjustment ends a step early for a comparison to 1e-9."""
    monkeypatch.setattr(gauss_helmert, "STEP_TOLERANCE", 1e-11)


def adjusted(prior, model, approach, so_far):
    return prior.augment(CalibrationProblem.of(model, approach, so_far)).adjust()


def observed(model, sessions=SESSIONS):
    order = np.random.default_rng(1).permutation(N)
    ideal = session(model, model.vector(VALUES), get_scheme(f"fibonacci-{N}").directions[order])
    return ideal.draw(Noise(), sessions, np.random.default_rng(2))


@pytest.mark.parametrize("n", [0, 1, 5, 12])
def test_a_factory_calibration_is_observations_of_the_parameters(n):
    so_far = observed(NINE).take(np.arange(n))
    mean = NINE.vector({"b_x": 0.04, "s_x": 1e-4})
    sigma = np.repeat([0.02, 1e-3, 2e-3], 3)
    found = adjusted(Prior.of_covariance(mean, np.diag(sigma**2)), NINE, GRAVITY, so_far)
    assert found.redundancy == n
    assert found.converged.all()
    if n == 0:  # and nothing else is known
        np.testing.assert_allclose(found.parameters, np.tile(mean, (SESSIONS, 1)), atol=1e-14)
        np.testing.assert_allclose(found.cofactors[0], np.diag(sigma**2), rtol=1e-12)
        return
    # By least squares of linearised lengths, iterated: |c(f)| = g, and the parameters as observed.
    for i in range(SESSIONS):
        x, forces = mean.copy(), so_far.forces[i]
        for _ in range(5):
            f = NINE.correct(forces, x)
            out = np.linalg.norm(f, axis=1)
            unit = (f / out[:, None])[:, None]
            by_x = (unit @ NINE.correction_jacobian(forces, x))[:, 0]
            slope = np.linalg.norm((unit @ NINE.output_jacobian(forces, x))[:, 0], axis=1)
            rows = np.concatenate([by_x / (0.002 * slope)[:, None], np.diag(1 / sigma)])
            left = np.concatenate([(9.80665 - out) / (0.002 * slope), (mean - x) / sigma])
            x = x + np.linalg.lstsq(rows, left)[0]
        own = np.sqrt(np.diag(found.cofactors[i]))
        np.testing.assert_allclose((found.parameters[i] - x) / own, 0, atol=2e-2)
        np.testing.assert_allclose(own, np.sqrt(np.diag(np.linalg.inv(rows.T @ rows))), rtol=1e-3)


def test_a_covariance_matrix_says_more_than_its_sigmas():
    model, approach = get_model("bias-scale"), ROBOT
    alone = observed(model, sessions=1)
    first = calibrate(model, approach, alone.take(np.arange(12)))
    earlier = Prior.of_covariance(first.parameters[0], first.cofactors[0])
    later = adjusted(earlier, model, approach, alone.take(np.arange(12, N)))
    whole = calibrate(model, approach, alone)
    sigma = np.sqrt(np.diagonal(whole.cofactors[0]))
    # The same but for the place at which the first half is linearised.
    np.testing.assert_allclose(later.parameters[0] / sigma, whole.parameters[0] / sigma, atol=2e-3)
    assert later.redundancy == 12 * 3


def test_a_prior_that_is_none():
    with pytest.raises(InputError, match="positive definite"):
        Prior.of_covariance(np.zeros(2), np.zeros((2, 2)))
