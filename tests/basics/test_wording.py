"""Numbers and quantities as all messages and pages write them."""

import math

import pytest

from accelstudy.basics.units import GON, MGON
from accelstudy.basics.wording import estimate, number, p_value, quantity_text


@pytest.mark.parametrize(("value", "expected"), [
    (0, "0"),
    (0.04419, "0.0442"),
    (0.9996, "1.00"),
    (99.96, "100"),
    (441.9, "442"),
    (-1999517, "−1999517"),
    (999999999.7, "1.00 · 10⁹"),
    (1.2345e16, "1.23 · 10¹⁶"),
    (math.nan, "–"),
    (-math.inf, "−∞"),
])  # fmt: skip
def test_a_number_has_three_significant_digits(value, expected):
    assert number(value) == expected


@pytest.mark.parametrize(("value", "unit", "expected"), [
    (12.34 * MGON, "rad", "12.34 mgon"),
    (30 * GON, "rad", "30 gon"),
    (30.04321 * GON, "rad", "30.0 gon"),
    (0.0004419312, "m/s^2", "0.442 mm/s^2"),
    (200.0, "m/s^2", "200000 mm/s^2"),
    (0.05, "1", "50000 ppm"),
    (0.5, "s^2/m^2", "0.5 s^2/m^2"),
])  # fmt: skip
def test_a_round_quantity_gets_no_zeros(value, unit, expected):
    assert quantity_text(value, unit) == expected


@pytest.mark.parametrize(("value", "sigma", "expected"), [
    (1.23456, 0.0321, ("1.235", "0.032")),
    (1.23456, 0.0996, ("1.23", "0.10")),
    (-123456, 1234, ("−123500", "1200")),
    (-123456, 99.6, ("−123460", "100")),
    (12.5, 1.5, ("12.5", "1.5")),
    (1 / 3, 0.0, ("0.333333", "0.000000")),
    (1 / 3, math.nan, ("0.333", "–")),
])  # fmt: skip
def test_a_value_is_as_exact_as_its_sigma_says(value, sigma, expected):
    assert estimate(value, sigma, "K") == expected


def test_a_p_value_has_its_sign_of_relation():
    shown = [p_value(p) for p in (1e-13, 2.44e-5, 0.0321, 0.5, 0.9999)]
    assert shown == ["p < 10⁻¹²", "p = 2.4 · 10⁻⁵", "p = 0.032", "p = 0.5", "p > 0.999"]
