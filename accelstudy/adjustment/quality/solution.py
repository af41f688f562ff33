"""How good one calibration is: tests, redundancy, reliability and held-out errors.

It all follows from the adjustment linearised at its solution, A dx + B v + w = 0. Scaled to unit
weight with B Q Bᵀ = L Lᵀ, the misclosures are e = L⁻¹ w = R ε with the projector

    R = I − Ã (Ãᵀ Ã)⁻¹ Ãᵀ = I − U Uᵀ,   Ã = L⁻¹ A,   ε ~ N(0, σ0² I),

with an orthonormal basis U of the columns of Ã, so that eᵀe = Ω and tr R = r. R is never formed,
as only its diagonal blocks are needed. A gross error shifts the conditions of its
position by ∇ and e by R L⁻¹ ∇. In the gravity-based approach one condition covers the three forces
of a position, which no test can tell apart. So positions are tested, not single observations.

Sources: Baarda (1968), A testing procedure for use in geodetic networks; Pope (1976), The
statistics of residuals and the detection of outliers; Koch (1999), Parameter estimation and
hypothesis testing in linear models; Teunissen (2006), Testing theory; Holm (1979).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.calibration import CalibrationProblem, calibrate
from accelstudy.adjustment.gauss_helmert import Adjustment
from accelstudy.adjustment.observations import Observations
from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

MIN_REDUNDANCY = 1e-6
"""A direction of a position with a smaller redundancy is not checked by the other positions."""


@dataclass(frozen=True)
class Solution:
    """One calibrated session, linearised at its solution; n positions of c conditions.

    Attributes
    ----------
    model, approach, observed : what was calibrated, R = 1
    parameters : (u,) array, SI; gravity last, if it is observed
    gravity : float, m/s², estimated or fixed
    cofactors : (u, u) array, Q_xx
    residuals : (n, o) array, v, in m/s² and rad
    variances : (n, o) array, diagonal of Q, (m/s²)² and rad²
    jac_parameters : (n, c, u) array, A
    jac_observations : (n, c, o) array, B
    misclosures : (n, c) array, w = ψ(l + v, x) − B v, m/s²; of the raw readings
    prior : (k, u) array and (k,) array, rows of unit weight of Ã and of e for what is known of
        parameters directly: of those with a prior, and of observed gravity, which is the last
    omega : float, Ω
    redundancy : int, r
    """

    model: SensorModel
    approach: Approach
    observed: Observations
    parameters: Array
    gravity: float
    cofactors: Array
    residuals: Array
    variances: Array
    jac_parameters: Array
    jac_observations: Array
    misclosures: Array
    prior: tuple[Array, Array]
    omega: float
    redundancy: int

    @cached_property
    def whitening(self) -> Array:
        """L of each position, (n, c, c)."""
        return whitening_of(self.jac_observations, self.variances)

    @cached_property
    def design(self) -> Array:
        """Ã, (n c + k, u)."""
        a = np.linalg.solve(self.whitening, self.jac_parameters)
        return np.concatenate([a.reshape(-1, a.shape[-1]), self.prior[0]])

    @cached_property
    def errors(self) -> Array:
        """Misclosures e of unit weight, (n c + k,)."""
        e = np.linalg.solve(self.whitening, self.misclosures[..., None])
        return np.concatenate([e.ravel(), self.prior[1]])

    @cached_property
    def basis(self) -> Array:
        """Orthonormal basis U of the columns of Ã, (n c + k, u); R = I − U Uᵀ."""
        return column_basis(self.design)

    @cached_property
    def blocks(self) -> Array:
        """R of each position, (n, c, c)."""
        return diagonal_blocks(self.basis, *self.misclosures.shape)

    @cached_property
    def sigma_dof(self) -> float:
        """Degrees of freedom of the stated noise in Ω; infinite where it is known.

        Beside angles they are those of σ² of the forces over the square of the share that the
        forces have in r.
        """
        dof, angles = self.observed.sigma_dof, self.variances.shape[1] > 3
        if not (angles and np.isfinite(dof) and self.redundancy > 0):
            return dof
        return float(dof / (self.shares[:, :3].sum() / self.redundancy) ** 2)

    @cached_property
    def shares(self) -> Array:
        """Diagonal of Q_vv Q⁻¹, (n, o): share of an error of an observation that shows in v."""
        b = np.linalg.solve(self.whitening, self.jac_observations)
        # v = −Q B̃ᵀ e, so that Q_vv Q⁻¹ = Q B̃ᵀ R B̃, which also holds for an observation without
        # noise.
        return np.asarray(self.variances * np.einsum("nco,ncd,ndo->no", b, self.blocks, b))

    @cached_property
    def root(self) -> tuple[Array, NDArray[np.int_]]:
        """H (n, c, c) with H Hᵀ = R⁺ of each position, and the rank of R, (n,)."""
        return root_of(self.blocks)


def column_basis(design: Array) -> Array:
    """Orthonormal basis of the columns of a design (m, u) of full rank, (m, u)."""
    return np.asarray(np.linalg.qr(design / np.linalg.norm(design, axis=0))[0])


def diagonal_blocks(basis: Array, n: int, c: int) -> Array:
    """Blocks (n, c, c) of I − U Uᵀ on its diagonal, U (n c + k, u)."""
    part = basis[: n * c].reshape(n, c, -1)
    return np.eye(c) - part @ np.swapaxes(part, 1, 2)


def root_of(blocks: Array) -> tuple[Array, NDArray[np.int_]]:
    """H (n, c, c) with H Hᵀ = R⁺ of blocks R (n, c, c), and their ranks (n,)."""
    values, vectors = np.linalg.eigh(blocks)
    seen = values > MIN_REDUNDANCY
    scale = np.where(seen, 1 / np.sqrt(np.where(seen, values, 1.0)), 0.0)
    return vectors * scale[:, None], np.count_nonzero(seen, axis=1)


def whitening_of(b: Array, variances: Array) -> Array:
    """L of each position, (n, c, c), with B Q Bᵀ = L Lᵀ; B (n, c, o), variances (n, o)."""
    return np.linalg.cholesky(np.einsum("nco,no,ndo->ncd", b, variances, b))


def solve(
    model: SensorModel,
    approach: Approach,
    observed: Observations,
    result: Adjustment | None = None,
) -> Solution:
    """Linearise a session at its solution.

    Parameters
    ----------
    model, approach, observed : as in `calibrate`, one session
    result : Adjustment, optional, what `calibrate` returned for it

    Raises
    ------
    InputError
        If there is not exactly one session, or it has no valid solution.
    """
    if len(observed.forces) != 1:
        raise InputError(f"quality is that of one session, not of {len(observed.forces)}")
    result = calibrate(model, approach, observed) if result is None else result
    if not result.converged[0]:
        why = "its normal matrix is singular" if result.singular[0] else "it does not converge"
        raise InputError(f"the calibration of model {model.name!r} has no solution: {why}")

    problem = CalibrationProblem.of(model, approach, observed)
    x, v = result.parameters[0], result.residuals[0]
    gravity = float(x[-1]) if problem.with_gravity else float(np.ravel(observed.gravity)[0])
    at = problem.linearise(x[None], problem.observations + v)
    b = np.moveaxis(at.jac_observations[:, :, 0], -1, 0)
    root_weight = np.sqrt(problem.weights)
    seen = problem.weights > 0
    return Solution(
        model=model,
        approach=approach,
        observed=observed,
        parameters=x,
        gravity=gravity,
        cofactors=result.cofactors[0],
        residuals=v,
        variances=problem.cofactors,
        jac_parameters=np.moveaxis(at.jac_parameters[:, :, 0], -1, 0),
        jac_observations=b,
        misclosures=at.psi[:, 0].T - np.einsum("nco,no->nc", b, v),
        prior=(np.diag(root_weight)[seen], (root_weight * (x - problem.direct[0]))[seen]),
        omega=float(result.omega[0]),
        redundancy=result.redundancy,
    )
