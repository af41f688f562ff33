"""The fit of the base model to a campaign, with equal axes, and what is known of its noise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution, solve
from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.campaign.calibration.fit import fit_campaign, least_sigma
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.evidence.size import Level
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

BEYOND_WHITE = 5.0
"""Ratio of variances up to which white noise within the holds may explain the scatter of means."""


@dataclass(frozen=True)
class BaseFit:
    """The fit of a model to a campaign; computed once, when it is needed."""

    campaign: Campaign
    model: SensorModel
    approach: Approach

    @property
    def sigma_known(self) -> bool:
        """Whether the campaign states the noise of a position mean."""
        return self.campaign.sigma_force is not None

    @property
    def solution(self) -> Solution:
        """The fit."""
        return self._fit[0]

    @cached_property
    def _fit(self) -> tuple[Solution, bool]:
        """The fit, and whether its sigma is that of the noise within the holds."""
        campaign = self.campaign
        # Without a sigma the weights of forces and angles need one: that of the residuals.
        for _ in range(1 if self.sigma_known else 3):
            fit = fit_campaign(campaign, self.model, self.approach)
            if fit.adjustment.redundancy <= 0:
                raise InputError(
                    f"{campaign.name}: {campaign.n_positions} positions leave no redundancy beside "
                    f"the {self.model.n_parameters} parameters of {self.model.name!r}: nothing can "
                    "be tested; more positions are needed"
                )
            if not self.sigma_known:
                least = max(1e-9, least_sigma(campaign, self.approach))
                sigma = max(fit.sigma_position, least)
                campaign = replace(campaign, sigma_force=sigma, slope=None, sd_slope=None)
        fitted = solve(fit.model, fit.approach, fit.observed, fit.adjustment)
        if self.sigma_known or not self._is_white(fit.sigma_position_posteriori):
            return fitted, False
        assert self.white is not None
        observed = replace(fit.observed, sigma_force=float(np.sqrt(np.mean(self.white))))
        return solve(fit.model, fit.approach, observed), True

    @property
    def level(self) -> Level:
        """What is known of the noise of a position mean."""
        if self.sigma_known:
            return Level.given()
        return Level.within_holds() if self._fit[1] else Level.unknown()

    def _is_white(self, sigma: float) -> bool:
        """Whether white noise within the holds may explain a scatter of the means."""
        least = least_sigma(self.campaign, self.approach)
        if self.white is None or np.mean(self.white) <= least**2:
            return False
        return bool(1 / BEYOND_WHITE < sigma**2 / np.mean(self.white) < BEYOND_WHITE)

    @cached_property
    def white(self) -> Array | None:
        """Variances of position means, (3,), if white noise within the holds is all there is."""
        sd, n = self.campaign.sd, self.campaign.n_samples
        if sd is None or n is None or not np.all(sd > 0):
            return None
        return np.asarray(np.mean(sd**2 / n[:, None], axis=0))
