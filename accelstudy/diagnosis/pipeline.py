"""The diagnosis of a campaign in four stages, each of which uses the results of the earlier ones.

1. `recognise`: gross errors are recognised by their size, and corrected.
2. `fit_base` fits the base model. `pose` makes a `Problem` of its residuals and of every effect,
   function and kind of noise that the model may lack. Its properties are computed on demand: the
   test whether anything is missing, the evidence for each explanation and for sets of up to three
   effects, the posterior.
3. `decide`: rules judge the evidence, and the first rule that matches gives the finding.
4. `confirm`: the effect is chosen and fitted again without a part of the positions, and its
   prediction of these held-out positions confirms it or does not.

The `CampaignDiagnosis` computes on demand where the misfit is, what it means for the tilt error,
and where to measure next.
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
    """Diagnose whether, where and why a campaign contradicts a sensor model.

    Parameters
    ----------
    campaign : Campaign
        Positions and what is known of their noise.
    model : SensorModel
        The base model, which may lack an effect.
    approach : Approach
        By default robot-aided if the campaign has the robot's angles.
    seed : int
        Seed of all random numbers.

    Raises
    ------
    InputError
        If the positions do not determine the model, or leave no redundancy to test anything.
    """
    approach = approach or usual_approach(campaign)
    recognised = recognise(campaign, approach.uses_angles)
    if recognised is not None:
        campaign = recognised.corrected
    # A random stream for each stage that draws, so that neither changes the numbers of the other.
    null, split = (np.random.SeedSequence(seed, spawn_key=(key,)) for key in (0, 1))
    problem = pose(fit_base(campaign, model, approach), null)
    finding = decide(problem, campaign)
    confirmation = confirm(problem, finding, split)
    return CampaignDiagnosis(problem, campaign, finding, confirmation, recognised)
