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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.adjustment.calibration import CalibrationProblem, calibrate
from accelstudy.adjustment.gauss_helmert import Adjustment
from accelstudy.adjustment.observations import Observations
from accelstudy.approaches import Approach
from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.levels import MAX_TILT_GON, REFUTATION_LEVEL
from accelstudy.basics.units import GON
from accelstudy.effects import HoldConditions
from accelstudy.effects.hold_conditions import REFERENCE_TEMPERATURE
from accelstudy.leveling.angles import angles_of, roll_pitch, tilt_slope, wrap_angle
from accelstudy.leveling.error import cap_forces
from accelstudy.sensors.sensor import SensorModel

MIN_REDUNDANCY = 1e-6
"""A direction of a position with a smaller redundancy is not checked by the other positions."""
NO_POWER = 2
"""Redundancy up to which the global test has next to no power."""
HARDLY_KNOWN = 8
"""Degrees of freedom of σ0; with fewer the global test accepts residuals of 2.5 σ0 and more."""
SINGLE_LEVEL = 0.001
"""Level of the test of a single position."""
POWER = 0.8
"""Probability with which a detectable error or change is found."""
MIDPOINTS = 200
"""Number of nodes over an estimated variance, for the power of a test."""
ATTITUDES = 64
"""Least number of attitudes over which the effect of an error on leveling is averaged."""
NEAR_POLE = 0.1
"""Cosine of pitch below which an error of roll says nothing of the tilt."""


# --- the linearised solution --------------------------------------------------------------------


@dataclass(frozen=True)
class Linearisation:
    """One session, linearised at some parameters; n positions of c conditions.

    Attributes
    ----------
    variances : (n, o) array, diagonal of Q, (m/s²)² and rad²
    jac_parameters : (n, c, u) array, A
    jac_observations : (n, c, o) array, B
    misclosures : (n, c) array, w = ψ(l + v, x) − B v, m/s²; of the raw readings
    prior : (k, u) array and (k,) array, rows of unit weight of Ã and of e for what is known of
        parameters directly: of those with a prior, and of observed gravity, which is the last
    """

    variances: Array
    jac_parameters: Array
    jac_observations: Array
    misclosures: Array
    prior: tuple[Array, Array]

    @staticmethod
    def at(problem: CalibrationProblem, x: Array, v: Array) -> Linearisation:
        """Linearise a session at parameters (u,) and residuals (n, o)."""
        at = problem.linearise(x[None], problem.observations + v)
        b = np.moveaxis(at.jac_observations[:, :, 0], -1, 0)
        root_weight, seen = np.sqrt(problem.weights), problem.weights > 0
        return Linearisation(
            variances=problem.cofactors,
            jac_parameters=np.moveaxis(at.jac_parameters[:, :, 0], -1, 0),
            jac_observations=b,
            misclosures=at.psi[:, 0].T - np.einsum("nco,no->nc", b, v),
            prior=(np.diag(root_weight)[seen], (root_weight * (x - problem.direct[0]))[seen]),
        )

    @cached_property
    def whitening(self) -> Array:
        """L of each position, (n, c, c), with B Q Bᵀ = L Lᵀ."""
        b = self.jac_observations
        return np.linalg.cholesky(np.einsum("nco,no,ndo->ncd", b, self.variances, b))

    @cached_property
    def by_observations(self) -> Array:
        """Derivatives B̃ = L⁻¹ B of the errors of unit weight by the observations, (n, c, o)."""
        return np.asarray(np.linalg.solve(self.whitening, self.jac_observations))

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


class Squares(NamedTuple):
    """Sum of squares Ω of some observations, and their redundancy r."""

    omega: float
    redundancy: float

    @property
    def has_variance(self) -> bool:
        """Whether there is a redundancy of 1, the least that tells a variance."""
        return self.redundancy > 1 - MIN_REDUNDANCY

    def variance(self, otherwise: float = np.nan) -> float:
        """Variance of unit weight Ω/r, or another one where the redundancy is not enough."""
        return self.omega / self.redundancy if self.has_variance else otherwise


