"""A calibration in words: how good it is, what limits it, and what to do next."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from accelstudy.basics import suggestions
from accelstudy.basics.levels import ACCEPTED, BLIND, IMPLAUSIBLE, MAX_TILT_GON, REJECTED
from accelstudy.basics.units import GON, display_unit
from accelstudy.basics.wording import estimate
from accelstudy.campaign.calibration.campaign_fit import CampaignFit
from accelstudy.campaign.importing.noise import steps_text
from accelstudy.pages import render_lines
from accelstudy.sensors.plausibility import USUAL_CAUSE

TEMPLATE = "campaign/calibration/wording.txt.j2"
ANGLES = {"nonorthogonality", "cross_axis_misalignment"}
"""Effects of which a model needs one, or it takes the axes to be at right angles."""


def parameter_lines(content: Mapping[str, Any]) -> list[str]:
    """Return each parameter of calibration.json with its sigma, in the units that people read."""
    shown = []
    for entry in content["parameters"]:
        value, sigma = estimate(entry["value"], entry["sigma"], entry["unit"])
        shown.append(f"{entry['name']:>9} = {value:>12} ± {sigma} {display_unit(entry['unit'])}")
    return shown


def verdict_lines(fit: CampaignFit) -> list[str]:
    """Say how good the calibration is, for what, and what limits it; the verdict comes first."""
    state, shares = fit.state, fit.tilt.shares
    steps = fit.campaign.header.resolution_mps2
    says_tilt = state != IMPLAUSIBLE and np.isfinite(fit.tilt.total).all()
    suspects = dict(sorted(fit.suspects.items()))
    return render_lines(
        TEMPLATE,
        "verdict",
        fit=fit,
        suspects=suspects,
        limit=max(shares, key=lambda name: float(shares[name].max())) if says_tilt else "",
        max_tilt=MAX_TILT_GON * GON,
        usual_cause=USUAL_CAUSE,
        diagnose=state in (REJECTED, IMPLAUSIBLE) or (state != ACCEPTED and bool(suspects)),
        resolution="" if steps is None else steps_text(np.array(steps)),
        right_angles=state != REJECTED
        and not ANGLES & {effect.name for effect in fit.model.effects},
        blind="" if fit.approach.uses_angles else BLIND,
    )


def approach_words(fit: CampaignFit) -> str:
    """Say what the positions were held against."""
    campaign = fit.campaign
    has = campaign.angles is not None, campaign.header.reference is not None
    return render_lines(TEMPLATE, "approach", fit.approach.name, fit.approach.uses_angles, *has)[0]


def interval_words(fit: CampaignFit) -> str:
    """Say what the sigmas are, and how many of them hold 95 %."""
    return render_lines(TEMPLATE, "sigmas", fit)[0]


def what_a_check_finds(fit: CampaignFit) -> str:
    """Say what `check_sigmas` can find, and what it cannot."""
    return render_lines(TEMPLATE, "finds", fit)[0]


def next_steps(fit: CampaignFit, campaign: Path, result: Path) -> list[tuple[str, str]]:
    """Say what to do next, most urgent first.

    Parameters
    ----------
    fit : CampaignFit
    campaign : path of the campaign's folder
    result : path of calibration.json

    Returns
    -------
    list of (purpose, command)
    """
    chosen = fit.model.name, fit.approach.name, fit.campaign.prior
    diagnose = suggestions.diagnose(campaign, *chosen)
    if fit.state in (REJECTED, IMPLAUSIBLE):
        return [("Find what is wrong or missing", diagnose)]
    return [
        ("Level a log with this calibration", suggestions.apply(result)),
        ("See whether the residuals have a pattern that the model lacks", diagnose),
    ]
