"""The residuals of a calibration as a space in which hypotheses are compared.

The misclosures of unit weight of an adjustment are z = R ε with R = I − Ã (ÃᵀÃ)⁻¹ Ãᵀ = I − U Uᵀ,
U an orthonormal basis of the columns of Ã. They are m numbers in a space of r dimensions, in which
they have one variance in all directions, whatever the parameters are. An effect that is missing
from the model adds R D p to them, D the derivatives of the conditions by its parameters p. All
tests of the diagnosis work in this space, so they take into account what the parameters of the
model have already absorbed.

The rows are those of the positions and of what was observed of the parameters themselves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment import Observations
from accelstudy.adjustment.calibration import CalibrationProblem
from accelstudy.adjustment.quality import Linearisation, Solution, column_basis, diagonal_blocks
from accelstudy.approaches import Approach
from accelstudy.basics.arrays import Array
from accelstudy.leveling.angles import angles_of, specific_force
from accelstudy.sensors.sensor import SensorModel


@dataclass(frozen=True)
class Signature:
    """Derivatives of the observations by the k parameters of an effect, at zero.

    Attributes
    ----------
    force : (n, 3, k) array, of the sensor's output
    angles : (n, 2, k) array, of the robot's reading
    """

    force: Array
    angles: Array


@dataclass(frozen=True)
class Residuals:
    """The residual space of a set of linearised positions.

    Attributes
    ----------
    design : (m, u) array, Ã
    errors : (m,) array, e
    whitening : (n, c, c) array, L of each position
    jac_observations : (n, c, o) array, B
    sigmas : (n, o) array, of the observations
    """

    design: Array
    errors: Array
    whitening: Array
    jac_observations: Array
    sigmas: Array

    @classmethod
    def of(cls, solution: Linearisation) -> Residuals:
        """Residual space of a session that is linearised, as a calibration is at its solution."""
        return cls(
            solution.design,
            solution.errors,
            solution.whitening,
            solution.jac_observations,
            np.sqrt(solution.variances),
        )

    @classmethod
    def at(
        cls,
        model: SensorModel,
        approach: Approach,
        observed: Observations,
        parameters: Array | None = None,
        variances: Array | None = None,
    ) -> Residuals:
        """Residual space of observations as they are, without any adjustment.

        Parameters
        ----------
        model, approach, observed : as in `calibrate`, one session
        parameters : (u,) array; those of an ideal sensor by default
        variances : (n, o) array, of the observations; by default as they say
        """
        problem = CalibrationProblem.of(model, approach, replace(observed, initial=None))
        x = problem.initial[0] if parameters is None else parameters
        at = Linearisation.at(problem, x, np.zeros_like(problem.observations[0]))
        return cls.of(at if variances is None else replace(at, variances=variances))

    @cached_property
    def absorbed(self) -> Array:
        """U, (m, u)."""
        return column_basis(self.design)

    @cached_property
    def z(self) -> Array:
        """Residuals of unit weight, (m,)."""
        return self.project(self.errors)

    def orthogonal_to(self, basis: Array) -> Residuals:
        """Residuals of a fit that takes up a further space, too, with a basis (m, l)."""
        return replace(self, design=np.concatenate([self.design, basis], axis=1))

    @property
    def redundancy(self) -> int:
        """Rows less parameters, r."""
        m, u = self.design.shape
        return m - u

    @property
    def variance(self) -> float:
        """Variance of unit weight a posteriori."""
        return float(self.z @ self.z) / self.redundancy

    @property
    def sigma(self) -> float:
        """Noise of a condition, m/s²: rms over positions and conditions."""
        return float(np.sqrt(np.mean(np.sum(self.whitening**2, axis=2))))

    @cached_property
    def blocks(self) -> Array:
        """R of each position, (n, c, c)."""
        return diagonal_blocks(self.absorbed, *self.whitening.shape[:2])

    @cached_property
    def force_noise(self) -> Array:
        """L⁻¹ B for the forces in units of their sigmas, (n, c, 3)."""
        return np.asarray(self.by_observations[..., :3] * self.sigmas[:, None, :3])

    @cached_property
    def by_observations(self) -> Array:
        """L⁻¹ B, (n, c, o): derivatives of the conditions of unit weight by the observations."""
        return np.asarray(np.linalg.solve(self.whitening, self.jac_observations))

    def whiten(self, signature: Signature) -> Array:
        """Derivatives of the conditions of unit weight by the parameters of an effect, (m, k)."""
        b = self.by_observations
        change = b[..., :3] @ signature.force
        if b.shape[-1] > 3 and signature.angles.any():
            change += b[..., 3:] @ signature.angles
        return self.stack(change)

    def size(self, signature: Signature, g: float) -> Array:
        """Size of a signature in the observations, (k,), however little the approach sees of it.

        Angles count as the forces that they change.
        """
        force, turned = signature.force, g * signature.angles
        return np.sqrt(np.sum(force**2, axis=(0, 1)) + np.sum(turned**2, axis=(0, 1))) / self.sigma

    def stack(self, change: Array) -> Array:
        """Stack changes of unit weight, (n, c, k), with none of observed gravity, (m, k)."""
        white = change.reshape(-1, change.shape[-1])
        rows = np.zeros((len(self.design), white.shape[1]))
        rows[: len(white)] = white
        return rows

    def project(self, rows: Array) -> Array:
        """R rows: what the parameters of the model do not absorb of rows (m, k), likewise."""
        return np.asarray(rows - self.absorbed @ (self.absorbed.T @ rows))


def ideal_residuals(solution: Solution) -> tuple[Residuals, Array]:
    """Residual space of an ideal sensor in the same positions, and its forces (n, 3).

    Effects that are invisible or equal are exactly so at the ideal sensor. A real sensor differs
    from it by a few percent, and so do its signatures.
    """
    observed, model, approach = solution.observed, solution.model, solution.approach
    g = solution.gravity
    if approach.uses_angles and observed.angles is not None:
        angles = observed.angles[0]
        forces = np.column_stack(specific_force(angles[:, 0], angles[:, 1], g))
    else:
        p = solution.parameters[: model.n_parameters]
        forces = model.correct(observed.forces[0], p, g, observed.hold)
        forces = g * forces / np.linalg.norm(forces, axis=1, keepdims=True)
        angles = angles_of(forces)
    # Weights that are taken from the residuals could hide an axis.
    variances = solution.variances.copy()
    variances[:, :3] = variances[:, :3].mean()
    ideal = replace(observed, forces=forces[None], angles=angles[None], gravity=g)
    return Residuals.at(model, approach, ideal, variances=variances), forces


def spans(
    columns: Array, sizes: Array | None, tolerance: float
) -> tuple[Array, Array, NDArray[np.int_]]:
    """What each of several sets of columns (s, m, k) spans.

    Parameters
    ----------
    columns : (s, m, k) array
    sizes : (s, k) array beside which the columns are seen; their own norms if None
    tolerance : float, share of them below which a direction counts as nothing

    Returns
    -------
    directions : (s, k, l) array, combinations of the columns, l the smaller of m and k
    basis : (s, m, l) array, orthonormal, of their spaces
    rank : (s,) int array; what is beyond it is zero
    """
    norms = np.linalg.norm(columns, axis=1) if sizes is None else sizes
    scale = np.where(norms > 0, norms, 1.0)
    left, values, right = np.linalg.svd(columns / scale[:, None], full_matrices=False)
    seen = values > tolerance
    directions = np.swapaxes(right, 1, 2) / scale[..., None] * seen[:, None]
    return directions, left * seen[:, None], np.count_nonzero(seen, axis=1)
