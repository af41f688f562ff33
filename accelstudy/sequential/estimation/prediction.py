"""Test whether a new position agrees with those before it, before it is used."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prediction:
    """Prediction of the next position from those so far, R sessions.

    Attributes
    ----------
    misclosures : (R, c) array, of unit weight
    covariance : (R, c, c) array, a priori, of the next position and the prediction together
    """

    misclosures: Array
    covariance: Array

    @property
    def statistic(self) -> Array:
        """Squared misclosures over their covariance, (R,): σ0² χ² with c degrees of freedom."""
        scaled = np.linalg.solve(self.covariance, self.misclosures[..., None])[..., 0]
        return np.asarray(np.sum(self.misclosures * scaled, axis=-1))

    def p_value(self, omega: Array | None = None, redundancy: int = 0) -> Array:
        """P-values of a position that is free of a gross error, (R,).

        Parameters
        ----------
        omega : (R,) array, optional
            Ω of the earlier positions, where the noise is estimated from them (an F test); by
            default the noise is known (a χ² test).
        redundancy : int, of the earlier positions; with 0 there is no test, and the p-value is NaN
        """
        c = self.misclosures.shape[-1]
        if omega is None:
            return np.asarray(special.chdtrc(c, self.statistic))
        if redundancy <= 0:
            return np.full(len(self.misclosures), np.nan)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.statistic / c / (omega / redundancy)
        return np.asarray(special.fdtrc(c, redundancy, ratio))
