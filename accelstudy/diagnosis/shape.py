"""A learned function as people see it: what depends on what, and its table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.units import attitude_unit, to_attitude
from accelstudy.basics.wording import comma_list, number
from accelstudy.diagnosis.decision.functions import coordinate_values
from accelstudy.diagnosis.decision.verdict import Finding
from accelstudy.diagnosis.rules import RULES
from accelstudy.effects import learned
from accelstudy.effects.learned import OF_EACH, WAVES, LearnedFunction

Array = NDArray[np.float64]

POINTS = 121
"""Values of the coordinate in the table of a function."""


# --- coordinates, and what may depend on them ---------------------------------------------------


class Coordinate(NamedTuple):
    """How people see a coordinate.

    Attributes
    ----------
    words : str
    place : str, the same where no axis is meant
    unit : str, of its values
    size : float, SI size of that unit
    """

    words: str
    place: str
    unit: str
    size: float = 1.0

    def at(self, value: float) -> str:
        """Show a value."""
        return f"{number(value / self.size)} {self.unit}".rstrip()


def coordinate_of(name: str) -> Coordinate:
    """Describe a coordinate of a learned effect, or of a place."""
    words, place, unit, size = COORDINATES[WAVES.get(name, name)]
    if unit == "rad":
        unit, size = attitude_unit(), float(1 / to_attitude(1.0))
    return Coordinate(words, place or words, unit, size)


RATE = "the rate of the temperature", "", "K/min", 1 / 60
COORDINATES = {
    "angle": ("the angle", "roll and pitch", "rad", 1.0),
    "yaw": ("the yaw", "", "rad", 1.0),
    "move": ("the last move of the robot", "", "rad", 1.0),
    "force": ("the force along the same axis", "the force", "m/s²", 1.0),
    "previous": ("the force in the position before", "", "m/s²", 1.0),
    "next": ("the step to the next position", "", "m/s²", 1.0),
    "vibration": ("the vibration", "vibration", "m/s²", 1.0),
    "temperature": ("the temperature", "temperature", "°C", 1.0),
    "temperature rate": RATE,
    "dT/dt": RATE,
    "time": ("the time", "time", "min", 60.0),
    "order": ("the number of the position", "", "", 1.0),
}
"""Words of each coordinate, also where no axis is meant if these are others, and its unit."""


class Target(NamedTuple):
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


# --- the function -------------------------------------------------------------------------------


@dataclass(frozen=True)
class LearnedShape:
    """A function h of a coordinate that was learned, without a name in the catalogue.

    Attributes
    ----------
    coordinate, target : str
    effect : LearnedFunction
    subject : str, what depends on what: "the bias of x and y depends on the yaw"
    components : tuple of str, c components that have a function
    axes : tuple of str, those in which it shows
    grid : (k,) array, the coordinate, SI
    values, sigmas : (k, c) arrays, h and its sigma there, SI
    """

    coordinate: str
    target: str
    effect: LearnedFunction
    subject: str
    components: tuple[str, ...]
    axes: tuple[str, ...]
    grid: Array
    values: Array
    sigmas: Array

    @property
    def extents(self) -> dict[str, float]:
        """How far the function goes up and down in the session, by the axes in which it shows."""
        extents = zip(self.components, np.ptp(self.values, axis=0).tolist(), strict=True)
        return {name: extent for name, extent in extents if name in self.axes}


def shape_of(finding: Finding, variance: float) -> LearnedShape | None:
    """Describe the function that was learned; None if none was.

    Parameters
    ----------
    finding : Finding, whose first choice is the function
    variance : float, of unit weight
    """
    if finding.place is None:
        return None
    effect, frame, solution = finding.chosen[0].shape.effect, finding.frame, finding.frame.solution
    assert isinstance(effect, LearnedFunction)
    at = coordinate_values(effect, frame)
    if effect.coordinate not in (*OF_EACH, "angle"):
        at = at[:, :1]
    grid = np.linspace(at.min(), at.max(), POINTS)
    names = list(solution.model.parameter_names)
    own = [names.index(parameter.name) for parameter in effect.parameters]
    parameters, cofactors = solution.parameters[own], solution.cofactors[np.ix_(own, own)]
    values, sigmas = effect.function(grid, parameters, variance * cofactors)
    target, most = TARGETS[effect.target], np.max(np.abs(values) / sigmas, axis=0)
    shown = most >= min(RULES.z_component, most.max())
    axes = tuple(name for name, seen in zip(target.components, shown, strict=True) if seen)
    which = "all axes" if len(axes) == len("xyz") else comma_list(axes)
    return LearnedShape(
        *finding.place,
        effect,
        f"{target.words.format(which)} depends on {coordinate_of(effect.coordinate).words}",
        target.components,
        axes,
        grid,
        values,
        sigmas,
    )
