"""What is known of the parameters before the first position, from an earlier calibration."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.adjustment.calibration import CalibrationProblem
from accelstudy.design.information import Information

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prior:
    """Parameters that are known beforehand, with their accuracy.

    Attributes
    ----------
    mean : (u,) array, SI
    information : Information, of all u parameters
    """

    mean: Array
    information: Information

    @classmethod
    def of_covariance(cls, mean: ArrayLike, covariance: ArrayLike) -> Prior:
        """Return the prior of an earlier calibration: values (u,) and covariance matrix (u, u).

        Raises
        ------
        InputError
            If the matrix is not positive definite.
        """
        return cls(np.asarray(mean, dtype=float), Information.of_covariance(covariance))

    def augment(self, problem: CalibrationProblem) -> CalibrationProblem:
        """The problem of sessions together with what is known; they may have no positions yet."""
        of_model = slice(len(self.mean))
        # Observed gravity, and 0 ± 1 of errors that angles share, are known beforehand, too.
        weights, direct = np.diag(problem.weights), problem.direct.copy()
        weights[of_model, of_model] = self.information.normal
        direct[:, of_model] = self.mean
        return replace(problem, initial=direct, direct=direct, weights=weights)
