"""What a diagnosis found: the result that files, figures and pages are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from accelstudy.adjustment.quality import GlobalTest, Solution, global_test
from accelstudy.adjustment.quality.whole_model import REFUTED
from accelstudy.approaches import Approach
from accelstudy.campaign.format import Campaign
from accelstudy.diagnosis.decision.explanations import Explanation
from accelstudy.diagnosis.evidence.detection import Detection
from accelstudy.diagnosis.evidence.noise import NoiseTest
from accelstudy.diagnosis.space.hypotheses import Setting
from accelstudy.diagnosis.worth.changes import Change
from accelstudy.diagnosis.worth.gap import HeldOutGap
from accelstudy.diagnosis.worth.limits import UpperLimit
from accelstudy.diagnosis.worth.next_positions import NextPosition
from accelstudy.gross_errors.recognition import Recognised
from accelstudy.sensor import SensorModel

LEVEL_EFFECTS = 0.04
"""Level of the test for anything that is missing, where the noise level is not tested, too."""


def level_of_effects(sigma_known: bool) -> float:
    """Level of the test for anything that is missing.

    With the tests of the noise it makes 5 %; with a stated sigma its level is one of them.
    """
    return LEVEL_EFFECTS - REFUTED if sigma_known else LEVEL_EFFECTS


@dataclass(frozen=True)
class Named:
    """An effect, noise effect or gross error that was found.

    Attributes
    ----------
    name, spec : str; of a bumped position `spec` is the name
    equivalence_class : tuple of str, names that mean the same in this campaign
    p_value : float, family-wise; None of a gross error that is recognised by its size
    posterior : float; None of what is no rival of the others
    rivals : tuple of (name, cosine)
    parameters : tuple of (name, value, sigma, unit), SI
    position : int, of a bumped position
    """

    name: str
    spec: str
    equivalence_class: tuple[str, ...]
    p_value: float | None
    posterior: float | None
    rivals: tuple[tuple[str, float], ...] = ()
    parameters: tuple[tuple[str, float, float | None, str], ...] = ()
    position: int | None = None


@dataclass(frozen=True)
class Gap:
    """How far the disagreement shrinks; None where it does not apply.

    `statement` says what is confirmed: "effect", that one of the credible set is missing, or
    "name", that it is the most probable one; None if nothing is.
    """

    before: float
    after: float | None = None
    held_out: HeldOutGap | None = None
    leveling: tuple[float, float] | None = None
    confirmed: bool = False
    reason: str = ""
    statement: str | None = None


@dataclass(frozen=True)
class Diagnosis:
    """What the diagnosis of one campaign found.

    Attributes
    ----------
    campaign : Campaign, with a recognised gross error mended
    approach : Approach
    model, extended : SensorModel, without and with the effects that were found
    verdict : str, "no_effect", "named", "narrowed", "unknown", "noise_model" or "gross_error"
    credible_set : tuple of Explanation, most probable first; empty if nothing is missing
    found : tuple of Named
    base : Solution, of the base model with equal axes
    setting : Setting, of the base fit, with unequal axes weighted
    final : Setting, of the extended fit, or the same
    sigma_known : bool
    sigma_source : str
    unit_variance : float, variance of unit weight that is taken for the noise
    noise_tests : tuple of NoiseTest
    screening : Detection, of all candidates
    probabilities : dict of name to posterior probability, given that something is missing
    location : dict of group to share of the excess χ²
    gap : Gap
    changes : tuple of Change, of the parameters of the base model by effects that were added
    upper_limits : tuple of UpperLimit, of the effects that were not found
    next_positions : tuple of NextPosition, that would separate what is left best
    simulations : int, of residuals without any effect
    recognised : Recognised or None, a gross error of unit, axes or order
    suspects : tuple of (label, p-value), positions that the calibration marks, on their own
    reason : str, why the verdict is what it is
    """

    campaign: Campaign
    approach: Approach
    model: SensorModel
    extended: SensorModel
    verdict: str
    credible_set: tuple[Explanation, ...]
    found: tuple[Named, ...]
    base: Solution
    setting: Setting
    final: Setting
    sigma_known: bool
    sigma_source: str
    unit_variance: float
    noise_tests: tuple[NoiseTest, ...]
    screening: Detection
    probabilities: Mapping[str, float]
    location: Mapping[str, float]
    gap: Gap
    changes: tuple[Change, ...]
    upper_limits: tuple[UpperLimit, ...]
    next_positions: tuple[NextPosition, ...]
    simulations: int
    recognised: Recognised | None
    suspects: tuple[tuple[int, float], ...]
    reason: str

    @property
    def level(self) -> float:
        """Level of the test for anything that is missing."""
        return level_of_effects(self.sigma_known)

    @property
    def global_test(self) -> GlobalTest | None:
        """Test of the base model against the a-priori sigma."""
        if not self.sigma_known:
            return None
        return global_test(self.base.omega, self.base.redundancy)

    @property
    def sigma_position(self) -> float:
        """Noise of a position mean, m/s², as it is taken."""
        return float(
            np.sqrt(self.unit_variance) * np.mean(self.final.frame.residuals.sigmas[:, :3])
        )
