"""Rare tilt errors of a cell by importance sampling, with linear theory as proposal.

By linear theory the squared tilt error of a calibration is a quadratic form Q(y) in standard
normals y, so the y that leave a large error are known. The part y of the noise is drawn where they
lie, from densities φ(y) exp(θ Q(y)) / E exp(θ Q), which are normal; the rest of the noise is drawn
as usual. Each calibration counts with the ratio of the densities of its y, whatever linear theory
leaves out: only the standard error depends on how good the theory is. One of the densities that
are mixed is φ itself, so no weight is larger than their number (Owen 2013, sections 9.11 and 9.13).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from accelstudy.adjustment.linear_theory import LinearTheory
from accelstudy.basics.errors import InputError
from accelstudy.leveling.distribution import TiltDistribution
from accelstudy.leveling.error import TiltError
from accelstudy.simulation.sessions import BLOCK, Errors, session
from accelstudy.study.cell import Cell
from accelstudy.study.compiling import calibrator
from accelstudy.study.monte_carlo.followed import cell_tilt_error, tilts

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RareTilts:
    """Weighted calibrations of a cell.

    Attributes
    ----------
    tilts : (3, R) array, rad, of roll, of pitch and of the larger; NaN if not converged
    weights : (R,) array, with mean 1
    """

    tilts: Array
    weights: Array

    @property
    def effective(self) -> float:
        """Effective sample size of all weights."""
        return float(self.weights.sum() ** 2 / (self.weights**2).sum())

    @property
    def failed(self) -> tuple[int, float, float]:
        """Calibrations that did not converge: their number, share and its standard error."""
        failed = np.isnan(self.tilts[0])
        share = self.weights * failed
        error = share.std(ddof=1) / np.sqrt(len(share))
        return int(np.count_nonzero(failed)), float(share.mean()), float(error)

    def quantile(self, beyond: ArrayLike) -> tuple[Array, Array, Array]:
        """Tilt errors that given shares of the calibrations that converge exceed.

        Parameters
        ----------
        beyond : (k,) array, shares, such as 1e-6

        Returns
        -------
        value : (3, k) array, rad; NaN where no calibration lies beyond
        error : (3, k) array, rad, standard error
        equivalent : (3, k) array, plain calibrations with the same standard error
        """
        shares = np.atleast_1d(np.asarray(beyond, dtype=float))
        results = np.full((3, 3, len(shares)), np.nan)
        converged = np.isfinite(self.tilts[0])
        weights = np.where(converged, self.weights, 0.0)
        n = len(weights)
        # The mean weight is known, so the share that converged follows from those that failed.
        kept = 1 - self.failed[1]
        for angle, values in enumerate(self.tilts):
            order = np.argsort(-np.where(converged, values, -np.inf), kind="stable")
            largest = values[order][: np.count_nonzero(converged)]
            above = np.cumsum(weights[order])[: len(largest)] / n / kept
            squares = np.cumsum(weights[order] ** 2)[: len(largest)] / n / kept**2
            for i, share in enumerate(shares):
                at = int(np.searchsorted(above, share))
                if at == 0 or at >= len(largest):
                    continue
                error = np.sqrt(max(squares[at] - share**2, 0.0) / n)
                near = np.clip([share - error, share + error], above[0], above[-1])
                # Woodruff's interval: the quantiles of the share less and plus its error.
                high, low = np.exp(np.interp(near, above, np.log(largest)))
                value = np.exp(np.interp(share, above, np.log(largest)))
                results[:, angle, i] = value, (high - low) / 2, share * (1 - share) / error**2
        return results[0], results[1], results[2]


@dataclass(frozen=True)
class _Proposal:
    """Mixture of the standard normal density of y and of densities where the tails lie.

    Attributes
    ----------
    constant : (2,) array; linear : (2, r) array; forms : (2, r, r) array
        Squared errors of roll and of pitch, constant + 2 linear y + y form y.
    components : list of angle, θ, mean (r,), root (r, r) of the covariance, and log E exp(θ Q)
    """

    linear: Array
    forms: Array
    components: list[tuple[int, float, Array, Array, float]]

    @classmethod
    def of(cls, tilt: TiltError, root: Array, squares: Array) -> _Proposal:
        """Choose θ such that the mean of Q is a square in the tail, (2, k), of each angle."""
        linear, forms = tilt.linear @ root, root.T @ tilt.quadratic @ root
        components = []
        for angle, (g, form) in enumerate(zip(linear, forms, strict=True)):
            sizes, axes = np.linalg.eigh(form)
            along = axes.T @ g

            def mean(theta: float, sizes: Array = sizes, along: Array = along) -> float:
                s = 1 / (1 - 2 * theta * sizes)
                middle = 2 * theta * s * along
                return float(sizes @ (s + middle**2) + 2 * along @ middle)

            most = (1 - 1e-9) / (2 * sizes[-1])
            for square in squares[angle] - tilt.constant[angle]:
                if not mean(0.0) < square < mean(most):
                    continue
                theta = float(brentq(lambda t, to=square, f=mean: f(t) - to, 0.0, most))
                s = 1 / (1 - 2 * theta * sizes)
                log_mean = 0.5 * np.log(s).sum() + 2 * theta**2 * (s @ along**2)
                middle = axes @ (2 * theta * s * along)
                components.append((angle, theta, middle, axes * np.sqrt(s), float(log_mean)))
        return cls(linear, forms, components)

    def draw(self, replicates: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """Draw y (R, r), and the weights (R,)."""
        chosen = rng.integers(1 + len(self.components), size=replicates)
        y = rng.standard_normal((replicates, self.linear.shape[1]))
        for number, (_, _, mean, root, _) in enumerate(self.components, 1):
            y[chosen == number] = mean + y[chosen == number] @ root.T
        squares = 2 * y @ self.linear.T + np.einsum("ri,aij,rj->ra", y, self.forms, y)
        ratios = [np.exp(theta * squares[:, a] - c) for a, theta, _, _, c in self.components]
        return y, (1 + len(ratios)) / (1 + sum(ratios, np.zeros(replicates)))


def rare_tilts(
    cell: Cell,
    seed: int,
    leveling: Mapping[str, Any],
    beyond: Sequence[float],
    blocks: range,
) -> RareTilts:
    """Simulate calibrations of a cell of which many leave a rare tilt error.

    Parameters
    ----------
    cell : Cell
    seed : int, of the study
    leveling : mapping with max_tilt_gon and attitudes
    beyond : shares in whose tail is drawn
    blocks : range, numbers of the blocks of `BLOCK` calibrations, each with its own random numbers

    Raises
    ------
    InputError
        If the cell has no calibration without noise.
    """
    simulated, model, approach = cell.simulated_model, cell.estimated_model, cell.conditions
    truth = simulated.vector(cell.truth)
    ideal = session(simulated, truth, cell.positions.directions, cell.gravity, cell.hold)
    theory = LinearTheory.of(model, approach, ideal.observations(cell.noise))
    if theory is None:
        raise InputError(f"{cell.name}: has no calibration without noise, so no linear theory")
    u = model.n_parameters
    tilt = cell_tilt_error(cell, leveling)
    scale = _scales(cell, approach.uses_angles)
    sees, root = theory.directions(scale)
    distribution = TiltDistribution(tilt, theory.covariance[:u, :u])
    squares = distribution.approximate_quantile(1 - np.asarray(beyond, dtype=float))[:2] ** 2
    proposal = _Proposal.of(tilt, root[:u], squares)
    calibrate = calibrator(cell)
    found, weights = [], []
    for block in blocks:
        rng = np.random.default_rng(cell.seed(seed, block).spawn(1)[0])
        normal = ideal.errors(cell.noise, BLOCK, rng, angles=approach.uses_angles)
        y, weight = proposal.draw(BLOCK, rng)
        observed = ideal.disturbed(_with_part(normal, y, sees, scale), cell.noise, rng)
        result = calibrate(model, approach, observed)
        each = np.full((3, BLOCK), np.nan)
        each[:, result.converged] = tilts(tilt, result.estimates[result.converged][:, :u])
        found.append(each)
        weights.append(weight)
    return RareTilts(np.concatenate(found, axis=1), np.concatenate(weights))


def _scales(cell: Cell, angles: bool) -> Array:
    """Standard deviations of the errors of all observations, (n o + 1,), gravity the last."""
    noise = cell.noise
    each = [noise.sigma_force] * 3 + [noise.sigma_angle] * (2 if angles else 0)
    return np.append(np.tile(each, cell.positions.n_positions), noise.sigma_gravity)


def _with_part(errors: Errors, y: Array, sees: Array, scale: Array) -> Errors:
    """Replace the part of the errors that linear theory sees, P ε, by y; P is `sees`."""
    count, n, _ = errors.force.shape
    o = (len(scale) - 1) // n
    both = errors.force if o == 3 or errors.angle is None else _joined(errors.force, errors.angle)
    gravity = np.zeros(count) if errors.gravity is None else errors.gravity
    drawn = np.column_stack([both.reshape(count, -1), gravity])
    normal = np.divide(drawn, scale, out=np.zeros_like(drawn), where=scale > 0)
    changed = drawn + (y - normal @ sees.T) @ sees * scale
    parts = changed[:, :-1].reshape(count, n, o)
    angle = errors.angle if o == 3 else parts[..., 3:]
    held = None if errors.gravity is None else changed[:, -1]
    return replace(errors, force=parts[..., :3], angle=angle, gravity=held)


def _joined(force: Array, angle: Array) -> Array:
    return np.concatenate([force, angle], axis=-1)
