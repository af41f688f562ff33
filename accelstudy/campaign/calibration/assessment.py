"""How far a calibration can be trusted: tests, the tilt error that is left, and the state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment import quality
from accelstudy.adjustment.components import VarianceComponents, variance_components
from accelstudy.basics.levels import ACCEPTED, IMPLAUSIBLE, REJECTED, UNCHECKED
from accelstudy.basics.units import GON
from accelstudy.campaign.calibration.fit import CampaignFit, campaign_noise
from accelstudy.campaign.gross_errors.recognition import Recognition, recognise
from accelstudy.leveling.angles import tilt_by_output, tilt_slope
from accelstudy.leveling.error import ATTITUDES, MAX_TILT_GON, cap_forces, holds_in_use
from accelstudy.sensors.plausibility import implausible_parameters, implausible_tilt

Array = NDArray[np.float64]

OUTLIER_LEVEL = 0.05
"""Family-wise level of the tests of single positions."""


@dataclass(frozen=True)
class TiltLeft:
    """Rms tilt error that a calibration leaves, without the noise of a reading.

    Each is a (2,) array, rad, of roll and of pitch, over all tilts up to a largest one. Effects
    that depend on temperature or time have those of the campaign. Effects of the rig have no share:
    the sensor in use has left the rig.

    Attributes
    ----------
    shares : mapping of effect to what the uncertainty of its parameters leaves
    parameters : of all parameters together
    reference : the part of it that the calibration of a reference causes; None without one
    missing : of a reading that is wrong by as much as the residuals exceed the stated noise; 0
        where they do not refute it
    """

    shares: Mapping[str, Array]
    parameters: Array
    reference: Array | None
    missing: Array

    @property
    def total(self) -> Array:
        """Tilt error by the parameters and by what the model lacks together."""
        return np.hypot(self.parameters, self.missing)


class Assessment:
    """Quality of a calibrated campaign; each part is computed when it is asked for.

    Parameters
    ----------
    fit : CampaignFit
    """

    def __init__(self, fit: CampaignFit) -> None:
        self.fit = fit
        self._session = fit.model, fit.approach, fit.observed

    @property
    def solution(self) -> quality.Solution:
        """The adjustment, linearised at the estimates."""
        return self.fit.solution

    @cached_property
    def tests(self) -> quality.PositionTests:
        """Tests of the positions."""
        return quality.position_tests(self.solution)

    @cached_property
    def reliability(self) -> quality.Reliability:
        """Reliability of the positions."""
        return quality.reliability(self.solution)

    @cached_property
    def suspects(self) -> tuple[quality.Suspect, ...]:
        """Positions in conflict with the others, removed one at a time."""
        known = self.fit.trusts_sigma
        return quality.suspects(*self._session, alpha=OUTLIER_LEVEL, sigma_known=known)

    @cached_property
    def held_out(self) -> quality.HeldOut | None:
        """Prediction of each position from the others; None where those do not determine it."""
        return quality.held_out(self.solution)

    @cached_property
    def components(self) -> VarianceComponents | None:
        """Variance components of accelerometer and robot; None without a robot."""
        return variance_components(*self._session) if self.fit.sigma_known else None

    @cached_property
    def tilt(self) -> TiltLeft:
        """The tilt error that is left."""
        return tilt_left(self.fit)

    @cached_property
    def implausible(self) -> tuple[str, ...]:
        """Parameters and tilt errors that no sensor has."""
        fit = self.fit
        parameters = implausible_parameters(fit.model.effects, fit.parameters, fit.sigma)
        return *parameters, *implausible_tilt(*self.tilt.total)

    @cached_property
    def gross_error(self) -> Recognition | None:
        """A gross error in the campaign; one of the angles shows even where they are not used."""
        return recognise(self.fit.campaign)

    @property
    def p_adjusted(self) -> Array:
        """P-values of the positions, (n,), adjusted for their number.

        That of a suspect is from the round in which it was found, without the worse ones before it.
        """
        p_values = self.tests.p_adjusted(self.fit.trusts_sigma)
        for suspect in self.suspects:
            p_values[suspect.position] = suspect.p_value
        return p_values

    @property
    def warnings(self) -> list[str]:
        """Signs of a gross error; empty for a plausible calibration."""
        gross = self.gross_error
        return [*self.implausible, *([] if gross is None else [gross.reason])]

    @property
    def state(self) -> str:
        """State of the calibration: the first that applies of those below.

        `IMPLAUSIBLE` if no sensor has such parameters or the data look grossly wrong, `REJECTED` if
        the residuals refute the stated noise, `UNCHECKED` if nothing could have refuted it, else
        `ACCEPTED`.
        """
        test = self.fit.global_test
        if self.implausible or self.gross_error is not None:
            return IMPLAUSIBLE
        if test is not None and not test.accepted:
            return REJECTED
        return UNCHECKED if test is None or test.powerless else ACCEPTED


def tilt_left(fit: CampaignFit, max_tilt: float = MAX_TILT_GON * GON) -> TiltLeft:
    """Tilt error that a calibration leaves over tilts up to `max_tilt`, rad.

    The excess of the residuals over the stated noise is what the model does not describe. An effect
    of the sensor is in each reading that is leveled, as it was in the positions, and the
    uncertainty of the parameters does not contain it.
    """
    model, campaign, g = fit.model, fit.campaign, fit.gravity
    f_b = cap_forces(max_tilt, ATTITUDES, g)
    hold = holds_in_use(campaign.hold, campaign.n_positions, f_b)
    p = np.where(model.stays, fit.parameters, 0.0)
    in_use = model, p, model.sense(f_b, p, g, hold), f_b, g, hold
    slope = tilt_slope(*in_use) * model.stays

    def rms(columns: slice = slice(None), covariance: Array = fit.covariance) -> Array:
        part, block = slope[..., columns], covariance[columns, columns]
        return np.sqrt(np.einsum("kau,uw,kaw->a", part, block, part) / len(part))

    shares = {effect.name: rms(own) for effect, own in model.parts if effect.part == "sensor"}
    missing = np.zeros(2)
    if fit.sigma_known and not fit.trusts_sigma:
        excess = fit.sigma_position_posteriori**2 - campaign_noise(campaign).sigma_force ** 2
        by_output = np.mean(np.sum(tilt_by_output(*in_use) ** 2, axis=-1), axis=0)
        missing = np.sqrt(max(excess, 0.0) * by_output)
    by_reference = fit.by_reference
    reference = None if by_reference is None else rms(covariance=by_reference)
    return TiltLeft(shares, rms(), reference, missing)
