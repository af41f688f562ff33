"""What a diagnosis found: the result that files, figures and pages are made of."""

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
from accelstudy.diagnosis.beside import Beside
from accelstudy.diagnosis.decision.explanations import Explanation
from accelstudy.diagnosis.evidence.detection import Detection
from accelstudy.diagnosis.evidence.noise.kinds import NoiseTest
from accelstudy.diagnosis.held_out.gap import HeldOutGap
from accelstudy.diagnosis.space.examined import ExaminedFit
from accelstudy.diagnosis.worth.changes import Change
from accelstudy.diagnosis.worth.limits import UpperLimit
from accelstudy.diagnosis.worth.next_positions import NextPosition
from accelstudy.sensors.plausibility import implausible_parameters
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
class Named:
    """An effect, noise effect or gross error that was found.

    Attributes
    ----------
    name, spec : str; of a bumped position `spec` is the name
    equivalence_class : tuple of str, names that mean the same in this campaign
    p_value : float, family-wise; None of a gross error that is recognised by its size
    posterior : float; None of what is no rival of the others
    rivals : tuple of (name, cosine)
    imitators : tuple of str, further names that could leave the same, and more
    parameters : tuple of (name, value, sigma, unit), SI
    position : int, of a bumped position
    """

    name: str
    spec: str
    equivalence_class: tuple[str, ...]
    p_value: float | None
    posterior: float | None
    rivals: tuple[tuple[str, float], ...] = ()
    imitators: tuple[str, ...] = ()
    parameters: tuple[tuple[str, float, float | None, str], ...] = ()
    position: int | None = None


@dataclass(frozen=True)
class Gap:
    """How far the disagreement shrinks; None where it does not apply.

    If it is confirmed that such an effect is missing, `names` says of which names one is confirmed
    against all others: what was found, with all that could leave the same. It is empty if that is
    open.
    """

    before: float
    after: float | None = None
    held_out: HeldOutGap | None = None
    confirmed: bool = False
    reason: str = ""
    names: tuple[str, ...] = ()

    @property
    def statement(self) -> str | None:
        """What is confirmed: "name", that it is this effect, or "effect", that there is one."""
        if not self.confirmed:
            return None
        return "name" if len(self.names) == 1 else "effect"


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
    examined : ExaminedFit, of the base fit, with unequal axes weighted
    final : ExaminedFit, of the extended fit, or the same
    sigma_known : bool
    sigma_holds : bool, whether sigma is given, and the final fit does not refute it
    unit_variance : float, variance of unit weight that is taken for the noise
    noise_tests : tuple of NoiseTest
    screening : Detection, of all candidates
    probabilities : dict of name to posterior probability, given that something is missing
    gap : Gap
    beside : Beside, all else that follows
    simulations : int, of residuals without any effect
    recognised : Recognised or None, a gross error of unit, axes or order
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
    examined: ExaminedFit
    final: ExaminedFit
    sigma_known: bool
    sigma_holds: bool
    unit_variance: float
    noise_tests: tuple[NoiseTest, ...]
    screening: Detection
    probabilities: Mapping[str, float]
    gap: Gap
    beside: Beside
    simulations: int
    recognised: Recognised | None
    reason: str

    @property
    def kept(self) -> NDArray[np.bool_]:
        """Which positions, (n,), the final fit uses: all but those that were found to be bumped."""
        bumped = [found.position for found in self.found if found.position is not None]
        return ~np.isin(self.campaign.positions, bumped)

    @property
    def location(self) -> Mapping[str, float]:
        """Share of the excess χ² in each group of which it can be told."""
        return self.beside.location.shares

    @property
    def not_located(self) -> Mapping[str, str]:
        """Why nothing can be told of the other groups."""
        return self.beside.location.untestable

    @property
    def leveling(self) -> tuple[float, float] | None:
        """Tilt error without and with the effects that were found, rad; None if there is none."""
        return self.beside.leveling

    @property
    def better_for_leveling(self) -> str | None:
        """Model that leaves the smaller tilt error, "base" or "extended"; None if there is one."""
        if self.leveling is None or self.extended is self.model:
            return None
        before, after = self.leveling
        return "base" if after > LARGER * before else "extended"

    @property
    def changes(self) -> tuple[Change, ...]:
        """Changes of the parameters of the base model by effects that were added."""
        return self.beside.changes

    @property
    def upper_limits(self) -> tuple[UpperLimit, ...]:
        """Limits of the effects that were not found."""
        return self.beside.upper_limits

    @property
    def next_positions(self) -> tuple[NextPosition, ...]:
        """Positions that would separate what is left best."""
        return self.beside.next_positions

    @property
    def suspects(self) -> tuple[tuple[int, float], ...]:
        """Label and p-value of positions that the calibration marks, on their own."""
        return tuple((int(self.campaign.positions[i]), p) for i, p in self.beside.suspects)

    @property
    def implausible(self) -> tuple[str, ...]:
        """Parameters of the final fit that no sensor has."""
        solution, u = self.final.frame.solution, self.extended.n_parameters
        sigma = np.sqrt(np.diag(solution.cofactors)[:u] * self.unit_variance)
        effects = self.extended.effects
        return tuple(implausible_parameters(effects, solution.parameters[:u], sigma))

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
        """Noise of a position mean, m/s², that the diagnosis assumes."""
        return float(
            np.sqrt(self.unit_variance) * np.mean(self.final.frame.residuals.sigmas[:, :3])
        )
