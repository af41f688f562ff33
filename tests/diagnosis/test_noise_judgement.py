"""What is said of the noise: which test counts, at which level, and what follows from it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_helpers import explanation, posed, shuffled
from scipy import stats
from usual import GRAVITY, NINE, G

from accelstudy.diagnosis.decision.posterior import Posterior
from accelstudy.diagnosis.decision.verdict import judge_noise
from accelstudy.diagnosis.evidence.noise import (
    AXES,
    COLOUR,
    LEVEL,
    STEPS,
    TAILS,
    NoiseTest,
    lack_of_fit,
    square_of_repeats,
    worst_of,
)
from accelstudy.diagnosis.evidence.size import Level
from accelstudy.simulation.sessions import Noise, session

OF_LEVEL, OF_ALL_OTHERS = 0.01, 0.01
"""Levels of the test of sigma, and of all other tests together."""
OTHERS = (AXES, COLOUR, TAILS, STEPS)


def made(tests=(), **p):
    """Tests with p-values; what is not named has 0.5."""
    return [NoiseTest(name, 1.0, p.get(name, 0.5), name) for name in tests]


def by_holds(p):
    """The test against the noise within the holds."""
    return NoiseTest(COLOUR, 1.0, p, "holds", by_holds=True)


def worst(tests, **p):
    test = worst_of(made(tests, **p))
    return None if test is None else test.name


# --- which test counts ---------------------------------------------------------------------------


@pytest.mark.parametrize("tests", [OTHERS, (LEVEL, *OTHERS)])
def test_the_tests_beside_that_of_sigma_share_one_percent(tests):
    """Each has a quarter of it, whether sigma is tested or not; sigma has a level of its own."""
    for name in tests:
        share = OF_LEVEL if name == LEVEL else OF_ALL_OTHERS / 4
        assert worst(tests, **{name: 0.99 * share}) == name
        assert worst(tests, **{name: 1.01 * share}) is None


def test_the_most_specific_finding_comes_first():
    """Coarse readings make any noise look odd, and a wrong sigma says least."""
    left = [STEPS, COLOUR, AXES, TAILS, LEVEL]
    while left:
        tests = {name: 1e-6 for name in left}
        assert worst((LEVEL, *OTHERS), **tests) == left.pop(0)


@pytest.mark.parametrize(("sigma", "counts"), [(0.5, False), (0.5 * OF_LEVEL, True)])
def test_where_sigma_holds_the_noise_within_the_holds_accuses_nothing(sigma, counts):
    """A sigma that the residuals confirm knows of what varies from hold to hold."""
    tests = made((LEVEL, *OTHERS), **{LEVEL: sigma})
    test = worst_of([*tests, by_holds(1e-9)])
    assert (test is not None and test.by_holds) == counts
    # Without it the others have a quarter each, with it a fifth.
    tests = made((LEVEL, *OTHERS), **{LEVEL: sigma, TAILS: 0.9 * OF_ALL_OTHERS / 4})
    assert worst_of([*tests, by_holds(0.5)]).name == (LEVEL if counts else TAILS)


def test_where_sigma_is_not_given_the_holds_say_how_large_the_noise_is():
    assert worst_of([*made(OTHERS), by_holds(0.99 * OF_ALL_OTHERS / 5)]).by_holds
    assert worst_of([*made(OTHERS), by_holds(1.01 * OF_ALL_OTHERS / 5)]) is None


# --- what follows --------------------------------------------------------------------------------


def judged(name, factor=1.5, of_noise=0.5, fit=0.5):
    """The finding where a test is significant, and so much of the posterior is of the noise."""
    weighed = [
        explanation(LEVEL, np.log(of_noise)),
        explanation("hysteresis", np.log1p(-of_noise)),
    ]
    test = NoiseTest(name, 1.0, 1e-6, "what it says")
    residuals = SimpleNamespace(variance=factor)
    posterior = Posterior.of(weighed)
    problem = SimpleNamespace(
        frame="fit", residuals=residuals, posterior=posterior, lack_of_fit=fit
    )
    return judge_noise(problem, test)


@pytest.mark.parametrize(("case", "said", "code"), [
    ({"name": AXES, "of_noise": 0.1}, "noise_model", "noise"),
    ({"name": LEVEL, "of_noise": 0.51}, "noise_model", "noise"),
    ({"name": LEVEL, "of_noise": 0.49}, "unknown", "noise or effect"),
    ({"name": LEVEL, "of_noise": 0.1, "factor": 0.5}, "noise_model", "noise"),
    ({"name": TAILS, "fit": 0.009}, "unknown", "lack of fit"),
    ({"name": TAILS, "fit": 0.011}, "noise_model", "noise"),
    ({"name": LEVEL, "of_noise": 0.9, "fit": 0.009}, "unknown", "lack of fit"),
    ({"name": STEPS, "fit": 0.009}, "noise_model", "noise"),
])  # fmt: skip
def test_what_a_significant_test_means(case, said, code):
    """Larger residuals may be an effect; a misfit that repeats share is no noise, but steps are."""
    found = judged(**case)
    assert (found.verdict, found.reason.code) == (said, code)
    if code == "noise or effect":
        assert found.reason.facts["p"] == pytest.approx(case["of_noise"])
        assert found.reason.facts["other"] == "hysteresis"
    if code != "lack of fit":
        assert (found.reason.facts["name"], found.reason.facts["remark"]) == (
            case["name"],
            "what it says",
        )


# --- sigma and repeats ---------------------------------------------------------------------------


def repeated(level, scatter=1.0, missed=0.0, seed=4):
    """The problem of a session of 18 attitudes, each twice, without a robot.

    The noise has `scatter` times its sigma, and each attitude misses by an amount of its own.
    """
    rng = np.random.default_rng(seed)
    ideal = session(NINE, np.zeros(9), np.tile(shuffled("faces-edges-18"), (2, 1)), G)
    observed = ideal.draw(Noise(sigma_force=scatter * 0.002), 1, rng)
    forces = observed.forces + missed * np.tile(rng.standard_normal((18, 3)), (2, 1))
    observed = replace(observed, forces=forces, sigma_force=0.002)
    return posed(GRAVITY, observed, level)


@pytest.mark.parametrize("missed", [0.0, 0.003])
def test_lack_of_fit_is_the_analysis_of_variance(missed):
    """The mean of two repeats against the model, by what they differ: F with 9 and 18."""
    problem = repeated(Level.of_stated_sigma(), missed=missed)
    e = problem.base.solution.misclosures[:, 0]
    pure = np.sum((e[:18] - e[18:]) ** 2) / 2
    f = (np.sum(e**2) - pure) / 9 / (pure / 18)
    assert problem.lack_of_fit == pytest.approx(stats.f.sf(f, 9, 18), rel=0.02)
    same = SimpleNamespace(z=np.ones(4), redundancy=4)  # coarse readings repeat exactly
    assert lack_of_fit(same, *square_of_repeats(same, np.full((4, 1), 0.5))) < 1e-12


@pytest.mark.parametrize(("level", "scatter", "holds"), [
    (Level.of_stated_sigma(), 1.0, True),
    (Level.of_stated_sigma(), 2.0, False),
    (Level.of_stated_sigma(), 0.4, False),
    (Level.of_nothing_stated(), 1.0, False),
])  # fmt: skip
def test_sigma_is_taken_where_it_is_given_and_not_refuted(level, scatter, holds):
    problem = repeated(level, scatter)
    e = problem.base.solution.misclosures[:, 0] / 0.002
    judged = problem.base.solution.judge_noise(level.known)
    assert judged.trusted == holds
    variance = 1.0 if holds else np.sum(e**2) / 27
    assert judged.variance == pytest.approx(variance, rel=1e-3)
