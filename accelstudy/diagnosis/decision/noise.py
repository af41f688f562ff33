"""What the residuals say of the noise: whether a fit leaves more than that, what is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.adjustment.quality import Solution, pooled_variance
from accelstudy.basics.levels import REFUTATION_LEVEL
from accelstudy.campaign.calibration.fit import JudgedNoise
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.problem import Problem, is_exact
from accelstudy.diagnosis.evidence.noise_tests import (
    AXES,
    COLOUR,
    LEVEL,
    STEPS,
    TAILS,
    NoiseTest,
    axis_test,
    colour_test,
    level_test,
    resolution_test,
    tail_test,
    within_hold_test,
)
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.hypotheses import clusters, space_of_attitudes
from accelstudy.diagnosis.space.residuals import Residuals

Array = NDArray[np.float64]

SPECIFIC = (STEPS, COLOUR, AXES, TAILS, LEVEL)
"""What may be wrong with the noise, the most specific first."""


class Misfit(NamedTuple):
    """Ratio of the residuals of a fit to the noise."""

    ratio: float
    of_repeats: bool
    """Whether the noise is what repeated positions differ by, and not what is stated."""


def misfit(problem: Problem, solution: Solution) -> Misfit | None:
    """Return by how much the residuals are larger than the noise; None if they are not.

    The noise is the given sigma. Where none is given, or where repeated positions refute it even
    after the refit, it is the difference of repeated positions.
    """
    stated = problem.evidence.level.known
    if (
        stated
        and 2 * float(special.chdtrc(solution.redundancy, solution.omega)) >= REFUTATION_LEVEL
    ):
        return None
    ratio = float(np.sqrt(solution.omega / solution.redundancy))
    than_stated = Misfit(ratio, of_repeats=False) if stated else None
    left = Residuals.of(solution)
    labels = clusters(problem.frame.forces)
    if len(labels) != len(solution.misclosures) or len(np.unique(labels)) == len(labels):
        return than_stated
    square, freedom = _square_of_repeats(left, space_of_attitudes(left, labels))
    if not freedom or (stated and special.chdtrc(freedom, square) >= REFUTATION_LEVEL / 2):
        return than_stated
    if _lack_of_fit(left, square, freedom) >= REFUTATION_LEVEL:
        return None
    return than_stated or Misfit(ratio / float(np.sqrt(square / freedom)), of_repeats=True)


def lack_of_fit(problem: Problem) -> float:
    """p-value of the test whether repeats agree better with each other than with the model."""
    residuals, same = problem.residuals, problem.attitude
    if same is None:
        return 1.0
    return _lack_of_fit(residuals, *_square_of_repeats(residuals, same.vectors))


def _lack_of_fit(residuals: Residuals, square: float, freedom: int) -> float:
    """F test of all but the differences of repeats against these differences."""
    rest = residuals.redundancy - freedom
    if not freedom or not rest:
        return 1.0
    ratio = (float(residuals.z @ residuals.z) - square) / rest / (square / freedom)
    return float(special.fdtrc(rest, freedom, ratio))


def _square_of_repeats(residuals: Residuals, same: Array) -> tuple[float, int]:
    """Square of the differences of repeated positions, and its degrees of freedom.

    Parameters
    ----------
    residuals : Residuals
    same : (m, l) array, orthonormal basis of what they have in common
    """
    z = residuals.z
    square = float(z @ z - np.sum((z @ same) ** 2))
    return max(square, 0.0), residuals.redundancy - same.shape[1]


def tests_of_noise(
    problem: Problem, campaign: Campaign, frame: SessionFit
) -> tuple[NoiseTest, ...]:
    """All tests of the noise that a campaign allows, on the residuals of the base or final fit."""
    if is_exact(problem.base.solution):
        return ()
    residuals, base, chance = frame.residuals, problem.residuals, problem.chance
    sigma, sigma_base = (float(np.mean(one.sigmas[:, :3])) for one in (residuals, base))
    # With a sigma far too large, the attitudes would look like steps.
    least = sigma_base * min(1.0, float(np.sqrt(base.variance)))
    tests = [level_test_of(problem, frame)] if problem.evidence.level.known else []
    tests += [
        axis_test(residuals, chance),
        colour_test(residuals, chance),
        tail_test(residuals, chance),
        resolution_test(campaign.forces, least),
    ]
    if campaign.sd is not None and campaign.n_samples is not None:
        tests.append(within_hold_test(residuals, sigma, campaign.sd, campaign.n_samples))
    return tuple(tests)


def level_test_of(problem: Problem, frame: SessionFit) -> NoiseTest:
    """Test the level of the noise; the base fit by its own Ω, as the calibration does."""
    fit = problem.base.solution if frame is problem.frame else frame.solution
    return level_test(Residuals.of(fit), fit.sigma_dof)


def judged_noise(problem: Problem, frame: SessionFit) -> JudgedNoise:
    """Judge the noise by the residuals of a fit, which give it where no stated sigma holds."""
    residuals = frame.residuals
    stated, r = problem.evidence.level.known, residuals.redundancy
    if not stated or level_test_of(problem, frame).p_value < REFUTATION_LEVEL:
        return JudgedNoise(trusted=False, variance=residuals.variance)
    omega = r * residuals.variance
    return JudgedNoise(True, pooled_variance(omega, r, frame.solution.sigma_dof))


def exceeds_stated(problem: Problem, frame: SessionFit) -> bool:
    """Whether sigma is given, and the residuals of a fit are larger than it allows."""
    refuted = problem.evidence.level.known and not judged_noise(problem, frame).trusted
    return refuted and frame.residuals.variance > 1


def worst_of(tests: Sequence[NoiseTest]) -> NoiseTest | None:
    """Return what is wrong with the noise, the most specific finding first."""
    level = next((t for t in tests if t.name == LEVEL), None)
    counted = [
        t
        for t in tests
        # A sigma that the residuals confirm knows of what varies from hold to hold.
        if not (t.by_holds and level is not None and level.p_value >= REFUTATION_LEVEL)
    ]
    others = RULES.level_noise / max(len(counted) - (level is not None), 1)
    failed = [t for t in counted if t.p_value < (REFUTATION_LEVEL if t is level else others)]
    return min(failed, key=lambda t: SPECIFIC.index(t.name), default=None)
