"""A sensor over time: whether its parameters drift, and whether they scatter between sessions.

A parameter of session i at time tᵢ is a + r tᵢ + sᵢ + eᵢ: a line, the scatter of the sessions with
the sd τ, as by switching off and on, and the noise of the calibration. The scatter is estimated by
the squares about the line, so that the rate is a t variable with n − 2 degrees of freedom, whether
or not there is scatter (Knapp & Hartung 2003, Statistics in Medicine 22, 2693; exact where all
sigmas are equal). The scatter is tested by the squares that noise alone leaves, χ² with stated
noise. Where noise was estimated they follow Johansen (1980, Biometrika 67, 85).

All tests have one level together, by the steps of Holm (1979, Scand. J. Statist. 6, 65).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats

from accelstudy.adjustment.random_effects import RandomEffects
from accelstudy.basics.errors import InputError
from accelstudy.campaign.calibration.applying import Calibration
from accelstudy.effects import Parameter
from accelstudy.epochs.common import Common, in_common
from accelstudy.epochs.congruence import LEVEL, POWER

Array = NDArray[np.float64]

YEAR = 365.25 * 86400.0
"""s"""
FEWEST = 3
"""Calibrations of which a line leaves a degree of freedom."""
QUANTILES = (np.arange(200) + 0.5) / 200
"""Probabilities over which a power is averaged."""


@dataclass(frozen=True, eq=False)
class Course:
    """A parameter over time.

    Attributes
    ----------
    line : RandomEffects, about the value at the last date and the rate, per year
    dof : (n,) array, degrees of freedom of the sigmas; inf if the noise was stated
    """

    line: RandomEffects
    dof: Array

    @property
    def rate(self) -> tuple[float, float]:
        """Rate and its sigma, per year."""
        return float(self.line.estimates[1]), float(np.sqrt(self.line.covariance[1, 1]))

    @property
    def sigmas_95(self) -> float:
        """Number of sigmas on either side of the line that hold 95 %."""
        return float(stats.t.isf(0.025, self.line.dof))

    @property
    def rate_interval(self) -> tuple[float, float]:
        """Interval that holds the rate with a probability of 95 %."""
        (rate, sigma), half = self.rate, self.sigmas_95
        return rate - half * sigma, rate + half * sigma

    @property
    def p_values(self) -> tuple[float, float]:
        """Of the rate and of the scatter, each if it is zero."""
        rate, sigma = self.rate
        factor, other = self._of_squares
        return (
            2 * float(stats.t.sf(abs(rate) / sigma, self.line.dof)),
            _tail(self.line.squares(0.0) / factor, self.line.dof, other),
        )

    def detectable_rate(self, level: float) -> float:
        """Rate that a test at some level finds with a probability of `POWER`, with this scatter."""
        dof, sigma = self.line.dof, self.rate[1]
        limit = stats.t.isf(level / 2, dof)
        # Sigmas never are smaller than by the noise alone.
        least = np.sqrt(self.line.covariance_with(0.0)[1, 1]) / sigma
        bounds = limit * np.maximum(least, np.sqrt(stats.chi2.ppf(QUANTILES, dof) / dof))

        def missed(size: float) -> float:
            found = stats.norm.sf(bounds - size) + stats.norm.cdf(-bounds - size)
            return float(np.mean(found)) - POWER

        return sigma * float(optimize.brentq(missed, 0.0, 10 * bounds[-1] + 10))

    def detectable_scatter(self, level: float) -> float:
        """Scatter that a test at some level finds with a probability of `POWER`.

        Squares are taken as a scaled χ² variable of the same mean and variance.
        """
        n, (factor, other) = len(self.line.values), self._of_squares
        limit = factor * _limit(level, self.line.dof, other)
        root = np.sqrt(self.line.variances)
        apart = (np.eye(n) - self.line.design @ self.line.combination(0.0)) * root / root[:, None]
        sizes = np.linalg.eigvalsh((apart / self.line.variances) @ apart.T)[-self.line.dof :]

        def missed(ratio: float) -> float:
            each = 1 + ratio**2 * sizes * self.line.variances.min()
            scale = np.sum(each**2) / np.sum(each)
            return float(stats.chi2.sf(limit / scale, np.sum(each) / scale)) - POWER

        most = 1.0
        while missed(most) < 0:
            most *= 2
        return float(np.sqrt(self.line.variances.min()) * optimize.brentq(missed, 0.0, most))

    @cached_property
    def _of_squares(self) -> tuple[float, float]:
        """Factor c and second degrees of freedom: squares of noise alone are c F(n − 2, ν)."""
        leverage = np.einsum("iu,ui->i", self.line.design, self.line.combination(0.0))
        a, f = float(np.sum((1 - leverage) ** 2 / self.dof)), self.line.dof
        return f + 2 * a - 6 * a / (f + 2), (f * (f + 2) / (3 * a) if a else np.inf)


def _tail(statistic: float, dof: int, other: float) -> float:
    if np.isinf(other):
        return float(stats.chi2.sf(dof * statistic, dof))
    return float(stats.f.sf(statistic, dof, other))


def _limit(level: float, dof: int, other: float) -> float:
    if np.isinf(other):
        return float(stats.chi2.isf(level, dof)) / dof
    return float(stats.f.isf(level, dof, other))


@dataclass(frozen=True, eq=False)
class History:
    """Calibrations of one sensor in the order of time.

    Attributes
    ----------
    calibrations : tuple of n Calibration
    dates : tuple of n datetime
    common : Common, the effects that all have
    """

    calibrations: tuple[Calibration, ...]
    dates: tuple[datetime, ...]
    common: Common

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters that all have."""
        return self.common.model.parameters

    @cached_property
    def years(self) -> Array:
        """Time before the last calibration, (n,), negative."""
        return np.array([(date - self.dates[-1]).total_seconds() / YEAR for date in self.dates])

    @cached_property
    def courses(self) -> tuple[Course, ...]:
        """Each parameter over time."""
        design = np.column_stack([np.ones_like(self.years), self.years])
        variances = np.diagonal(self.common.covariances, axis1=1, axis2=2)
        return tuple(
            Course(RandomEffects(values, variance, design), self.common.dof)
            for values, variance in zip(self.common.values.T, variances.T, strict=True)
        )

    @property
    def level(self) -> float:
        """Level of the first of all tests; it is that of each test which states its power."""
        return LEVEL / (2 * len(self.parameters))

    @cached_property
    def found(self) -> NDArray[np.bool_]:
        """Whether each parameter drifts, and whether it scatters, (p, 2), at one level for all."""
        return holm(np.array([course.p_values for course in self.courses]))


