"""What it costs in roll and pitch to leave out what a lot lacks."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON
from accelstudy.campaign.calibration.assessment import tilt_shares
from accelstudy.campaign.calibration.fit import CampaignFit, JudgedNoise, fit_campaign
from accelstudy.leveling.error import (
    ATTITUDES,
    MAX_TILT_GON,
    cap_forces,
    holds_in_use,
    tilt_error,
)
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]


def worth(fits: Sequence[CampaignFit | InputError], model: SensorModel) -> Array | None:
    """Rms tilt error of the sensors by what their model lacked, (2,), rad, of roll and of pitch.

    It is over tilts up to `MAX_TILT_GON`, in the conditions of the campaigns, and without what the
    uncertainty of the parameters adds. None if no sensor tells it.

    Parameters
    ----------
    fits : calibrations with the model of the type, of sensors that are not odd
    model : SensorModel, without what was found
    """
    squares = []
    for fit in fits:
        if isinstance(fit, CampaignFit):
            with suppress(InputError):
                squares.append(_of_sensor(fit, model))
    if not squares:
        return None
    return np.sqrt(np.maximum(np.mean(squares, axis=0), 0.0))


def _of_sensor(fit: CampaignFit, model: SensorModel) -> Array:
    """Square of the error less that by noise: of nested models the difference of covariances."""
    noise = JudgedNoise(fit.trusts_sigma, fit.variance_factor)
    base = replace(fit_campaign(fit.campaign, model, fit.approach), judged=noise)
    f_b = cap_forces(MAX_TILT_GON * GON, ATTITUDES, fit.gravity)
    hold = holds_in_use(fit.campaign.hold, fit.campaign.n_positions, f_b)
    error = tilt_error(
        fit.model, fit.parameters, model, base.parameters, f_b, fit.gravity, hold
    ).constant
    by_noise = tilt_shares(fit)["all"] ** 2 - tilt_shares(base)["all"] ** 2
    return np.asarray(error - by_noise)
