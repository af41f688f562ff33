"""Knowledge of the parameters before the first position, such as a factory calibration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.errors import InputError
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prior:
    """Parameters that are known beforehand, with their accuracy.

    Attributes
    ----------
    mean : (u,) array, SI; None where nothing is known
    rows : (m, u) array, square root of the information: rowsᵀ rows is the inverse of the covariance
        matrix, and rows · (x − mean) has covariance I
    """

    mean: Array | None = None
    rows: Array | None = None

    @classmethod
    def of_sigmas(cls, mean: ArrayLike, sigma: ArrayLike) -> Prior:
        """Return the prior of a data sheet: values (u,) with sigmas (u,), infinite where unknown.

        Raises
        ------
        InputError
            If a sigma is not positive.
        """
        sigma = np.asarray(sigma, dtype=float)
        if not np.all(sigma > 0):
            raise InputError("a sigma that is known beforehand must be greater than 0")
        return cls(np.asarray(mean, dtype=float), np.diag(1 / sigma)[np.isfinite(sigma)])

    @classmethod
    def of_covariance(cls, mean: ArrayLike, covariance: ArrayLike) -> Prior:
        """Return the prior of an earlier calibration: values (u,) and covariance matrix (u, u).

        Raises
        ------
        InputError
            If the matrix is not positive definite.
        """
        try:
            root = np.linalg.cholesky(np.asarray(covariance, dtype=float))
        except np.linalg.LinAlgError:
            raise InputError("a covariance matrix must be positive definite") from None
        return cls(np.asarray(mean, dtype=float), np.linalg.inv(root))

    def start(self, model: SensorModel) -> Array:
        """Values of the parameters of a model, (u,); those of an ideal sensor if none are known."""
        return np.zeros(model.n_parameters) if self.mean is None else self.mean

    def rows_of(self, model: SensorModel) -> Array:
        """Rows (m, u) for a model; none if nothing is known."""
        return np.zeros((0, model.n_parameters)) if self.rows is None else self.rows


NOTHING_KNOWN = Prior()
