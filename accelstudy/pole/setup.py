"""The quantities of a pole and of its use, and how well they are known.

Commands and configurations take the unit, usual value and bounds of each quantity from here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.units import Given

POLE, USE, ERRORS = "The pole", "Its use", "How well it is known (standard deviations)"
"""Sections of the quantities."""
HAND = 0.6
"""Usual height of the hand as a part of the length."""


def _given(section: str, *arguments: Any) -> Any:
    given = replace(Given(*arguments), section=section)
    return field(default=given.value if given.usual else None, metadata={"given": given})


HOLD = Given("s", "10s", "Time at each position.", 1e-3, 1e6)
ROBOT_SIGMA = Given("rad", "3.2mgon", "Sd of the robot's roll and of its pitch.", 1e-9, 0.1)
TILT_SIGMA = Given("rad", "", "Sd of roll and of pitch, if no more is known.", 1e-9, 0.5)
TILT_RANGE = Given("rad", "50gon", "Largest tilt.", 1e-3, 1.5)
"""Quantities besides those of the pole: of the sensor's calibration, and the largest tilt."""


@dataclass(frozen=True)
class Setup:
    """A pole and its use, in SI.

    The pole's own axes are forward, right and down along it, from the top to the foot; heading is
    that of forward. Lengths along the pole count to the centre of the antenna or prism.
    """

    length: float = _given(
        POLE, "m", "2m", "Length from the foot to the antenna or prism.", 0.1, 30.0
    )
    offset_forward: float = _given(
        POLE, "m", "0", "Antenna or prism in front of the axis of the pole.", -1.0, 1.0
    )
    offset_right: float = _given(
        POLE, "m", "0", "Antenna or prism to the right of the axis.", -1.0, 1.0
    )
    sensor_height: float | None = _given(
        POLE, "m", "", "Height of the sensor above the foot.  [default: the length]"
    )
    hand_height: float | None = _given(
        POLE, "m", "", f"Height of the hand above the foot.  [default: {HAND:g} of the length]"
    )
    head_mass: float = _given(POLE, "kg", "1.1kg", "Mass of what sits on top.", 0.0, 50.0)
    pole_mass: float = _given(POLE, "kg/m", "0.6kg/m", "Mass of a metre of the pole.", 0.0, 50.0)
    stiffness: float = _given(
        POLE, "Nm^2", "1500Nm2", "Stiffness of the pole against bending, E·I.", 1.0, 1e9
    )

    averaging: float = _given(USE, "s", "2s", "Time over which a reading is averaged.", 1e-3, 1e6)
    age: float = _given(
        USE, "s", "8h", "Time since the calibration, with the sensor off.", 0.0, 1e9
    )
    temperature_change: float = _given(USE, "K", "10K", "Change since the calibration.", 0.0, 200.0)

    heading_sigma: float = _given(ERRORS, "rad", "0.3gon", "Sd of the heading.", 0.0, 0.5)
    mounting_sigma: float = _given(
        ERRORS, "rad", "20mgon", "Sd of each of the sensor's axes against the pole.", 0.0, 0.2
    )
    length_sigma: float = _given(ERRORS, "m", "0.5mm", "Sd of the length.", 0.0, 1.0)
    top_sigma: float = _given(
        ERRORS, "m", "8mm", "Sd of the antenna's or prism's horizontal position.", 0.0, 10.0
    )
    top_sigma_vertical: float = _given(ERRORS, "m", "15mm", "Sd of its height.", 0.0, 10.0)

    def __post_init__(self) -> None:
        for name in ("sensor_height", "hand_height"):
            height = getattr(self, name)
            if height is not None and height > self.length:
                raise InputError(
                    f"{name}: {height:g} m is above the top of the pole; its length is "
                    f"{self.length:g} m"
                )

    @property
    def sensor_at(self) -> float:
        """Height of the sensor above the foot along the pole, m."""
        return self.length if self.sensor_height is None else self.sensor_height

    @property
    def hand_at(self) -> float:
        """Height of the hand above the foot along the pole, m."""
        return HAND * self.length if self.hand_height is None else self.hand_height


LINEAR = ("model", "scheme", "approach", "hold", "robot_sigma")
"""Options that describe a calibration that has not been made yet."""
KINDS = (("calibration",), ("tilt_sigma",), LINEAR)
"""Ways to say how the sensor is calibrated; they exclude each other."""


def check_one_kind(given: Mapping[str, str]) -> None:
    """Check that the calibration is described in one way.

    Parameters
    ----------
    given : mapping of the names in `KINDS` that the user gave, to how the user writes them

    Raises
    ------
    InputError
        If two ways are mixed.
    """
    kinds = [next(given[n] for n in kind if n in given) for kind in KINDS if set(kind) & set(given)]
    if len(kinds) > 1:
        raise InputError(f"{kinds[0]} and {kinds[1]} exclude each other: give one of them")


def quantities() -> dict[str, Given]:
    """All quantities of a pole, by name."""
    return {each.name: each.metadata["given"] for each in fields(Setup)}


def setup_of(texts: Mapping[str, Any]) -> Setup:
    """Make a pole and its use from texts with units, as in a configuration.

    Raises
    ------
    InputError
        If there is no such quantity, or a text cannot be read.
    """
    all_quantities = quantities()
    values = {}
    for name, text in texts.items():
        if name not in all_quantities:
            raise UnknownNameError("quantity of a pole", name, all_quantities)
        try:
            values[name] = all_quantities[name].read(str(text))
        except InputError as error:
            raise InputError(f"{name}: {error}") from None
    return Setup(**values)
