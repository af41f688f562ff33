"""What a credible set leaves no doubt of, on sets made by hand."""

import pytest
from diagnosis_helpers import explanation

from accelstudy.diagnosis.decision.statement import family_of, statement_of
from accelstudy.diagnosis.report.words import missing, most_probable, without_a_name

SLOW, EVEN = "slow change in time", "even nonlinearity"

FOUR_PAIRS = (
    ("bias_drift+quadratic_scale", 0.36),
    ("warm_up+quadratic_scale", 0.28),
    ("scale_asymmetry+bias_drift", 0.2),
    ("warm_up+scale_asymmetry", 0.15),
)


RIVALS = (
    ("bias_drift", "warm_up", "thermal_bias"),
    ("quadratic_scale", "scale_asymmetry"),
    ("base_tilt", "encoder_offset", "encoder_scale"),
)
"""Effects whose signatures are alike in the campaigns of this file."""


def cosine(one, other):
    """Canonical cosine of the signatures of two effects."""
    return 0.8 if any({one, other} <= {*alike} for alike in RIVALS) else 0.1


def made(*explanations):
    """Explanations, each "one+two" with its posterior; = joins names that mean the same."""
    return tuple(explanation(text, posterior=p) for text, p in explanations)


@pytest.mark.parametrize(("explanations", "certain", "beside"), [
    # one name
    ([("thermal_bias", 0.97)], [("", {"thermal_bias": 0.97})], []),
    # what is not like it does not stand in its place
    ([("bias_drift", 0.92), ("hysteresis", 0.05)],
     [("", {"bias_drift": 0.92})], [((), 0.92), (("hysteresis",), 0.05)]),
    # near rivals are one family
    ([("bias_drift", 0.51), ("warm_up", 0.44)],
     [(SLOW, {"bias_drift": 0.51, "warm_up": 0.44})], []),
    # four pairs are a set for each part
    (FOUR_PAIRS,
     [(SLOW, {"bias_drift": 0.56, "warm_up": 0.43}),
      (EVEN, {"quadratic_scale": 0.64, "scale_asymmetry": 0.35})],
     []),
    # what one name leaves is open
    ([("hysteresis+quadratic_scale", 0.4), ("hysteresis", 0.3), ("hysteresis+warm_up", 0.25)],
     [("", {"hysteresis": 0.95})],
     [(("quadratic_scale",), 0.4), ((), 0.3), (("warm_up",), 0.25)]),
    # a family beside which more may be missing
    ([("bias_drift", 0.5), ("warm_up+hysteresis", 0.42)],
     [(SLOW, {"bias_drift": 0.5, "warm_up": 0.42})],
     [((), 0.5), (("hysteresis",), 0.42)]),
    # strangers leave nothing certain
    ([("bias_drift+hysteresis", 0.5), ("saturation", 0.45)],
     [],
     [(("bias_drift", "hysteresis"), 0.5), (("saturation",), 0.45)]),
    # names of several families have none in common
    ([("bias_drift=thermal_bias", 0.5), ("warm_up", 0.45)],
     [("", {"bias_drift": 0.5, "warm_up": 0.45})], []),
    # what one family has in common is not enough where the signatures differ
    ([("hysteresis", 0.5), ("settling", 0.45)],
     [], [(("hysteresis",), 0.5), (("settling",), 0.45)]),
    # two of a family are two things
    ([("bias_drift+warm_up", 0.6), ("bias_drift+quadratic_scale", 0.35)],
     [("", {"bias_drift": 0.95})],
     [(("warm_up",), 0.6), (("quadratic_scale",), 0.35)]),
    # a rival that hardly matters belongs to what is certain, but not to its names
    ([("bias_drift", 0.6), ("warm_up", 0.32), ("thermal_bias", 0.05)],
     [(SLOW, {"bias_drift": 0.6, "warm_up": 0.32})], []),
    # two outlier positions count once
    ([("outlier_position+outlier_position", 0.6), ("outlier_position", 0.35)],
     [("", {"outlier_position": 0.95})], []),
    # too little is not certain
    ([("bias_drift", 0.5), ("warm_up", 0.3)], [], [(("bias_drift",), 0.5), (("warm_up",), 0.3)]),
    ([], [], []),
])  # fmt: skip
def test_what_is_certain_of_a_set_and_what_is_open(explanations, certain, beside):
    """Parts by their family, unless they have one name, with the posteriors."""
    found = statement_of(made(*explanations), cosine)
    for part, (family, names) in zip(found.certain, certain, strict=True):
        assert len(part.names) == 1 or part.family == family
        assert {name.name: name.posterior for name in part.names} == pytest.approx(names)
        assert part.posterior >= sum(names.values()) - 1e-9
        assert part.purity == (None if len(names) == 1 else 0.8)
    assert [(one.names, pytest.approx(one.posterior)) for one in found.open] == beside


