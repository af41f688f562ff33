"""What linear theory knows of the calibrations of a cell before any is simulated."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.adjustment.linear_theory import LinearTheory
from accelstudy.leveling.distribution import TiltDistribution
from accelstudy.leveling.error import TiltError
from accelstudy.study.cell import Cell

Array = NDArray[np.float64]

CENTRAL = 1e-6
"""Offsets below this share of a standard deviation, and an Ω below it, count as none."""


@dataclass(frozen=True)
class KnownValues:
    """Statistics of the calibrations of a cell by linear theory, SI; NaN where it knows none.

    Parameters
    ----------
    cell : Cell
    theory : LinearTheory, of the cell
    tilt : TiltError; None where its statistics are not asked for
    """

    cell: Cell
    theory: LinearTheory
    tilt: TiltError | None = None

    @property
    def bias(self) -> Array:
        """Mean errors of the estimates, (u,)."""
        return self.theory.reference - self.cell.true_values

    @property
    def sd(self) -> Array:
        """Standard deviations of the estimates, (u,)."""
        return np.sqrt(np.diagonal(self.theory.covariance))

    @property
    def correlation(self) -> Array:
        """Correlations of the estimates below the diagonal, (u (u − 1) / 2,)."""
        matrix = self.theory.covariance / np.outer(self.sd, self.sd)
        return matrix[np.tril_indices(len(matrix), -1)]

    @property
    def sigma_posteriori(self) -> Array:
        """Mean standard deviations a posteriori, (u,)."""
        return self._mean_root * self.theory.sigma

    @property
    def effect_sigma(self) -> Array:
        """Mean standard deviation a posteriori of the parameters of each effect, (e,)."""
        return np.array([self.sigma_posteriori[at].mean() for at in self.cell.effect_columns])

    @property
    def sd_ratio(self) -> Array:
        """Mean standard deviations a posteriori over those of the estimates, (u,)."""
        return self.sigma_posteriori / self.sd

    @property
    def variance_factor(self) -> float:
        """Mean of σ̂0²."""
        theory = self.theory
        return 1 + theory.misfit / theory.redundancy if self._determines_factor else np.nan

    @property
    def coverage(self) -> Array:
        """Share of the nominal 95 % intervals that hold the truth, (u,)."""
        # The interval has its nominal share where the truth is in its middle.
        shift = np.abs(self.bias) / self.theory.sigma
        central = (shift < CENTRAL) & (self.theory.misfit < CENTRAL) & self._determines_factor
        return np.where(central, 0.95, np.nan)

    @property
    def tilt_rms(self) -> Array:
        """Rms over attitudes and calibrations of the errors of roll and of pitch, (2,), rad."""
        return np.sqrt(self.tilts.mean_squares)

    @cached_property
    def tilts(self) -> TiltDistribution:
        """Distribution of the tilt errors."""
        assert self.tilt is not None
        u = len(self.tilt.reference)
        return TiltDistribution(self.tilt, self.theory.covariance[:u, :u])

    def error_quantiles(self, levels: Array) -> Array:
        """Quantiles of the errors of the estimates, (u, k)."""
        return np.asarray(self.bias[:, None] + self.sd[:, None] * special.ndtri(levels))

    def factor_quantiles(self, levels: Array) -> Array:
        """Quantiles of σ̂0, (k,)."""
        if not self._determines_factor:
            return np.full(len(levels), np.nan)
        redundancy = self.theory.redundancy
        return np.sqrt(special.chndtrix(levels, redundancy, self.theory.misfit) / redundancy)

    def effect_ratio_quantiles(self, other: KnownValues, effect: int, levels: Array) -> Array:
        """Quantiles of the sigma of an effect over that of another, independent cell, (k,)."""
        pair = (self, other)
        if not all(each._determines_factor and each.theory.misfit <= CENTRAL for each in pair):
            return np.full(len(levels), np.nan)
        sigma, other_sigma = (e.theory.sigma[e.cell.effect_columns[effect]].mean() for e in pair)
        freedom = self.theory.redundancy, other.theory.redundancy
        return np.asarray(sigma / other_sigma * np.sqrt(special.fdtri(*freedom, levels)))

    @property
    def _determines_factor(self) -> bool:
        """Whether the distribution of σ̂0² is known."""
        return self.theory.chi_squared and self.theory.redundancy > 0

    @property
    def _mean_root(self) -> float:
        """Mean of σ̂0, the root of a (noncentral) χ² over its degrees of freedom."""
        if not self._determines_factor:
            return np.nan
        r, offset = self.theory.redundancy, self.theory.misfit
        ratio = np.exp(special.gammaln((r + 1) / 2) - special.gammaln(r / 2))
        return float(np.sqrt(2 / r) * ratio * special.hyp1f1(-0.5, r / 2, -offset / 2))
