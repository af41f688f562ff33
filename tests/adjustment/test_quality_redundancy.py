"""Redundancy numbers: exact sums, and closed forms of a uniform scheme."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from quality_helpers import GRAVITY, NINE, ROBOT, SIGMA, draw

from accelstudy.adjustment.quality import redundancy_numbers, solve
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import MGON
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import MODELS, get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import Noise, session


@hypothesis_settings(max_examples=40)
@given(
    scheme=st.sampled_from(["mclaren-24", "faces-edges-18", "fibonacci-24", "fibonacci-36"]),
    model=st.sampled_from([name for name in MODELS if not name.endswith("crossaxis")]),
    approach=st.sampled_from([GRAVITY, ROBOT]),
    sigma_gravity=st.sampled_from([0.0, 1e-5, 1e-3]),
    sigma_angle=st.sampled_from([0.0, 3.2 * MGON]),
    seed=st.integers(0, 1000),
)
def test_redundancy_numbers_sum_up_to_r(scheme, model, approach, sigma_gravity, sigma_angle, seed):
    model = get_model(model)
    noise = Noise(sigma_gravity=sigma_gravity, sigma_angle=sigma_angle)
    observed = draw(seed, scheme, model, noise)
    try:
        solution = solve(model, approach, observed)
    except InputError:  # too few positions for the model
        n_conditions = observed.forces.shape[1] * approach.n_conditions
        assert approach is GRAVITY
        assert n_conditions < 24
        return
    numbers = redundancy_numbers(solution)
    gravity = numbers.gravity or 0.0
    assert (numbers.gravity is None) == (sigma_gravity == 0)
    assert numbers.observations.sum() + gravity == pytest.approx(solution.redundancy, abs=1e-8)
    assert numbers.positions.sum() + gravity == pytest.approx(solution.redundancy, abs=1e-8)
    np.testing.assert_allclose(numbers.observations.sum(axis=1), numbers.positions, atol=1e-10)
    assert numbers.observations.min() > -1e-10
    assert numbers.observations.max() < 1 + 1e-10


def test_positions_of_mclaren_share_the_redundancy_equally():
    """Exactly at the ideal sensor; the paper's errors break the symmetry by a few 1e-4."""
    directions = get_scheme("mclaren-24").directions
    ideal = session(NINE, np.zeros(9), directions).observations(Noise())
    numbers = redundancy_numbers(solve(NINE, GRAVITY, ideal))
    np.testing.assert_allclose(numbers.positions, 15 / 24, atol=1e-9)
    # Of the three forces of a position, each has the share of its axis in the direction.
    np.testing.assert_allclose(numbers.observations, 15 / 24 * directions**2, atol=1e-9)


def test_the_value_of_gravity_is_not_checked_beside_scale_factors():
    assert redundancy_numbers(
        solve(NINE, ROBOT, draw(1, noise=Noise(sigma_gravity=1e-5)))
    ).gravity == pytest.approx(0, abs=1e-9)
    only_bias = SensorModel.of("bias alone", ("bias",))
    observed = session(only_bias, np.zeros(3), get_scheme("mclaren-24").directions).observations(
        Noise(sigma_gravity=1e-3)
    )
    # σ² of the mean of 24 norms against σ_g², as two observations of one quantity
    expected = 1e-6 / (1e-6 + SIGMA**2 / 24)
    numbers = redundancy_numbers(solve(only_bias, GRAVITY, observed))
    assert numbers.gravity == pytest.approx(expected, rel=1e-6)
