"""The sensors of a lot, calibrated with all that their model lacks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.levels import MAX_TILT_GON
from accelstudy.basics.units import MGON
from accelstudy.campaign.calibration.campaign_fit import CampaignFit
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.sensor_type import SensorType
from accelstudy.leveling.error import attitudes_in_use, tilt_error
from accelstudy.lots.file_format import Tilt
from accelstudy.lots.lot import LotDiagnosis, sensors_with
from accelstudy.lots.passes import LotEffect
from accelstudy.lots.type_parameter import TypeParameter
from accelstudy.sensors.models import compose
from accelstudy.sensors.sensor import SensorModel

MIN_SHARE = 1e-6
"""Least posterior probability that a sensor has an effect of which something is expected."""


@dataclass(frozen=True, eq=False)
class LotCalibration:
    """A calibration of each sensor of a lot with the model of the type.

    Attributes
    ----------
    diagnosis : LotDiagnosis, all that is missing
    fits : mapping of the numbers of sensors to calibrations with the model of the type
    failed : mapping of campaigns to why they have none
    """

    diagnosis: LotDiagnosis
    fits: Mapping[int, CampaignFit]
    failed: Mapping[str, str]

    @classmethod
    def of(cls, diagnosis: LotDiagnosis) -> LotCalibration:
        """Calibrate each sensor with all that was found, if that explains the lot."""
        fits, failed = dict[int, CampaignFit](), dict[str, str]()
        for i, sensor in enumerate(sensors_with(diagnosis.effects, diagnosis.passes[0].sensors)):
            try:
                fits[i] = fit_campaign(sensor.campaign, sensor.model, sensor.approach)
            except InputError as error:
                failed[sensor.campaign.name] = str(error)
        return cls(diagnosis, fits, failed)

    @property
    def model(self) -> SensorModel:
        """The model that was diagnosed, without what was found."""
        return self.diagnosis.passes[0].sensors[0].model

    @property
    def usual(self) -> dict[int, CampaignFit]:
        """Calibrations of the sensors that are not odd, by their numbers."""
        return {i: fit for i, fit in self.fits.items() if i not in self.diagnosis.odd}

    @cached_property
    def parameters(self) -> dict[str, TypeParameter]:
        """Parameters of the model of the type; of an effect, over the sensors that have it."""
        diagnosis, n = self.diagnosis, len(self.diagnosis.last.sensors)
        model, each = diagnosis.model, diagnosis.each
        values, sigmas = np.full((2, n, model.n_parameters), np.nan)
        for i, fit in self.fits.items():
            values[i], sigmas[i] = fit.parameters, np.sqrt(self._variances(i, fit))
        usual = np.isin(np.arange(n), [*diagnosis.odd], invert=True)
        having = {
            name: np.array([found.names[0] in one.names for one in each])
            for found in diagnosis.effects
            for name in _parameters_of(found)
        }
        return {
            p.name: TypeParameter(
                p.name, p.unit, stays, values[:, j], sigmas[:, j], usual,
                having.get(p.name, np.ones(n, dtype=bool)),
            )
            for j, (p, stays) in enumerate(zip(model.parameters, model.stays.tolist(), strict=True))
        }  # fmt: skip

    def sizes(self, found: LotEffect) -> list[TypeParameter]:
        """Parameters of an effect that was found."""
        return [self.parameters[name] for name in _parameters_of(found)]

    def _variances(self, i: int, fit: CampaignFit) -> Array:
        """Variances of the parameters of a sensor, (u,), by what all sensors tell of its noise.

        Its own estimate has few degrees of freedom: taken as it is, what is not known of the noise
        would look like scatter of the parameters.
        """
        own, noise = fit.sigma**2, self.diagnosis.last.sensors[i].noise
        if fit.noise.trusted or noise is None:
            return own
        r, ratio = fit.solution.redundancy, (noise.sigma / fit.sigma_position_posteriori) ** 2
        return own * float((r + noise.freedom * ratio) / (r + noise.freedom))

    @cached_property
    def tilt(self) -> Tilt | None:
        """Rms tilt error of the sensors by what their model lacked.

        It is over tilts up to `MAX_TILT_GON`, in the conditions of the campaigns, of sensors that
        are not odd, and without what the uncertainty of the parameters adds. None if nothing of the
        catalogue was found, or no sensor tells it.
        """
        squares = []
        if any(found.spec is not None for found in self.diagnosis.effects):
            for i, fit in self.usual.items():
                with suppress(InputError):
                    squares.append(_squared_error(fit, self.model, self._expected(i)))
        if not squares:
            return None
        roll, pitch = np.sqrt(np.maximum(np.mean(squares, axis=0), 0.0)) / MGON
        return Tilt(roll_mgon=roll, pitch_mgon=pitch, max_tilt_gon=MAX_TILT_GON)

    def _expected(self, i: int) -> SensorType:
        """What the others tell of the effects that a sensor has, which may be none."""
        expected = dict[str, tuple[float, float]]()
        for found in self.diagnosis.effects:
            p = max(float(found.having[i]), MIN_SHARE)
            for one in self.sizes(found):
                square = one.scatter**2 + one.sigma**2 + (1 - p) * one.mean**2
                expected[one.name] = (p * one.mean, float(np.sqrt(p * square)))
        return SensorType("", len(self.usual), expected)


def _parameters_of(found: LotEffect) -> Sequence[str]:
    """Names of the parameters of what was found; none of what is no effect."""
    return () if found.spec is None else compose(found.spec, (found.spec,)).parameter_names


def _squared_error(fit: CampaignFit, model: SensorModel, of_type: SensorType) -> Array:
    """Mean square of the tilt error of a model that lacks effects of which a type tells something.

    With what the type tells as an observation, the estimates of the two models differ by the
    effects, and not by the noise; the difference of covariances is what is not known of the
    effects.
    """
    told = replace(fit.campaign, sensor_type=of_type)
    whole, base = (
        replace(fit_campaign(campaign, one, fit.approach), judgement=fit.noise)
        for campaign, one in ((told, fit.model), (fit.campaign, model))
    )
    f_b, hold = attitudes_in_use(fit.campaign.hold, fit.gravity)
    error = tilt_error(
        fit.model, whole.parameters, model, base.parameters, f_b, fit.gravity, hold
    ).constant
    return np.asarray(error + whole.tilt.parameters**2 - base.tilt.parameters**2)
