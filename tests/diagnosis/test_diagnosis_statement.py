"""What a credible set leaves no doubt of, on sets made by hand."""

import pytest

from accelstudy.diagnosis.decision.posterior import Explanation
from accelstudy.diagnosis.decision.statement import statement
from accelstudy.diagnosis.report.words import missing, most_probable, not_told_apart, without_a_name

SLOW, EVEN = "slow change in time", "even nonlinearity"
COSINES = {
    frozenset({"bias_drift", "warm_up"}): 0.93,
    frozenset({"quadratic_scale", "scale_asymmetry"}): 0.96,
}


FOUR_PAIRS = (
    ("bias_drift+quadratic_scale", 0.36),
    ("warm_up+quadratic_scale", 0.28),
    ("scale_asymmetry+bias_drift", 0.2),
    ("warm_up+scale_asymmetry", 0.15),
)


def made(*explanations):
    """Explanations, each "one+two" with its posterior; = joins names that mean the same."""
    found = []
    for text, p in explanations:
        classes = tuple(tuple(part.split("=")) for part in text.split("+"))
        found.append(Explanation(tuple(c[0] for c in classes), classes, p))
    return tuple(found)


@pytest.mark.parametrize(("explanations", "certain", "beside"), [
    # one name
    ([("thermal_bias", 0.97)], [("", {"thermal_bias": 0.97}, None)], []),
    # near rivals are one family
    ([("bias_drift", 0.51), ("warm_up", 0.44)],
     [(SLOW, {"bias_drift": 0.51, "warm_up": 0.44}, 0.93)], []),
    # four pairs are a set for each part
    (FOUR_PAIRS,
     [(SLOW, {"bias_drift": 0.56, "warm_up": 0.43}, 0.93),
      (EVEN, {"quadratic_scale": 0.64, "scale_asymmetry": 0.35}, 0.96)],
     []),
    # what one name leaves is open
    ([("hysteresis+quadratic_scale", 0.4), ("hysteresis", 0.3), ("hysteresis+warm_up", 0.25)],
     [("", {"hysteresis": 0.95}, None)],
     [(("quadratic_scale",), 0.4), ((), 0.3), (("warm_up",), 0.25)]),
    # a family beside which more may be missing
    ([("bias_drift", 0.5), ("warm_up+hysteresis", 0.42)],
     [(SLOW, {"bias_drift": 0.5, "warm_up": 0.42}, 0.93)],
     [((), 0.5), (("hysteresis",), 0.42)]),
    # strangers leave nothing certain
    ([("bias_drift+hysteresis", 0.5), ("saturation", 0.45)],
     [],
     [(("bias_drift", "hysteresis"), 0.5), (("saturation",), 0.45)]),
    # a class with a name of another family is of no family
    ([("bias_drift=thermal_bias", 0.5), ("warm_up", 0.45)],
     [],
     [(("bias_drift",), 0.5), (("warm_up",), 0.45)]),
    # two of a family are two things
    ([("bias_drift+warm_up", 0.6), ("bias_drift+quadratic_scale", 0.35)],
     [("", {"bias_drift": 0.95}, None)],
     [(("warm_up",), 0.6), (("quadratic_scale",), 0.35)]),
    # two bumped positions count once
    ([("outlier_position+outlier_position", 0.6), ("outlier_position", 0.35)],
     [("", {"outlier_position": 0.95}, None)], []),
    # too little is not certain
    ([("bias_drift", 0.5), ("warm_up", 0.3)], [], [(("bias_drift",), 0.5), (("warm_up",), 0.3)]),
    ([], [], []),
])  # fmt: skip
def test_what_is_certain_of_a_set_and_what_is_open(explanations, certain, beside):
    """Parts by their family, unless they have one name, with the posteriors and the purity."""
    cosine = lambda a, b: COSINES.get(frozenset({a, b}), 0.2)  # noqa: E731
    found = statement(made(*explanations), cosine)
    for part, (family, names, purity) in zip(found.certain, certain, strict=True):
        assert len(part.names) == 1 or part.family == family
        assert {name.name: name.posterior for name in part.names} == pytest.approx(names)
        assert part.posterior == pytest.approx(sum(names.values()))
        assert part.purity == purity
    assert [(one.names, pytest.approx(one.posterior)) for one in found.open] == beside


