"""The diagnosis of a campaign, stage after stage: each takes what those before it found.

1. Gross errors are recognised by their size, and mended (`recognise`).
2. The base model is fitted (`fit_base`). Its residuals, and every effect, function and kind of
   noise that the model may lack, are the `Problem` (`pose`), whose properties are computed when a
   stage asks for them: the test for anything that is missing, the evidence for each explanation and
   for sets of up to three effects, the posterior.
3. The evidence is judged by rules, of which the first that matches decides (`decide`).
4. The effect is chosen and fitted again on a part of the positions, and the others confirm it, or
   do not (`confirm`).

Where the disagreement lives, what it is worth, and where to measure next, a `CampaignDiagnosis`
computes when it is asked.
"""

from __future__ import annotations

import numpy as np

from accelstudy.approaches import Approach
from accelstudy.campaign.calibration.fit import usual_approach
from accelstudy.campaign.gross_errors.recognition import recognise
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.problem import fit_base, pose
from accelstudy.diagnosis.decision.verdict import decide
from accelstudy.diagnosis.held_out import confirm
from accelstudy.diagnosis.result import CampaignDiagnosis
from accelstudy.sensors.sensor import SensorModel


def diagnose(
    campaign: Campaign,
    model: SensorModel,
    approach: Approach | None = None,
    seed: int = 1,
) -> CampaignDiagnosis:
    """Find whether, where and why a campaign disagrees with a sensor model.

    Parameters
    ----------
    campaign : Campaign
    model : SensorModel, in which something may be missing
    approach : Approach; by default robot-aided if the campaign has the robot's angles
    seed : int, of all that is simulated or drawn

    Raises
    ------
    InputError
        If the positions do not determine the model, or leave no redundancy to test anything.
    """
    approach = approach or usual_approach(campaign)
    recognised = recognise(campaign, approach.uses_angles)
    if recognised is not None:
        campaign = recognised.corrected
    # A stream for each, so that none changes what another one draws.
    null, split = (np.random.SeedSequence(seed, spawn_key=(key,)) for key in (0, 1))
    problem = pose(fit_base(campaign, model, approach), null)
    finding = decide(problem, campaign)
    confirmation = confirm(problem, finding, split)
    return CampaignDiagnosis(problem, campaign, finding, confirmation, recognised)