class ForceNoise(NamedTuple):
    """What the residuals of a session with angles tell of the noise of its forces alone.

    Attributes
    ----------
    variance : float, over the one that the forces have in the adjustment; NaN if nothing tells it
    dof : float, degrees of freedom of that variance
    in_residuals : float, share of the forces in the redundancy
    in_parameters : float, largest share of the forces in the variance of a parameter
    """

    variance: float
    dof: float
    in_residuals: float
    in_parameters: float


@dataclass(frozen=True)
class Solution(Linearisation):
    """One calibrated session, linearised at its solution.

    Attributes
    ----------
    model, approach, observed : what was calibrated, R = 1
    parameters : (u,) array, SI; gravity last, if it is observed
    gravity : float, m/s², estimated or fixed
    cofactors : (u, u) array, Q_xx
    residuals : (n, o) array, v, in m/s² and rad
    omega : float, Ω
    redundancy : int, r
    iterations : int, that it took
    """

    model: SensorModel
    approach: Approach
    observed: Observations
    parameters: Array
    gravity: float
    cofactors: Array
    residuals: Array
    omega: float
    redundancy: int
    iterations: int

    @property
    def sigma_force(self) -> float:
        """Noise of a force of unit weight, m/s²: the mean over positions and axes."""
        return float(np.mean(np.asarray(self.observed.sigma_force)))

    @cached_property
    def of_positions(self) -> Squares:
        """Parts of Ω and r that tell of the noise: those of the positions.

        The rest is that of gravity and of priors, whose sigmas do not depend on the noise.
        """
        rows, errors = self.prior
        known = float(len(rows) - np.sum(self.basis[len(self.basis) - len(rows) :] ** 2))
        if known < MIN_REDUNDANCY:  # as of gravity, which no position checks
            return Squares(self.omega, self.redundancy)
        return Squares(self.omega - float(errors @ errors), self.redundancy - known)

    @property
    def variance_posteriori(self) -> float:
        """Variance of unit weight a posteriori σ̂0² = Ω/r of the positions; NaN if r is below 1."""
        return self.of_positions.variance()

    @property
    def sigma_posteriori(self) -> float:
        """Noise of a force by the residuals, m/s²; NaN without redundancy."""
        return self.sigma_force * float(np.sqrt(self.variance_posteriori))

    @property
    def global_test(self) -> GlobalTest | None:
        """Test of the whole model against the stated noise; None without redundancy."""
        share = self.of_positions.redundancy / self.redundancy if self.redundancy > 0 else 1.0
        return global_test(self.omega, self.redundancy, sigma_dof=self.sigma_dof / share**2)

    def judge_noise(self, stated: bool) -> NoiseJudgement:
        """Judge the noise by the global test, and say which variance of unit weight to quote.

        A stated noise is trusted unless the residuals refute it. If it is itself an estimate it is
        pooled with the residuals: a variance of 1 with ν degrees of freedom and one of Ω/r with r
        give (ν + Ω)/(ν + r). If it is not trusted the noise is that of the residuals, and what is
        known of parameters directly may be refuted, too, as by a sensor of another type.

        Parameters
        ----------
        stated : bool, whether the noise was stated, and not taken from the residuals
        """
        test, dof, (omega, r) = self.global_test, self.sigma_dof, self.of_positions
        if not stated:
            return NoiseJudgement(False, self.variance_posteriori)
        if test is not None and not test.accepted:
            of_prior = Squares(self.omega - omega, self.redundancy - r).variance(1.0)
            return NoiseJudgement(False, self.of_positions.variance(1.0), max(of_prior, 1.0))
        return NoiseJudgement(True, (dof + omega) / (dof + r) if np.isfinite(dof) else 1.0)

    def covariance(self, noise: NoiseJudgement) -> Array:
        """Covariance matrix of the parameters with the noise that is quoted, (u, u).

        Σ = Q (σ0² N₁ + σ1² N₂) Q with Q⁻¹ = N₁ + N₂, N₁ of the positions and N₂ of what is known of
        parameters directly.
        """
        part, of_noise = self.prior[0] @ self.cofactors, noise.variance * self.cofactors
        return np.asarray(of_noise + (noise.of_prior - noise.variance) * part.T @ part)

    @property
    def redundancy_numbers(self) -> Array:
        """Redundancy of each position, (n,), the trace of its R (Baarda 1968; Koch 1999).

        With the share of observed gravity they sum up to r.
        """
        return np.asarray(np.einsum("ncc->n", self.blocks))

    @cached_property
    def sigma_dof(self) -> float:
        """Degrees of freedom of the stated noise of the positions; infinite where it is known.

        Beside angles they are those of σ² of the forces over the square of the share that the
        forces have in r.
        """
        dof = self.observed.sigma_dof
        if np.isinf(dof) or self.force_noise is None:
            return dof
        return dof / self.force_noise.in_residuals**2

    @cached_property
    def force_noise(self) -> ForceNoise | None:
        """The noise of the forces where angles are beside them; None if nothing tells it.

        With the part F of the forces in the variance of e the squares of v_f, over their variances,
        are eᵀ F e. They have the mean tr RF, which a variance θ of the forces makes larger by
        (θ − 1) tr (RF)², and tr (RF)² are its degrees of freedom (Koch 1999, chapter 3).
        """
        (n, c), r = self.misclosures.shape, self.of_positions.redundancy
        if self.variances.shape[1] == 3 or not self.of_positions.has_variance:
            return None
        part = self.by_observations[..., :3] * np.sqrt(self.variances[:, None, :3])
        part = part @ np.swapaxes(part, 1, 2)
        basis = self.basis[: n * c].reshape(n, c, -1)
        seen = part @ basis
        both = np.einsum("ncu,ncv->uv", basis, seen)
        dof = np.sum(part**2) - 2 * np.sum(seen**2) + np.sum(both**2)

        e = self.errors
        e = (e - self.basis @ (self.basis.T @ e))[: n * c].reshape(n, c)
        squares, freedom = np.einsum("nc,ncd,nd->", e, part, e), self.shares[:, :3].sum()
        # The step is right to first order: it halves sigma at most, and leaves the residuals one
        # degree of freedom at least, as these go with the square of θ.
        least = max(0.25, float(np.sqrt(min(1.0, r / 2) / dof)))
        variance = max(1 + (squares - freedom) / dof, least)

        u = self.model.n_parameters
        rows = self.design[: n * c].reshape(n, c, -1) @ self.cofactors[:, :u]
        in_parameters = np.einsum("ncu,ncd,ndu->u", rows, part, rows) / np.diag(self.cofactors)[:u]
        return ForceNoise(float(variance), float(dof), freedom / r, float(in_parameters.max()))

    @cached_property
    def shares(self) -> Array:
        """Diagonal of Q_vv Q⁻¹, (n, o): share of an error of an observation that shows in v."""
        b = self.by_observations
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
    return Solution(
        **vars(Linearisation.at(problem, x, v)),
        model=model,
        approach=approach,
        observed=observed,
        parameters=x,
        gravity=gravity,
        cofactors=result.cofactors[0],
        residuals=v,
        omega=float(result.omega[0]),
        redundancy=result.redundancy,
        iterations=int(result.iterations[0]),
    )


