"""A calibration in words: how good it is, what limits it, and what to do next.

The sentences stand in `wording.txt.j2`, which takes names of this module from `w`.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from accelstudy.basics import suggestions
from accelstudy.basics.levels import BLIND, IMPLAUSIBLE, MAX_TILT_GON, REJECTED  # noqa: F401
from accelstudy.basics.units import GON, display_unit
from accelstudy.basics.wording import estimate
from accelstudy.campaign.calibration.campaign_fit import CampaignFit
from accelstudy.campaign.importing.noise import steps_text  # noqa: F401
from accelstudy.pages import render_lines
from accelstudy.sensors.plausibility import USUAL_CAUSE  # noqa: F401

HERE = sys.modules[__name__]
TEMPLATE = "campaign/calibration/wording.txt.j2"
MAX_TILT = MAX_TILT_GON * GON
ANGLES = {"nonorthogonality", "cross_axis_misalignment"}
"""Effects of which a model needs one, or it takes the axes to be at right angles."""


def parameter_lines(content: Mapping[str, Any]) -> list[str]:
    """Return each parameter of calibration.json with its sigma, in the units that people read."""
    shown = []
    for entry in content["parameters"]:
        value, sigma = estimate(entry["value"], entry["sigma"], entry["unit"])
        shown.append(f"{entry['name']:>9} = {value:>12} ± {sigma} {display_unit(entry['unit'])}")
    return shown


def sentences(fit: CampaignFit, part: str = "verdict") -> list[str]:
    """Return the sentences of one part of what is said of a calibration.

    Parameters
    ----------
    fit : CampaignFit
    part : macro of the template: the "verdict", how good it is, for what, and what limits it; the
        "approach", what its positions were held against; "sigmas", what these are; or "finds", what
        `check_sigmas` can find, and what it cannot
    """
    return render_lines(TEMPLATE, part, fit, HERE)


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
