"""A calibration in words: how good it is, what limits it, and what to do next."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from accelstudy.basics import suggested
from accelstudy.basics.levels import BLIND, IMPLAUSIBLE, REJECTED
from accelstudy.basics.units import GON, attitude_unit, display_unit, to_attitude, to_display
from accelstudy.basics.wording import comma_list, p_value, words
from accelstudy.campaign.calibration.assessment import Assessment
from accelstudy.campaign.calibration.fit import CampaignFit
from accelstudy.leveling.error import MAX_TILT_GON
from accelstudy.sensors.plausibility import USUAL_CAUSE


def verdict_lines(assessment: Assessment) -> list[str]:
    """Say how good the calibration is, for what, and what limits it; the verdict comes first."""
    fit, state = assessment.fit, assessment.state
    lines = [*_implausible(assessment), *_consistency(fit), *_conflict(assessment)]
    if state != IMPLAUSIBLE and np.isfinite(assessment.tilt).all():
        lines.append(_tilt(assessment))
    if state in (REJECTED, IMPLAUSIBLE) or assessment.suspects:
        lines.append("“accelstudy diagnose” looks for what is wrong or missing.")
    if not fit.approach.uses_angles:
        lines.append(BLIND)
    return lines


def interval_words(fit: CampaignFit) -> str:
    """Say what the sigmas are, and how many of them hold 95 %."""
    many = f"{fit.sigmas_95:.2f} of them hold 95 %"
    if fit.trusts_sigma:
        return f"sigmas of the stated noise; {many}"
    r = fit.adjustment.redundancy
    return f"sigmas of the noise in the residuals; {many} (Student's t, r = {r})"


def next_steps(
    fit: CampaignFit,
    state: str,
    campaign: str | Path,
    result: str | Path,
) -> list[tuple[str, str]]:
    """Say what to do next, most urgent first.

    Parameters
    ----------
    fit : CampaignFit
    state : str, of the calibration
    campaign : path of the campaign's folder
    result : path of calibration.json

    Returns
    -------
    list of (purpose, command)
    """
    diagnose = suggested.diagnose(campaign, fit.model.name, fit.approach.name)
    if state in (REJECTED, IMPLAUSIBLE):
        return [("Find what is wrong or missing", diagnose)]
    return [
        ("Level a log with this calibration", suggested.apply(result)),
        ("See whether the residuals have a pattern that the model lacks", diagnose),
    ]


def _implausible(assessment: Assessment) -> list[str]:
    """Name the gross error and the parameters that no sensor has."""
    lines = []
    gross, implausible = assessment.gross_error, assessment.implausible
    if gross is not None:
        lines.append(f"This looks like a gross error ({words(gross.name)}): {gross.reason}.")
    if implausible:
        cause = "" if gross is not None else f" {USUAL_CAUSE}"
        lines.append(f"No sensor is like this: {comma_list(implausible)}.{cause}")
    return lines


def _conflict(assessment: Assessment) -> list[str]:
    """Name the positions that contradict the others; their holds need not be at fault."""
    suspects = sorted(assessment.suspects, key=lambda suspect: suspect.position)
    if not suspects:
        return []
    labels = [str(assessment.fit.campaign.positions[suspect.position]) for suspect in suspects]
    p = p_value(max(suspect.p_value for suspect in suspects))
    if len(suspects) == 1:
        return [
            f"In conflict with the others: position {labels[0]} ({p}, adjusted for the number of "
            "positions). The sensor may have been bumped there, or the model lacks an effect."
        ]
    return [
        f"In conflict with the others: positions {comma_list(labels)} (the largest {p}, adjusted "
        "for the number of positions). The sensor may have been bumped there, or the model lacks "
        "an effect."
    ]


def _tilt(assessment: Assessment) -> str:
    """Say which tilt error is left, and what it comes from."""
    shares = assessment.tilt_shares
    limit = words(max(shares, key=lambda name: float(shares[name].max())))
    most, unit = to_attitude(MAX_TILT_GON * GON), display_unit("rad")
    where = f"rms over tilts up to {most:.0f} {attitude_unit()}, without the noise of a reading"
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
        f"The calibration leaves a tilt error of {whole} ({where}) if an effect that the model "
        "lacks makes the residuals so large: readings in use have that effect, too. The "
        f"uncertainty of the parameters alone leaves {alone}."
    )


def _consistency(fit: CampaignFit) -> list[str]:
    """Say whether the residuals agree with the stated noise."""
    r, test = fit.adjustment.redundancy, fit.global_test
    if r == 0:
        return ["There is no redundancy: the positions determine the model and nothing checks it."]
    if test is None:
        return [
            "The noise of a position is not stated, so nothing says whether the model is complete.",
            f"Estimated from the residuals it is {1e3 * fit.sigma_position:.2f} mm/s² (r = {r}).",
        ]
    if test.accepted and test.powerless:
        return [f"With r = {r} the test of the model has next to no power."]
    ratio = float(np.sqrt(test.statistic / test.dof))
    p = p_value(test.p_value)
    if test.accepted:
        return [f"The residuals agree with the stated noise (σ̂0 = {ratio:.2f}, {p})."]
    if ratio > 1:
        return [
            f"The residuals are {ratio:.1f} times as large as the stated noise allows ({p}): the "
            "noise is understated, or an effect is missing.",
            "The sigmas are taken from the residuals.",
        ]
    return [
        f"The residuals are only {ratio:.2g} times the stated noise ({p}): it is overstated.",
        "The sigmas are taken from the residuals.",
    ]
