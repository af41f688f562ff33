"""Held-out positions: what they need to confirm a name, given that a name was given."""

import numpy as np
import pytest
from diagnosis_helpers import design, posed, shuffled, some_holds
from usual import GRAVITY, NINE, ROBOT, G

import accelstudy as acs
from accelstudy.basics.wording import words
from accelstudy.diagnosis import held_out
from accelstudy.diagnosis.decision.refits import refit
from accelstudy.diagnosis.evidence.candidates import weigh_singles
from accelstudy.diagnosis.evidence.detection import Chance, detect
from accelstudy.diagnosis.evidence.size import Level
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.prediction import LinearSplit, held_out_gap, split_positions
from accelstudy.diagnosis.report.words import render
from accelstudy.diagnosis.rules import RULES
from accelstudy.simulation.sessions import Noise, session

SETS = 25_000


@pytest.fixture(
    scope="module",
    params=[Level.of_stated_sigma(), Level.of_nothing_stated()],
    ids=["given", "not given"],
)
def parts(request):
    """Problems of all positions and of two thirds, and the split, with nothing missing."""
    ideal = session(NINE, np.zeros(NINE.n_parameters), shuffled("fibonacci-30"), G)
    observed = ideal.draw(Noise(), 1, np.random.default_rng(5))
    problem = posed(ROBOT, observed, request.param)
    frame = problem.frame
    fitted, held = split_positions(frame.forces, frame.hold, 10, np.random.default_rng(2))
    part = posed(ROBOT, observed.take(fitted), request.param)
    return problem, part, LinearSplit(frame, fitted, held)


def weighed(problem):
    """The evidence for each candidate by itself."""
    return weigh_singles(problem.frame, problem.evidence)


def test_a_name_that_noise_made_is_confirmed_in_5_percent(parts):
    """In plain noise, of which few sets are given a name, instead of by importance sampling."""
    problem, part, split = parts
    residuals, field, evidence = problem.residuals, problem.field, problem.evidence
    chance = Chance(np.random.SeedSequence(1), len(residuals.design))
    beyond = detect(field, evidence, residuals, chance).threshold(RULES.level_effects)
    rng = np.random.default_rng(3)
    needed = held_out.threshold(problem, None, beyond, part, split, rng)
    assert needed > RULES.z_significant + 0.3
    rng = np.random.default_rng(4)
    noise = rng.standard_normal((SETS, len(residuals.design)))
    z = residuals.project(noise.T).T
    odds = field.odds(evidence, field.project(z))
    of_any = np.logaddexp.reduce(odds, axis=1) - np.log(len(field.names))
    label = held_out.labels(problem.classes)
    claimed = held_out.claimed_names(odds, field.names, label)
    sets = np.flatnonzero((claimed >= 0) & (of_any > beyond))
    found, change = held_out.chosen_names(part, split, noise[sets], label)
    values = split.statistic(change, noise[sets], evidence.level.known)
    same, n = found == claimed[sets], len(sets)
    assert n > 150
    rate = np.mean(same & (values > needed))
    # Both the simulation of the bound and that of the rate err.
    assert rate == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 * (1 / n + 1 / 300)))
    # Without regard to the name, as if it were independent, far more would be confirmed.
    assert np.mean(same & (values > RULES.z_significant)) > 0.12


def test_prediction_to_first_order_is_that_of_refits(parts):
    """Of an effect that the fitted positions show; what either leaves of the held-out ones."""
    problem, part, split = parts
    first, base = problem.base.solution, part.base.solution
    fit = refit(part.frame.solution, [weighed(part).best["quadratic_scale"]])
    rest = first.observed.take(split.held)
    gap = held_out_gap(base, fit, rest, split.held, 1.0)
    errors = problem.residuals.errors[None]
    missed = split.base_residuals(errors)[1]
    (columns,) = problem.frame.columns([weighed(problem).best["quadratic_scale"]])
    change = split.corrections(errors, [(0, columns, 0.0)])
    assert np.mean(missed**2) == pytest.approx(gap.before, rel=0.02)
    assert np.mean((missed - change) ** 2) == pytest.approx(gap.after, rel=0.02)


GROUPS = {
    ("thermal_bias", "ABBA", "robot"): {"thermal_bias", "thermal_curve"},
    ("thermal_bias", "random", "robot"): {"thermal_bias"},
    ("quadratic_scale", "random", "gravity"): {"quadratic_scale", "cross_coupling"},
}
"""What is confirmed of an effect, by the order of the temperatures and the approach."""


@pytest.mark.parametrize("case", GROUPS)
def test_a_name_is_confirmed_only_where_no_other_could_leave_the_same(case):
    """At two temperatures a curve is a line; by gravity alone a coupling can do what a scale does.

    At many temperatures, with a robot, a linear effect is told from a quadratic one: by its name.
    """
    effect, order, approach = case
    measured = acs.simulate_campaign(
        scheme="fibonacci-30", order="random", approach=approach, effects=(effect,), yaw="random",
        temperature=(15.0, 40.0), temperature_order=order, seed=3,
    )  # fmt: skip
    found = diagnose(measured, NINE)
    assert found.verdict == "named"
    assert found.gap.confirmed
    assert set(found.gap.names) == GROUPS[case]
    assert found.gap.statement == ("name" if len(GROUPS[case]) == 1 else "effect")
    (line,) = render("confirmation", found)
    assert all(words(name) in line for name in GROUPS[case])


def test_no_name_is_confirmed_where_the_fit_leaves_more_than_the_stated_noise():
    """Sigma is half of the true one: that, or something unlisted, may make the name."""
    measured = acs.simulate_campaign(
        scheme="fibonacci-18", repeats=3, order="random", approach="robot", yaw="random",
        effects=("thermal_bias",), noise_effects=("noise_level(kappa=4)",),
        temperature=(15.0, 40.0), temperature_order="random", seed=3,
    )  # fmt: skip
    found = diagnose(measured, NINE)
    assert (found.verdict, found.found[0].name) == ("named", "thermal_bias")
    assert found.gap.confirmed
    assert found.gap.statement == "effect"
    (line,) = render("confirmation", found)
    assert line.endswith("rather than a rival, since more is left than the stated noise.")


def test_an_imitator_leaves_nothing_of_what_it_imitates():
    """By least squares: of the imitators, and of no others, a shape takes up all of an effect."""
    frame_of = design(shuffled("fibonacci-30"), GRAVITY, some_holds(30))
    one = frame_of.candidates["quadratic_scale"][0]
    could = set()
    for name, shapes in frame_of.candidates.items():
        if name not in ("quadratic_scale", "outlier_position"):
            left = (
                one.ideal - s.ideal @ np.linalg.lstsq(s.ideal, one.ideal, rcond=None)[0]
                for s in shapes
            )
            could |= {name for rest in left if np.linalg.norm(rest, 2) <= np.sqrt(1 - 0.9995**2)}
    assert set(frame_of.imitators(one)) == could == {"cross_coupling"}
