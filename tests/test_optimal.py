"""Optimal schemes: criteria, constraints, search, and known optima."""

import numpy as np
import pytest

from accelstudy.adjustment import whitened_jacobian
from accelstudy.approaches import get_approach
from accelstudy.models import get_model
from accelstudy.optimal.information import information, position_rows
from accelstudy.schemes import get_scheme
from accelstudy.simulation import Noise, session

NINE = get_model("bias-scale-nonorthogonality")


@pytest.mark.parametrize("approach", ["gravity", "robot"])
@pytest.mark.parametrize("sigma_gravity", [0.0, 1e-5])
def test_the_rows_of_positions_add_up_to_the_normal_matrix(approach, sigma_gravity):
    noise, directions = Noise(sigma_gravity=sigma_gravity), get_scheme("mclaren-24").directions
    truth = NINE.vector({"b_x": 0.05, "s_y": 0.004, "gamma_yz": 0.003})
    rows = position_rows(NINE, get_approach(approach), noise, directions, truth)
    assert rows.shape == (24, 1 if approach == "gravity" else 3, 9 + (sigma_gravity > 0))
    seen = session(NINE, truth, directions).observations(noise)
    whole = whitened_jacobian(NINE, get_approach(approach), seen, truth)
    normal = whole.T @ whole
    if sigma_gravity:
        normal[-1, -1] -= sigma_gravity**-2
    np.testing.assert_allclose(information(rows).sum(axis=0), normal, rtol=1e-9, atol=1e-6)
    alone = position_rows(NINE, get_approach(approach), noise, directions[5:6], truth)
    np.testing.assert_allclose(alone[0], rows[5], rtol=1e-9, atol=1e-9)