# --- tests -------------------------------------------------------------------------------------


class GlobalTest(NamedTuple):
    """Test of the whole model, two-sided (Koch 1999, chapter 4).

    Ω/σ0² ~ χ²_r, or Ω/(r σ0²) ~ F(r, ν) where σ0 was itself estimated with ν degrees of freedom.

    Attributes
    ----------
    statistic : float
    dof : int, r
    sigma_dof : float, ν; infinite where σ0 is known
    p_value : float
    accepted : bool, at the level asked for
    """

    statistic: float
    dof: int
    p_value: float
    accepted: bool
    sigma_dof: float = np.inf

    @property
    def powerless(self) -> bool:
        """Whether the test has next to no power."""
        return bool(self.shortage)

    @property
    def shortage(self) -> str:
        """What the test lacks to reject: redundancy, or degrees of freedom of sigma; else empty."""
        if self.dof <= NO_POWER:
            return f"redundancy {self.dof}"
        few = self.sigma_dof < HARDLY_KNOWN
        return f"{self.sigma_dof:.0f} degrees of freedom of sigma" if few else ""

    @property
    def remark(self) -> str:
        """Why the test has no power, in words; empty if it has."""
        return f"{self.shortage}: the test has next to no power" if self.powerless else ""


def global_test(
    omega: float,
    redundancy: int,
    alpha: float = REFUTATION_LEVEL,
    variance: float = 1.0,
    sigma_dof: float = np.inf,
) -> GlobalTest | None:
    """Test Ω against its distribution; None without redundancy, where there is nothing to test.

    Parameters
    ----------
    omega, redundancy : of the adjustment
    alpha : float, level
    variance : float, σ0² a priori
    sigma_dof : float, ν of σ0², where it is an estimate
    """
    if redundancy <= 0:
        return None
    statistic = omega / variance
    if np.isfinite(sigma_dof):
        ratio = statistic / redundancy
        tails = (f(redundancy, sigma_dof, ratio) for f in (special.fdtr, special.fdtrc))
    else:
        tails = (f(redundancy, statistic) for f in (special.chdtr, special.chdtrc))
    p_value = float(2 * min(tails))
    return GlobalTest(float(statistic), redundancy, p_value, p_value >= alpha, sigma_dof)


