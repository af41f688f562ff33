"""The diagnosis: what is hidden is named, what is not there is not, and the gap shrinks."""

import math

import numpy as np
import pytest
from diagnosis_helpers import campaign
from usual import NINE, G

from accelstudy.adjustment.quality import solve
from accelstudy.approaches import get_approach
from accelstudy.diagnosis.decision.statement import Reason
from accelstudy.diagnosis.held_out import held_out_test, split_positions
from accelstudy.diagnosis.pipeline import diagnose
from accelstudy.diagnosis.report.words import verdict_lines
from accelstudy.effects import HoldConditions
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import compose
from accelstudy.simulation.sessions import Noise, session

# --- statistics ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "scheme", "count"), [("robot", "mclaren-24", 8), ("gravity", "fibonacci-24", 6)]
)
def test_held_out_z_is_standard_normal_if_nothing_is_missing(name, scheme, count):
    """Whatever effect was added, whether the prediction is as certain as a position or not."""
    approach, rng, z = get_approach(name), np.random.default_rng(0), []
    extended = compose("extended", (*(e.spec for e in NINE.effects), "quadratic_scale"))
    directions = get_scheme(scheme).directions
    ideal = session(NINE, np.zeros(NINE.n_parameters), directions, G)
    fitted, held = split_positions(-directions, HoldConditions(), count, rng)
    for _ in range(200):
        observed = ideal.draw(Noise(), 1, rng)
        part, rest = observed.take(fitted), observed.take(held)
        base, more = (solve(model, approach, part) for model in (NINE, extended))
        z.append(held_out_test(base, more, rest, held, 1.0).z)
    assert abs(np.mean(z)) < 4 / math.sqrt(len(z))
    assert abs(np.std(z) - 1) < 4 / math.sqrt(2 * len(z))


# --- hidden effects ------------------------------------------------------------------------------

HIDDEN = {
    "thermal_bias: 0.002, -0.002, 0.001": ("temperature", "bias"),
    "thermal_scale: 3e-4, -3e-4, 2e-4": ("temperature", "scale"),
    "warm_up(tau=600): 0.05, -0.05, 0.05": ("time", "bias"),
    "hysteresis: 0.03, -0.03, 0.03": ("previous", "bias"),
    "cubic_scale: 0.01, -0.01, 0.01": ("force", "bias"),
    "encoder_eccentricity: 1e-3, -9e-4, -9e-4, -9e-4": ("angle", "reading"),
    "axis_nonperpendicularity: 6e-4": None,
    "mounting_rotation: 2e-3, -2e-3, 2e-3": None,
    "saturation(knee=8): 0.02, 0.02, 0.02": ("force", "bias"),
    "vibration_rectification: 0.06, -0.06, 0.06": ("vibration", "bias"),
}
"""Effects, and of what they make which part of the reading a function, if they do; the golden set
has all of the catalogue, pairs and triples of them, and each kind of noise and of gross errors."""


@pytest.mark.parametrize("effect", HIDDEN)
def test_a_large_effect_is_named_confirmed_and_placed_where_its_formula_has_it(effect):
    measured = campaign(11, scheme="fibonacci-36", effects=(effect,))
    truth = measured.truth
    found = diagnose(measured, NINE)
    assert found.verdict == "named"
    (named,) = found.found
    spec, place = effect.partition(":")[0], HIDDEN[effect]
    assert spec.partition("(")[0] in named.equivalence_class
    assert found.confirmation.confirmed
    assert found.variances["extended"] < 2 < found.variances["base"]
    if named.name == spec:  # estimates are only comparable in the same shape
        true = {p["name"]: p["value"] for p in truth["effects"][0]["parameters"]}
        for one in named.parameters:
            assert abs(one.value - true[one.name]) < 5 * one.sigma
    if place is not None:
        assert (found.like[0].coordinate, found.like[0].target) == place
        posteriors = [each.posterior for each in found.like]
        assert posteriors[0] > 0.5
        assert posteriors == sorted(posteriors, reverse=True)
        assert sum(posteriors) == pytest.approx(1)
        said = "As a smooth function, what is missing"
        assert any(line.startswith(said) for line in verdict_lines(found))


@pytest.mark.parametrize(("tau", "seed"), [(100, 0), (1200, 2)])
def test_a_warm_up_far_above_the_noise_needs_no_second_effect(tau, seed):
    """However large it is, and though no time constant of the grid fits it."""
    keys = {"effects": (f"warm_up(tau={tau}): 0.1, -0.15, 0.2",), "temperature_order": "linear"}
    (found,) = diagnose(campaign(seed, **keys), NINE).found
    assert found.name == "warm_up"
    assert float(found.spec.split("=")[1].rstrip(")")) == pytest.approx(tau, rel=0.1)


def test_hard_clipping_has_its_name_or_none():
    """An output that does not change has no inverse; at this knee one axis never clips."""
    found = diagnose(campaign(1, effects=("saturation(knee=9.6): 1, 1, 1",)), NINE)
    assert (found.verdict, [one.name for one in found.found]) == ("named", ["saturation"])
    assert found.confirmation.confirmed
    clipped = campaign(1, effects=("saturation(knee=9.4): 1, 1, 1",), approach="gravity")
    found = diagnose(clipped, NINE)
    assert found.verdict == "unknown"
    assert found.reason == Reason.of("no solution", names=("saturation",))


@pytest.mark.parametrize("approach", ["robot", "gravity"])
def test_the_other_parameters_are_right_with_the_effect(approach):
    """Far more than the noise does, so that the truth is only found with the effect."""
    measured = campaign(11, effects=("hysteresis",), size=3, approach=approach)
    truth = measured.truth
    found = diagnose(measured, NINE)
    true = [p["value"] for effect in truth["sensor"] for p in effect["parameters"]]
    sigma = np.sqrt(np.diag(found.final.solution.cofactors)[:9])
    before, after = found.base.parameters[:9], found.final.solution.parameters[:9]
    assert np.max(np.abs(np.subtract(after, true) / sigma)) < 4
    assert np.max(np.abs(np.subtract(before, true) / sigma)) > 10
