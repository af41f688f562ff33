"""What is said of a calibration: one of four states, in plain words, and what to do next."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from accelstudy.basics import suggested
from accelstudy.basics.units import GON, attitude_unit, display_unit, to_attitude, to_display
from accelstudy.basics.wording import comma_list, p_value, words
from accelstudy.campaign.calibration.assessment import Assessment
from accelstudy.campaign.calibration.fit import CampaignFit
from accelstudy.campaign.calibration.states import (
    ACCEPTED,
    BLIND,
    IMPLAUSIBLE,
    REJECTED,
    UNCHECKED,
)
from accelstudy.leveling.error import MAX_TILT_GON
from accelstudy.sensors.plausibility import implausible_parameters, implausible_tilt


def state(assessment: Assessment) -> str:
    """Say in a word what becomes of a calibration; the first that holds.

    `IMPLAUSIBLE` if no sensor has such parameters or the data look grossly wrong, `REJECTED` if
    the residuals refute the stated noise, `UNCHECKED` if nothing could have refuted it, else
    `ACCEPTED`.
    """
    test = assessment.fit.global_test
    if warnings(assessment):
        return IMPLAUSIBLE
    if test is not None and not test.accepted:
        return REJECTED
    return UNCHECKED if test is None or test.powerless else ACCEPTED


def warnings(assessment: Assessment) -> list[str]:
    """Say what of a calibration can only be a gross error; nothing of a plausible one."""
    fit = assessment.fit
    said = implausible_parameters(fit.model.effects, fit.parameters, fit.sigma)
    said += implausible_tilt(*assessment.tilt)
    if assessment.gross_error is not None:
        said.append(assessment.gross_error.reason)
    return said


def verdict_lines(assessment: Assessment) -> list[str]:
    """Say whether the calibration is good, for what, and what limits it; the first comes first."""
    fit = assessment.fit
    lines = [*_implausible(assessment), *_consistency(fit)]
    lines += _conflict(assessment)
    judged = state(assessment)
    if judged != IMPLAUSIBLE and np.isfinite(assessment.tilt).all():
        lines.append(_tilt(assessment))
    if judged in (REJECTED, IMPLAUSIBLE) or assessment.suspects:
        lines.append("What is wrong or missing, “accelstudy diagnose” may tell.")
    if not fit.approach.uses_angles:
        lines.append(BLIND)
    return lines


def next_steps(
    fit: CampaignFit,
    judged: str,
    campaign: str | Path = "CAMPAIGN",
    result: str | Path = "calibration.json",
) -> list[tuple[str, str]]:
    """Say what to do next, most urgent first: what for, and the command.

    Parameters
    ----------
    fit : CampaignFit
    judged : str, its state
    campaign : path of the campaign's folder
    result : path of calibration.json
    """
    diagnose = suggested.diagnose(campaign, fit.model.name, fit.approach.name, fit.campaign.name)
    if judged in (REJECTED, IMPLAUSIBLE):
        return [("Find what is wrong or missing", diagnose)]
    return [
        ("Level a log with this calibration", suggested.apply(result)),
        ("See whether the residuals have a pattern that the model lacks", diagnose),
    ]


def _implausible(assessment: Assessment) -> list[str]:
    said = warnings(assessment)
    if not said:
        return []
    found, gross = said, assessment.gross_error
    lines = []
    if gross is not None:
        found = said[:-1]
        what = words(gross.name)
        lines.append(f"This looks like a gross error ({what}): {gross.reason}.")
    if found:
        cause = "" if gross is not None else " A wrong unit, sign, axis or row is the usual cause."
        lines.append(f"No sensor is like this: {comma_list(found)}.{cause}")
    return lines


def _conflict(assessment: Assessment) -> list[str]:
    """Name the positions that the others do not bear, which need not be the fault of the holds."""
    found = sorted(assessment.suspects, key=lambda suspect: suspect.position)
    if not found:
        return []
    labels = [str(assessment.fit.campaign.positions[suspect.position]) for suspect in found]
    p = p_value(max(suspect.p_value for suspect in found))
    if len(found) == 1:
        return [
            f"In conflict with the others: position {labels[0]} ({p}, all positions counted). It "
            "may be bumped, or show what the model lacks."
        ]
    least = p if "<" in p else f"{p} or less"
    return [
        f"In conflict with the others: positions {comma_list(labels)} (each with {least}, all "
        "positions counted). They may be bumped, or show what the model lacks."
    ]


def _tilt(assessment: Assessment) -> str:
    shares = assessment.tilt_shares
    limit = words(max(shares, key=lambda name: float(shares[name].max())))
    most, unit = to_attitude(MAX_TILT_GON * GON), display_unit("rad")
    where = f"rms up to {most:.0f} {attitude_unit()} of tilt, noise of a reading apart"
    alone, whole = (
        f"{roll:.1f} {unit} in roll and {pitch:.1f} {unit} in pitch"
        for roll, pitch in (
            to_display(tilt, "rad") for tilt in (assessment.tilt_parameters, assessment.tilt)
        )
    )
    if alone == whole:
        return (
            f"The calibration leaves a tilt error of {alone} ({where}), limited by the uncertainty "
            f"of {limit}."
        )
    return (
        f"The calibration leaves a tilt error of {whole} ({where}) if what the residuals have too "
        "much is an effect that the model lacks, since readings in use have it as well. The "
        f"uncertainty of the parameters alone would leave {alone}."
    )


def _consistency(fit: CampaignFit) -> list[str]:
    r, test = fit.adjustment.redundancy, fit.global_test
    if r == 0:
        return ["There is no redundancy: the positions determine the model and nothing checks it."]
    if test is None:
        return [
            "The noise of a position is not stated, so nothing says whether the model is complete.",
            f"From the residuals it is {1e3 * fit.sigma_position:.2f} mm/s² with r = {r}.",
        ]
    if test.accepted and test.powerless:
        return [f"With r = {r} the test of the model has next to no power."]
    ratio = float(np.sqrt(test.statistic / test.dof))
    p = p_value(test.p_value)
    if test.accepted:
        return [f"The residuals agree with the stated noise (σ̂0 = {ratio:.2f}, {p})."]
    if ratio > 1:
        return [
            f"The residuals are {ratio:.1f} times as large as the stated noise allows "
            f"({p}): it is understated, or an effect is missing.",
            "Sigmas are those of the residuals.",
        ]
    return [
        f"The residuals are only {ratio:.2g} times the stated noise ({p}): it is overstated.",
        "Sigmas are those of the residuals.",
    ]