class NoiseJudgement(NamedTuple):
    """A judgement of the noise of a fit.

    Attributes
    ----------
    trusted : bool, whether the noise is stated and nothing refutes it
    variance : float, variance of unit weight to quote; 1 where the stated noise is known
    of_prior : float, that of what is known of parameters directly; more than 1 if it is refuted
    """

    trusted: bool
    variance: float
    of_prior: float = 1.0


@dataclass(frozen=True)
class PositionTests:
    """Tests for a gross error, one for each of n positions.

    Attributes
    ----------
    dof : (n,) int array, q, the directions in which the position is controlled; 0 is not testable
    statistic : (n,) array, ~ χ²_q if σ0 is known (Baarda 1968), q F(q, ν) if it was estimated
        beforehand with ν degrees of freedom
    studentised : (n,) array, ~ F(q, r − q) if σ0 is not; σ0 estimated without the position
    tau : (n,) array, √(statistic / (q σ̂0²)), after Pope (1976); its p-values are those of F
    p_known, p_unknown : (n,) arrays, two-sided p-values with σ0 known or not; NaN: not testable
    """

    dof: NDArray[np.int_]
    statistic: Array
    studentised: Array
    tau: Array
    p_known: Array
    p_unknown: Array

    def p_adjusted(self, sigma_known: bool = True) -> Array:
        """P-values with the family-wise error of all n tests controlled (Holm 1979), (n,)."""
        return holm(self.p_known if sigma_known else self.p_unknown)

    def worst(self, sigma_known: bool = True) -> int | None:
        """Position with the smallest p-value; None if no position can be tested."""
        p = self.p_known if sigma_known else self.p_unknown
        return None if np.isnan(p).all() else int(np.nanargmin(p))


def holm(p_values: Array) -> Array:
    """Adjust p-values by Holm's step-down method; NaN stays NaN and does not count."""
    adjusted = np.full(np.shape(p_values), np.nan)
    order = np.argsort(p_values)[: np.count_nonzero(~np.isnan(p_values))]
    steps = np.arange(len(order), 0, -1) * p_values[order]
    adjusted[order] = np.minimum(np.maximum.accumulate(steps), 1.0)
    return adjusted


def position_tests(solution: Solution) -> PositionTests:
    """Test each position for a gross error, the others being free of one.

    With σ0 unknown, statistic/Ω has a Beta(q/2, (r − q)/2) distribution, of which the studentised
    F and Pope's τ are two monotone functions; they are NaN where r − q = 0.
    """
    n, c = solution.misclosures.shape
    root, q = solution.root
    e = solution.errors[: n * c].reshape(n, c)
    normalised = np.einsum("ncd,nc->nd", root, e)
    statistic = np.sum(normalised**2, axis=1)
    omega, r = solution.of_positions
    with np.errstate(divide="ignore", invalid="ignore"):
        free = np.where(r - q > MIN_REDUNDANCY, r - q, np.nan)
        studentised = statistic / q / (np.maximum(omega - statistic, 0.0) / free)
        tau = np.sqrt(statistic / q / solution.variance_posteriori)
        nu = solution.sigma_dof
        p_known = special.chdtrc(q, statistic)
        if np.isfinite(nu):
            p_known = special.fdtrc(q, nu, statistic / q)
        p_known = np.where(q > 0, p_known, np.nan)
        p_unknown = special.fdtrc(q, r - q, studentised)
    return PositionTests(
        dof=q,
        statistic=statistic,
        studentised=studentised,
        tau=tau,
        p_known=p_known,
        p_unknown=p_unknown,
    )


