"""What linear theory knows of the calibrations of a cell before any is simulated."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from accelstudy.adjustment.linear_theory import LinearTheory
from accelstudy.basics.arrays import Array
from accelstudy.leveling.distribution import TiltDistribution
from accelstudy.study.cell import Cell

CENTRAL = 1e-6
"""Offsets below this share of a standard deviation, and an Ω below it, count as none."""


@dataclass(frozen=True)
class KnownValues:
    """Statistics of the calibrations of a cell by linear theory, SI; NaN where it knows none.

    Parameters
    ----------
    cell : Cell
    theory : LinearTheory, of the cell
    """

    cell: Cell
    theory: LinearTheory

    @cached_property
    def bias(self) -> Array:
        """Mean errors of the estimates, (u,)."""
        return self.theory.reference - self.cell.true_values

    @cached_property
    def sd(self) -> Array:
        """Standard deviations of the estimates, (u,)."""
        return np.sqrt(np.diagonal(self.theory.covariance))

    @cached_property
    def sigma_posteriori(self) -> Array:
        """Mean standard deviations a posteriori, (u,)."""
        if not self._determines_factor:
            return np.full(len(self.theory.sigma), np.nan)
        # The mean of σ̂0, which is the root of a (noncentral) χ² over its degrees of freedom.
        r, offset = self.theory.redundancy, self.theory.misfit
        ratio = np.exp(scipy.special.gammaln((r + 1) / 2) - scipy.special.gammaln(r / 2))
        root = np.sqrt(2 / r) * ratio * scipy.special.hyp1f1(-0.5, r / 2, -offset / 2)
        return np.asarray(root * self.theory.sigma)

    @cached_property
    def tilts(self) -> TiltDistribution:
        """Distribution of the tilt errors."""
        tilt = self.cell.tilt_error
        u = len(tilt.reference)
        return TiltDistribution(tilt, self.theory.covariance[:u, :u])

    @property
    def statistics(self) -> dict[str, Array | float]:
        """Statistics by their names in `accelstudy.study.statistics`."""
        theory, determined = self.theory, self._determines_factor
        correlation = theory.covariance / np.outer(self.sd, self.sd)
        # The interval has its nominal share where the truth is in its middle.
        central = np.abs(self.bias) / theory.sigma < CENTRAL
        central &= theory.misfit < CENTRAL and determined
        return {
            "bias": self.bias,
            "sd": self.sd,
            "sigma_posteriori": self.sigma_posteriori,
            "sd_ratio": self.sigma_posteriori / self.sd,
            "coverage": np.where(central, 0.95, np.nan),
            "correlation": correlation[np.tril_indices(len(correlation), -1)],
            "variance_factor": 1 + theory.misfit / theory.redundancy if determined else np.nan,
            "tilt_rms": np.sqrt(self.tilts.mean_squares),
        }

    def quantiles(self, levels: Array) -> dict[str, tuple[Array, Array]]:
        """Quantiles (m, k) of each quantity of a study, and their relative errors."""
        r, factor = self.theory.redundancy, np.full(len(levels), np.nan)
        if self._determines_factor:
            factor = np.sqrt(scipy.special.chndtrix(levels, r, self.theory.misfit) / r)
        error = self.bias[:, None] + self.sd[:, None] * scipy.special.ndtri(levels)
        return {
            "error": (error, np.zeros_like(error)),
            "sd_posteriori": (np.outer(self.theory.sigma, factor), np.zeros_like(error)),
            "tilt": (self.tilts.quantile(levels), self.tilts.relative_error(levels)),
        }

    @property
    def _determines_factor(self) -> bool:
        """Whether the distribution of σ̂0² is known."""
        return self.theory.chi_squared and self.theory.redundancy > 0
