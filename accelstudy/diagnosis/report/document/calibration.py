"""The calibration with the model that a diagnosis found: the content of `calibration.json`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from accelstudy.adjustment import calibrate
from accelstudy.campaign.calibration.assessment import assess
from accelstudy.campaign.calibration.document import calibration_document, quality_document
from accelstudy.campaign.calibration.fit import CampaignFit, JudgedNoise, campaign_estimability
from accelstudy.diagnosis.report.words.missing import explanation_words, missing
from accelstudy.diagnosis.report.words.summary import keep_base
from accelstudy.diagnosis.result import Diagnosis


def diagnosed_fit(diagnosis: Diagnosis) -> CampaignFit:
    """Return the final fit of a diagnosis as a calibration.

    It is that of the extended model, without positions that were found to be bumped, of data in
    which a recognised gross error is mended, and with the noise that the diagnosis takes.
    """
    d = diagnosis
    bumped = d.campaign.positions[~d.kept].tolist()
    campaign = d.campaign.without(dict.fromkeys(bumped, "bumped, as the diagnosis found"))
    solution = d.final.frame.solution
    start = solution.parameters[: d.extended.n_parameters]
    observed = replace(solution.observed, initial=start)
    return CampaignFit(
        campaign=campaign,
        model=d.extended,
        approach=d.approach,
        observed=observed,
        adjustment=calibrate(d.extended, d.approach, observed),
        estimability=campaign_estimability(campaign, d.extended, d.approach),
        judged=JudgedNoise(d.sigma_holds, d.unit_variance),
    )


def diagnosed_calibration(diagnosis: Diagnosis) -> dict[str, Any]:
    """Describe the final fit of a diagnosis, as `calibrate` describes its own.

    What was mended stands in `mended`; its matrix turns forces as they are read into those that
    were fitted.

    Raises
    ------
    InputError
        If the fit cannot be assessed.
    """
    fit = diagnosed_fit(diagnosis)
    content = {**calibration_document(fit), "quality": quality_document(assess(fit))}
    warnings = list(fit.campaign.warnings)
    if diagnosis.verdict == "narrowed":
        warnings.append(
            f"What is missing is {missing(diagnosis.credible_set)}. The calibration "
            f"takes {explanation_words(diagnosis.credible_set[0])}, and its sigmas do not know of "
            "the others."
        )
    warnings += keep_base(diagnosis)
    weights = np.asarray(fit.observed.sigma_force)
    if weights.ndim:
        sigmas = np.sqrt(fit.variance_factor) * weights[0]
        content["sigma_position_axes_mps2"] = sigmas.tolist()
        x, y, z = (f"{1e3 * sigma:.3g}" for sigma in sigmas)
        warnings.append(
            f"The axes are weighted by their noise, {x}, {y} and {z} mm/s² in x, y and z; "
            "`accelstudy calibrate` takes them as equal, and differs by that."
        )
    if (found := diagnosis.recognised) is not None:
        warning = f"The calibration is of mended data: {found.reason}."
        if found.matrix is not None:
            warning += " Readings need the same mending; `accelstudy apply` and `export` do it."
        warnings.append(warning)
        content["mended"] = {
            "error": found.name,
            "reason": found.reason,
            "matrix": None if found.matrix is None else found.matrix.tolist(),
        }
    return {**content, "warnings": warnings}
