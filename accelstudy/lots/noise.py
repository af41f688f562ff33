"""The noise of a lot: how its sensors scatter about what their campaigns say of it.

A campaign states the sigma uᵢ of its position means, or the samples within its holds tell one, or
it says nothing, uᵢ = 1 m/s². Sensors of a type may be held for 2 s or for 60, so that their noise
differs; what they share is a factor c of what each campaign says:

    sᵢ² / (c uᵢ)² ~ 0.9 F(rᵢ, ν) + 0.1 F(rᵢ, 1),

with the variances sᵢ² of their calibrations by rᵢ degrees of freedom. The second term are sensors
whose sigma is wrong. Of a sensor that states nothing, nothing can be wrong: there is no such term.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import stats

from accelstudy.basics.arrays import Array
from accelstudy.diagnosis.decision.problem import BaseFit
from accelstudy.diagnosis.evidence.size import Level
from accelstudy.diagnosis.rules import RULES

LEAST_SIGMA = 1e-9
"""m/s², least noise, for readings without any residual."""
FREEDOMS = (RULES.freedom_given, 60.0, 20.0, 8.0, RULES.freedom_doubted)
"""Values of ν to choose from; with the last one the sensors have nothing in common."""
MIN_LOG_RATIO = 1.0
"""Difference of log likelihoods below which the larger ν is preferred."""
ODD_SHARE, ODD_FREEDOM = 0.1, 1.0
"""Share of sensors whose variance may be anything, and ν of these."""
DOUBT = 0.02
"""Prior probability that a sensor has a noise of its own."""
MIN_SENSORS = 3
"""Least number of sensors whose noise is compared."""
STEP = 0.02
"""Step of log c² in the search for its most probable value, as there may be several maxima."""
NOISE_TOLERANCE = 0.02
"""Relative change below which the noise of a lot is found."""
MAX_REFITS = 8
"""Largest number of calibrations of all sensors in that search."""
STATED, WITHIN, NOTHING = "stated", "within holds", "nothing"
"""Sources of the noise of a single campaign."""


@dataclass(frozen=True)
class NoisePrior:
    """The noise of a sensor by that of the lot: its variance is σ² times inverse-gamma(ν/2, ν/2).

    Attributes
    ----------
    sigma : float, m/s², of a position mean
    freedom : float, ν: few where sensors differ in noise
    stated : bool, whether its campaign says how large the noise is, which may be wrong then
    """

    sigma: float
    freedom: float = RULES.freedom_given
    stated: bool = True

    @property
    def level(self) -> Level:
        """What a campaign knows of its noise by that of the others."""
        return Level((1 - DOUBT, DOUBT), (self.freedom, RULES.freedom_doubted), known=True)


def stated_sigma(fit: BaseFit) -> tuple[str, float]:
    """Return the source of the noise of a campaign by itself, and its sigma, m/s²."""
    if fit.level.known:
        return STATED, fit.solution.sigma_force
    return (NOTHING, 1.0) if fit.within is None else (WITHIN, float(np.sqrt(np.mean(fit.within))))


def agreement(
    ratios: Array, redundancies: Array, odd_share: float = ODD_SHARE
) -> tuple[float, float]:
    """Find the most probable factor c of the noise, and the largest ν that explains as much.

    Parameters
    ----------
    ratios, redundancies : (n,) arrays, s/u and r of the sensors
    odd_share : float, share of sensors whose sigma is wrong
    """
    logs = 2 * np.log(ratios)
    grid = np.arange(logs.min(), logs.max() + STEP, STEP)
    squares = np.exp(logs - grid[:, None])
    usual = [stats.f.logpdf(squares, redundancies, freedom) for freedom in FREEDOMS]
    with np.errstate(divide="ignore"):  # no sensor may be wrong
        odd = stats.f.logpdf(squares, redundancies, ODD_FREEDOM) + np.log(odd_share)
    each = np.logaddexp(np.array(usual) + np.log1p(-odd_share), odd)
    likelihood = np.sum(each - grid[:, None], axis=-1)  # (ν, c)
    best = likelihood.max(axis=1)
    k = int(np.argmax(best > best.max() - MIN_LOG_RATIO))
    return float(np.exp(grid[likelihood[k].argmax()] / 2)), FREEDOMS[k]


def noises_of_lot(
    n: int, fit: Callable[[int, float | None], BaseFit | None]
) -> list[NoisePrior | None]:
    """Noise of each sensor, by what all those tell whose campaigns say it in the same way.

    Parameters
    ----------
    n : int, number of sensors
    fit : function that calibrates a sensor, by its number, with a sigma in m/s² or by what its
        campaign says; None where that does not determine the model

    Returns
    -------
    list
        None for sensors that speak for themselves, as their noise has nothing in common.
    """
    noises: list[NoisePrior | None] = [None] * n
    fits = {i: one for i in range(n) if (one := fit(i, None)) is not None}
    for source in (STATED, WITHIN, NOTHING):
        own = {i: u for i, one in fits.items() for by, u in [stated_sigma(one)] if by == source}
        if len(own) < MIN_SENSORS:
            continue
        group, factor = {i: fits[i] for i in own}, np.inf
        # Beside angles the noise of the forces is not in proportion to the residuals, and is
        # searched for: with it the residuals are as large as it says.
        for _ in range(1 + MAX_REFITS):
            sigmas = np.array([one.solution.sigma_posteriori for one in group.values()])
            ratios = np.maximum(sigmas, LEAST_SIGMA) / [own[i] for i in group]
            redundancies = np.array([one.solution.redundancy for one in group.values()])
            before, odd_share = factor, 0.0 if source == NOTHING else ODD_SHARE
            factor, freedom = agreement(ratios, redundancies, odd_share)
            uses_angles = any(one.solution.approach.uses_angles for one in group.values())
            if not uses_angles or abs(factor / before - 1) < NOISE_TOLERANCE:
                break
            again = {i: fit(i, factor * own[i]) for i in group}
            group = {i: one for i, one in again.items() if one is not None}
        if freedom > RULES.freedom_doubted:
            for i, u in own.items():
                noises[i] = NoisePrior(factor * u, freedom, stated=source != NOTHING)
    return noises
