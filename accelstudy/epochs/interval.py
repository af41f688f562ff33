"""The calibration interval: how long the last calibration of a sensor stays good enough.

A time t after it, the error of the last calibration n is δ(t) = eₙ + sₙ − s − r t, with its noise,
the scatter of its session, that of the session in use, and the drift since. The true rate r is the
estimated one less what noise and scatter of all sessions put into it; both are drawn. The scatter
is estimated itself: the mean square of the tilt error has the degrees of freedom of Satterthwaite
(1946, Biometrics Bulletin 2, 110), of which a χ² variable is drawn.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import timedelta
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy import optimize

from accelstudy.basics.arrays import Array
from accelstudy.basics.units import GON, MGON
from accelstudy.epochs.course import YEAR
from accelstudy.leveling.error import TiltError

if TYPE_CHECKING:
    from accelstudy.epochs.history import History


DRAWS = 4000
SEED = 1
MAX_YEARS = 10.0
"""Years after the last calibration up to which a date is given."""
SHOWN_YEARS = (0.0, 0.25, 0.5, 1.0, 2.0, 5.0)
"""Years at which errors are told."""


@dataclass(frozen=True, eq=False)
class Interval:
    """How long a calibration stays good enough.

    Attributes
    ----------
    history : History
    accuracy : float, rad, rms of roll and of pitch over the tilts
    confidence : float, probability that neither of the two is larger
    """

    history: History
    accuracy: float
    confidence: float

    def error(self, years: float) -> float:
        """Tilt error after some years that is not exceeded with the probability, rad."""
        at_once, per_year = self._draws
        squares = self._tilt.squares(self._tilt.reference + at_once + years * per_year)
        return float(np.sqrt(np.quantile(squares.max(axis=1), self.confidence)))

    @property
    def until(self) -> str:
        """Date until which it stays good enough."""
        last = self.history.dates[-1] + timedelta(seconds=self.years * YEAR)
        return last.date().isoformat()

    @cached_property
    def years(self) -> float:
        """Years until the error exceeds the accuracy; 0 if it does at once, at most `MAX_YEARS`."""

        def beyond(years: float) -> float:
            return self.error(years) - self.accuracy

        steps = np.linspace(0.0, MAX_YEARS, 201).tolist()
        first = next((t for t in steps if beyond(t) > 0), None)
        if first is None:
            return MAX_YEARS
        return float(optimize.brentq(beyond, first - steps[1], first)) if first else 0.0

    @property
    def accuracy_mgon(self) -> float:
        """The accuracy in mgon."""
        return self.accuracy / MGON

    @property
    def max_tilt_gon(self) -> float:
        """Tilts that it is taken over."""
        return self.history.tilt_range / GON

    @property
    def errors(self) -> list[dict[str, float]]:
        """Errors over time."""
        return [{"years": t, "mgon": self.error(t) / MGON} for t in SHOWN_YEARS]

    @cached_property
    def _tilt(self) -> TiltError:
        """Tilt error by errors of the last calibration."""
        values = self.history.estimates[-1]
        return self.history.tilt_error(values, values)

    @cached_property
    def _draws(self) -> tuple[Array, Array]:
        """Error of the last calibration at once, and its growth per year, (DRAWS, u) each."""
        history, rng = self.history, np.random.default_rng(SEED)
        noise = np.array([_normal(rng, c) for c in history.covariances])
        at_once, per_year = noise[-1].copy(), np.zeros_like(noise[-1])
        for k, course in enumerate(history.courses):
            scatter = course.model.scatter
            sessions = scatter * rng.standard_normal((len(noise) + 1, DRAWS))
            errors = noise[:, :, k] + sessions[:-1]
            per_year[:, k] = course.model.combination(scatter)[1] @ errors
            at_once[:, k] += sessions[-2] - sessions[-1]
        drift = np.array([course.rate.per_year for course in history.courses])
        parts = np.einsum("auu->u", self._tilt.quadratic) * np.mean(at_once**2, axis=0)
        freedom = np.array([course.model.dof for course in history.courses])
        dof = np.sum(parts) ** 2 / np.sum(parts**2 / freedom)
        factor = np.sqrt(dof / rng.chisquare(dof, DRAWS))[:, None]
        return factor * at_once, factor * per_year - drift


def _normal(rng: np.random.Generator, covariance: Array) -> Array:
    """Draws (DRAWS, u) of errors of a covariance matrix."""
    size = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    # The symmetric root, as the signs of eigenvectors depend on the processor.
    root = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    return np.asarray(rng.standard_normal((DRAWS, len(size))) @ root * size)