@pytest.mark.parametrize(("explanations", "words"), [
    (FOUR_PAIRS,
     "a slow change in time (bias drift or warm up) and an even nonlinearity (quadratic scale or "
     "scale asymmetry)"),
    ([("base_tilt=encoder_offset", 0.6), ("encoder_scale", 0.35)],
     "an error in the attitude of the rig: base tilt, encoder offset or encoder scale"),
    ([("bias_drift", 0.5), ("warm_up+hysteresis", 0.42)],
     "a slow change in time (bias drift or warm up), and perhaps hysteresis"),
    # what has next to no probability is left to the page
    ([("bias_drift", 0.55), ("warm_up", 0.3), ("warm_up+settling", 0.04), ("unknown", 0.03)],
     "a slow change in time: bias drift or warm up"),
])  # fmt: skip
def test_a_small_set_in_words(explanations, words):
    assert missing(made(*explanations), cosine) == words


def test_what_is_certain_of_the_unknown_comes_first():
    """What is beside it follows by name, if these are few; else only that something is."""
    rare = [(f"bias_drift+{name}", 0.18) for name in ("hysteresis", "settling", "saturation")]
    slow = "The model lacks a slow change in time (bias drift or warm up)"
    for explanations, says in (
        ([*rare, ("warm_up+cubic_scale", 0.2), ("warm_up+quadratic_scale", 0.17)],
         "The model lacks a slow change in time: bias drift or warm up; what is missing beside it "
         "has no name here."),
        ([*rare, ("warm_up", 0.2), ("warm_up+quadratic_scale", 0.17)],
         f"{slow}, and perhaps hysteresis, settling, saturation or quadratic scale."),
    ):  # fmt: skip
        assert without_a_name(statement_of(made(*explanations), cosine)) == says


def test_what_is_worth_a_word_has_its_probability():
    spread = made(("bias_drift+hysteresis", 0.6), ("unknown", 0.32), ("warm_up", 0.05))
    assert most_probable(spread) == (
        "bias drift with hysteresis (0.6) and something that is not in the catalogue (0.32)"
    )


def test_names_that_are_not_alike_are_no_component():
    """Each is like the most probable one, and not like the other."""

    def chain(one, other):
        return 0.3 if {one, other} == {"bias_drift", "hysteresis"} else 0.7

    three = made(("warm_up", 0.4), ("bias_drift", 0.3), ("hysteresis", 0.25))
    assert statement_of(three, chain).certain == ()
    (part,) = statement_of(three[:2], chain, probability=0.6).certain
    assert (part.purity, family_of("warm_up", "bias_drift")) == (0.7, part.family)


@pytest.mark.parametrize("explanations", [
    [("unknown", 0.95)],
    [("coloured_noise", 0.5), ("heavy_tails", 0.45)],
    [("bias_drift", 0.3), ("hysteresis", 0.2), ("coloured_noise", 0.3), ("unknown", 0.15)],
])  # fmt: skip
def test_nothing_is_certain_of_what_no_effect_explains(explanations):
    says = without_a_name(statement_of(made(*explanations), cosine))
    assert says.startswith("Something is missing from the model")
