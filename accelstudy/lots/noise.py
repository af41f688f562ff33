"""The noise of a type, as the calibrations of its sensors tell it together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats

from accelstudy.adjustment.quality import Solution
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.evidence.size import AS_GIVEN, DOUBTED, Level

Array = NDArray[np.float64]

LEAST_SIGMA = 1e-9
"""m/s², of readings that are their own model."""
FREEDOMS = (AS_GIVEN, 60.0, 20.0, 8.0, DOUBTED)
"""ν of a type, the most first."""
ALIKE = 1.0
"""Difference of log likelihoods that says nothing."""
ODD_SHARE, ODD_FREEDOM = 0.1, 1.0
"""Share of sensors whose variance may be anything, and ν of these."""
AGREE = 0.02
"""Relative change below which the noise of a type is found."""
REFITS = 8
"""Most calibrations of all sensors for it."""


@dataclass(frozen=True)
class LotNoise:
    """The noise of a type: variances of its sensors are σ² times an inverse-gamma(ν/2, ν/2).

    Attributes
    ----------
    sigma : float, m/s², of a position mean
    freedom : float, ν: few where sensors differ in noise
    doubt : float, prior probability that a sensor has a noise of its own
    """

    sigma: float
    freedom: float
    doubt: float = 0.02

    @classmethod
    def of(cls, sigmas: Array, redundancies: Array) -> LotNoise:
        """Of the variances s² of calibrations, of which s²/σ² is of F(r, ν), but for odd ones.

        Of the ν that explain them equally well the largest one is taken.

        Parameters
        ----------
        sigmas, redundancies : (n,) arrays, s in m/s² and r, of the sensors
        """
        squares = np.square(sigmas)

        def less_likely(log: float, freedom: float) -> float:
            ratios = squares / np.exp(log)
            usual, odd = (stats.f.logpdf(ratios, redundancies, nu) for nu in (freedom, ODD_FREEDOM))
            usual, odd = usual + np.log(1 - ODD_SHARE), odd + np.log(ODD_SHARE)
            return float(len(squares) * log - np.sum(np.logaddexp(usual, odd)))

        middle = float(np.median(np.log(squares)))
        best = [
            optimize.minimize_scalar(less_likely, (middle - 0.2, middle + 0.2), args=(nu,))
            for nu in FREEDOMS
        ]
        least = min(one.fun for one in best)
        log, freedom = next(
            (one.x, nu) for one, nu in zip(best, FREEDOMS, strict=True) if one.fun < least + ALIKE
        )
        return cls(float(np.exp(log / 2)), freedom)

    @property
    def level(self) -> Level:
        """What a campaign knows of its noise by that of the others."""
        if not self.doubt:
            return Level((1.0,), (self.freedom,), known=True)
        return Level((1 - self.doubt, self.doubt), (self.freedom, DOUBTED), known=True)


def with_noise(campaign: Campaign, noise: LotNoise | None) -> Campaign:
    """Return a campaign with the noise of its type, if it is known, in place of its own."""
    return campaign if noise is None else replace(campaign, sigma_force=noise.sigma, sigma_dof=None)


def noise_of_type(
    fits: Sequence[Solution | None],
    fits_of: Callable[[Sequence[Campaign]], list[Solution | None]],
    campaigns: Sequence[Campaign],
) -> LotNoise:
    """Noise of the type by the calibrations of its sensors, as far as there are any.

    Beside angles the noise of the forces is not in proportion to the residuals, and is searched
    for: with it the residuals are as large as it says.
    """
    noise, before = lot_noise(fits), None
    beside = any(fit is not None and fit.approach.uses_angles for fit in fits)
    for _ in range(REFITS if beside else 0):
        sigma = noise.sigma
        again = lot_noise(
            fits_of([replace(one, sigma_force=sigma, sigma_dof=None) for one in campaigns])
        )
        off = float(np.log(again.sigma / sigma))
        if abs(off) < AGREE:
            return again
        step = off
        if before is not None and (off - before[1]) * (np.log(sigma) - before[0]) < 0:
            step = -off * (np.log(sigma) - before[0]) / (off - before[1])
        before = float(np.log(sigma)), off
        noise = replace(again, sigma=sigma * float(np.exp(np.clip(step, -2, 2))))
    return noise


def lot_noise(each: Sequence[Solution | None]) -> LotNoise:
    """Noise of a type by the calibrations of its sensors."""
    fits = [fit for fit in each if fit is not None]
    redundancies = np.array([fit.redundancy for fit in fits])
    factors = np.sqrt(np.array([fit.omega for fit in fits]) / redundancies)
    sigmas = np.array([sigma_stated(fit) for fit in fits]) * factors
    return LotNoise.of(np.maximum(sigmas, LEAST_SIGMA), redundancies)


def sigma_stated(fit: Solution) -> float:
    """Return the sigma of forces that a fit took, m/s²."""
    return float(np.mean(np.asarray(fit.observed.sigma_force)))
