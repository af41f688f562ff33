"""Condition equations written as functions, for the checks of the general adjustment."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from accelstudy.adjustment import Linearisation


@dataclass(frozen=True)
class FunctionConditions:
    """Condition equations given as functions of parameters (R, u) and observations (R, n, o).

    psi -> (R, n, c), jac_parameters A -> (R, n, c, u), jac_observations B -> (R, n, c, o).
    """

    psi: Callable
    jac_parameters: Callable
    jac_observations: Callable

    def linearise(self, parameters, adjusted, latent):
        """Evaluate the three functions."""
        x, l_hat = np.moveaxis(parameters, 0, -1), np.moveaxis(adjusted, 0, -1)
        return Linearisation(
            np.moveaxis(self.psi(x, l_hat), -1, 0),
            np.moveaxis(self.jac_parameters(x, l_hat), (-2, -1), (0, 1)),
            np.moveaxis(self.jac_observations(x, l_hat), (-2, -1), (0, 1)),
        )
