"""The sensors of a lot, calibrated with the model of their type, and its parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.random_effects import RandomEffects
from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON
from accelstudy.campaign.calibration.assessment import tilt_left
from accelstudy.campaign.calibration.fit import (
    CampaignFit,
    JudgedNoise,
    fit_campaign,
    usual_approach,
)
from accelstudy.campaign.session import Campaign
from accelstudy.leveling.error import (
    ATTITUDES,
    MAX_TILT_GON,
    cap_forces,
    holds_in_use,
    tilt_error,
)
from accelstudy.lots.lot import Lot
from accelstudy.sensors.models import compose
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TypeParameter:
    """A parameter over the sensors of a lot.

    Attributes
    ----------
    name, unit : str, SI
    values, sigmas : (n,) arrays, of the sensors; NaN where a campaign cannot show it
    usual, has : (n,) bool arrays, whether a sensor is not odd, and whether it has the parameter
    """

    name: str
    unit: str
    values: Array
    sigmas: Array
    usual: NDArray[np.bool_]
    has: NDArray[np.bool_]

    @cached_property
    def of_type(self) -> RandomEffects | None:
        """Mean and scatter over usual sensors that have it; None if no campaign shows it."""
        told = self.usual & self.has & np.isfinite(self.values) & np.isfinite(self.sigmas)
        if not told.any():
            return None
        design = np.ones((np.count_nonzero(told), 1))
        return RandomEffects(self.values[told], self.sigmas[told] ** 2, design)

    @property
    def mean(self) -> float:
        """Mean of the type."""
        return np.nan if self.of_type is None else float(self.of_type.estimates[0])

    @property
    def sigma(self) -> float:
        """Sigma of the mean."""
        return np.nan if self.of_type is None else float(np.sqrt(self.of_type.covariance[0, 0]))

    @property
    def scatter(self) -> float:
        """Scatter from sensor to sensor, an sd."""
        return np.nan if self.of_type is None else self.of_type.scatter

    def scatter_interval(self, probability: float = 0.95) -> tuple[float, float]:
        """Interval that holds the scatter with a probability; that of one sensor has no end."""
        if self.of_type is None:
            return np.nan, np.nan
        return self.of_type.scatter_interval(probability) if self.of_type.dof else (0.0, np.inf)


@dataclass(frozen=True, eq=False)
class CalibratedLot:
    """A lot, and a calibration of each of its sensors.

    Attributes
    ----------
    lot : Lot
    model : SensorModel, of the diagnosis, without what was found
    fits : calibrations with the model of the type, or why there is none
    approach : Approach, of the first campaign
    left_out : mapping of campaigns that are not in the lot to why
    """

    lot: Lot
    model: SensorModel
    fits: Sequence[CampaignFit | InputError]
    approach: Approach
    left_out: Mapping[str, str]

    @classmethod
    def of(
        cls,
        lot: Lot,
        model: SensorModel,
        campaigns: Sequence[Campaign],
        approach: Approach | None,
        left_out: Mapping[str, str],
    ) -> CalibratedLot:
        """Calibrate each sensor with the model of the type.

        Parameters
        ----------
        lot, model, left_out : as above
        campaigns : of its sensors, in the same order
        approach : Approach, as in `weigh_lot`
        """
        fits: list[CampaignFit | InputError] = []
        for i, campaign in enumerate(campaigns):
            try:
                chosen = lot.model_of(i), approach or usual_approach(campaign)
                fits.append(fit_campaign(campaign, *chosen))
            except InputError as error:
                fits.append(error)
        return cls(lot, model, fits, approach or usual_approach(campaigns[0]), left_out)

    @property
    def usual(self) -> list[CampaignFit]:
        """Calibrations of the sensors that are not odd."""
        fits = [self.fits[i] for i in self.lot.usual]
        return [fit for fit in fits if isinstance(fit, CampaignFit)]

    @cached_property
    def parameters(self) -> dict[str, TypeParameter]:
        """Parameters of the model of the type; of an effect, over the sensors that have it."""
        model, each = self.lot.model, self.lot.each()
        values, sigmas = np.full((2, len(each), model.n_parameters), np.nan)
        for i, fit in enumerate(self.fits):
            if isinstance(fit, CampaignFit):
                values[i], sigmas[i] = fit.parameters, np.sqrt(self._variances(fit))
        usual = np.isin(np.arange(len(each)), self.lot.usual)
        has = dict.fromkeys(model.parameter_names, np.ones(len(each), dtype=bool))
        for found, spec in self.lot.effects:
            having = np.array([found.names[0] in names for _, names, _ in each])
            has |= dict.fromkeys(_names_of(spec), having)
        return {
            p.name: TypeParameter(p.name, p.unit, values[:, j], sigmas[:, j], usual, has[p.name])
            for j, p in enumerate(model.parameters)
        }

    def parameters_of(self, spec: str | None) -> list[TypeParameter]:
        """Parameters of an effect; none of what has no effect of the catalogue."""
        return [self.parameters[name] for name in _names_of(spec)]

    def _variances(self, fit: CampaignFit) -> Array:
        """Variances of the parameters of a sensor, (u,), by what all sensors tell of its noise.

        Its own estimate has few degrees of freedom: taken as it is, what is not known of the noise
        would look like scatter of the parameters.
        """
        own, noise = fit.sigma**2, self.lot.noises[fit.campaign.name]
        if fit.trusts_sigma or noise is None:
            return own
        r, ratio = fit.adjustment.redundancy, (noise.sigma / fit.sigma_position_posteriori) ** 2
        return own * float((r + noise.freedom * ratio) / (r + noise.freedom))

    @cached_property
    def tilt(self) -> Array | None:
        """Rms tilt error of the sensors by what their model lacked, (2,), rad: roll and pitch.

        It is over tilts up to `MAX_TILT_GON`, in the conditions of the campaigns, of sensors that
        are not odd, and without what the uncertainty of the parameters adds. None if nothing of the
        catalogue was found, or no sensor tells it.
        """
        squares = []
        if any(spec is not None for _, spec in self.lot.effects):
            for fit in self.usual:
                with suppress(InputError):
                    squares.append(_squared_error(fit, self.model))
        return np.sqrt(np.maximum(np.mean(squares, axis=0), 0.0)) if squares else None


def _names_of(spec: str | None) -> Sequence[str]:
    """Names of the parameters of an effect."""
    return () if spec is None else compose(spec, (spec,)).parameter_names


def _squared_error(fit: CampaignFit, model: SensorModel) -> Array:
    """Square of the error less that by noise: of nested models the difference of covariances."""
    noise = JudgedNoise(fit.trusts_sigma, fit.variance_factor)
    base = replace(fit_campaign(fit.campaign, model, fit.approach), judged=noise)
    f_b = cap_forces(MAX_TILT_GON * GON, ATTITUDES, fit.gravity)
    hold = holds_in_use(fit.campaign.hold, fit.campaign.n_positions, f_b)
    error = tilt_error(
        fit.model, fit.parameters, model, base.parameters, f_b, fit.gravity, hold
    ).constant
    by_noise = tilt_left(fit).parameters ** 2 - tilt_left(base).parameters ** 2
    return np.asarray(error - by_noise)
