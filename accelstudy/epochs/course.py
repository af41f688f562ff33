"""A parameter of a sensor over time: whether it changes, drifts, and scatters between sessions.

Its value in session i at time tᵢ is a + r tᵢ + sᵢ + eᵢ: a line, the scatter of the sessions with
the sd τ, as by switching off and on, and the noise of the calibration.

* It changes if its squares about the mean are more than noise leaves: χ² with stated noise. Where
  noise was estimated the limit allows for it as that of the congruence test (`congruence.py`).
* It scatters if its squares about the line are.
* The rate is a t variable with n − 2 degrees of freedom, as the scatter is estimated by the squares
  about the line, whether or not there is scatter (Knapp & Hartung 2003, Statistics in Medicine 22,
  2693; exact where all sigmas are equal).
* That is so if the scatter of each session is independent of that of the others. If instead it adds
  up from session to session, a random walk with the variance q t, a line is hardly seen in it. The
  rate is given for that, too: by generalized least squares, with q by the squares, as τ is.

Each of p parameters has the p-th part of the level. What changes is tested further for rate and for
scatter: one of the two is not zero then, so that the other may take the same part.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, optimize, stats

from accelstudy.adjustment.quality import POWER, noncentrality
from accelstudy.adjustment.random_effects import RandomEffects
from accelstudy.basics.shares import sigmas_95
from accelstudy.epochs.congruence import LEVEL, dof_of_squares, f_tail

Array = NDArray[np.float64]

YEAR = 365.25 * 86400.0
"""s"""


class Rate(NamedTuple):
    """A rate per year, with its sigma, which has some degrees of freedom."""

    per_year: float
    sigma: float
    dof: int

    @property
    def interval(self) -> tuple[float, float]:
        """Interval that holds the rate with a probability of 95 %."""
        half = sigmas_95(self.dof) * self.sigma
        return self.per_year - half, self.per_year + half

    @property
    def p_value(self) -> float:
        """Probability of a larger estimate where there is no rate."""
        return 2 * float(stats.t.sf(abs(self.per_year) / self.sigma, self.dof))


@dataclass(frozen=True, eq=False)
class ParameterCourse:
    """A parameter over time.

    Attributes
    ----------
    years : (n,) array, time
    values, variances : (n,) arrays, of the calibrations
    dof : (n,) array, degrees of freedom of the variances; inf if the noise was stated
    """

    years: Array
    values: Array
    variances: Array
    dof: Array

    @cached_property
    def line(self) -> RandomEffects:
        """Value at the time 0, and rate per year."""
        design = np.column_stack([np.ones_like(self.years), self.years])
        return RandomEffects(self.values, self.variances, design)

    @cached_property
    def mean(self) -> RandomEffects:
        """Mean value, as of `line` without a rate."""
        return RandomEffects(self.values, self.variances, np.ones((len(self.years), 1)))

    @property
    def rate(self) -> Rate:
        """Rate per year, if sessions are independent."""
        variance = self.line.covariance[1, 1]
        return Rate(float(self.line.estimates[1]), float(np.sqrt(variance)), self.line.dof)

    @cached_property
    def wandering_rate(self) -> Rate:
        """Rate per year, if the parameter walks at random instead of scattering."""
        design, f = self.line.design, self.line.dof
        since = self.years - self.years.min()
        noise, walk = np.diag(self.variances), np.minimum.outer(since, since)
        # Contrasts without value and rate, of which the noise is white and the walk diagonal.
        free = linalg.null_space((design * [1.0, 1 / np.ptp(since)]).T)
        sizes, turned = linalg.eigh(free.T @ walk @ free, free.T @ noise @ free)
        squares = (turned.T @ (free.T @ self.values)) ** 2

        def too_many(q: float) -> float:
            return float(np.sum(squares / (1 + q * np.maximum(sizes, 0.0)))) - f

        q = 0.0
        if too_many(0.0) > 0:
            most = 1 / float(sizes.max())
            while too_many(most) > 0:
                most *= 4
            q = optimize.brentq(too_many, 0.0, most)
        weighted = np.linalg.solve(noise + q * walk, design).T
        covariance = np.linalg.inv(weighted @ design)
        rate = float((covariance @ weighted @ self.values)[1])
        return Rate(rate, float(np.sqrt(covariance[1, 1])), f)

    def p_values(self, level: float = LEVEL) -> tuple[float, float, float]:
        """Whether nothing changes, nothing drifts, and nothing scatters; exact at some level."""
        return self._exceeds(self.mean, level), self.rate.p_value, self._exceeds(self.line, level)

    def found(self, level: float) -> tuple[str, ...]:
        """Findings at some level: drifts, scatters, both, or changed; empty for none."""
        change, drift, scatter = (p <= level for p in self.p_values(level))
        if not change:
            return ()
        named = {"drifts": drift, "scatters": scatter}
        return tuple(word for word, is_so in named.items() if is_so) or ("changed",)

    def detectable_rate(self, level: float) -> float:
        """Rate that by itself is found to be a change with a probability of `POWER`."""
        other = self._other_dof(self.mean, level)
        # Squares about the mean that a rate of 1 adds.
        each = RandomEffects(self.years, self.variances, self.mean.design).squares(0.0)
        return float(np.sqrt(noncentrality(self.mean.dof, level, noise_dof=other) / each))

    def detectable_scatter(self, level: float) -> float:
        """Scatter that by itself is found to be a change with a probability of `POWER`.

        Squares are taken as a scaled χ² variable of the same mean and variance.
        """
        other = self._other_dof(self.mean, level)
        f, root, design = self.mean.dof, np.sqrt(self.variances), self.mean.design
        limit = stats.chi2.isf(level, f) if np.isinf(other) else f * stats.f.isf(level, f, other)
        apart = (np.eye(f + 1) - design @ self.mean.combination(0.0)) * root / root[:, None]
        sizes = np.linalg.eigvalsh((apart / self.variances) @ apart.T)[1:] * self.variances.min()

        def missed(ratio: float) -> float:
            each = 1 + ratio**2 * sizes
            scale = np.sum(each**2) / np.sum(each)
            return float(stats.chi2.sf(limit / scale, np.sum(each) / scale)) - POWER

        most = 1.0
        while missed(most) < 0:
            most *= 2
        return float(root.min() * optimize.brentq(missed, 0.0, most))

    def _exceeds(self, fit: RandomEffects, level: float) -> float:
        """Probability that noise alone leaves such squares."""
        return f_tail(fit.squares(0.0) / fit.dof, fit.dof, self._other_dof(fit, level))

    def _other_dof(self, fit: RandomEffects, level: float) -> float:
        """Second degrees of freedom ν: squares of noise alone are f F(f, ν)."""
        root = np.sqrt(self.variances)
        smooth = fit.design @ fit.combination(0.0) * root / root[:, None]
        left = np.eye(len(root)) - smooth
        return dof_of_squares(np.diag(left), left**2, self.dof, level)
