"""The calibration interval: how long the last calibration of a sensor stays good enough.

A time t after it, the error of the last calibration n is δ(t) = eₙ + sₙ − s − r t, with its noise,
the scatter of its session, that of the session in use, and the drift since. What the calibrations
say of r and of the scatter τ is drawn by generalised inference (Iyer, Wang & Mathew 2004, J. Am.
Stat. Assoc. 99, 1060): the squares about the line are those of a drawn χ² variable, which gives τ;
a drawn noise and scatter of all sessions is taken from the estimated rate, which gives r, and leave
that of the last session in δ.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats

from accelstudy.epochs.common import session_like
from accelstudy.epochs.history import History
from accelstudy.leveling.error import ATTITUDES, cap_forces, tilt_error

Array = NDArray[np.float64]

DRAWS = 4000
SEED = 1
LONGEST = 10.0
"""Years beyond which nothing is promised."""
SIZES = 80
"""Scatters between which the squares about a line are interpolated."""
BEYOND = 1e3
"""Largest scatter, in parts of what is seen."""


@dataclass(frozen=True, eq=False)
class Interval:
    """How long a calibration stays good enough.

    Attributes
    ----------
    history : History
    accuracy : float, rad, rms of roll and of pitch over the tilts
    tilt_range : float, rad
    confidence : float, probability that neither of the two is larger
    """

    history: History
    accuracy: float
    tilt_range: float
    confidence: float

    def error(self, years: float) -> float:
        """Tilt error that is not exceeded with the probability, so many years later, rad."""
        a, b, c = self._squares
        larger = np.max(a + b * years + c * years**2, axis=1)
        return float(np.sqrt(np.quantile(np.maximum(larger, 0.0), self.confidence)))

    @cached_property
    def years(self) -> float:
        """Years until the error exceeds the accuracy; 0 if it does at once, at most `LONGEST`."""
        if self.error(0.0) > self.accuracy:
            return 0.0
        steps = np.linspace(0.0, LONGEST, 201)
        too_large = [t for t in steps if self.error(t) > self.accuracy]
        if not too_large:
            return LONGEST
        first = too_large[0]
        return float(
            optimize.brentq(lambda t: self.error(t) - self.accuracy, first - steps[1], first)
        )

    @cached_property
    def _squares(self) -> tuple[Array, Array, Array]:
        """Squared errors of roll and pitch of the draws, (DRAWS, 2), as a + b t + c t², rad²."""
        last = self.history.calibrations[-1]
        g, forces = last.gravity, cap_forces(self.tilt_range, ATTITUDES, last.gravity)
        hold, values = session_like(last, -forces / g).hold, last.parameters
        form = tilt_error(last.model, values, last.model, values, forces, g, hold).quadratic
        at_once, per_year = self._drawn()
        first, second = (np.einsum("ku,auw->kaw", each, form) for each in (at_once, per_year))
        return (
            np.einsum("kaw,kw->ka", first, at_once),
            2 * np.einsum("kaw,kw->ka", first, per_year),
            np.einsum("kaw,kw->ka", second, per_year),
        )

    def _drawn(self) -> tuple[Array, Array]:
        """Error of the last calibration at once, and its growth per year, (DRAWS, u) each."""
        history, rng = self.history, np.random.default_rng(SEED)
        common, last = history.common, history.calibrations[-1]
        n = len(history.years)
        noise = [_normal(rng, c, dof) for c, dof in zip(common.covariances, common.dof, strict=True)]
        at_once = _normal(rng, last.covariance, common.dof[-1])
        names = last.model.parameter_names
        places = [names.index(name) for name in common.model.parameter_names]
        noise[-1] = at_once[:, places]
        per_year = np.zeros_like(at_once)
        for k, (place, course) in enumerate(zip(places, history.courses, strict=True)):
            scatters, squares = course.line.profile(SIZES, BEYOND)
            drawn = np.log(rng.chisquare(course.line.dof, DRAWS))
            scatter = np.interp(-drawn, -np.log(squares), scatters)
            sessions = scatter[:, None] * rng.standard_normal((DRAWS, n + 1))
            errors = np.stack([each[:, k] for each in noise], axis=1) + sessions[:, :n]
            rates = np.array([course.line.combination(size)[1] for size in scatters])
            of_draw = np.stack([np.interp(scatter, scatters, each) for each in rates.T], axis=1)
            per_year[:, place] = -np.einsum("ki,ki->k", of_draw, course.values - errors)
            at_once[:, place] += sessions[:, n - 1] - sessions[:, n]
        return at_once, per_year


def _normal(rng: np.random.Generator, covariance: Array, dof: float) -> Array:
    """Draws (DRAWS, u) of errors of a covariance matrix that was estimated or stated."""
    size = np.sqrt(np.diag(covariance))
    size = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    root = size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    normal = rng.standard_normal((DRAWS, len(size))) @ root.T
    if np.isfinite(dof):
        normal *= np.sqrt(dof / rng.chisquare(dof, DRAWS))[:, None]
    return np.asarray(normal)
