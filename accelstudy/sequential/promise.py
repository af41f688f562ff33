"""The tilt accuracy that is promised, and when it counts as reached.

The positions are chosen by the design, which hardly depends on the readings. So with a **known**
noise the time of stopping is not random, and the accuracy is the one that the covariance states.

With an **unknown** noise, or an estimated one, the time of stopping is random. Ω grows from
position to position by the squares of the recursive residuals. These are independent N(0, σ0²), and
independent of the estimate (Brown, Durbin & Evans 1975, J. R. Stat. Soc. B 37, 149-192). So
stopping by them does not bias the estimate, but it does bias Ω/r: a person who stops when the
accuracy seems good stops when Ω/r happens to be small. Here an upper confidence bound of the
variance is used, from a least redundancy on. It is looked at again and again, so its level is
higher than that of the promise. In simulations the promise then holds in about 95 % of the sessions
or more, whatever is promised (docs/guides/sequential.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from accelstudy.basics.arrays import Array
from accelstudy.leveling.error import TiltError

LEVEL = 0.975
"""Level of the upper confidence bound of the variance at each look, for 0.95 over all looks."""
LEAST_REDUNDANCY = 5
"""Least degrees of freedom with which an estimate may state the noise."""


@dataclass(frozen=True)
class Promise:
    """Rms of roll and of pitch, each, that a calibration may leave.

    The rms is over all tilts up to `tilt_range` and over all possible outcomes of the calibration,
    without the noise of the leveled reading.

    Attributes
    ----------
    accuracy : float, rad
    tilt_range : float, rad
    """

    accuracy: float
    tilt_range: float

    def is_kept(self, rms: Array) -> NDArray[np.bool_]:
        """Whether the rms of roll and of pitch, (..., 2), both keep the promise."""
        return np.asarray(np.all(rms <= self.accuracy, axis=-1))

    def weight(self, error: TiltError, rms: Array) -> Array:
        """W of the next choice, (..., u, u): mean variance of the angles that miss the promise.

        rms : (..., 2) array, of roll and pitch so far
        """
        missing = (rms > self.accuracy) | self.is_kept(rms)[..., None]
        share = missing / missing.sum(axis=-1, keepdims=True)
        return np.einsum("...a,auw->...uw", share, error.quadratic)


def bound(omega: ArrayLike, redundancy: float, sigma_dof: float = 0.0) -> Array:
    """Upper confidence bound of the variance of unit weight.

    A stated noise that is an estimate with ν degrees of freedom counts as Ω = ν with r = ν: none
    is stated if ν is 0, and the noise is known, so that the variance is 1, if ν is infinite. With
    too few degrees of freedom the bound is infinite.
    """
    omega, dof = np.asarray(omega), sigma_dof + redundancy
    if np.isinf(sigma_dof) or dof < LEAST_REDUNDANCY:
        return np.full(omega.shape, 1.0 if np.isinf(sigma_dof) else np.inf)
    return np.asarray((sigma_dof + omega) / special.chdtri(dof, LEVEL))
