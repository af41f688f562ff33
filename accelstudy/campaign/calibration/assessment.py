"""How far a calibration can be trusted, for a person and for a program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.adjustment import quality
from accelstudy.adjustment.quality import VarianceComponents, variance_components
from accelstudy.approaches import get_approach
from accelstudy.basics.units import GON, MGON
from accelstudy.campaign.calibration.fit import CampaignFit, campaign_noise
from accelstudy.campaign.gross_errors.recognition import Recognised, recognise
from accelstudy.leveling.angles import jacobian, tilt_slope
from accelstudy.leveling.error import ATTITUDES, MAX_TILT_GON, cap_forces, holds_in_use

Array = NDArray[np.float64]

SUSPECT = 0.05
"""Family-wise level of the tests of single positions."""


@dataclass(frozen=True)
class Assessment:
    """Quality of a calibrated campaign.

    Attributes
    ----------
    fit : CampaignFit
    solution : linearisation at the solution
    redundancy, tests, reliability : of the positions
    suspects : positions in conflict with the others, removed one at a time
    held_out : None where the others do not determine the model
    components : variance components of accelerometer and robot; None without a robot
    tilt_shares : group of parameters (effect) -> its tilt error (2,) alone, rms roll and pitch, rad
    tilt_parameters : (2,) array, rad, tilt error that the uncertainty of all parameters leaves, rms
    tilt_missing : (2,) array, rad, tilt error of a reading that is as wrong as the residuals say
        beyond the stated noise, rms; 0 where they do not refute it
    gross_error : Recognised or None, of what the campaign holds, the robot's angles included
    """

    fit: CampaignFit
    solution: quality.Solution
    redundancy: quality.Redundancy
    tests: quality.PositionTests
    reliability: quality.Reliability
    suspects: tuple[quality.Suspect, ...]
    held_out: quality.HeldOut | None
    components: VarianceComponents | None
    tilt_shares: Mapping[str, Array]
    tilt_parameters: Array
    tilt_missing: Array
    gross_error: Recognised | None

    @property
    def tilt(self) -> Array:
        """Tilt error that is left, rms, rad, (2,): of parameters, and of what the model lacks."""
        return np.hypot(self.tilt_parameters, self.tilt_missing)


def assess(fit: CampaignFit) -> Assessment:
    """Assess a calibrated campaign."""
    session = (fit.model, fit.approach, fit.observed)
    solution = quality.solve(*session, fit.adjustment)
    shares = tilt_shares(fit)
    sees = get_approach("gravity" if fit.campaign.angles is None else "robot")
    return Assessment(
        fit=fit,
        solution=solution,
        redundancy=quality.redundancy_numbers(solution),
        tests=quality.position_tests(solution),
        reliability=quality.reliability(solution),
        suspects=quality.suspects(*session, alpha=SUSPECT, sigma_known=fit.trusts_sigma),
        held_out=quality.held_out(*session),
        components=variance_components(*session) if fit.sigma_known else None,
        tilt_shares=shares,
        tilt_parameters=shares.pop("all"),
        tilt_missing=tilt_missing(fit),
        gross_error=recognise(fit.campaign, sees),
    )


def tilt_missing(fit: CampaignFit) -> Array:
    """Tilt error of a reading that is wrong by the excess of the residuals, (2,), rad.

    Residuals beyond the stated noise are what the model does not describe. An effect of the sensor
    is in each reading that is leveled, as it was in the positions; the uncertainty of the
    parameters does not contain it.
    """
    if not fit.sigma_known or fit.trusts_sigma:
        return np.zeros(2)
    excess = fit.sigma_position_posteriori**2 - campaign_noise(fit.campaign).sigma_force ** 2
    slope = jacobian(cap_forces(MAX_TILT_GON * GON, ATTITUDES, fit.gravity))
    return np.sqrt(max(excess, 0.0) * np.mean(np.sum(slope**2, axis=-1), axis=0))


def tilt_shares(fit: CampaignFit) -> dict[str, Array]:
    """Tilt error from the uncertainty of each effect's parameters, and of "all", (2,), rad.

    Rms of roll and of pitch over tilts up to `MAX_TILT_GON`, at the temperatures and times of the
    campaign where effects depend on them, without the noise of a reading. Effects of the rig, which
    the sensor has left, have no share.
    """
    model, campaign, g = fit.model, fit.campaign, fit.gravity
    f_b = cap_forces(MAX_TILT_GON * GON, ATTITUDES, g)
    hold = holds_in_use(campaign.hold, campaign.n_positions, f_b)
    p = np.where(model.stays, fit.parameters, 0.0)
    output = model.sense(f_b, p, g, hold)
    slope = tilt_slope(model, p, output, f_b, g, hold) * model.stays
    covariance = fit.covariance

    def rms(columns: slice) -> Array:
        part, block = slope[..., columns], covariance[columns, columns]
        return np.sqrt(np.einsum("kau,uw,kaw->a", part, block, part) / len(f_b))

    shares, first = {"all": rms(slice(None))}, 0
    for effect in model.effects:
        last = first + len(effect.parameters)
        if effect.part == "sensor":
            shares[effect.name] = rms(slice(first, last))
        first = last
    return shares


def assessed_positions(assessment: Assessment) -> pd.DataFrame:
    """One row per position: residuals, tests and reliability, in the units that the names say."""
    fit, tests, reliability = assessment.fit, assessment.tests, assessment.reliability
    scale = np.sqrt(fit.variance_factor)  # reliability is in terms of the a-priori noise
    table = pd.DataFrame(
        {
            "position": fit.campaign.positions,
            "norm_residual_mps2": fit.norm_residuals,
            "redundancy": assessment.redundancy.positions,
            "statistic": tests.statistic,
            "dof": tests.dof,
            "p_value": tests.p_known if fit.trusts_sigma else tests.p_unknown,
            "p_value_adjusted": tests.p_adjusted(fit.trusts_sigma),
            "tau": tests.tau,
            "mdb_mps2": scale * reliability.mdb[:, -1],
            "external_roll_mgon": scale * reliability.leveling[:, 0] / MGON,
            "external_pitch_mgon": scale * reliability.leveling[:, 1] / MGON,
        }
    )
    residuals = assessment.solution.residuals
    for i, name in enumerate(("fx", "fy", "fz")):
        table[f"v_{name}_mps2"] = residuals[:, i]
    if fit.approach.uses_angles:
        for i, name in enumerate(("roll", "pitch")):
            table[f"v_{name}_mgon"] = residuals[:, 3 + i] / MGON
    if assessment.held_out is not None:
        table["held_out_mps2"] = np.linalg.norm(assessment.held_out.misclosures, axis=1)
    found = {s.position for s in assessment.suspects}
    table["suspect"] = [i in found for i in range(len(table))]
    return table
