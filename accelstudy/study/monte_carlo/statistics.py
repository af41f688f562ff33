"""Statistics of the calibrations of a cell.

Means are estimated with linear theory as control variate (Owen, *Monte Carlo theory, methods and
examples*, ch. 8). With the number x of a calibration, the number y of linear theory of the same
noise, its known mean μ_y, and a coefficient β by regression,

    E x ≈ ⟨x⟩ − β (⟨y⟩ − μ_y).

Where calibrations fail, x is that of the others and y that of all: the mean is the ratio of
⟨c x⟩ − β (⟨y⟩ − μ_y) to ⟨c⟩, c being 1 where one converged and 0 elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.calibration import Block
from accelstudy.leveling.error import TiltError
from accelstudy.simulation.sessions import BLOCK
from accelstudy.study.cell import Cell
from accelstudy.study.monte_carlo.averaged import (
    CORRELATION,
    FACTOR,
    INSIDE,
    PRODUCT,
    SQUARE,
    Averaged,
)
from accelstudy.study.monte_carlo.control import Control
from accelstudy.study.monte_carlo.followed import ERROR, Followed
from accelstudy.study.monte_carlo.replicates import Replicates

Array = NDArray[np.float64]

ROUNDING = 1e-24
"""Variances below this share of that of plain averages are rounding."""
LEAST = 20
"""Replicates from which on a coefficient is estimated; fewer are only averaged."""
AT_ONCE = 20 * BLOCK
"""Replicates whose numbers are in memory at a time."""


@dataclass(frozen=True)
class Estimates:
    """Estimated numbers.

    Attributes
    ----------
    value : array, the estimates
    error : array, their standard errors by the number of replicates
    gain : array, variance of plain averages over that of the estimates; 1 without a control
    plain : array, plain averages of the replicates
    """

    value: Array
    error: Array
    gain: Array
    plain: Array

    def __getitem__(self, chosen: Any) -> Estimates:
        each = (self.value, self.error, self.gain, self.plain)
        return Estimates(*(values[chosen] for values in each))

    def root(self) -> Estimates:
        """Square roots of the numbers, with their errors to first order."""
        with np.errstate(invalid="ignore", divide="ignore"):
            value = np.sqrt(self.value)
            return Estimates(value, self.error / (2 * value), self.gain, np.sqrt(self.plain))

    def scaled(self, factor: Array | float) -> Estimates:
        """The numbers times known positive factors."""
        return Estimates(self.value * factor, self.error * factor, self.gain, self.plain * factor)


class Moments(NamedTuple):
    """Means and squares of R numbers x of calibrations and of the same numbers y of linear theory.

    Attributes
    ----------
    size : int, R; x is 0 where a calibration did not converge, y is 0 without linear theory
    difference, linear : (k,) arrays, means of x − y and of y
    squares : (3, k) array, Σ of (x − y)², (x − y) y and y² about the means
    linear_converged : (k,) array, Σ y over the converged replicates
    """

    size: int
    difference: Array
    linear: Array
    squares: Array
    linear_converged: Array

    @classmethod
    def of(cls, x: Array, y: Array, converged: NDArray[np.bool_]) -> Moments:
        """Sum up numbers (R, k)."""
        apart, n = x - y, max(len(x), 1)
        difference, linear = apart.sum(axis=0) / n, y.sum(axis=0) / n
        apart -= difference
        centred = y - linear
        pairs = (apart, apart), (apart, centred), (centred, centred)
        squares = np.stack([np.einsum("rk,rk->k", *pair) for pair in pairs])
        return cls(len(x), difference, linear, squares, y[converged].sum(axis=0))

    def merged(self, later: Moments) -> Moments:
        """Merge with the moments of other replicates (Chan, Golub & LeVeque 1983)."""
        weight = later.size / (self.size + later.size)
        steps = later.difference - self.difference, later.linear - self.linear
        outer = np.stack([steps[0] * steps[0], steps[0] * steps[1], steps[1] * steps[1]])
        return Moments(
            self.size + later.size,
            self.difference + weight * steps[0],
            self.linear + weight * steps[1],
            self.squares + later.squares + (weight * self.size) * outer,
            self.linear_converged + later.linear_converged,
        )


@dataclass(frozen=True)
class Statistics:
    """Statistics of the calibrations of a cell.

    Attributes
    ----------
    averaged : Averaged, the numbers of which there are means
    block : Block, the calibrations; None of a cell that was not simulated
    moments : Moments, of `averaged`
    known : (k,) array, means of the numbers by linear theory, NaN where it does not know them; None
        without a control
    """

    averaged: Averaged
    block: Block | None
    moments: Moments
    known: Array | None

    @classmethod
    def of(
        cls, cell: Cell, replicates: Replicates, control: Control | None, tilt: TiltError
    ) -> Statistics:
        """Return the statistics of the replicates of a cell."""
        simulated, linear = replicates
        centre = _pilot_mean(cell, replicates, control)
        averaged = Averaged(Followed.of(cell), centre, cell.estimability.cofactors, tilt)

        def moments(first: int) -> Moments:
            rows = slice(first, first + AT_ONCE)
            x = averaged.of(simulated.rows(rows))
            y = np.zeros_like(x) if linear is None else averaged.of(linear.rows(rows))
            return Moments.of(x, y, simulated.converged[rows])

        each = map(moments, range(0, len(simulated.converged), AT_ONCE))
        known = None if control is None else control.means(averaged)
        return cls(averaged, simulated, reduce(Moments.merged, each), known)

    @classmethod
    def of_none(cls, cell: Cell) -> Statistics:
        """Return the statistics of a cell that was not simulated."""
        followed = Followed.of(cell)
        u = len(followed.units)
        averaged = Averaged(followed, followed.truth, np.full((u, u), np.nan), None)
        empty = np.zeros((0, averaged.count))
        return cls(averaged, None, Moments.of(empty, empty, np.zeros(0, bool)), None)

    @property
    def followed(self) -> Followed:
        """The quantities."""
        return self.averaged.followed

    @property
    def control(self) -> str:
        """Which control variate the estimates have: `linear` or `none`."""
        controlled = self.known is not None and self.simulated >= LEAST
        return "linear" if controlled else "none"

    @property
    def simulated(self) -> int:
        """Number of simulated calibrations."""
        return self.moments.size

    @cached_property
    def converged(self) -> int:
        """Number of calibrations that converged."""
        return 0 if self.block is None else int(self.block.converged.sum())

    @property
    def redundancy(self) -> int:
        """Redundancy of a calibration; 0 of a cell that was not simulated."""
        return 0 if self.block is None else self.block.redundancy

    def first(self, quantity: str) -> Array:
        """A quantity of `Followed` in the first calibration that converged, (u,) or (e,)."""
        columns = self.followed.columns(quantity)
        if self.block is None or not self.converged:
            return np.full(len(self.followed.keys), np.nan)[columns]
        first = int(np.argmax(self.block.converged))
        return self.followed.values(self.block.rows(slice(first, first + 1)))[0, columns]

    def mean(self, quantity: str) -> Estimates:
        """Means of a quantity of `Averaged`, SI; NaN without calibrations.

        Those of errors and their products are about the centre.
        """
        return self._means[self.averaged.columns[quantity]]

    @property
    def bias(self) -> Estimates:
        """Mean errors, (u,), SI."""
        mean, shift = self.mean(ERROR), self.averaged.centre - self.followed.truth
        return Estimates(mean.value + shift, mean.error, mean.gain, mean.plain + shift)

    @property
    def sd(self) -> Estimates:
        """Empirical standard deviations of the estimates, (u,), SI."""
        mean, products = self.mean(ERROR), self.mean(PRODUCT)
        u = len(mean.value)
        squares = products[np.cumsum(np.arange(1, u + 1)) - 1]
        n = self.converged
        with np.errstate(divide="ignore", invalid="ignore"):
            value = squares.value - mean.value**2 + mean.error**2
            plain = (squares.plain - mean.plain**2) * (n / np.float64(n - 1))
        return Estimates(value, squares.error, squares.gain, plain).root()

    @property
    def mean_correlation(self) -> Array:
        """Mean of the correlations from Σ_xx, (u, u)."""
        u = len(self.followed.units)
        total = np.zeros((u, u)) if self.block is None else self.block.correlation_sum
        return total / (self.converged or np.nan)

    @property
    def correlation(self) -> Estimates:
        """Empirical correlations over the calibrations, (u, u)."""
        mean, sd = self.mean(ERROR), self.sd
        products, influence = self.mean(PRODUCT), self.mean(CORRELATION)
        u = len(sd.value)
        i, j = np.tril_indices(u)
        below, at = i != j, np.tril_indices(u, -1)
        enough = self.converged > u

        def whole(values: Array, diagonal: float) -> Array:
            matrix = np.full((u, u), diagonal if enough else np.nan)
            if enough:
                matrix[at] = values
                matrix.T[at] = values
            return matrix

        def scaled(product: Array, mean: Array, spread: Array) -> Array:
            return np.clip((product - mean[i] * mean[j])[below] / spread, -1, 1)

        def spread(of: Array) -> Array:
            return np.asarray(of[at[0]] * of[at[1]])

        bias_free = spread(sd.value) - spread(mean.error)
        n = max(self.converged, 2)
        scale = np.sqrt(np.diagonal(self.averaged.cofactors))
        units = spread(scale) / spread(sd.value)
        return Estimates(
            whole(scaled(products.value, mean.value, bias_free), 1.0),
            whole(influence.error * units, 0.0),
            whole(influence.gain, np.nan),
            whole(scaled(products.plain, mean.plain, spread(sd.plain) * (1 - 1 / n)), 1.0),
        )

    @property
    def factor(self) -> Estimates:
        """Mean variance factor σ̂0², (1,)."""
        return self.mean(FACTOR)

    @property
    def inside(self) -> Estimates:
        """Shares of the nominal 95 % intervals that hold the truth, (u,)."""
        return self.mean(INSIDE)

    @property
    def tilt_rms(self) -> Estimates:
        """Rms over attitudes and calibrations of the errors of roll and of pitch, (2,), rad."""
        return self.mean(SQUARE).root()

    @cached_property
    def _means(self) -> Estimates:
        """Means of all numbers, (k,)."""
        m = self.moments
        n, converged = m.size, self.converged
        if not converged:
            return Estimates(*np.full((4, len(m.linear)), np.nan))
        share = converged / n
        plain = (m.difference + m.linear) / share
        # Numbers about their mean, 0 where a calibration failed, minus those of linear theory.
        differences, crosses, controls = m.squares
        failed = m.linear_converged - converged * m.linear
        own = n * (m.difference + m.linear) - m.linear_converged - converged * m.difference
        differences = differences - 2 * plain * own + plain**2 * converged * (1 - share)
        crosses = crosses - plain * failed
        known = np.full(len(plain), np.nan) if self.known is None else self.known
        used = np.isfinite(known) & (controls > 0) & (n >= LEAST)
        rest = np.divide(crosses, controls, out=np.full_like(crosses, -1.0), where=used)
        left = np.where(used, differences - rest * crosses, differences + 2 * crosses + controls)
        whole = differences + 2 * crosses + controls
        known = np.where(used, known, m.linear)
        # Equal to plain − (1 + rest) (linear − known) / share, with less rounding.
        value = (m.difference + known - rest * (m.linear - known)) / share
        with np.errstate(divide="ignore", invalid="ignore"):
            spread = n * np.float64(n - 1) if converged > 1 else np.nan
            error = np.sqrt(np.maximum(left, ROUNDING * whole) / spread) / share
            gain = np.where(used, whole / np.maximum(left, ROUNDING * whole), 1.0)
        return Estimates(value, error, gain, plain)


def _pilot_mean(cell: Cell, replicates: Replicates, control: Control | None) -> Array:
    """Mean of the estimates in the first block of a cell in which a calibration converged, (u,).

    It is the truth if none of the first replicates converged.
    """
    simulated, linear = replicates
    for first in range(0, min(len(simulated.converged), AT_ONCE), BLOCK):
        rows = slice(first, first + BLOCK)
        converged = simulated.converged[rows]
        if converged.any():
            estimates = simulated.estimates[rows][converged]
            if control is not None and linear is not None and converged.all():
                return control.theory.reference + (estimates - linear.estimates[rows]).mean(axis=0)
            return np.asarray(estimates.mean(axis=0))
    return cell.true_values
