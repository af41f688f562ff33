"""A parameter of a sensor over time: whether it drifts, steps, and scatters between sessions.

Its value in session i at time tᵢ is a + r tᵢ + sᵢ + eᵢ: a line, the scatter of the sessions with
the sd τ, as by switching off and on, and the noise of the calibration.

* It scatters if its squares about the line are more than noise leaves: χ² with stated noise. Where
  noise was estimated the limit allows for it, as do the ends of its interval.
* The rate is a t variable with n − 2 degrees of freedom, as the scatter is estimated by the squares
  about the line, whether or not there is scatter (Knapp & Hartung 2003, Statistics in Medicine 22,
  2693; exact where all sigmas are equal).
* That is so if the scatter of each session is independent of that of the others. If instead it adds
  up from session to session, a random walk, the interval of the rate is much too short.
* It steps if a step at one time instead of the line is much more probable, whatever the scatter is.
  Both have a change from the first to the last session; steps at any time are as probable. The line
  has this step in it then, and a degree of freedom less.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import special, stats

from accelstudy.adjustment.random_effects import RandomEffects
from accelstudy.basics.arrays import Array
from accelstudy.basics.shares import sigmas_95
from accelstudy.epochs.congruence import LEVEL
from accelstudy.epochs.file_format import Rate, Scatter, Step

YEAR = 365.25 * 86400.0
"""s"""
MIN_STEP = 4
"""Calibrations of which a step and a line are compared."""
SURE = 0.9
"""Probability from which on a step is said, and of the sessions between which it is."""
POSSIBLE = {"drifts": 1 - SURE, "scatters": 0.7}
"""Probabilities from which on a step is said to be possible instead."""


@dataclass(frozen=True, eq=False)
class ParameterCourse:
    """A parameter over time.

    Attributes
    ----------
    years : (n,) array, time
    values, variances : (n,) arrays, of the calibrations
    dof : (n,) array, degrees of freedom of the variances; inf if the noise was stated
    level : float, of what is found
    """

    years: Array
    values: Array
    variances: Array
    dof: Array
    level: float = LEVEL

    def _level_and(self, *courses: Array) -> RandomEffects:
        """Model of a level, and of changes that follow some courses."""
        design = np.column_stack([np.ones_like(self.years), *courses])
        return RandomEffects(self.values, self.variances, design, self.dof)

    @cached_property
    def _steps(self) -> list[RandomEffects]:
        """Value before a step, and its size, for a step after each session but the last."""
        after = np.tri(len(self.years), k=-1).T[:-1]
        return [self._level_and(course) for course in after]

    @cached_property
    def _step_evidence(self) -> Array:
        """Logarithms of the likelihoods of these steps over that of a line."""
        span = np.ptp(self.years)
        line = self._level_and(self.years / span).log_evidence()
        with np.errstate(divide="ignore"):  # there is no step between two sessions of one date
            at = np.log(np.diff(self.years) / span)
        return np.array([model.log_evidence() for model in self._steps]) + at - line

    @property
    def _best_step(self) -> RandomEffects:
        """The step that explains most."""
        return self._steps[int(np.argmax(self._step_evidence))]

    @cached_property
    def step(self) -> Step | None:
        """The step that explains most, and how probable a step is; None of few calibrations."""
        if len(self.years) < MIN_STEP:
            return None
        shares, order = special.softmax(self._step_evidence), np.argsort(-self._step_evidence)
        likely = order[: np.searchsorted(np.cumsum(shares[order]), SURE) + 1]
        return Step(
            size=self._best_step.estimates[1],
            sigma=np.sqrt(self._best_step.covariance[1, 1]),
            after=likely.min() + 1,
            before=likely.max() + 2,
            probability=special.expit(special.logsumexp(self._step_evidence)),
        )

    @cached_property
    def model(self) -> RandomEffects:
        """Value at the time 0, rate per year, and the size of a step where one is sure."""
        if not self._is_step:
            return self._level_and(self.years)
        return self._level_and(self.years, self._best_step.design[:, 1])

    @property
    def _is_step(self) -> bool:
        """Whether a step is sure."""
        return self.step is not None and self.step.probability >= SURE

    @cached_property
    def rate(self) -> Rate:
        """Rate per year, beside a step where one is sure, if sessions are independent."""
        rate, variance, dof = self.model.estimates[1], self.model.covariance[1, 1], self.model.dof
        sigma = np.sqrt(variance)
        half = sigmas_95(dof) * sigma
        p_value = 2 * stats.t.sf(abs(rate) / sigma, dof)
        return Rate(per_year=rate, sigma=sigma, ci95=[rate - half, rate + half], p_value=p_value)

    @cached_property
    def scatter(self) -> Scatter:
        """Scatter about the line, with the step in it where one is sure."""
        model = self.model
        return Scatter(
            sd=model.scatter,
            ci95=[*model.scatter_interval()],
            p_value=model.probability_beyond(0.0),
        )

    @property
    def found(self) -> tuple[str, ...]:
        """What a parameter that changed does, in words; "changed" if that is not sure."""
        tests = {"drifts": self.rate.p_value, "scatters": self.scatter.p_value}
        found = ["steps"] if self._is_step else []
        found += [word for word, p in tests.items() if p is not None and p <= self.level]
        return tuple(found) or ("changed",)
