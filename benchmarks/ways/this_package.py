"""What this package has: compiled code, and NumPy."""

import numpy as np

from accelstudy.adjustment import calibrate
from accelstudy.adjustment.calibration import Block
from accelstudy.kernel import calibrate as kernel
from problem import MODEL
from ways.base import Way, register


def with_sigma(block):
    """Estimates and standard deviations a posteriori of a block, (2, R, u)."""
    sigma_0 = np.sqrt(block.omega / block.redundancy)
    return np.array([block.estimates, block.sigma_priori * sigma_0[:, None]])


@register
class Compiled(Way):
    """`accelstudy.kernel`."""

    name, title = "compiled", "compiled"
    calibrations, difference = 5000, 0.0

    def __init__(self, approach):
        self._approach = approach

    def solve(self, observed):
        """Solve them."""
        return with_sigma(kernel.calibrate(MODEL, self._approach, observed))


@register
class Reference(Way):
    """`accelstudy.adjustment`."""

    name, title = "numpy", "NumPy"
    calibrations, difference = 1000, 1e-10

    def __init__(self, approach):
        self._approach = approach

    def solve(self, observed):
        """Solve them."""
        return with_sigma(Block.of(calibrate(MODEL, self._approach, observed)))
