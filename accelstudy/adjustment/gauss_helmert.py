"""Rigorous Gauss–Helmert adjustment, batched over replicates.

Conditions ψ(l + v, x) = 0 between observations l with cofactors Q and parameters x, in independent
blocks (the positions of a calibration; one block for a general problem). Each iteration linearises
at the *adjusted* observations (Pope 1972; Lenzmann & Lenzmann 2004; Neitzel 2010),

    A dx + B v + w = 0,   w = ψ(l + v₀, x₀) − B v₀,

not at the raw ones. All replicates of a batch are solved together. Each stops at its own
convergence, so its result does not depend on the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.adjustment import cholesky
from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError

MAX_ITERATIONS = 30
STEP_TOLERANCE = 1e-6
"""Largest last step of a converged replicate, in standard deviations."""
ROUNDING = 64
"""Roundings of the largest observation; a smaller last step is asked of no replicate."""
PIVOT_TOLERANCE = 1e-12
"""Cholesky pivot of a normal matrix, scaled to unit diagonal, below which it is singular."""

# glibc returns freed blocks above a threshold to the system. To fetch them again page by page in
# each iteration takes a quarter of the time. One large block that is freed untouched raises the
# threshold (mallopt(3), M_MMAP_THRESHOLD). On other systems it has no effect.
np.empty(31 << 20, dtype=np.uint8)


@dataclass(frozen=True)
class Linearisation:
    """Condition equations at (x, l + v): values and Jacobians, components first.

    psi : (c, R, n); jac_parameters A : (c, u, R, n); jac_observations B : (c, o, R, n);
    latent : what the equations carry from iteration to iteration, an array (k, R, n) or None.
    """

    psi: Array
    jac_parameters: Array
    jac_observations: Array
    latent: Array | None = None


class ConditionEquations(Protocol):
    """Condition equations that the adjustment can linearise."""

    def linearise(self, parameters: Array, adjusted: Array, latent: Any) -> Linearisation:
        """Linearise at parameters (u, R) and adjusted observations (o, R, n)."""


@dataclass(frozen=True)
class Adjustment:
    """Result of an adjustment of R replicates; NaN where a replicate has no valid result.

    Attributes
    ----------
    parameters : (R, u) array
    residuals : (R, n, o) array, v
    cofactors : (R, u, u) array, Q_xx; covariance a priori, as σ0² = 1
    omega : (R,) array, Ω = vᵀ Q⁻¹ v
    redundancy : int, r = conditions − unknowns
    converged : (R,) bool array
    iterations : (R,) int array
    singular : (R,) bool array, the normal matrix had no full rank
    """

    parameters: Array
    residuals: Array
    cofactors: Array
    omega: Array
    redundancy: int
    converged: NDArray[np.bool_]
    iterations: NDArray[np.int_]
    singular: NDArray[np.bool_]

    @property
    def variance_posteriori(self) -> Array:
        """Variance of unit weight a posteriori σ̂0² = Ω/r, (R,); NaN without redundancy."""
        if self.redundancy <= 0:
            return np.full_like(self.omega, np.nan)
        return self.omega / self.redundancy

    @property
    def covariance_posteriori(self) -> Array:
        """Σ_xx = σ̂0² Q_xx, (R, u, u)."""
        return self.variance_posteriori[:, None, None] * self.cofactors

    @property
    def sigma_priori(self) -> Array:
        """Standard deviations a priori, (R, u)."""
        return np.sqrt(np.diagonal(self.cofactors, axis1=1, axis2=2))

    @property
    def sigma_posteriori(self) -> Array:
        """Standard deviations a posteriori, (R, u)."""
        return np.sqrt(np.diagonal(self.covariance_posteriori, axis1=1, axis2=2))

    @classmethod
    def concatenate(cls, parts: Sequence[Adjustment]) -> Adjustment:
        """Join adjustments of replicates of one problem."""
        arrays: dict[str, Any] = {
            field.name: np.concatenate([getattr(part, field.name) for part in parts])
            for field in fields(cls)
            if field.name != "redundancy"
        }
        return replace(parts[0], **arrays)


def adjust(
    equations: ConditionEquations,
    observations: ArrayLike,
    cofactors: ArrayLike,
    initial: ArrayLike,
    *,
    parameter_observations: ArrayLike | None = None,
    parameter_weights: ArrayLike | None = None,
    latent: Array | None = None,
    max_iterations: int = MAX_ITERATIONS,
) -> Adjustment:
    """Adjust R replicates of one problem.

    Parameters
    ----------
    equations : ConditionEquations
    observations : (R, n, o) array, l
    cofactors : (n, o) array of variances, or (n, o, o) array of matrices, Q of each block
    initial : (u,) or (R, u) array, initial values of the parameters
    parameter_observations : (R, u) array, optional
        Direct observations of parameters, such as gravity with σ_g.
    parameter_weights : (u,) array, optional
        Their weights; a weight of zero means that the parameter is not observed.
    latent : (k, R, n) array, optional
        Initial value of the quantity that the equations carry along.
    max_iterations : int

    Returns
    -------
    Adjustment
        A replicate that does not converge or whose normal matrix is singular is flagged and its
        numbers are NaN.

    Raises
    ------
    InputError
        If there are fewer conditions than unknowns.
    """
    observed = np.moveaxis(np.asarray(observations, dtype=float), -1, 0).copy()
    q = np.moveaxis(np.asarray(cofactors, dtype=float), 0, -1).copy()
    n_observations, n_replicates, n_blocks = observed.shape
    n_unknowns = np.shape(initial)[-1]
    x = np.empty((n_unknowns, n_replicates))
    x[:] = np.moveaxis(np.atleast_2d(np.asarray(initial, dtype=float)), -1, 0)
    v = np.zeros_like(observed)
    weights = np.diag(np.zeros(n_unknowns) if parameter_weights is None else parameter_weights)
    direct = np.zeros_like(x)
    if parameter_observations is not None:
        direct[:] = np.moveaxis(np.atleast_2d(np.asarray(parameter_observations)), -1, 0)

    parameters = np.full((n_replicates, n_unknowns), np.nan)
    residuals = np.full((n_replicates, n_blocks, n_observations), np.nan)
    q_xx = np.full((n_replicates, n_unknowns, n_unknowns), np.nan)
    omega = np.full(n_replicates, np.nan)
    converged = np.zeros(n_replicates, dtype=bool)
    iterations = np.zeros(n_replicates, dtype=int)
    singular = np.zeros(n_replicates, dtype=bool)
    tolerance = _tolerance(observed, q)
    active = np.arange(n_replicates)
    redundancy = 0
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for iteration in range(1, max_iterations + 1):
            at = equations.linearise(x, observed + v, latent)
            redundancy = redundancy_of(at.psi.shape[0] * at.psi.shape[2], np.diag(weights))
            step = _step(at, v, q, weights, direct - x)
            x, v, latent = x + step.dx, step.v, at.latent
            small = step.size <= tolerance[active]
            going_on = ~small & np.isfinite(step.size)

            iterations[active] = iteration
            singular[active] = step.singular
            converged[active] = small
            ended = active[small]
            parameters[ended] = x[:, small].T
            residuals[ended] = np.moveaxis(v[:, small], 0, -1)
            omega[ended] = step.omega[small]
            if len(ended):
                q_xx[ended] = step.cofactors(small)

            if not going_on.any():
                break
            if not going_on.all():
                active, x, v = active[going_on], x[:, going_on], v[:, going_on]
                observed, direct = observed[:, going_on], direct[:, going_on]
                latent = None if latent is None else latent[:, going_on]
    return Adjustment(
        parameters, residuals, q_xx, omega, redundancy, converged, iterations, singular
    )


@dataclass(frozen=True)
class _Step:
    """One iteration: the step, the new residuals, and their size in standard deviations."""

    dx: Array
    v: Array
    omega: Array
    size: Array
    factor: Array
    scale: Array

    @property
    def singular(self) -> NDArray[np.bool_]:
        return np.asarray(np.isnan(self.factor[-1, -1]))

    def cofactors(self, chosen: NDArray[np.bool_]) -> Array:
        """Q_xx = N⁻¹ of the chosen replicates, (R, u, u)."""
        scale = self.scale[:, chosen]
        inverse = cholesky.inverse(self.factor[..., chosen])
        return np.moveaxis(inverse / (scale[:, None] * scale), -1, 0)


def _step(at: Linearisation, v: Array, q: Array, weights: Array, prior_misclosure: Array) -> _Step:
    """Solve the linearised problem; `prior_misclosure` is observed minus present parameters."""
    white = whiten(at, v, q)
    normal, right = _normal_equations(white.design, white.misclosures)
    normal += weights[..., None]
    right += weights @ prior_misclosure

    scale = np.sqrt(np.einsum("uur->ur", normal))
    lower = cholesky.factor(normal / (scale[:, None] * scale), PIVOT_TOLERANCE)
    half = cholesky.forward(lower, right / scale)
    dx = cholesky.backward(lower, half) / scale

    misclosure, v_new = white.solve(dx)
    omega = np.einsum("crn,crn->r", misclosure, misclosure)
    left = prior_misclosure - dx
    omega += (left * (weights @ left)).sum(axis=0)

    # All three must vanish: the step in x, the step in v, and ψ at the adjusted observations.
    size_x = np.sqrt((half**2).sum(axis=0))
    size_v = (np.abs(v_new - v) / _sigma(q)[:, None]).max(axis=(0, 2), initial=0.0)
    size_psi = np.abs(cholesky.forward(white.factor, at.psi)).max(axis=(0, 2), initial=0.0)
    size = np.maximum(np.maximum(size_x, size_v), size_psi)
    return _Step(dx, v_new, omega, size, lower, scale)


@dataclass(frozen=True)
class WhitenedConditions:
    """Linearised conditions scaled to unit weight: A dx + w = −B v has covariance I.

    Attributes
    ----------
    factor : (c, c, R, n) array, L with B Q Bᵀ = L Lᵀ
    design : (c, u, R, n) array, L⁻¹ A
    misclosures : (c, R, n) array, L⁻¹ (ψ(l + v) − B v)
    corrections : (c, o, R, n) array, −L⁻¹ B Q, residuals by errors of unit weight
    """

    factor: Array
    design: Array
    misclosures: Array
    corrections: Array

    def solve(self, dx: Array) -> tuple[Array, Array]:
        """Errors of unit weight (c, R, n) and residuals v (o, R, n) after a step (u, R)."""
        errors = self.misclosures + np.einsum("curn,ur->crn", self.design, dx)
        return errors, np.einsum("crn,corn->orn", errors, self.corrections)


def whiten(at: Linearisation, v: Array, q: Array) -> WhitenedConditions:
    """Scale conditions linearised at l + v to unit weight.

    v : (o, R, n); q : (o, n) variances or (o, o, n) matrices
    """
    b, root = at.jac_observations, _root(q)
    factor, unit = cholesky.factor_of_rows(_times(b, root))
    design = cholesky.forward(factor, at.jac_parameters)
    w = cholesky.forward(factor, at.psi - np.einsum("corn,orn->crn", b, v))
    transposed = root.swapaxes(0, -2)  # standard deviations stay as they are
    return WhitenedConditions(factor, design, w, -_times(unit, transposed))


def whitened_design(at: Linearisation, q: Array) -> Array:
    """Jacobian of the conditions with respect to the parameters, at unit weight, (c, u, R, n).

    q : (o, n) variances or (o, o, n) matrices
    """
    factor, _ = cholesky.factor_of_rows(_times(at.jac_observations, _root(q)))
    return cholesky.forward(factor, at.jac_parameters)


def _root(q: Array) -> Array:
    """Standard deviations (o, n), or G (o, o, n) with Q = G Gᵀ."""
    return np.sqrt(q) if q.ndim == 2 else cholesky.factor(q)


def _times(b: Array, root: Array) -> Array:
    """Product B G, (c, o, R, n)."""
    return b * root[:, None] if root.ndim == 2 else np.einsum("corn,opn->cprn", b, root)


def _normal_equations(a: Array, w: Array) -> tuple[Array, Array]:
    """N = Σ AᵀA (u, u, R) and −Σ Aᵀw (u, R) of whitened conditions (c, u, R, n) and (c, R, n)."""
    u, n_replicates = a.shape[1:3]
    normal = np.empty((u, u, n_replicates))
    for i in range(u):
        normal[i, : i + 1] = np.einsum("crn,cjrn->jr", a[:, i], a[:, : i + 1])
        normal[: i + 1, i] = normal[i, : i + 1]
    return normal, -np.einsum("curn,crn->ur", a, w)


def redundancy_of(conditions: int, weights: Array) -> int:
    """Redundancy r = conditions (direct observations of parameters included) − unknowns.

    Raises
    ------
    InputError
        If there are fewer conditions than unknowns.
    """
    n_conditions = conditions + int(np.count_nonzero(weights))
    if n_conditions < len(weights):
        raise InputError(
            f"{n_conditions} condition equations cannot determine {len(weights)} parameters"
        )
    return n_conditions - len(weights)


def _sigma(q: Array) -> Array:
    """Standard deviations (o, n) of the observations; infinite where one is held fixed."""
    variances = q if q.ndim == 2 else np.einsum("oon->on", q)
    return np.sqrt(np.where(variances > 0, variances, np.inf))


def _tolerance(observed: Array, q: Array) -> Array:
    """Step at which each replicate stops, in standard deviations; never below rounding."""
    largest = np.max(np.abs(observed) / _sigma(q)[:, None], axis=(0, 2), initial=0.0)
    return np.asarray(np.maximum(STEP_TOLERANCE, ROUNDING * np.finfo(float).eps * largest))