class Suspect(NamedTuple):
    """A position (its index) that is in conflict with the others, and its adjusted p-value."""

    position: int
    p_value: float


def suspects(
    model: SensorModel,
    approach: Approach,
    observed: Observations,
    alpha: float = 0.05,
    sigma_known: bool = True,
    most: int = 5,
) -> tuple[Suspect, ...]:
    """Find positions with gross errors: remove the worst, adjust again, until none is rejected.

    Parameters
    ----------
    model, approach, observed : as in `calibrate`, one session
    alpha : float, family-wise level of each round
    sigma_known : bool, whether the variances of the observations are to be trusted
    most : int, positions to remove at most

    Returns
    -------
    tuple of Suspect, in the order of their removal
    """
    remaining = np.arange(observed.forces.shape[1])
    removed: list[Suspect] = []
    while len(removed) < most:
        tests = position_tests(solve(model, approach, observed.take(remaining)))
        worst = tests.worst(sigma_known)
        if worst is None:
            break
        p_value = float(tests.p_adjusted(sigma_known)[worst])
        if p_value >= alpha:
            break
        removed.append(Suspect(int(remaining[worst]), p_value))
        remaining = np.delete(remaining, worst)
    return tuple(removed)


# --- reliability --------------------------------------------------------------------------------


class Reliability(NamedTuple):
    """Largest errors that the tests may miss; infinite where a position is not controlled.

    Attributes
    ----------
    mdb : (n, c) array, m/s², minimal detectable error of |f_b| (gravity-based) or semi-axes of the
        ellipsoid of barely detectable errors of the vector f_b, ascending (robot)
    leveling : (n, 2) array, rad, largest effect of such an error on roll and on pitch, rms over all
        tilts up to `MAX_TILT_GON`
    """

    mdb: Array
    leveling: Array


def noncentrality(
    dof: int, alpha: float = SINGLE_LEVEL, power: float = POWER, noise_dof: float = np.inf
) -> float:
    """λ0 at which a test of level `alpha` has `power`; 17.075 by default for one dof.

    The test is χ² where the noise is known; else F, whose noise has `noise_dof` degrees of freedom.
    """
    if np.isinf(noise_dof):
        return float(special.chndtrinc(special.chdtri(dof, alpha), dof, 1 - power))
    from scipy import optimize, stats  # slow to import, and seldom needed

    # A mean over χ²(ν): the noncentral F of SciPy has no numbers for some ν, and its inverse ends
    # at 10⁴.
    evenly = (np.arange(MIDPOINTS) + 0.5) / MIDPOINTS
    ratios = stats.chi2.ppf(evenly, noise_dof) / noise_dof
    limits = dof * stats.f.isf(alpha, dof, noise_dof) * ratios

    def missed(size: float) -> float:
        return float(np.mean(stats.ncx2.cdf(limits, dof, size))) - (1 - power)

    most = 1e4
    while missed(most) > 0:
        most *= 10
    return float(optimize.brentq(missed, 1e-6, most))


def reliability(solution: Solution) -> Reliability:
    """Minimal detectable errors and their effects (Baarda 1968; Teunissen 2006).

    Leveling is taken at the reference temperature, at time zero, without vibration and without a
    change of position, where effects depend on such things.
    """
    n, c = solution.misclosures.shape
    root, rank = solution.root
    # Barely detectable errors are ∇ = √λ0 L H s with a unit vector s; maxima are over s.
    axes = np.linalg.svd(solution.whitening @ root, compute_uv=False)[:, ::-1]
    a = solution.design[: n * c].reshape(n, c, -1)
    slope = _leveling_slope(solution)
    # The largest singular value of the changes of all attitudes, by their sum of squares.
    squares = np.einsum("kau,kav->auv", slope, slope) / len(slope)
    on_parameters = solution.cofactors[: slope.shape[-1]] @ np.swapaxes(a, 1, 2) @ root
    on_level = on_parameters[:, None]
    on_leveling = np.swapaxes(on_level, 2, 3) @ squares @ on_level
    largest = np.sqrt(np.maximum(np.linalg.eigvalsh(on_leveling)[..., -1], 0.0))
    checked, size = (rank == c)[:, None], np.sqrt(noncentrality(c))
    return Reliability(*(np.where(checked, size * x, np.inf) for x in (axes, largest)))


