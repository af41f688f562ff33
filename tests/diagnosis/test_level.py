"""How often noise alone counts as something missing: as the level says, no more and no less."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_helpers import campaign, design, shuffled
from usual import GRAVITY, NINE, ROBOT

from accelstudy.basics.levels import REFUTATION_LEVEL
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.calibration.wording import sentences as calibrated_lines
from accelstudy.diagnosis.decision.problem import SEED, BaseFit, Problem
from accelstudy.diagnosis.decision.verdict import decide
from accelstudy.diagnosis.evidence import detection
from accelstudy.diagnosis.evidence.detection import (
    Chance,
    detect,
    null_distribution,
    tail_probability,
)
from accelstudy.diagnosis.evidence.size import Level, log_mean
from accelstudy.diagnosis.held_out import Confirmation
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.report.words import TEMPLATE, badge, verdict_lines
from accelstudy.diagnosis.result import CampaignDiagnosis
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.pages import render_lines

GIVEN, NOT_GIVEN = 0.03, 0.04
"""How often noise alone may count as something missing, where sigma is given and where not."""
RUNS, SETS = 28, 400
"""Null simulations, and sets of noise that are judged by each."""
STANDARD_ERRORS = 4


@pytest.fixture(scope="module")
def designs():
    return {a.name: design(shuffled("mclaren-24"), a, seed=7) for a in (ROBOT, GRAVITY)}


@pytest.mark.parametrize(("approach", "level", "wanted"), [
    ("robot", Level.of_stated_sigma(), GIVEN),
    ("gravity", Level.of_nothing_stated(), NOT_GIVEN),
    ("gravity", Level.of_holds(), NOT_GIVEN),
])  # fmt: skip
def test_noise_alone_counts_as_often_as_the_level_says(designs, approach, level, wanted):
    """Each null simulation has a seed of its own, so that the rates scatter as they really do."""
    frame, rng = designs[approach], np.random.default_rng([1, 2])
    residuals = frame.residuals
    problem = Problem(BaseFit(frame.solution, level, None), frame, SEED)
    field, evidence = problem.field, problem.evidence
    rates, seen, weights = [], [], []
    for seed in range(RUNS):
        chance = Chance(np.random.SeedSequence(seed), len(residuals.design))
        errors = rng.standard_normal((SETS, len(residuals.design)))
        first = replace(residuals, errors=errors[0])
        found, null = (f(field, evidence, first, chance) for f in (detect, null_distribution))
        z = residuals.project(errors.T).T
        odds = log_mean(field.odds(evidence, z))
        p = np.array([tail_probability(*null, value) for value in odds])
        # Densities of many sets at once are rounded: one or two may move past the observed one.
        assert p[0] == pytest.approx(found, abs=0.005)
        rates.append(np.mean(p < RULES.level(level.known)))
        seen.append(odds)
        weights.append(np.mean(null[1]))
    error = np.std(rates, ddof=1) / np.sqrt(RUNS)
    # Small enough that a level of one percent more or less would not pass.
    assert STANDARD_ERRORS * error < 0.012
    assert np.mean(rates) == pytest.approx(wanted, abs=STANDARD_ERRORS * error)
    # The weights make noise of what was drawn with effects, and the odds have the mean 1: the bound
    # beyond what was simulated.
    assert np.mean(weights) == pytest.approx(1.0, abs=0.03)
    for value in (0.0, 1.0, 2.0):
        assert np.mean(np.concatenate(seen) > value) <= np.exp(-value)


@pytest.mark.parametrize(("known", "level"), [(True, GIVEN), (False, NOT_GIVEN)])
def test_a_diagnosis_decides_at_the_levels(known, level):
    """Noise alone, of which the test says that it is on either side of a level.

    What has no name counts at the level of a calibration that accepts the fit, and both say the
    same of it; without a stated sigma, a calibration cannot accept any.
    """
    measured = campaign(1, scheme="mclaren-24", sigma_known=known)
    says = calibrated_lines(fit_campaign(measured, NINE, ROBOT))
    problem = diagnose(measured, NINE).problem
    for p, verdict, weak in (
        (level + 1e-6, "no_effect", False),
        (level - 1e-6, "no_effect" if known else "unknown", known),
        (REFUTATION_LEVEL + 1e-6, "no_effect" if known else "unknown", known),
        (REFUTATION_LEVEL - 1e-6, "unknown", False),
    ):
        vars(problem)["p_value"] = p
        found = CampaignDiagnosis(problem, measured, decide(problem, measured), Confirmation())
        assert (found.verdict, found.reason.code == "weak") == (verdict, weak)
        assert badge(found) == ("accepted" if weak else verdict)
        if weak:
            assert "weak" in verdict_lines(found)[0]
            assert render_lines(TEMPLATE, "agreement", found)[0] in says


def test_no_random_number_is_drawn_twice(monkeypatch):
    """Positions, priors and effects have streams of their own, all of one seed."""
    n, priors, sets = 12, 3, 50
    design = np.eye(n + priors, 2)  # takes up two conditions, and leaves the others
    one = np.ones((n, 1, 1))
    residuals = Residuals(design, np.zeros(n + priors), one, one, np.ones((n, 1)))
    chance = Chance(np.random.SeedSequence(1), n, sets)
    monkeypatch.setattr(
        detection, "draw_effects", lambda m, count, rng: rng.standard_normal((count, m))
    )
    plain = chance.errors(residuals)
    changed = chance.errors_with_effects(residuals, n + priors)[sets // 2 :]
    left = np.concatenate([plain, changed - plain[sets // 2 :]])[:, 2:].round(9)
    assert left.shape == (sets + sets // 2, n + priors - 2)
    assert len(np.unique(left)) == left.size
