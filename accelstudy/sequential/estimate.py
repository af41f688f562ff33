"""What sessions tell of the parameters so far, together with what was known before."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.adjustment import Observations
from accelstudy.adjustment.calibration import CalibrationProblem
from accelstudy.adjustment.gauss_helmert import PIVOT_TOLERANCE
from accelstudy.adjustment.observations import Known
from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prior:
    """Parameters that are known beforehand, with their accuracy.

    Attributes
    ----------
    mean : (u,) array, SI; None where nothing is known
    information : (u, u) array, inverse of the covariance matrix; None where nothing is known
    """

    mean: Array | None = None
    information: Array | None = None

    @classmethod
    def of_covariance(cls, mean: ArrayLike, covariance: ArrayLike) -> Prior:
        """Return the prior of an earlier calibration: values (u,) and covariance matrix (u, u).

        Raises
        ------
        InputError
            If the matrix is not positive definite.
        """
        try:
            root = np.linalg.inv(np.linalg.cholesky(np.asarray(covariance, dtype=float)))
        except np.linalg.LinAlgError:
            raise InputError("a covariance matrix must be positive definite") from None
        return cls(np.asarray(mean, dtype=float), root.T @ root)

    @classmethod
    def of_known(cls, known: Known, model: SensorModel) -> Prior:
        """Return the prior of single parameters, which are independent of each other."""
        pairs = [known.get(name, (0.0, np.inf)) for name in model.parameter_names]
        mean, sigma = np.array(pairs).T
        return cls(mean, np.diag(sigma**-2.0))


NOTHING_KNOWN = Prior()


@dataclass(frozen=True)
class Estimate:
    """Estimates of R sessions with n positions each.

    Attributes
    ----------
    n_positions : int
    solved : (R,) bool array, whether all parameters are determined, and the adjustment converged
    parameters : (R, u') array, SI; NaN where a session is not solved
    information : (R, u', u') array, inverse of the covariance matrix for known noise; where a
        session is not solved, that of its raw readings at the first values of the parameters
    omega : (R,) array, Ω; NaN where a session is not solved
    redundancy : int, conditions, prior knowledge included, less unknowns; negative at first
    """

    n_positions: int
    solved: NDArray[np.bool_]
    parameters: Array
    information: Array
    omega: Array
    redundancy: int

    @property
    def cofactors(self) -> Array:
        """Covariance matrices for known noise, (R, u', u'); NaN where a session is not solved."""
        result = np.full(self.information.shape, np.nan)
        result[self.solved] = np.linalg.inv(self.information[self.solved])
        return result

    def sessions(self, chosen: NDArray[np.int_]) -> Estimate:
        """Return some of the sessions."""
        names = ("solved", "parameters", "information", "omega")
        part: dict[str, Any] = {name: getattr(self, name)[chosen] for name in names}
        return replace(self, **part)


def estimate(
    model: SensorModel,
    approach: Approach,
    observed: Observations,
    prior: Prior = NOTHING_KNOWN,
    initial: Array | None = None,
) -> Estimate:
    """Estimate the parameters of sessions from their positions so far.

    Parameters
    ----------
    model : SensorModel
    approach : Approach
    observed : Observations
        R sessions; they may have no positions yet.
    prior : Prior, optional
        What is known before the first position.
    initial : (u,) array, SI, optional
        First values of the parameters; the mean of the prior by default.

    Raises
    ------
    InputError
        As `accelstudy.adjustment.calibrate`, where something is missing.
    """
    problem = CalibrationProblem.of(model, approach, observed)
    sessions, u = problem.initial.shape
    n, of_model = problem.observations.shape[1], slice(model.n_parameters)
    # Observed gravity, and 0 ± 1 of errors that angles share, are prior knowledge, too.
    weights, direct, start = np.diag(problem.weights), problem.direct.copy(), problem.initial.copy()
    if prior.information is not None and prior.mean is not None:
        weights[of_model, of_model] = prior.information
        direct[:, of_model] = prior.mean
    start[:, of_model] = direct[:, of_model] if initial is None else initial
    redundancy = approach.n_conditions * n + int(np.count_nonzero(np.diag(weights))) - u

    rows = np.zeros((sessions, 0, u)) if n == 0 else problem.rows(start)
    information = weights + np.swapaxes(rows, 1, 2) @ rows
    solved = has_full_rank(information) & (redundancy >= 0)
    parameters, omega = np.full((sessions, u), np.nan), np.full(sessions, np.nan)
    if n == 0:
        parameters[solved], omega[solved] = direct[solved], 0.0
    elif solved.any():
        result = replace(
            problem,
            observed=tuple(each[solved] for each in problem.observed),
            initial=start[solved],
            direct=direct[solved],
            weights=weights,
        ).adjusted()
        chosen = np.flatnonzero(solved)
        solved[chosen] = result.converged
        parameters[chosen], omega[chosen] = result.parameters, result.omega
        converged = result.converged
        information[chosen[converged]] = np.linalg.inv(result.cofactors[converged])
    return Estimate(n, solved, parameters, information, omega, redundancy)


def has_full_rank(information: Array) -> NDArray[np.bool_]:
    """Whether information matrices (R, u, u) have full rank, as the adjustment judges it."""
    root = np.sqrt(np.diagonal(information, axis1=1, axis2=2))
    size = np.where(root > 0, root, 1.0)
    scaled = information / (size[:, :, None] * size[:, None, :])
    known: NDArray[np.bool_] = np.all(np.isfinite(scaled), axis=(1, 2))
    values = np.linalg.eigvalsh(np.where(known[:, None, None], scaled, 0.0))
    return np.asarray(values[:, 0] > PIVOT_TOLERANCE)
