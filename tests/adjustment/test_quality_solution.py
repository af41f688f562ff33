"""The linearised solution, on which all measures of quality rest."""

from dataclasses import replace

import numpy as np
import pytest
from quality_helpers import BOTH, GRAVITY, NINE, ROBOT, SIGMA, draw

from accelstudy.adjustment import calibrate
from accelstudy.adjustment.quality import solve
from accelstudy.basics.errors import InputError
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import Noise


@BOTH
@pytest.mark.parametrize("sigma_gravity", [0.0, 1e-5])
def test_a_solution_reproduces_the_adjustment(approach, sigma_gravity):
    observed = draw(1, noise=Noise(sigma_gravity=sigma_gravity))
    result, solution = calibrate(NINE, approach, observed), solve(NINE, approach, observed)
    e, a = solution.errors, solution.design
    assert e @ e == pytest.approx(result.omega[0], rel=1e-9)
    np.testing.assert_allclose(a.T @ e, 0, atol=1e-5 * np.linalg.norm(a, axis=0).max())
    normal = np.linalg.inv(result.cofactors[0])
    np.testing.assert_allclose(a.T @ a, normal, rtol=1e-6, atol=1e-9 * normal.max())
    np.testing.assert_allclose(solution.basis.T @ e, 0, atol=1e-6)
    # v = −Q Bᵀ L⁻ᵀ e
    white = np.linalg.solve(solution.whitening, solution.jac_observations)
    part = e[: white.shape[0] * white.shape[1]].reshape(white.shape[:2])
    v = -solution.variances * np.einsum("nco,nc->no", white, part)
    np.testing.assert_allclose(v, result.residuals[0], atol=1e-7 * SIGMA)


def test_quality_is_that_of_one_session():
    with pytest.raises(InputError, match="one session, not of 3"):
        solve(NINE, GRAVITY, draw(1, replicates=3))


def test_a_calibration_without_a_solution_has_no_quality():
    model = get_model("bias-scale-nonorthogonality-crossaxis")
    with pytest.raises(InputError, match="no solution: its normal matrix is singular"):
        solve(model, GRAVITY, draw(0, model=model))
    observed = draw(0)
    broken = replace(observed, forces=np.where(observed.forces > 9, np.nan, observed.forces))
    with pytest.raises(InputError, match="no solution"):
        solve(NINE, ROBOT, broken)
