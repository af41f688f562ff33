"""What a credible set leaves no doubt of, on sets made by hand."""

import pytest

from accelstudy.diagnosis.decision.explanations import Explanation
from accelstudy.diagnosis.report.statement import statement

SLOW, EVEN = "slow change in time", "even nonlinearity"
FAMILIES = {
    **dict.fromkeys(["bias_drift", "warm_up"], SLOW),
    **dict.fromkeys(["quadratic_scale", "scale_asymmetry"], EVEN),
}
COSINES = {
    frozenset({"bias_drift", "warm_up"}): 0.93,
    frozenset({"quadratic_scale", "scale_asymmetry"}): 0.96,
}


def family(*members):
    found = {FAMILIES.get(name, "") for name in members}
    return found.pop() if len(found) == 1 else ""


def said(*explanations):
    """Statement about explanations, each "one + two" with its posterior; = joins equal names."""
    made = []
    for text, p in explanations:
        classes = tuple(tuple(part.split("=")) for part in text.split("+"))
        made.append(Explanation(tuple(c[0] for c in classes), classes, p))
    return statement(made, family, lambda a, b: COSINES.get(frozenset({a, b}), 0.2))


def parts(found):
    return [(part.family, [name.name for name in part.names]) for part in found.certain]


def beside(found):
    return [(one.names, pytest.approx(one.posterior)) for one in found.open]


def test_one_name_is_certain():
    found = said(("thermal_bias", 0.97))
    assert parts(found) == [("", ["thermal_bias"])]
    assert found.certain[0].purity is None
    assert not found.open


def test_near_rivals_are_one_family():
    found = said(("bias_drift", 0.51), ("warm_up", 0.44))
    assert parts(found) == [(SLOW, ["bias_drift", "warm_up"])]
    (part,) = found.certain
    assert part.posterior == pytest.approx(0.95)
    assert part.purity == 0.93
    assert not found.open


def test_four_pairs_are_a_set_for_each_part():
    found = said(
        ("bias_drift+quadratic_scale", 0.36),
        ("warm_up+quadratic_scale", 0.28),
        ("scale_asymmetry+bias_drift", 0.2),
        ("warm_up+scale_asymmetry", 0.15),
    )
    assert parts(found) == [
        (SLOW, ["bias_drift", "warm_up"]),
        (EVEN, ["quadratic_scale", "scale_asymmetry"]),
    ]
    assert [name.posterior for name in found.certain[0].names] == pytest.approx([0.56, 0.43])
    assert [part.purity for part in found.certain] == [0.93, 0.96]
    assert not found.open


def test_what_one_name_leaves_is_open():
    found = said(
        ("hysteresis+quadratic_scale", 0.4), ("hysteresis", 0.3), ("hysteresis+warm_up", 0.25)
    )
    assert parts(found) == [("", ["hysteresis"])]
    assert beside(found) == [(("quadratic_scale",), 0.4), ((), 0.3), (("warm_up",), 0.25)]


def test_a_family_beside_which_more_may_be_missing():
    found = said(("bias_drift", 0.5), ("warm_up+hysteresis", 0.42))
    assert parts(found) == [(SLOW, ["bias_drift", "warm_up"])]
    assert beside(found) == [((), 0.5), (("hysteresis",), 0.42)]


def test_strangers_leave_nothing_certain():
    found = said(("bias_drift+hysteresis", 0.5), ("saturation", 0.45))
    assert not found.certain
    assert beside(found) == [(("bias_drift", "hysteresis"), 0.5), (("saturation",), 0.45)]


def test_a_class_with_another_family_in_it_is_no_family():
    found = said(("bias_drift=thermal_bias", 0.5), ("warm_up", 0.45))
    assert not found.certain


def test_two_of_a_family_are_two_things():
    found = said(("bias_drift+warm_up", 0.6), ("bias_drift+quadratic_scale", 0.35))
    assert parts(found) == [(SLOW, ["bias_drift"])]
    assert beside(found) == [(("warm_up",), 0.6), (("quadratic_scale",), 0.35)]


def test_too_little_is_not_certain():
    assert not said(("bias_drift", 0.5), ("warm_up", 0.3)).certain
    assert said() == said()
    assert not said().certain
    assert not said().open
