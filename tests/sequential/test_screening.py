"""Positions in use: what is kept while they are sorted anew is what they give alone."""

import numpy as np
import pytest

from accelstudy.approaches import get_approach
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.sequential.recursion import Recursion
from accelstudy.sequential.screening import Screening
from accelstudy.simulation.sessions import Noise, session

NINE = get_model("bias-scale-nonorthogonality")


@pytest.mark.parametrize("approach", ["gravity", "robot"])
def test_a_recursion_has_the_bits_of_its_positions_alone(approach):
    """With two gross errors, each later position has all sorted anew."""
    approach = get_approach(approach)
    ideal = session(NINE, np.full(9, 1e-4), get_scheme("fibonacci-24").directions)
    observed = ideal.draw(Noise(), 1, np.random.default_rng(3))
    observed.forces[0, [4, 16]] += 0.1
    found = Screening(NINE, approach, observed, sigma_known=True)
    assert found.aside == [4, 16]
    chosen = observed.take(np.array(found.used))
    alone = Recursion(NINE, approach, chosen)
    assert found.recursion.parameters.tobytes() == alone.parameters.tobytes()
    assert found.recursion.root_information.tobytes() == alone.root_information.tobytes()
    assert found.recursion.residuals.tobytes() == alone.residuals.tobytes()
