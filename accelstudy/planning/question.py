"""The question that a plan answers, and its assumptions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from accelstudy.basics.errors import InputError, key
from accelstudy.data_sheets import DataSheet, get_data_sheet, read_data_sheet
from accelstudy.effects import get_effect
from accelstudy.planning.quantities import QUANTITIES
from accelstudy.schemes import Scheme, get_scheme, is_scheme_file

if TYPE_CHECKING:
    from accelstudy.leveling.distribution import Tilt
    from accelstudy.planning.simulated import SimulatedTilt

HOLDS = (1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0)
"""Durations of a hold that are tried, s."""
USUAL_HOLD = 10.0
"""s, for a sensor of which only the noise of a position is known."""
NONLINEAR = ("quadratic_scale", "cubic_scale")
LOGS = (".csv", ".txt", ".gz", ".mat", ".parquet", ".log", ".dat")
"""Endings of files that are no data sheets, though one can be made of them."""


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
        return "by hand" if self.name == "gravity" else "with a robot"

    def seconds(self, positions: int, hold: float) -> float:
        """Time in the field, s."""
        return self.setup + positions * (hold + self.moving)


BY_HAND = Equipment("gravity", QUANTITIES["moving_time"].value, 0.0)
ROBOT = Equipment(
    "robot", QUANTITIES["robot_moving_time"].value, QUANTITIES["robot_setup_time"].value
)


@dataclass(frozen=True)
class Question:
    """The question that a plan answers, in SI.

    Attributes
    ----------
    target : float, rad, tilt accuracy, of roll and of pitch
    tilt_range : float, rad
    sheet : DataSheet
    equipment : tuple of Equipment
    confidence : float, share of the calibrations that must reach the target; None for the rms
    holds : tuple of float, s, durations that are tried
    sigma_angle : float, rad, of the robot's roll and pitch
    most_seconds : float, s in the field
    most_positions : int
    schemes : tuple of str, names or files of schemes besides those that are always compared
    """

    target: float
    tilt_range: float
    sheet: DataSheet
    equipment: tuple[Equipment, ...] = (BY_HAND, ROBOT)
    confidence: float | None = None
    holds: tuple[float, ...] = ()
    sigma_angle: float = QUANTITIES["robot_sigma"].value
    most_seconds: float = math.inf
    most_positions: int = 200
    schemes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.holds:
            fixed = self.sheet.position_sigma is not None
            object.__setattr__(self, "holds", (USUAL_HOLD,) if fixed else HOLDS)

    @cached_property
    def sizes(self) -> dict[str, float]:
        """Usual sizes, SI, of the effects that cause errors if a model lacks them.

        They are the sds of the parameters over sensors: of the data sheet, else typical ones. A
        nonlinearity is divided equally into a quadratic and a cubic part. The rotation of the axes
        against the housing is left out, since it does not change the sensor's own tilt.
        """
        shares = {"nonorthogonality": 1.0, **dict.fromkeys(NONLINEAR, math.sqrt(0.5))}
        stated = {effect: getattr(self.sheet, effect) for effect in shares}
        return {
            effect: usual_size(effect) if size is None else shares[effect] * size
            for effect, size in stated.items()
        }

    @property
    def assumed(self) -> list[str]:
        """Effects of a usual size, as nothing is known of them."""
        return [effect for effect in self.sizes if getattr(self.sheet, effect) is None]

    @property
    def is_linear(self) -> bool:
        """Whether the sensor is assumed to be linear."""
        return "nonlinearity" in self.sheet.assumed

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

    def scheme_text(self, scheme: Scheme) -> str:
        """Name of a scheme in commands and configurations: a name, or the path of its file."""
        for text in self.schemes:
            if is_scheme_file(text) and get_scheme(text).name == scheme.name:
                return str(Path(text).resolve())
        return scheme.name


def confidence_of(text: str) -> float | None:
    """Share of the calibrations that a text tells, ``95%`` or ``0.95``; None for ``rms``."""
    if text == "rms":
        return None
    try:
        share = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
    except ValueError:
        share = math.nan
    if not 0.5 <= share <= 0.999:
        raise InputError(
            f"{key('confidence')}: must be rms, or a share from 50% to 99.9% of the calibrations, "
            f"not {text!r}"
        )
    return share


def usual_size(effect: str) -> float:
    """Size of an effect between that in good and that in cheap equipment, SI."""
    low, high = get_effect(effect).typical
    return math.sqrt(low * high)


def get_sensor(text: str) -> DataSheet:
    """Return a sensor by its name, from a YAML file, or from the folder of a campaign.

    Raises
    ------
    InputError
        If there is no such sensor; for a log the message says how to make a data sheet of it.
    """
    path = Path(text)
    if path.is_dir():
        from accelstudy.data_sheets.measured import sheet_of_campaign

        return sheet_of_campaign(path)
    if path.suffix in LOGS:
        raise InputError(
            f"{text}: a log, not a data sheet; make one of it: accelstudy data-sheet {text} --out "
            f"{path.stem}.yaml, with the options by which import reads it"
        )
    return read_data_sheet(path) if path.is_file() else get_data_sheet(text)