@pytest.mark.parametrize(("explanations", "words", "apart"), [
    ([("bias_drift", 0.51), ("warm_up", 0.44)], "a slow change in time: bias drift or warm up",
     "bias drift (0.51) and warm up (0.44) apart"),
    (
        FOUR_PAIRS,
        "a slow change in time (bias drift or warm up) and an even nonlinearity (quadratic "
        "scale or scale asymmetry)",
        "bias drift (0.56) and warm up (0.43), nor quadratic scale (0.64) and scale asymmetry "
        "(0.35) apart",
    ),
    ([("base_tilt=encoder_offset", 0.6), ("encoder_scale", 0.35)],
     "an error in the attitude of the rig: base tilt, encoder offset or encoder scale",
     "base tilt or encoder offset (0.6) and encoder scale (0.35) apart"),
    (
        [("bias_drift", 0.5), ("warm_up+hysteresis", 0.42)],
        "a slow change in time (bias drift or warm up), and perhaps hysteresis",
        "bias drift (0.5) and warm up (0.42) apart, nor whether hysteresis (0.42) is missing "
        "as well",
    ),
    ([("thermal_bias", 0.5), ("warm_up", 0.42)], "thermal bias or warm up",
     "thermal bias (0.5) and warm up (0.42) apart"),
    ([("bias_drift+hysteresis", 0.5), ("saturation", 0.45)],
     "bias drift with hysteresis, or saturation",
     "bias drift with hysteresis (0.5) and saturation (0.45) apart"),
    ([("bias_drift", 0.5), ("warm_up", 0.3), ("coloured_noise", 0.12)],
     "a slow change in time: bias drift or warm up, unless it is coloured noise",
     "bias drift (0.5) and warm up (0.3) apart"),
    (  # what has next to no probability is left to the figure
        [("bias_drift", 0.55), ("warm_up", 0.3), ("warm_up+settling", 0.04), ("unknown", 0.03)],
        "a slow change in time: bias drift or warm up",
        "bias drift (0.55) and warm up (0.34) apart",
    ),
    ([("hysteresis", 0.68), ("coloured_noise", 0.25)], "hysteresis, unless it is coloured noise",
     "hysteresis (0.68) and coloured noise (0.25) apart"),
])  # fmt: skip
def test_a_small_set_in_words(explanations, words, apart):
    assert missing(made(*explanations)) == words
    assert not_told_apart(made(*explanations)) == f"This campaign cannot tell {apart}"


def test_what_is_certain_of_the_unknown_comes_first():
    with_many = [(f"bias_drift+{name}", 0.18) for name in ("hysteresis", "settling", "saturation")]
    spread = made(*with_many, ("warm_up+cubic_scale", 0.2), ("warm_up+quadratic_scale", 0.17))
    slow = "a slow change in time (bias drift or warm up)"
    assert without_a_name(spread) == (
        f"The model lacks {slow}; what is missing beside it has no name here."
    )
    open_end = made(*with_many, ("warm_up", 0.2), ("warm_up+quadratic_scale", 0.17))
    assert without_a_name(open_end) == (
        f"The model lacks {slow}; whether more is missing, and what, is open."
    )
    # It would have been named, had it not left a misfit.
    misfit = made(("bias_drift+hysteresis", 0.95))
    assert without_a_name(misfit) == (
        "What is missing from the model is much like bias drift and hysteresis, and yet it has no "
        "name here."
    )


def test_the_unknown_is_said_by_families():
    spread = made(
        ("bias_drift", 0.4),
        ("coloured_noise", 0.25),
        ("warm_up", 0.2),
        ("unknown", 0.1),
        ("hysteresis", 0.05),
    )
    assert most_probable(spread) == (
        "Most probable: a slow change in time (0.6), noise of another kind (0.25) and something "
        "that is not in the catalogue (0.1)."
    )
    beside = made(("bias_drift+unknown", 0.7), ("bias_drift+hysteresis", 0.25))
    assert without_a_name(beside).startswith("The model lacks bias drift; what is missing beside")
    assert most_probable(beside) == (
        "Most probable beside it: something that is not in the catalogue (0.7) and a memory of the "
        "previous position (0.25)."
    )


@pytest.mark.parametrize("explanations", [
    [("unknown", 0.95)],
    [("coloured_noise", 0.5), ("heavy_tails", 0.45)],
    [("bias_drift", 0.3), ("hysteresis", 0.2), ("coloured_noise", 0.3), ("unknown", 0.15)],
])  # fmt: skip
def test_nothing_is_certain_of_what_no_effect_explains(explanations):
    assert without_a_name(made(*explanations)).startswith("Something is missing from the model")
