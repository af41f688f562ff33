"""How far a calibration can be trusted, for a person and for a program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.adjustment import quality
from accelstudy.adjustment.quality import VarianceComponents, variance_components
from accelstudy.campaign.document import number
from accelstudy.campaign.fit import ALPHA, CampaignFit
from accelstudy.leveling import jacobian
from accelstudy.leveling_error import cap_forces
from accelstudy.units import GON, MGON

Array = NDArray[np.float64]

MAX_TILT_GON = 50.0
"""Range of tilts for which the accuracy of leveling is stated."""

BLIND = (
    "Gravity alone cannot see a rotation of the sensor in its housing: tilts are relative to the "
    "sensor's own axes."
)
"""What holds for every calibration without a robot."""


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
    tilt : (2,) array, rad, tilt error that the uncertainty of all parameters leaves, rms
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
    tilt: Array


def assess(fit: CampaignFit) -> Assessment:
    """Assess a calibrated campaign."""
    session = (fit.model, fit.approach, fit.observed)
    solution = quality.solve(*session, fit.adjustment)
    shares = tilt_shares(fit)
    return Assessment(
        fit=fit,
        solution=solution,
        redundancy=quality.redundancy_numbers(solution),
        tests=quality.position_tests(solution),
        reliability=quality.reliability(solution),
        suspects=quality.suspects(*session, alpha=ALPHA, sigma_known=fit.trusts_sigma),
        held_out=quality.held_out(*session),
        components=variance_components(*session) if fit.sigma_known else None,
        tilt_shares=shares,
        tilt=shares.pop("all"),
    )


def tilt_shares(fit: CampaignFit) -> dict[str, Array]:
    """Tilt error from the uncertainty of each effect's parameters, and of "all", (2,), rad.

    Rms of roll and of pitch over tilts up to `MAX_TILT_GON`, without the noise of a reading.
    """
    f_b = cap_forces(MAX_TILT_GON * GON, 200, fit.gravity)
    output = fit.model.sense(f_b, fit.parameters, fit.gravity)
    slope = jacobian(f_b) @ fit.model.correction_jacobian(output, fit.parameters, fit.gravity)
    covariance = fit.covariance

    def rms(columns: slice) -> Array:
        part, block = slope[..., columns], covariance[columns, columns]
        return np.sqrt(np.einsum("kau,uw,kaw->a", part, block, part) / len(f_b))

    shares, first = {"all": rms(slice(None))}, 0
    for effect in fit.model.effects:
        last = first + len(effect.parameters)
        shares[effect.name] = rms(slice(first, last))
        first = last
    return shares


def verdict(assessment: Assessment) -> str:
    """Say in plain words whether the calibration is good, for what, and what limits it."""
    fit = assessment.fit
    roll, pitch = assessment.tilt / MGON
    words = [_consistency(fit)]
    if assessment.suspects:
        named = ", ".join(str(fit.campaign.positions[s.position]) for s in assessment.suspects)
        words.append(f"In conflict with the others, to be checked or repeated: position {named}.")
    if np.isfinite([roll, pitch]).all():
        shares = assessment.tilt_shares
        limit = max(shares, key=lambda name: float(shares[name].max())).replace("_", " ")
        words.append(
            f"It leaves a tilt error of {roll:.1f} mgon in roll and {pitch:.1f} mgon in pitch "
            f"(rms up to {MAX_TILT_GON:.0f} gon of tilt, noise of a reading apart), limited by the "
            f"uncertainty of {limit}."
        )
    if not fit.approach.uses_angles:
        words.append(BLIND)
    return " ".join(words)


def _consistency(fit: CampaignFit) -> str:
    r, test = fit.adjustment.redundancy, fit.global_test
    if r == 0:
        return "There is no redundancy: the positions determine the model and nothing checks it."
    if test is None:
        return (
            "The noise of a position is estimated from the residuals, "
            f"{1e3 * fit.sigma_position:.2f} mm/s² with r = {r}; without an a-priori sigma nothing "
            "says whether the model is complete."
        )
    if test.remark:
        return f"With r = {r} the test of the model has next to no power."
    ratio = float(np.sqrt(test.statistic / test.dof))
    if test.accepted:
        return (
            f"The residuals agree with the stated noise (σ̂0 = {ratio:.2f}, p = {test.p_value:.2g})."
        )
    if ratio > 1:
        return (
            f"The residuals are {ratio:.1f} times as large as the stated noise allows "
            f"(p = {test.p_value:.1g}): it is understated, or an effect is missing. Sigmas are "
            "those of the residuals."
        )
    return (
        f"The residuals are only {ratio:.2f} times the stated noise (p = {test.p_value:.1g}): "
        "it is overstated. Sigmas are those of the residuals."
    )


def positions_table(assessment: Assessment) -> pd.DataFrame:
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


def quality_document(assessment: Assessment) -> dict[str, Any]:
    """Quality in plain data, for `calibration.json`."""
    held, test = assessment.held_out, assessment.fit.global_test
    components = assessment.components
    angles = None if held is None else held.rms_angles
    return {
        "verdict": verdict(assessment),
        "global_test": None
        if test is None
        else {
            "statistic": test.statistic,
            "dof": test.dof,
            "p_value": test.p_value,
            "accepted": test.accepted,
            "remark": test.remark,
        },
        "suspects": [
            {"position": int(assessment.fit.campaign.positions[s.position]), "p_value": s.p_value}
            for s in assessment.suspects
        ],
        "held_out": None
        if held is None
        else {
            "n_predicted": held.n_predicted,
            "rms_mps2": held.rms,
            "rms_roll_mgon": None if angles is None else float(angles[0] / MGON),
            "rms_pitch_mgon": None if angles is None else float(angles[1] / MGON),
        },
        "variance_components": None
        if components is None
        else {
            "accelerometer": float(components.factors[0]),
            "robot": float(components.factors[1]),
            "sigma": components.sigma.tolist(),
            "converged": components.converged,
        },
        "tilt_rms_mgon": {
            "roll": number(assessment.tilt[0] / MGON),
            "pitch": number(assessment.tilt[1] / MGON),
            "max_tilt_gon": MAX_TILT_GON,
        },
    }
