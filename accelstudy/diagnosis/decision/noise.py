"""The judgement of the noise: its tests, and the verdict where no effect is significant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from accelstudy.basics.levels import REFUTED
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision import priors
from accelstudy.diagnosis.decision.search import Search
from accelstudy.diagnosis.decision.verdict import Finding, lack_of_fit
from accelstudy.diagnosis.evidence.noise import kinds
from accelstudy.diagnosis.evidence.noise.kinds import NoiseTest
from accelstudy.diagnosis.evidence.noise.residual_tests import (
    axis_test,
    colour_test,
    level_test,
    tail_test,
    within_hold_test,
)
from accelstudy.diagnosis.evidence.noise.resolution import resolution_test
from accelstudy.diagnosis.space.examined import ExaminedFit
from accelstudy.diagnosis.space.residuals import Residuals

LEVEL_NOISE = 0.01
"""Family-wise level of all tests of the noise but that of its level, which has `REFUTED`. With the
test for anything that is missing they make 5 % false alarms."""


@dataclass(frozen=True)
class NoiseJudge:
    """Tests of the noise of a campaign, and what follows from them."""

    search: Search
    campaign: Campaign

    def tests(self, examined: ExaminedFit) -> tuple[NoiseTest, ...]:
        """All tests of the noise that the campaign allows, on the residuals of a fit."""
        residuals, campaign = examined.frame.residuals.positions, self.campaign
        chance = self.search.chance
        sigma = float(np.mean(residuals.sigmas[:, :3]))
        tests = []
        if self.search.level.known:
            tests.append(self.level(examined))
        tests += [
            axis_test(residuals, chance),
            colour_test(residuals, chance),
            tail_test(residuals, chance),
            self.resolution,
        ]
        if campaign.sd is not None and campaign.n_samples is not None:
            tests.append(within_hold_test(residuals, sigma, campaign.sd, campaign.n_samples))
        return tuple(tests)

    def level(self, examined: ExaminedFit) -> NoiseTest:
        """Test the level of the noise; the base fit by its own Ω, as the calibration does."""
        if examined is self.search.examined:
            return level_test(Residuals.of(self.search.first))
        return level_test(examined.frame.residuals.positions)

    @cached_property
    def resolution(self) -> NoiseTest:
        """Whether the readings are coarse compared with the noise of the base fit."""
        residuals = self.search.residuals.positions
        sigma = float(np.mean(residuals.sigmas[:, :3]))
        # With a sigma far too large, the attitudes would look like steps.
        noise = sigma * min(1.0, float(np.sqrt(residuals.variance)))
        return resolution_test(self.campaign.forces, noise)

    def worst(self, tests: Sequence[NoiseTest]) -> NoiseTest | None:
        """Return what is wrong with the noise, the most specific finding first."""
        level = next((t for t in tests if t.name == kinds.LEVEL), None)
        counted = [
            t
            for t in tests
            # A sigma that the residuals confirm knows of what varies from hold to hold.
            if not (t.by_holds and level is not None and level.p_value >= REFUTED)
        ]
        others = LEVEL_NOISE / max(len(counted) - (level is not None), 1)
        found = [t for t in counted if t.p_value < (REFUTED if t is level else others)]
        order = [kinds.STEPS, kinds.COLOUR, kinds.AXES, kinds.TAILS, kinds.LEVEL]
        return min(found, key=lambda t: order.index(t.name), default=None)

    def judged(self, worst: NoiseTest) -> Finding:
        """Judge a finding about the noise, when no effect was significant."""
        examined, posterior = self.search.examined, self.search.posterior
        if lack_of_fit(self.search) < REFUTED and worst.name != kinds.STEPS:
            reason = (
                "repeated positions agree better with each other than with the model, so it is not "
                "the noise"
            )
            return Finding("unknown", examined, reason, posterior=posterior)
        if worst.name != kinds.LEVEL or worst.estimate[0] < 1:
            return self._by_test(worst)
        # Larger residuals may be an effect that the test for a pattern could not see.
        noise = posterior.of_noise
        if noise >= priors.MORE_PROBABLE:
            return self._by_test(worst)
        name = next(n for e in posterior.explanations for n in e.names if n not in kinds.NOISES)
        reason = (
            f"{worst.remark}; it may be the noise (probability {noise:.2f}), but "
            f"{'something' if name == 'unknown' else 'an effect such as ' + name} is not excluded"
        )
        return Finding("unknown", examined, reason, posterior=posterior, says_the_level=True)

    def _by_test(self, worst: NoiseTest) -> Finding:
        """Blame the noise, as a test of it says."""
        return Finding(
            "noise_model",
            self.search.examined,
            worst.remark,
            posterior=self.search.posterior,
            says_the_level=worst.name == kinds.LEVEL,
        )

    def sigma_holds(self, final: ExaminedFit) -> bool:
        """Whether sigma is given, and the residuals of a fit do not refute it."""
        return self.search.level.known and self.level(final).p_value >= REFUTED

    def unit_variance(self, final: ExaminedFit) -> float:
        """Variance of unit weight: 1 where the given sigma holds, else a posteriori."""
        return 1.0 if self.sigma_holds(final) else final.frame.residuals.positions.variance
