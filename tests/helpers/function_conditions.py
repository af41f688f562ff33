"""Condition equations written as a function, for the checks of the general adjustment."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from accelstudy.adjustment import Linearisation

STEP = 1e-30


@dataclass(frozen=True)
class FunctionConditions:
    """Condition equations psi (R, n, c) of parameters (R, u) and observations (R, n, o).

    The function takes complex numbers, too: the derivatives are the imaginary parts that a tiny
    imaginary step of an argument makes, exact but for rounding.
    """

    psi: Callable

    def linearise(self, parameters, adjusted, latent):
        """Evaluate psi and its derivatives."""
        x, l = np.moveaxis(parameters, 0, -1), np.moveaxis(adjusted, 0, -1)
        steps = [STEP * 1j * np.eye(part.shape[-1]) for part in (x, l)]
        by_parameters = [self.psi(x + step, l + 0j).imag / STEP for step in steps[0]]
        by_observations = [self.psi(x + 0j, l + step).imag / STEP for step in steps[1]]
        return Linearisation(
            np.moveaxis(self.psi(x, l), -1, 0),
            np.moveaxis(by_parameters, -1, 0),
            np.moveaxis(by_observations, -1, 0),
        )
