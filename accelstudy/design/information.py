"""What positions tell of parameters, by linear theory.

Each position has rows of the design matrix at unit weight. Those of several positions, of several
sessions and of what is known before stand below each other. Where a model estimates the parameters
of the columns A, and neglects others, of the columns N and of values p, the noise n shifts the
estimates by (AᵀA)⁻¹Aᵀ n, the neglected parameters shift them by (AᵀA)⁻¹Aᵀ N p, and are missing
themselves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.adjustment.equations import equations_of
from accelstudy.adjustment.gauss_helmert import whitened_design
from accelstudy.adjustment.observations import AngleErrors, Known
from accelstudy.approaches import Approach
from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.effects import HoldConditions
from accelstudy.leveling.angles import angles_of
from accelstudy.leveling.distribution import NOISE, Tilt
from accelstudy.leveling.error import TiltError
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import Noise

SINGULAR = 1e-7
"""Singular values of the scaled design matrix below this fraction of the largest count as zero."""
MIN_INVOLVED, IN_NOISE = 1e-3, 0.1
"""Share of a parameter in a combination from which on that combination hides it: of one that does
not show at all, and of one that noise shows, and blurs."""
ROUNDING = 1e-14
"""Columns of the design matrix shorter than this fraction of the longest count as zero."""


@dataclass(frozen=True)
class Information:
    """What conditions tell of u parameters.

    Attributes
    ----------
    rows : (m, u) array, rows of the design matrix at unit weight, or any with the same RᵀR
    conditions : int, how many there are
    """

    rows: Array
    conditions: int

    @classmethod
    def of(cls, *rows: Array) -> Information:
        """Information of rows (..., u), condensed to at most u of them."""
        every = np.concatenate([each.reshape(-1, each.shape[-1]) for each in rows])
        return cls(_triangle(every) if len(every) > every.shape[1] else every, len(every))

    @classmethod
    def of_covariance(cls, covariance: ArrayLike) -> Information:
        """Information of estimates of this covariance (u, u), SI; `InputError` if singular."""
        try:
            root = np.linalg.inv(np.linalg.cholesky(np.asarray(covariance, dtype=float)))
        except np.linalg.LinAlgError:
            raise InputError("a covariance matrix must be positive definite") from None
        return cls(root, len(root))

    @property
    def normal(self) -> Array:
        """Normal matrix RᵀR, (u, u)."""
        return np.asarray(self.rows.T @ self.rows)

    @cached_property
    def _root(self) -> Array | None:
        """Errors of all parameters, (u, u), if all are estimated; None if not determined."""
        return self.errors(range(self.rows.shape[1]))

    @property
    def covariance(self) -> Array:
        """Covariance matrix of all parameters, (u, u), at unit weight; NaN if not determined."""
        root = self._root
        return np.full_like(self.normal, np.nan) if root is None else root @ root.T

    @property
    def determined(self) -> bool:
        """Whether all parameters are determined."""
        return rank_of(self.rows)[0] == self.rows.shape[1]

    def errors(
        self,
        estimated: Sequence[int] | NDArray[np.int_],
        neglected: Sequence[int] | NDArray[np.int_] = (),
        sizes: ArrayLike = (),
    ) -> Array | None:
        """Errors of all parameters as a linear function of standard normal variables.

        Parameters
        ----------
        estimated, neglected : columns of parameters; all others are known
        sizes : (q,) array, SI, standard deviations of the neglected parameters

        Returns
        -------
        (u, k + q) array, by k variables of the noise, as many as there are estimated parameters,
        and by the q neglected parameters; its product with its transpose is the covariance matrix.
        None if the estimated parameters are not determined.
        """
        estimated, neglected = list(estimated), list(neglected)
        design = self.rows[:, estimated]
        if len(design) < len(estimated):
            return None
        size = _column_size(design)
        left, values, right = np.linalg.svd(design / size, full_matrices=False)
        if values[-1] <= SINGULAR * values[0]:
            return None
        root = right.T / values / size[:, None]
        errors = np.zeros((self.rows.shape[1], len(estimated) + len(neglected)))
        errors[estimated] = root @ np.hstack(
            [np.eye(len(estimated)), left.T @ self.rows[:, neglected]]
        )
        errors[neglected, len(estimated) + np.arange(len(neglected))] = -1.0
        errors[:, len(estimated) :] *= np.asarray(sizes)
        return errors

    def tilt(
        self,
        error: TiltError,
        estimated: Sequence[int] | NDArray[np.int_],
        neglected: Mapping[str, tuple[Sequence[int] | NDArray[np.int_], float]] | None = None,
    ) -> Tilt | None:
        """Tilt error that a calibration leaves; None if its parameters are not determined.

        Parameters
        ----------
        error : TiltError, of the first parameters; those that follow (gravity) cause none in use
        estimated : columns of the parameters that it estimates
        neglected : mapping of effect to columns and sd of its parameters, SI; those that are not
            estimated are neglected, and cause an error
        """
        sizes = {
            i: (effect, size)
            for effect, (columns, size) in (neglected or {}).items()
            for i in columns
            if size and i not in estimated
        }
        errors = self.errors(estimated, [*sizes], [size for _, size in sizes.values()])
        if errors is None:
            return None
        causes = (*[NOISE] * len(estimated), *(effect for effect, _ in sizes.values()))
        root = errors[: len(error.reference)]
        return Tilt(root.T @ error.quadratic @ root, causes)

    def gain(self, candidates: Array, weight: Array | None = None) -> Array:
        """What each of k further positions would bring.

        A position with the rows A turns the covariance Q into Q − Q Aᵀ (I + A Q Aᵀ)⁻¹ A Q. So the
        log-determinant of the information grows by log det (I + A Q Aᵀ), the D criterion, and the
        mean square tr(W Q) falls by tr[(I + A Q Aᵀ)⁻¹ A Q W Q Aᵀ], the I criterion (Fedorov 1972,
        Theory of optimal experiments, chapter 4).

        Parameters
        ----------
        candidates : (k, c, u) array, rows of the positions
        weight : (v, v) array, W, of the first parameters; without it the determinant counts

        Returns
        -------
        (k,) array; NaN if the parameters are not determined
        """
        root = self._root
        if root is None:
            return np.full(len(candidates), np.nan)
        seen = candidates @ root
        with_noise = np.eye(seen.shape[1]) + seen @ seen.swapaxes(1, 2)
        if weight is None:
            return np.asarray(np.linalg.slogdet(with_noise)[1])
        first = root[: len(weight)]
        part = seen @ (first.T @ weight @ first) @ seen.swapaxes(1, 2)
        return np.trace(np.linalg.solve(with_noise, part), axis1=1, axis2=2)


def _triangle(rows: Array) -> Array:
    """R of a QR decomposition."""
    return np.asarray(np.linalg.qr(rows, mode="r"))


def _column_size(a: Array) -> Array:
    """Lengths of columns; of one of rounding errors, which must stay short, that of the longest."""
    length = np.linalg.norm(a, axis=0)
    longest = length.max() or 1.0
    return np.where(length > ROUNDING * longest, length, longest)


def rank_of(a: Array, least: Array | None = None) -> tuple[int, float, NDArray[np.bool_]]:
    """Rank and condition of a design matrix, and which columns its null space involves.

    Parameters
    ----------
    a : (m, u) array, A
    least : (k, u) array, D, optional
        A combination w of columns counts only where |A w| > |D w|. These are generalised singular
        values, which do not depend on the units of the parameters.
    """
    u = a.shape[1]
    least = np.zeros((0, u)) if least is None else least
    if not (np.isfinite(a).all() and np.isfinite(least).all()):
        return 0, np.inf, np.ones(u, dtype=bool)
    unit = 1 / _column_size(a)
    # R has the same null space, and saves a matrix of all conditions by all conditions.
    triangle = _triangle(a * unit) if len(a) > u else a * unit
    values = np.linalg.svd(triangle, compute_uv=False)
    floor = np.concatenate([least * unit, SINGULAR * (values.max(initial=0.0) or 1.0) * np.eye(u)])
    back = np.linalg.inv(_triangle(floor))
    # The whole null space is wanted, also of a matrix with fewer rows than columns.
    _, ratios, vt = np.linalg.svd(triangle @ back, full_matrices=True)
    rank = int(np.count_nonzero(ratios > 1))
    condition = float(values[0] / values[-1]) if rank == u else np.inf
    null, _ = np.linalg.qr(back @ vt[rank:].T)
    share = IN_NOISE if len(least) else MIN_INVOLVED
    return rank, condition, np.linalg.norm(null, axis=1) > share


def position_rows(
    model: SensorModel,
    approach: Approach,
    noise: Noise,
    directions: ArrayLike,
    gravity: float = STANDARD_GRAVITY,
    hold: HoldConditions | None = None,
    errors: AngleErrors | None = None,
    angles: Array | None = None,
) -> Array:
    """Rows of the design matrix that each position contributes, at unit weight.

    They are those of the ideal sensor: its output is the force, so that nothing is iterated. The
    normal matrix of any choice of positions is the sum of RᵀR over their rows R. Where effects
    depend on the position before, the order of the directions is that of the session, unless the
    holds tell their steps.

    Parameters
    ----------
    model : SensorModel
    approach : Approach
    noise : Noise
        With `sigma_gravity` > 0 gravity is the last parameter; its observation is in `prior_rows`.
    directions : (k, 3) array of unit vectors, gravity in the body frame
    gravity : float, m/s²
    hold : HoldConditions, optional
        What else is known of the k positions.
    errors : function of angles (k, 2), optional
        `sigma_angle` and `common` of `Observations`; errors that all angles share are parameters.
    angles : (k, 2) array, rad, optional
        Roll and pitch of the robot, where the directions are not exactly those.

    Returns
    -------
    (k, c, u') array, with the c conditions of the approach

    Raises
    ------
    InputError
        If the model needs what `hold` does not tell.
    """
    force = -gravity * np.asarray(directions, dtype=float)
    observed, variance = force, np.full(force.shape, noise.sigma_force**2)
    common: Array | None = None
    angles = angles_of(force) if angles is None else angles
    if model.hold_columns:
        roll, pitch = angles.T
        hold = replace(hold or HoldConditions(), roll=roll, pitch=pitch)
        hold = hold.with_steps(force) if hold.step_x is None else hold
    if approach.uses_angles:
        sigma, common = (noise.sigma_angle, None) if errors is None else errors(angles)
        observed = np.concatenate([force, angles], axis=1)
        of_angles = np.broadcast_to(np.square(sigma), angles.shape)
        variance = np.concatenate([variance, of_angles], axis=1)
    equations = equations_of(model.trace, approach, noise.sigma_gravity > 0)
    shared = 0 if common is None else common.shape[-1]
    x = np.zeros((equations.n_parameters + shared, 1))
    if equations.estimates_gravity:
        x[-1] = gravity + noise.gravity_error
    conditions = equations.at(model.settings, gravity + noise.gravity_error, hold, common)
    at = conditions.linearise(x, observed.T[:, None], force.T[:, None])
    rows = whitened_design(at, variance.T)[:, :, 0]
    return np.ascontiguousarray(rows.transpose(2, 0, 1))


def prior_rows(model: SensorModel, noise: Noise, known: Known | None = None) -> Array:
    """Rows of what is known of the parameters, and of gravity, before the first position.

    Parameters
    ----------
    model, noise : as in `position_rows`
    known : mapping, optional, what is known of parameters a priori, as in `Observations`

    Returns
    -------
    (k, u') array, a row of unit weight for each parameter that is known
    """
    sigmas = {name: sigma for name, (_, sigma) in (known or {}).items()}
    roots = [
        1 / sigmas[name] if name in sigmas else np.sqrt(weight)
        for name, weight in zip(model.parameter_names, model.prior_weights, strict=True)
    ]
    roots += [1 / noise.sigma_gravity] if noise.sigma_gravity > 0 else []
    return np.diag(roots)[np.array(roots) > 0]
