"""Coordinates of a session, and what may depend on them, as people see and say them."""

from __future__ import annotations

from dataclasses import dataclass

from accelstudy.basics.units import attitude_unit, to_attitude
from accelstudy.basics.wording import number
from accelstudy.effects import learned
from accelstudy.effects.learned import WAVES


@dataclass(frozen=True)
class Coordinate:
    """How people see a coordinate.

    Attributes
    ----------
    words : str
    unit, step : str, of its values and of their differences
    size : float, SI size of that unit
    has_zero : bool, whether its zero means something
    is_course : bool, whether it counts from a start on
    place : str, words where no axis is meant, if these are others
    """

    words: str
    unit: str
    step: str
    size: float = 1.0
    has_zero: bool = False
    is_course: bool = False
    place: str = ""

    def at(self, value: float) -> str:
        """Show a value."""
        return f"{number(value / self.size)} {self.unit}".rstrip()

    def by(self, value: float) -> str:
        """Show a difference of values."""
        return f"{number(value / self.size)} {self.step}"


def coordinate_of(name: str) -> Coordinate:
    """Describe a coordinate of a learned effect, or of a place."""
    name = WAVES.get(name, name)
    if name in ANGLES:
        unit = attitude_unit()
        words, place = ANGLES[name]
        return Coordinate(words, unit, unit, float(1 / to_attitude(1.0)), place=place)
    return COORDINATES[name]


ANGLES = {
    "angle": ("the angle", "roll and pitch"),
    "yaw": ("the yaw", "the yaw"),
    "move": ("the last move of the robot", "the last move of the robot"),
}
FORCE = ("m/s²", "m/s²", 1.0, True)
RATE = Coordinate("the rate of the temperature", "K/min", "K/min", 1 / 60, True)
COORDINATES = {
    "force": Coordinate("the force along the same axis", *FORCE, place="the force"),
    "previous": Coordinate("the force in the position before", *FORCE),
    "next": Coordinate("the step to the next position", *FORCE),
    "vibration": Coordinate("the vibration", *FORCE, place="vibration"),
    "temperature": Coordinate("the temperature", "°C", "K", place="temperature"),
    "temperature rate": RATE,
    "dT/dt": RATE,
    "time": Coordinate("the time", "min", "min", 60.0, is_course=True, place="time"),
    "order": Coordinate("the number of the position", "", "positions", is_course=True),
}
"""Coordinates that are no angles."""


@dataclass(frozen=True)
class Target:
    """What depends on a coordinate.

    Attributes
    ----------
    label, words : str, short and in a sentence, with a place for the components
    alone : str, in a sentence, without them
    components : tuple of str
    unit : str, SI
    """

    label: str
    words: str
    alone: str
    components: tuple[str, ...]
    unit: str


WORDS = {
    "bias": ("bias of {}", "the bias of {}", "a bias"),
    "scale": ("scale of {}", "the scale of {}", "a scale"),
    "square": ("quadratic scale of {}", "the quadratic scale of {}", "a scale"),
    "nonorthogonality": ("non-orthogonality {}", "the non-orthogonality {}", "a non-orthogonality"),
    "mounting": ("rotation about {}", "the rotation of the sensor on its mounting about {}",
                 "a rotation of the sensor on its mounting"),
    "reading": ("reading of {}", "the robot's reading of {}", "an error of the robot's readings"),
    "tilt": ("tilt {}", "the tilt of the robot's base ({})", "a tilt of the base"),
}  # fmt: skip
TARGETS = {name: Target(*said, *learned.TARGETS[name]) for name, said in WORDS.items()}
