"""What no sensor can have, beside what the positions hardly determine."""

import numpy as np
import pytest

from accelstudy.effects import get_effect
from accelstudy.sensors.plausibility import implausible_parameters, largest

DRIFT = get_effect("bias_drift")


def found(value, sigma):
    values = np.array([0.0, value, 0.0])
    return implausible_parameters([DRIFT], values, np.array([np.nan, sigma, 0.0]))


def test_a_parameter_is_implausible_only_if_it_is_clearly_beyond_its_bound():
    bound = largest(DRIFT)
    assert found(0.9 * bound, 0.0) == []
    (said,) = found(2 * bound, 0.1 * bound)
    assert said.startswith("d_y = ")
    assert found(2 * bound, bound) == [], "the positions hardly determine it"


@pytest.mark.parametrize(
    ("effect", "most", "least"), [("bias", 0.25 * 9.80665, 0.35 * 9.80665), ("scale", 0.1, 0.25)]
)
def test_what_data_sheets_allow_is_plausible_and_what_is_clearly_beyond_is_not(effect, most, least):
    """The ADXL345 allows ±250 mg of its z axis and ±10 % of its sensitivity."""
    for size, n in ((most, 0), (-most, 0), (least, 1), (-least, 1)):
        values = np.array([0.0, size, 0.0])
        assert len(implausible_parameters([get_effect(effect)], values, np.zeros(3))) == n


def test_an_unknown_sigma_excuses_nothing():
    assert len(found(2 * largest(DRIFT), np.nan)) == 1
    assert len(found(2 * largest(DRIFT), np.inf)) == 1
    assert len(found(np.nan, 0.0)) == 1
