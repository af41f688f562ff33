"""What a diagnosis found: the results that files, figures and pages are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import GlobalTest, Solution, global_test
from accelstudy.approaches import Approach
from accelstudy.basics.levels import REFUTED
from accelstudy.campaign.gross_errors.recognition import Recognised
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.consequences import Change, LikeShape
from accelstudy.diagnosis.decision.posterior import Explanation
from accelstudy.diagnosis.decision.statement import Part
from accelstudy.diagnosis.decision.verdict import Named
from accelstudy.diagnosis.evidence.detection import Detection
from accelstudy.diagnosis.evidence.noise_tests import NoiseTest
from accelstudy.diagnosis.held_out import Gap
from accelstudy.diagnosis.next_positions import NextPosition
from accelstudy.diagnosis.shape import LearnedShape
from accelstudy.diagnosis.space.examined import Frame
from accelstudy.diagnosis.space.shapes import Place
from accelstudy.diagnosis.visibility import UpperLimit
from accelstudy.sensors.sensor import SensorModel

LEVEL_EFFECTS = 0.04
"""Level of the test for anything that is missing, where the noise level is not tested as well."""
LARGER = 1.02
"""Ratio of tilt errors from which on one counts as larger."""


def level_of_effects(sigma_known: bool) -> float:
    """Level of the test for anything that is missing.

    With the tests of the noise it makes 5 % in all. Where sigma is given, its test takes a part.
    """
    return LEVEL_EFFECTS - REFUTED if sigma_known else LEVEL_EFFECTS


@dataclass(frozen=True)
class Verdict:
    """What is found in a campaign, and how sure that is.

    Attributes
    ----------
    campaign : Campaign, with a recognised gross error mended
    approach : Approach
    model, extended : SensorModel, without and with the effects that were found
    verdict : str, "no_effect", "named", "narrowed", "learned", "unknown", "noise_model" or
        "gross_error"
    reason : str, why the verdict is what it is
    says_the_level : bool, whether the reason says how large the residuals are
    coloured : float, probability of coloured noise that may be an effect of an absent column
    unrecorded : bool, whether the reason says so
    weak : bool, whether there is evidence that something is missing, too weak for a verdict
    credible_set : tuple of Explanation, most probable first; empty if nothing is missing
    found : tuple of Named; of the unknown, what is certain all the same
    place : Place or None, coordinate and target of a learned function, which is found first
    base : Solution, of the base model with equal axes
    frame : Frame, of the base fit with unequal axes weighted
    final : Frame, of the extended fit, or the same
    invisible : tuple of str, effects that the parameters of the model absorb whatever their size
    untestable : dict of effect to the reason why it cannot be tested
    sigma_known : bool
    sigma_holds : bool, whether sigma is given, and the final fit does not refute it
    unit_variance : float, variance of unit weight that is taken for the noise
    noise_tests : tuple of NoiseTest
    screening : Detection, of all candidates
    simulations : int, of residuals without any effect
    probabilities : dict of name to posterior probability, given that something is missing
    gap : Gap
    recognised : Recognised or None, a gross error of unit, axes or order
    """

    campaign: Campaign
    approach: Approach
    model: SensorModel
    extended: SensorModel
    verdict: str
    reason: str
    says_the_level: bool
    coloured: float
    unrecorded: bool
    weak: bool
    credible_set: tuple[Explanation, ...]
    found: tuple[Named, ...]
    place: Place | None
    base: Solution
    frame: Frame
    final: Frame
    invisible: tuple[str, ...]
    untestable: Mapping[str, str]
    sigma_known: bool
    sigma_holds: bool
    unit_variance: float
    noise_tests: tuple[NoiseTest, ...]
    screening: Detection
    simulations: int
    probabilities: Mapping[str, float]
    gap: Gap
    recognised: Recognised | None

    @property
    def kept(self) -> NDArray[np.bool_]:
        """Which positions, (n,), the final fit uses: all but those that were found to be bumped."""
        bumped = [named.position for named in self.found if named.position is not None]
        return ~np.isin(self.campaign.positions, bumped)

    @property
    def effects(self) -> tuple[Named, ...]:
        """What the verdict names; nothing if that is unknown."""
        return () if self.verdict == "unknown" else self.found

    @property
    def level(self) -> float:
        """Level of the test for anything that is missing."""
        return level_of_effects(self.sigma_known)

    @property
    def global_test(self) -> GlobalTest | None:
        """Test of the base model against the a-priori sigma."""
        if not self.sigma_known:
            return None
        return global_test(self.base.omega, self.base.redundancy, sigma_dof=self.base.sigma_dof)

    @property
    def sigma_position(self) -> float:
        """Noise of a position mean, m/s², that the diagnosis assumes."""
        return float(np.sqrt(self.unit_variance) * np.mean(self.final.residuals.sigmas[:, :3]))


@dataclass(frozen=True)
class Diagnosis(Verdict):
    """A verdict with all that follows from it.

    Attributes
    ----------
    certain : tuple of Part, what is missing whatever else is open
    open : tuple of Explanation, what may be missing beside that, most probable first; one without
        names stands for nothing
    repeated : bool, whether attitudes were measured repeatedly
    shape : LearnedShape or None, the function that was learned
    like : tuple of LikeShape, where what is missing may live, most probable first
    leveling : (float, float), tilt error without and with what was found, rad, or None
    changes : tuple of Change, of the parameters of the base model by effects that were added
    upper_limits : tuple of UpperLimit, of the effects that were not found
    next_positions : tuple of NextPosition, that would separate what is left best
    suspects : tuple of (label, p-value), positions that the calibration marks, each by itself
    implausible : tuple of str, parameters of the final fit that no sensor has
    """

    certain: tuple[Part, ...]
    open: tuple[Explanation, ...]
    repeated: bool
    shape: LearnedShape | None
    like: tuple[LikeShape, ...]
    leveling: tuple[float, float] | None
    changes: tuple[Change, ...]
    upper_limits: tuple[UpperLimit, ...]
    next_positions: tuple[NextPosition, ...]
    suspects: tuple[tuple[int, float], ...]
    implausible: tuple[str, ...]

    @property
    def better_for_leveling(self) -> str | None:
        """Model that leaves the smaller tilt error, "base" or "extended"; None if there is one."""
        if self.leveling is None or self.extended is self.model:
            return None
        before, after = self.leveling
        return "base" if after > LARGER * before else "extended"
