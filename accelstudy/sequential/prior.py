"""What is known of the parameters before the first position, from an earlier calibration."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.adjustment import Adjustment, Observations
from accelstudy.adjustment.calibration import CalibrationProblem
from accelstudy.approaches import Approach
from accelstudy.design.information import Information
from accelstudy.sensors.sensor import SensorModel

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

    def calibrate(
        self, model: SensorModel, approach: Approach, observed: Observations
    ) -> Adjustment:
        """Calibrate sessions, as `accelstudy.adjustment.calibrate`, together with what is known.

        The sessions may have no positions yet.
        """
        problem = CalibrationProblem.of(model, approach, observed)
        of_model = slice(model.n_parameters)
        # Observed gravity, and 0 ± 1 of errors that angles share, are known beforehand, too.
        weights, direct = np.diag(problem.weights), problem.direct.copy()
        weights[of_model, of_model] = self.information.normal
        direct[:, of_model] = self.mean
        return replace(problem, initial=direct, direct=direct, weights=weights).adjusted()
