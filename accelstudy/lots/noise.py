"""The noise of a lot: how its sensors scatter about what their campaigns say of it.

A campaign states the sigma uᵢ of its position means, or the samples within its holds tell one, or
it says nothing, uᵢ = 1 m/s². Sensors of a type may be held for 2 s or for 60, so that their noise
differs; what they share is a factor c of what each campaign says:

    sᵢ² / (c uᵢ)² ~ 0.9 F(rᵢ, ν) + 0.1 F(rᵢ, 1),

with the variances sᵢ² of their calibrations by rᵢ degrees of freedom. The second term are sensors
whose sigma is wrong. Of a sensor that states nothing, nothing can be wrong: there is no such term.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats

from accelstudy.diagnosis.decision.problem import BaseFit
from accelstudy.diagnosis.evidence.size import Level
from accelstudy.diagnosis.rules import RULES

Array = NDArray[np.float64]

LEAST_SIGMA = 1e-9
"""m/s², least noise, for readings without any residual."""
FREEDOMS = (RULES.freedom_given, 60.0, 20.0, 8.0, RULES.freedom_doubted)
"""Values of ν to choose from; with the last one the sensors have nothing in common."""
MIN_LOG_RATIO = 1.0
"""Difference of log likelihoods below which neither of two explanations is preferred."""
ODD_SHARE, ODD_FREEDOM = 0.1, 1.0
"""Share of sensors whose variance may be anything, and ν of these."""
DOUBT = 0.02
"""Prior probability that a sensor has a noise of its own."""
MIN_SENSORS = 3
"""Least number of sensors whose noise is compared."""
STEP = 0.1
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
    said : bool, whether its campaign says how large the noise is, which may be wrong then
    """

    sigma: float
    freedom: float
    said: bool = True

    @property
    def level(self) -> Level:
        """What a campaign knows of its noise by that of the others."""
        return Level((1 - DOUBT, DOUBT), (self.freedom, RULES.freedom_doubted), known=True)


def stated_sigma(fit: BaseFit) -> tuple[str, float]:
    """Return the source of the noise of a campaign by itself, and its sigma, m/s²."""
    if fit.level.known:
        return STATED, fit.sigma
    return (NOTHING, 1.0) if fit.within is None else (WITHIN, float(np.sqrt(np.mean(fit.within))))


@dataclass(frozen=True)
class Agreement:
    """How sensors agree in noise.

    Attributes
    ----------
    factor : float, c, by which the noise is larger than is said
    freedom : float, ν
    log_likelihood : float, of the variances of the calibrations
    """

    factor: float
    freedom: float
    log_likelihood: float

    @classmethod
    def of(
        cls, sigmas: Array, redundancies: Array, said: Array, odd_share: float = ODD_SHARE
    ) -> Agreement:
        """Find the most probable factor, and the largest ν that explains as much.

        Parameters
        ----------
        sigmas, redundancies : (n,) arrays, s in m/s² and r, of the sensors
        said : (n,) array, u in m/s²
        odd_share : float, share of sensors whose sigma is wrong
        """
        squares = np.square(sigmas / said)

        def log_likelihood(log: Array | float, freedom: float) -> Array:
            logs = np.asarray(log, dtype=float)[..., None]
            ratios = squares / np.exp(logs)
            each = stats.f.logpdf(ratios, redundancies, freedom)
            if odd_share:
                odd = stats.f.logpdf(ratios, redundancies, ODD_FREEDOM) + np.log(odd_share)
                each = np.logaddexp(each + np.log(1 - odd_share), odd)
            return np.asarray(np.sum(each - logs - 2 * np.log(said), axis=-1))

        ends = np.log(squares.min()), np.log(squares.max())
        grid = np.arange(ends[0] - STEP, ends[1] + 2 * STEP, STEP)
        found = []
        for freedom in FREEDOMS:
            near = grid[np.argmax(log_likelihood(grid, freedom))]
            best = optimize.minimize_scalar(
                lambda log, nu: -float(log_likelihood(log, nu)),
                (near - STEP, near + STEP),
                args=(freedom,),
            )
            found.append(cls(float(np.exp(best.x / 2)), freedom, -float(best.fun)))
        most = max(one.log_likelihood for one in found)
        usual = next(one for one in found if one.log_likelihood > most - MIN_LOG_RATIO)
        return replace(usual, log_likelihood=most)


def noises_of_lot(
    fits: Sequence[BaseFit | None], refit: Callable[[int, float], BaseFit | None]
) -> list[NoisePrior | None]:
    """Noise of each sensor, by what all those tell whose campaigns say it in the same way.

    Parameters
    ----------
    fits : calibrations of the sensors; None where there is none
    refit : function that calibrates a sensor, by its place, with another sigma in m/s²

    Returns
    -------
    list
        None for sensors that speak for themselves, as their noise has nothing in common.
    """
    noises: list[NoisePrior | None] = [None] * len(fits)
    for source in (STATED, WITHIN, NOTHING):
        group = {i: fit for i, fit in enumerate(fits) if fit and stated_sigma(fit)[0] == source}
        if len(group) < MIN_SENSORS:
            continue
        agreement, said = _agreement(group, 0.0 if source == NOTHING else ODD_SHARE, refit)
        if agreement.freedom > RULES.freedom_doubted:
            for i, u in zip(group, said.tolist(), strict=True):
                sigma = agreement.factor * u
                noises[i] = NoisePrior(sigma, agreement.freedom, said=source != NOTHING)
    return noises


def _agreement(
    group: dict[int, BaseFit], odd_share: float, refit: Callable[[int, float], BaseFit | None]
) -> tuple[Agreement, Array]:
    """Find how some sensors agree in noise, and of which sigmas their noise is a multiple.

    Sensors may have the same noise whatever their campaigns say of it: if that explains more, it is
    a multiple of one. Beside angles the noise of the forces is not in proportion to the residuals,
    and is searched for: with it the residuals are as large as it says.
    """

    def agreement(fits: Sequence[BaseFit], said: Array) -> Agreement:
        sigmas = np.maximum([fit.sigma_posteriori for fit in fits], LEAST_SIGMA)
        redundancies = np.array([fit.solution.redundancy for fit in fits])
        return Agreement.of(sigmas, redundancies, said, odd_share)

    fits = list(group.values())
    said, equal = np.array([stated_sigma(fit)[1] for fit in fits]), np.ones(len(fits))
    now, same = agreement(fits, said), agreement(fits, equal)
    if same.log_likelihood > now.log_likelihood + MIN_LOG_RATIO:
        now, said = same, equal
    before = None
    beside = any(fit.solution.approach.uses_angles for fit in fits)
    for _ in range(MAX_REFITS if beside else 0):
        factor = now.factor
        again = {k: refit(i, float(factor * said[k])) for k, i in enumerate(group)}
        there = {k: fit for k, fit in again.items() if fit is not None}
        now = agreement([*there.values()], said[[*there]])
        off = float(np.log(now.factor / factor))
        if abs(off) < NOISE_TOLERANCE:
            break
        step = off
        if before is not None and (off - before[1]) * (np.log(factor) - before[0]) < 0:
            step = -off * (np.log(factor) - before[0]) / (off - before[1])
        before = float(np.log(factor)), off
        now = replace(now, factor=factor * float(np.exp(np.clip(step, -2, 2))))
    return now, said
