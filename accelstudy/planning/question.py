"""The question that a plan answers, and its assumptions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from accelstudy.data_sheets import DataSheet
from accelstudy.effects import get_effect

if TYPE_CHECKING:
    from accelstudy.leveling.distribution import Tilt
    from accelstudy.planning.simulated import SimulatedTilt

HOLDS = (5.0, 10.0, 20.0, 30.0, 60.0, 120.0)
"""Durations of a hold that are tried, s; `import` finds none in a rest of less than 2.4 s."""
USUAL_HOLD = 10.0
"""s, for a sensor of which only the noise of a position is known."""
HOW = {"gravity": "by hand", "robot": "with a robot"}
"""Equipment in words, by its name."""
ESTIMATED = ("bias", "scale")
"""Effects that every planned model estimates."""
NONLINEAR = ("quadratic_scale", "cubic_scale")


@dataclass(frozen=True)
class Equipment:
    """The equipment that makes positions, and the time it takes.

    Attributes
    ----------
    name : "gravity" or "robot", as the approach
    moving : float, s, from the end of a hold to the beginning of the next
    setup : float, s, before the first hold
    """

    name: str
    moving: float
    setup: float

    @property
    def how(self) -> str:
        """The equipment in words."""
        return HOW[self.name]

    def seconds(self, positions: int, hold: float) -> float:
        """Time in the field, s."""
        return self.setup + positions * (hold + self.moving)


@dataclass(frozen=True)
class Question:
    """The question that a plan answers, in SI.

    Attributes
    ----------
    target : float, rad, tilt accuracy, of roll and of pitch
    tilt_range : float, rad
    sheet : DataSheet
    equipment : tuple of Equipment
    sigma_angle : float, rad, of the robot's roll and pitch
    most_positions : int
    confidence : float, share of the calibrations that must reach the target; None for the rms
    holds : tuple of float, s, durations that are tried
    most_seconds : float, s in the field
    """

    target: float
    tilt_range: float
    sheet: DataSheet
    equipment: tuple[Equipment, ...]
    sigma_angle: float
    most_positions: int
    confidence: float | None = None
    holds: tuple[float, ...] = ()
    most_seconds: float = math.inf

    def __post_init__(self) -> None:
        if not self.holds:
            fixed = self.sheet.position_sigma is not None
            object.__setattr__(self, "holds", (USUAL_HOLD,) if fixed else HOLDS)

    @cached_property
    def sizes(self) -> dict[str, float]:
        """Usual sizes, SI, of the effects of the sensor, which cause errors if a model lacks them.

        They are the sds of the parameters over sensors: of the data sheet, else typical ones. A
        nonlinearity is divided equally into a quadratic and a cubic part. The rotation of the axes
        against the housing is left out, since it does not change the sensor's own tilt.
        """
        shares = dict.fromkeys((*ESTIMATED, "nonorthogonality"), 1.0)
        shares |= dict.fromkeys(NONLINEAR, math.sqrt(0.5))
        sizes = dict[str, float]()
        for effect, share in shares.items():
            stated = getattr(self.sheet, effect)
            between = math.sqrt(math.prod(get_effect(effect).typical))  # good and cheap equipment
            sizes[effect] = between if stated is None else share * stated
        return sizes

    @property
    def assumed(self) -> list[str]:
        """Effects that a model may lack, of a usual size, as nothing is known of them."""
        unknown = [effect for effect in self.sizes if getattr(self.sheet, effect) is None]
        return [effect for effect in unknown if effect not in ESTIMATED]

    def accuracy(self, tilt: Tilt | SimulatedTilt) -> float:
        """Tilt accuracy by the measure that is asked for, rad."""
        if self.confidence is None:
            return float(tilt.rms.max())
        return tilt.quantile_of_both(self.confidence)

    def reached_by(self, tilt: Tilt) -> bool:
        """Whether the tilt accuracy that is asked for is reached."""
        # Such a quantile is not much below the rms, which is faster to compute.
        if (self.confidence or 0.0) >= 0.7 and tilt.rms.max() > self.target:
            return False
        return self.accuracy(tilt) <= self.target
