"""Square-root information: what is known of the parameters, before and after some positions.

What is known beforehand, and the conditions [Ã | −w̃] linearised at unit weight, Ã d = −w̃ + ε with
ε ~ N(0, I), are rows. They are kept as the triangle of their QR decomposition,

    [R  z]
    [0  ρ],   d̂ = R⁻¹ z,   Q_xx = R⁻¹ R⁻ᵀ,   Ω = ρ².

New rows are stacked below the triangle and decomposed with it, so the effort does not grow with the
number of positions. No normal matrix is formed, so no digits are lost to the square of its
condition. Source: Bierman (1977), Factorization methods for discrete sequential
estimation, chapter IV.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.adjustment import cholesky
from accelstudy.adjustment.observations import Known
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

    @classmethod
    def of_known(cls, known: Known, model: SensorModel) -> Prior:
        """Return the prior of single parameters, which are independent of each other."""
        pairs = [known.get(name, (0.0, np.inf)) for name in model.parameter_names]
        mean, sigma = np.array(pairs).T
        return cls(mean, np.diag(1 / sigma)[np.isfinite(sigma)])

    def start(self, model: SensorModel) -> Array:
        """Values of the parameters of a model, (u,); those of an ideal sensor if none are known."""
        return np.zeros(model.n_parameters) if self.mean is None else self.mean

    def rows_of(self, model: SensorModel) -> Array:
        """Rows (m, u) for a model; none if nothing is known."""
        return np.zeros((0, model.n_parameters)) if self.rows is None else self.rows


NOTHING_KNOWN = Prior()


def no_information(sessions: int, unknowns: int) -> Array:
    """Triangles (R, u + 1, u + 1) of no rows at all."""
    return np.zeros((sessions, unknowns + 1, unknowns + 1))


def absorb(triangles: Array, rows: Array) -> Array:
    """Triangles (R, u + 1, u + 1) with further rows (R, m, u + 1)."""
    return np.asarray(np.linalg.qr(np.concatenate([triangles, rows], axis=1), mode="r"))


def solution(triangles: Array) -> Array:
    """Steps d̂, (R, u); not finite where a triangle has no full rank."""
    lower, u = _transposed(triangles), triangles.shape[-1] - 1
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return cholesky.backward(lower, triangles[:, :u, u].T).T


def inverse_root(triangles: Array) -> Array:
    """R⁻¹, (R, u, u), with Q_xx = R⁻¹ R⁻ᵀ; not finite where a triangle has no full rank."""
    lower, u = _transposed(triangles), triangles.shape[-1] - 1
    right = np.broadcast_to(np.eye(u)[..., None], lower.shape)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.moveaxis(cholesky.backward(lower, right), -1, 0)


def length(triangles: Array, steps: Array) -> Array:
    """Lengths |R d|, (R,), of steps d (R, u), in standard deviations."""
    return np.asarray(np.linalg.norm((triangles[:, :-1, :-1] @ steps[..., None])[..., 0], axis=-1))


def _transposed(triangles: Array) -> Array:
    """Lower triangles Rᵀ, (u, u, R)."""
    return triangles[:, :-1, :-1].transpose(2, 1, 0)
