"""A parameter of a sensor over time: whether it drifts, and scatters between sessions.

Its value in session i at time tᵢ is a + r tᵢ + sᵢ + eᵢ: a line, the scatter of the sessions with
the sd τ, as by switching off and on, and the noise of the calibration.

* It scatters if its squares about the line are more than noise leaves: χ² with stated noise. Where
  noise was estimated the limit allows for it as that of the congruence test (`congruence.py`).
* The rate is a t variable with n − 2 degrees of freedom, as the scatter is estimated by the squares
  about the line, whether or not there is scatter (Knapp & Hartung 2003, Statistics in Medicine 22,
  2693; exact where all sigmas are equal).
* That is so if the scatter of each session is independent of that of the others. If instead it adds
  up from session to session, a random walk, the interval of the rate is much too short.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from accelstudy.adjustment.random_effects import RandomEffects
from accelstudy.basics.shares import sigmas_95
from accelstudy.epochs.congruence import LEVEL, dof_of_squares, f_tail
from accelstudy.epochs.file_format import Rate, Scatter

Array = NDArray[np.float64]

YEAR = 365.25 * 86400.0
"""s"""


@dataclass(frozen=True, eq=False)
class ParameterCourse:
    """A parameter over time.

    Attributes
    ----------
    years : (n,) array, time
    values, variances : (n,) arrays, of the calibrations
    dof : (n,) array, degrees of freedom of the variances; inf if the noise was stated
    level : float, of what is found, and at which the test of the scatter is exact
    """

    years: Array
    values: Array
    variances: Array
    dof: Array
    level: float = LEVEL

    @cached_property
    def line(self) -> RandomEffects:
        """Value at the time 0, and rate per year."""
        design = np.column_stack([np.ones_like(self.years), self.years])
        return RandomEffects(self.values, self.variances, design)

    @cached_property
    def rate(self) -> Rate:
        """Rate per year, if sessions are independent."""
        rate, sigma = float(self.line.estimates[1]), float(np.sqrt(self.line.covariance[1, 1]))
        half = sigmas_95(self.line.dof) * sigma
        p_value = 2 * float(stats.t.sf(abs(rate) / sigma, self.line.dof))
        return Rate(per_year=rate, sigma=sigma, ci95=[rate - half, rate + half], p_value=p_value)

    @cached_property
    def scatter(self) -> Scatter:
        """Scatter about the line."""
        line, root = self.line, np.sqrt(self.variances)
        smooth = line.design @ line.combination(0.0) * root / root[:, None]
        left = np.eye(len(root)) - smooth
        nu = dof_of_squares(np.diag(left), left**2, self.dof, self.level)
        p_value = f_tail(line.squares(0.0) / line.dof, line.dof, nu)
        return Scatter(sd=line.scatter, ci95=[*line.scatter_interval()], p_value=p_value)

    @property
    def found(self) -> tuple[str, ...]:
        """What a parameter that changed does, in words; "changed" if that is not sure."""
        named = {"drifts": self.rate.p_value, "scatters": self.scatter.p_value}
        found = (word for word, p in named.items() if p is not None and p <= self.level)
        return tuple(found) or ("changed",)
