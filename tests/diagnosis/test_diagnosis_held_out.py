"""Held-out positions: what they confirm of a name."""

import numpy as np
import pytest
from diagnosis_helpers import design, shuffled, some_holds
from usual import GRAVITY, NINE

import accelstudy as acs
from accelstudy.basics.wording import words
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.report.words import render

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
    assert found.confirmation.confirmed
    assert set(found.confirmation.names) == GROUPS[case]
    assert found.confirmation.statement == ("name" if len(GROUPS[case]) == 1 else "effect")
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
    assert found.confirmation.confirmed
    assert found.confirmation.statement == "effect"
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
