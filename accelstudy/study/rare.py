"""Rare tilt errors of a cell by importance sampling, with linear theory as proposal.

By linear theory the squared tilt error of a calibration is a quadratic form Q(y) in standard
normals y, so the y that leave a large error are known. The part y of the noise is drawn where they
lie, from densities φ(y) exp(θ Q(y)) / E exp(θ Q), which are normal; the rest of the noise is drawn
as usual. Each calibration counts with the ratio of the densities of its y, whatever linear theory
leaves out: only the standard error depends on how good the theory is. One of the densities that
are mixed is φ itself, so no weight is larger than their number (Owen 2013, sections 9.11 and 9.13).
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from accelstudy.basics.units import MGON
from accelstudy.files.tables import parquet_writer
from accelstudy.leveling.distribution import TiltDistribution
from accelstudy.leveling.error import TiltError
from accelstudy.simulation.sessions import BLOCK, Errors
from accelstudy.study.cell import Cell
from accelstudy.study.compiling import calibrator
from accelstudy.study.monte_carlo.followed import TILTS, cell_tilt_error, tilts

Array = NDArray[np.float64]

log = logging.getLogger(__name__)

LEAST = 50
"""Effective number of calibrations beyond a quantile below which it is not known."""

RARE = pa.schema(
    {
        "cell": pa.string(),
        "name": pa.string(),
        "share_beyond": pa.float64(),
        "value_mgon": pa.float64(),
        "value_se_mgon": pa.float64(),
        "equivalent": pa.float64(),
        "effective": pa.float64(),
        "share_failed": pa.float64(),
        "share_failed_se": pa.float64(),
        "n_replicates": pa.int64(),
    }
)
"""One row per cell, angle (of `TILTS`) and share. Values are NaN where they are not known."""


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
    def failed(self) -> tuple[float, float]:
        """Share of the calibrations that do not converge, and its standard error."""
        share = self.weights * np.isnan(self.tilts[0])
        return float(share.mean()), float(share.std(ddof=1) / np.sqrt(len(share)))

    def quantile(self, beyond: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """Tilt errors that given shares of the calibrations that converge exceed.

        All are NaN where fewer than `LEAST` calibrations effectively lie beyond.

        Parameters
        ----------
        beyond : (k,) array, shares, such as 1e-6

        Returns
        -------
        value : (3, k) array, rad
        error : (3, k) array, rad, standard error
        equivalent : (3, k) array, plain calibrations with the same standard error
        effective : (3, k) array, effective sample size of the calibrations beyond, the smallest
            from the quantile to the middle
        """
        shares = np.atleast_1d(np.asarray(beyond, dtype=float))
        results = np.full((4, 3, len(shares)), np.nan)
        converged = np.isfinite(self.tilts[0])
        # The mean weight is known, so the share that converged follows from those that failed.
        n, kept = len(converged), 1 - self.failed[0]
        for angle, values in enumerate(self.tilts[:, converged]):
            order = np.argsort(-values, kind="stable")
            largest, weights = np.log(values[order]), self.weights[converged][order] / kept
            above, squares = np.cumsum(weights) / n, np.cumsum(weights**2) / n
            # Weights that are large further in may be missing further out.
            effective = np.minimum.accumulate((n * above**2 / squares)[::-1])[::-1]
            for i, share in enumerate(shares):
                at = int(np.searchsorted(above, share))
                if at == len(above) or effective[at] < LEAST:
                    continue
                error = np.sqrt((squares[at] - share**2) / n)
                # Woodruff's interval: the quantiles of the share less and plus its error.
                near = share + error * np.array([-1, 0, 1])
                high, value, low = np.exp(np.interp(near, above, largest))
                equivalent = share * (1 - share) / error**2
                results[:, angle, i] = value, (high - low) / 2, equivalent, effective[at]
        return results[0], results[1], results[2], results[3]


@dataclass(frozen=True)
class _Proposal:
    """Mixture of the standard normal density of y and of densities where the tails lie.

    Attributes
    ----------
    linear : (2, r) array; forms : (2, r, r) array
        Squared errors of roll and of pitch but for a constant, 2 linear y + y form y.
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
    cell: Cell, seed: int, leveling: Mapping[str, Any], beyond: Sequence[float]
) -> RareTilts:
    """Simulate the calibrations of a cell such that many leave a rare tilt error.

    Each block of `BLOCK` calibrations has random numbers of its own.

    Parameters
    ----------
    cell : Cell, with linear theory
    seed : int, of the study
    leveling : mapping with max_tilt_gon and attitudes
    beyond : shares in whose tail is drawn
    """
    ideal, theory = cell.ideal, cell.linear_theory
    model, approach = cell.estimated_model, cell.conditions
    assert theory is not None
    u = model.n_parameters
    tilt = cell_tilt_error(cell, leveling)
    scale = _scales(cell, approach.uses_angles)
    sees, root = theory.directions(scale)
    distribution = TiltDistribution(tilt, theory.covariance[:u, :u])
    squares = distribution.approximate_quantile(1 - np.asarray(beyond, dtype=float))[:2] ** 2
    proposal = _Proposal.of(tilt, root[:u], squares)
    calibrate = calibrator(cell)
    found, weights = np.full((3, cell.replicates), np.nan), np.empty(cell.replicates)
    for block in range(cell.n_blocks):
        part = slice(block * BLOCK, min((block + 1) * BLOCK, cell.replicates))
        rng = np.random.default_rng(cell.seed(seed, block).spawn(1)[0])
        normal = ideal.errors(cell.noise, part.stop - part.start, rng, angles=approach.uses_angles)
        y, weights[part] = proposal.draw(part.stop - part.start, rng)
        observed = ideal.disturbed(_with_part(normal, y, sees, scale), cell.noise, rng)
        result = calibrate(model, approach, observed)
        kept = result.converged
        found[:, part][:, kept] = tilts(tilt, result.estimates[kept][:, :u])
    return RareTilts(found, weights)


def rare_table(spec: Mapping[str, Any], output: str | Path, provenance: Mapping[str, Any]) -> None:
    """Simulate rare tilt errors of cells, and write the table `rare`.

    Parameters
    ----------
    spec : mapping with `seed`, `cells` (plain data of `Cell`), `leveling` and `shares`
    output : path of the table
    provenance : see `accelstudy.files.tables.origin`
    """
    shares = spec["shares"]
    with parquet_writer(output, RARE, provenance) as write:
        for cell in map(Cell.from_dict, spec["cells"]):
            if not cell.estimability.estimable or cell.linear_theory is None:
                log.info("%s: has no linear theory", cell.name)
                continue
            found = rare_tilts(cell, spec["seed"], spec["leveling"], shares)
            value, error, equivalent, effective = map(np.ravel, found.quantile(shares))
            rows = len(value)
            failed, failed_error = (np.full(rows, each) for each in found.failed)
            columns = {
                "cell": [cell.name] * rows,
                "name": np.repeat(TILTS, len(shares)),
                "share_beyond": np.tile(shares, len(TILTS)),
                "value_mgon": value / MGON,
                "value_se_mgon": error / MGON,
                "equivalent": equivalent,
                "effective": effective,
                "share_failed": failed,
                "share_failed_se": failed_error,
                "n_replicates": np.full(rows, cell.replicates),
            }
            write(pa.table(columns, schema=RARE))
            log.info("%s: %d replicates", cell.name, cell.replicates)


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