def holm(p_values: Array) -> NDArray[np.bool_]:
    """Which of some hypotheses are rejected, at one level for all."""
    flat = p_values.ravel()
    order = np.argsort(flat, kind="stable")
    passed = flat[order] <= LEVEL / np.arange(len(flat), 0, -1)
    rejected = np.zeros(len(flat), dtype=bool)
    rejected[order] = np.logical_and.accumulate(passed)
    return rejected.reshape(p_values.shape)


def history_of(calibrations: Sequence[Calibration], dates: Sequence[datetime]) -> History:
    """Put calibrations of one sensor in the order of time, and bring them to common effects.

    Raises
    ------
    InputError
        If they are fewer than three, of one date, or cannot be compared; see `in_common`.
    """
    if len(calibrations) < FEWEST:
        raise InputError(
            f"CALIBRATION: a history has {FEWEST} or more, not {len(calibrations)}; `compare` "
            "takes two"
        )
    if len(set(dates)) < 2:
        raise InputError("--date: all are the same; a rate needs two dates or more")
    common = in_common(calibrations)
    order = np.argsort(np.array(dates, dtype="datetime64[us]"), kind="stable")
    ordered = Common(
        common.model, common.values[order], common.covariances[order], common.dof[order]
    )
    return History(
        tuple(calibrations[i] for i in order), tuple(dates[i] for i in order), ordered
    )