def _leveling_slope(solution: Solution) -> Array:
    """Derivatives of roll and pitch by the model's parameters, (k, 2, u); 0 by those of the rig."""
    model, g = solution.model, solution.gravity
    p = np.where(model.stays, solution.parameters[: model.n_parameters], 0.0)
    f_b = cap_forces(MAX_TILT_GON * GON, ATTITUDES, g)
    roll, pitch = roll_pitch(tuple(f_b.T))
    at_rest = dict.fromkeys(HoldConditions.columns(), np.zeros(len(f_b)))
    reference = np.full(len(f_b), REFERENCE_TEMPERATURE)
    hold = HoldConditions(**{**at_rest, "roll": roll, "pitch": pitch, "temperature": reference})
    return tilt_slope(model, p, model.sense(f_b, p, g, hold), f_b, g, hold) * model.stays


# --- held-out positions -------------------------------------------------------------------------


@dataclass(frozen=True)
class HeldOutErrors:
    """How well each position is predicted by a calibration from all others.

    Attributes
    ----------
    misclosures : (n, c) array, m/s², |f_b| − g, or the output less that in the robot's attitude;
        NaN where the others do not determine the parameters
    angles : (n, 2) array, rad, calibrated roll and pitch less the robot's; None without a robot.
        NaN in roll where the x axis is nearly vertical
    """

    misclosures: Array
    angles: Array | None

    @property
    def n_predicted(self) -> int:
        """Number of positions that could be predicted; the rms are over these."""
        return int(np.count_nonzero(~np.isnan(self.misclosures[:, 0])))

    @property
    def rms(self) -> float:
        """Rms of |misclosure|, m/s²."""
        return float(_rms(np.linalg.norm(self.misclosures, axis=1)))

    @property
    def rms_angles(self) -> Array | None:
        """Rms of roll and of pitch, rad, (2,)."""
        return None if self.angles is None else np.array([_rms(a) for a in self.angles.T])


def _rms(values: Array) -> float:
    predicted = values[~np.isnan(values)]
    return float(np.sqrt(np.mean(predicted**2))) if len(predicted) else np.nan


def held_out(solution: Solution) -> HeldOutErrors | None:
    """Predict each position of a session by all others; None if the redundancy is below c.

    Without position i the parameters change by dx = Q_xx Ãᵢᵀ R_ii⁻¹ e_i, and its misclosure becomes
    L R_ii⁻¹ e_i: to first order, as one position of many hardly changes the derivatives.
    """
    n, c = solution.misclosures.shape
    if solution.redundancy < c:
        return None
    model, observed = solution.model, solution.observed
    root, rank = solution.root
    root = np.where((rank == c)[:, None, None], root, np.nan)
    scaled = root @ np.swapaxes(root, 1, 2) @ solution.errors[: n * c].reshape(n, c, 1)
    misclosures = (solution.whitening @ scaled)[..., 0]
    if observed.angles is None or not solution.approach.uses_angles:
        return HeldOutErrors(misclosures, None)
    design = solution.design[: n * c].reshape(n, c, -1)
    x = solution.parameters + (np.swapaxes(design, 1, 2) @ scaled)[..., 0] @ solution.cofactors
    p = x[:, : model.n_parameters]
    g = x[:, -1] if observed.sigma_gravity > 0 else np.full(n, solution.gravity)
    # Each position has parameters of its own, so they are sessions of one position.
    hold = None if observed.hold is None else observed.hold.take(np.arange(n)[:, None])
    f_b = model.correct(observed.forces[0][:, None], p, g, hold)[:, 0]
    readings = observed.angles[0]
    attitude = readings - model.errors_of_reading(readings[:, None], p, hold)[:, 0]
    return HeldOutErrors(misclosures, _attitude_error(f_b, attitude))


def _attitude_error(f: Array, angles: Array) -> Array:
    """Roll and pitch of `f` less the given ones, (n, 2), roll wrapped into ±π."""
    roll, pitch = (angles_of(f) - angles).T
    roll = np.where(np.cos(angles[:, 1]) < NEAR_POLE, np.nan, wrap_angle(roll))
    return np.stack([roll, pitch], axis=-1)
