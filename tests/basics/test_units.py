"""Units at the border, and what is said of a unit that is unknown."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from accelstudy.basics.units import (
    GON,
    STANDARD_GRAVITY,
    UNITS,
    InputQuantity,
    angle_note,
    angles_in,
    attitude_unit,
    display_unit,
    recorded_unit,
    to_attitude,
    to_display,
    to_recorded,
    to_si,
)


@pytest.mark.parametrize(("value", "given", "unit", "expected"), [
    (400, "gon", "rad", 2 * math.pi),
    (1000, "mgon", "rad", GON),
    (90, "deg", "rad", math.pi / 2),
    (3600, "arcsec", "rad", math.pi / 180),
    (2, "mrad", "rad", 2e-3),
    (200, "ppm", "1", 2e-4),
    (3, "%", "1", 0.03),
    (1, "g", "m/s^2", 9.80665),
    (1, "mg/K", "m/s^2/K", 9.80665e-3),
    (3.6, "mm/s^2/h", "m/s^2/s", 1e-6),
    (9.80665, "ug/g^2", "s^2/m", 1e-6),
    (7, "K", "K", 7),  # a unit that is shown as it is
])  # fmt: skip
def test_conversions(value, given, unit, expected):
    assert to_si(value, given, unit) == pytest.approx(expected, rel=1e-14)


@given(unit=st.sampled_from([*UNITS, "s"]), value=st.floats(-1e6, 1e6))
def test_what_is_shown_can_be_read_back(unit, value):
    back = to_si(to_display(value, unit), display_unit(unit), unit)
    assert back == pytest.approx(value, rel=1e-14)
    assert to_si(to_recorded(value, unit), recorded_unit(unit), unit) == pytest.approx(
        value, rel=1e-14
    )


def test_angles_in_degrees_are_for_people_only():
    with angles_in("deg"):
        assert (attitude_unit(), display_unit("rad")) == ("deg", "mdeg")
        assert to_attitude(math.pi / 4) == pytest.approx(45, rel=1e-14)
        assert to_display(math.pi / 180, "rad") == pytest.approx(1000, rel=1e-14)
        assert recorded_unit("rad") == "mgon"
        assert to_recorded(math.pi / 200, "rad") == pytest.approx(1000, rel=1e-14)
        assert display_unit("1") == "ppm"
        assert "1 mdeg" in angle_note()
        with angles_in(None):
            assert attitude_unit() == "deg"
        with angles_in("gon"):
            assert to_attitude(math.pi / 2) == pytest.approx(100, rel=1e-14)
    assert (attitude_unit(), display_unit("rad")) == ("gon", "mgon")
    assert "100 gon = 90°" in angle_note()


@pytest.mark.parametrize(("text", "unit", "expected"), [
    ("0.01deg", "rad", math.radians(0.01)),
    ("0.01°", "rad", math.radians(0.01)),
    ("2mm/s2", "m/s^2", 2e-3),
    ("2 mm/s²", "m/s^2", 2e-3),
    ("50µg", "m/s^2", 50e-6 * STANDARD_GRAVITY),
    (".5 %", "1", 0.005),
    ("1.5e1mm", "m", 0.015),
    ("-3h", "s", -10800.0),
    ("0", "m", 0.0),
])  # fmt: skip
def test_a_number_with_its_unit_is_read(text, unit, expected):
    assert InputQuantity(unit, -math.inf).read(text) == pytest.approx(expected, rel=1e-14)
