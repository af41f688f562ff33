"""A calibrated campaign: its parameters with their sigmas, and how good they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from accelstudy.adjustment import quality
from accelstudy.adjustment.components import VarianceComponents, variance_components
from accelstudy.approaches import Approach
from accelstudy.basics.arrays import Array
from accelstudy.basics.levels import ACCEPTED, IMPLAUSIBLE, MAX_TILT_GON, REJECTED, UNCHECKED
from accelstudy.basics.shares import sigmas_95
from accelstudy.basics.units import GON
from accelstudy.campaign.gross_errors.recognition import Recognition, recognise
from accelstudy.campaign.session import Campaign
from accelstudy.leveling.angles import tilt_by_output, tilt_slope
from accelstudy.leveling.error import attitudes_in_use
from accelstudy.sensors.plausibility import implausible_parameters, implausible_tilt
from accelstudy.sensors.sensor import SensorModel

OUTLIER_LEVEL = 0.05
"""Family-wise level of the tests of single positions."""


@dataclass(frozen=True)
class TiltBudget:
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

    @property
    def limit(self) -> str:
        """Effect with the largest share; empty where there are no sigmas."""
        largest = {name: float(share.max()) for name, share in self.shares.items()}
        return max(largest, key=largest.__getitem__) if np.isfinite(self.total).all() else ""


@dataclass(frozen=True, eq=False)
class CampaignFit:
    """A calibrated campaign.

    Attributes
    ----------
    campaign : Campaign
    solution : Solution, of the adjustment
    judgement : NoiseJudgement, of another fit; by default the global test of this fit judges
    """

    campaign: Campaign
    solution: quality.Solution
    judgement: quality.NoiseJudgement | None = None

    @property
    def model(self) -> SensorModel:
        """Model that was fitted."""
        return self.solution.model

    @property
    def approach(self) -> Approach:
        """Approach by which it was fitted."""
        return self.solution.approach

    @property
    def parameters(self) -> Array:
        """Estimates of the model's parameters, (u,), SI."""
        return self.solution.parameters[: self.model.n_parameters]

    @property
    def global_test(self) -> quality.GlobalTest | None:
        """Test of the whole model; None where sigma is unknown or there is no redundancy."""
        return None if self.campaign.sigma_force is None else self.solution.global_test

    @cached_property
    def noise(self) -> quality.NoiseJudgement:
        """The noise that is quoted: that of another fit, or as the global test judges it."""
        return self.judgement or self.judge_noise(self.campaign.sigma_force is not None)

    def judge_noise(self, stated: bool) -> quality.NoiseJudgement:
        """Judge the noise that is stated, or else that of the residuals."""
        if self._unstated_noise is not None:
            return quality.NoiseJudgement(False, 1.0)
        return self.solution.judge_noise(stated)

    @property
    def _unstated_noise(self) -> quality.ForceNoise | None:
        """Noise of the forces by the residuals, where it is not stated beside angles; else None."""
        return self.solution.force_noise if self.campaign.sigma_force is None else None

    @property
    def dof(self) -> float:
        """Degrees of freedom of the noise that is quoted; infinite where it is known.

        Beside angles they are those of a parameter in which the forces have the largest share.
        """
        squares = self.solution.of_positions
        if self.noise.trusted:
            forces = self.solution.force_noise
            share = 1.0 if forces is None else forces.in_residuals / forces.in_parameters
            return (self.solution.sigma_dof + squares.redundancy) * share**2
        if (unstated := self._unstated_noise) is not None:
            return unstated.dof / unstated.in_parameters**2
        return squares.redundancy if squares.has_variance else self.solution.redundancy

    @property
    def is_noise_known(self) -> bool:
        """Whether the quoted noise is known, and no estimate."""
        return bool(np.isinf(self.dof))

    @property
    def sigma_position(self) -> float:
        """Noise of a position mean to quote, m/s²: as stated if trusted, else a posteriori."""
        return self.solution.sigma_force * float(np.sqrt(self.noise.variance))

    @property
    def sigma_position_posteriori(self) -> float:
        """Noise of a position mean from the residuals, m/s²; NaN without redundancy."""
        forces = self._unstated_noise
        if forces is None:
            return self.solution.sigma_posteriori
        return self.solution.sigma_force * float(np.sqrt(forces.variance))

    @property
    def covariance(self) -> Array:
        """Covariance matrix of the model's parameters to quote, (u, u), SI."""
        u = self.model.n_parameters
        return self.solution.covariance(self.noise)[:u, :u]

    @property
    def by_reference(self) -> Array | None:
        """Part of `covariance` that the calibration of a reference causes, (u, u), SI.

        It is what would be gone if that calibration had no errors: Σ_xc Σ_cc⁻¹ Σ_cx, with the
        errors c that all holds share. None where no reference was used.
        """
        common = self.solution.observed.common
        if common is None or not self.approach.uses_angles:
            return None
        sigma, u = self.solution.covariance(self.noise), self.model.n_parameters
        shared = slice(u, u + common.shape[-1])
        part = sigma[:u, shared] @ np.linalg.solve(sigma[shared, shared], sigma[shared, :u])
        return np.asarray(part)

    @property
    def sigma(self) -> Array:
        """Standard deviations of the parameters to quote, (u,), SI."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def sigmas_95(self) -> float:
        """Number of quoted sigmas on either side that hold 95 %; by Student's t of an estimate."""
        return sigmas_95(self.dof)

    @property
    def gravity(self) -> float:
        """Gravity, m/s²: the adjusted value if it was observed."""
        return self.solution.gravity

    @property
    def corrected(self) -> Array:
        """Calibrated specific forces of the holds, (n, 3), m/s²."""
        campaign = self.campaign
        return self.model.correct(campaign.forces, self.parameters, self.gravity, campaign.hold)

    @property
    def norm_residuals(self) -> Array:
        """|f_b| − g of the holds, (n,), m/s²."""
        return np.linalg.norm(self.corrected, axis=1) - self.gravity

    # --- How good it is

    @cached_property
    def tests(self) -> quality.PositionTests:
        """Tests of the positions."""
        return quality.position_tests(self.solution)

    @cached_property
    def reliability(self) -> quality.Reliability:
        """Reliability of the positions."""
        return quality.reliability(self.solution)

    @cached_property
    def suspects(self) -> dict[int, float]:
        """Adjusted p-values of the positions in conflict with the others, removed one at a time."""
        found = quality.suspects(
            self.model,
            self.approach,
            self.solution.observed,
            alpha=OUTLIER_LEVEL,
            sigma_known=self.noise.trusted,
        )
        return {int(self.campaign.positions[one.position]): one.p_value for one in found}

    @cached_property
    def held_out(self) -> quality.HeldOutErrors | None:
        """Prediction of each position from the others; None where those do not determine it."""
        return quality.held_out(self.solution)

    @cached_property
    def components(self) -> VarianceComponents | None:
        """Variance components of accelerometer and robot; None without a robot."""
        if self.campaign.sigma_force is None:
            return None
        return variance_components(self.model, self.approach, self.solution.observed)

    @cached_property
    def tilt(self) -> TiltBudget:
        """The tilt error that is left over usual tilts."""
        return self.tilt_budget()

    @cached_property
    def implausible(self) -> tuple[str, ...]:
        """Parameters and tilt errors that no sensor has."""
        parameters = implausible_parameters(self.model.effects, self.parameters, self.sigma)
        return *parameters, *implausible_tilt(*self.tilt.total)

    @cached_property
    def gross_error(self) -> Recognition | None:
        """A gross error in the campaign; one of the angles shows even where they are not used."""
        return recognise(self.campaign)

    @property
    def p_adjusted(self) -> Array:
        """P-values of the positions, (n,), adjusted for their number.

        That of a suspect is from the round in which it was found, without the worse ones before it.
        """
        p_values = self.tests.p_adjusted(self.noise.trusted)
        for position, p_value in self.suspects.items():
            p_values[self.campaign.positions == position] = p_value
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
        test = self.global_test
        if self.implausible or self.gross_error is not None:
            return IMPLAUSIBLE
        if test is not None and not test.accepted:
            return REJECTED
        return UNCHECKED if test is None or test.powerless else ACCEPTED

    def tilt_budget(self, max_tilt: float = MAX_TILT_GON * GON) -> TiltBudget:
        """Tilt error that a calibration leaves over tilts up to `max_tilt`, rad.

        The excess of the residuals over the stated noise is what the model does not describe. An
        effect of the sensor is in each reading that is leveled, as it was in the positions, and the
        uncertainty of the parameters does not contain it.
        """
        model, g = self.model, self.gravity
        f_b, hold = attitudes_in_use(self.campaign.hold, g, max_tilt)
        p = np.where(model.stays, self.parameters, 0.0)
        in_use = model, p, model.sense(f_b, p, g, hold), f_b, g, hold
        slope, quoted = tilt_slope(*in_use) * model.stays, self.covariance

        def rms(columns: slice = slice(None), covariance: Array = quoted) -> Array:
            part, block = slope[..., columns], covariance[columns, columns]
            return np.sqrt(np.einsum("kau,uw,kaw->a", part, block, part) / len(part))

        shares = {effect.name: rms(own) for effect, own in model.parts if effect.part == "sensor"}
        missing = np.zeros(2)
        stated = self.campaign.sigma_force
        if stated is not None and not self.noise.trusted:
            excess = self.sigma_position**2 - stated**2
            by_output = np.mean(np.sum(tilt_by_output(*in_use) ** 2, axis=-1), axis=0)
            missing = np.sqrt(max(excess, 0.0) * by_output)
        part = self.by_reference
        reference = None if part is None else rms(covariance=part)
        return TiltBudget(shares, rms(), reference, missing)
