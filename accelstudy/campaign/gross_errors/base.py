"""What a gross error is, and the registry of gross errors.

A gross error is not an effect of the sensor or of the rig: the data is not what it says it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.registry import RegistryWithSettings, WithSettings
from accelstudy.campaign.files.session import Campaign
from accelstudy.campaign.gross_errors.real_sensor import RealSensor

Array = NDArray[np.float64]

EVERYWHERE = 0
SINGLE = (1, 2)
"""Ranks of what is wrong in all positions alike, and of what is in single ones: rows that are not
exchanged may be wrong by themselves."""
READINGS = {"forces": False, "sd": True, "slope": False, "sd_slope": True}
"""Columns with what the sensor reads, and whether they are sds, which have no sign."""


@dataclass(frozen=True)
class Mending:
    """What would undo a gross error.

    Attributes
    ----------
    reason : str, what is wrong, in words
    campaign : Campaign, as it would have been right
    matrix : (3, 3) array, turns forces as they were read into mended ones, where it is not I
    changed : (n,) bool array, which positions would be others, where it is not all of them
    left_out : tuple of int, positions that cannot be mended
    """

    reason: str
    campaign: Campaign
    matrix: Array | None = None
    changed: NDArray[np.bool_] | None = None
    left_out: tuple[int, ...] = ()


class GrossError(WithSettings):
    """One gross error; subclasses say what it does to a campaign, and draw what is left open.

    A setting whose default is NaN is open: it is drawn for the campaign at hand.

    Attributes
    ----------
    equation : str, what it does, for people
    rank : int, when it is looked for: those of all positions alike first, together
    """

    kind = "gross error"
    family = "gross error"
    equation: ClassVar[str]
    rank: ClassVar[int]

    def drawn(self, campaign: Campaign, rng: np.random.Generator) -> Self:
        """Return the same error with all that was open drawn for a campaign."""
        raise NotImplementedError

    def act(self, campaign: Campaign) -> Campaign:
        """Return the campaign with the error; nothing is open any more."""
        raise NotImplementedError

    def mendings(self, campaign: Campaign, sensor: RealSensor) -> Iterator[Mending]:
        """Ways to undo the error, the simplest first; `sensor` fits most of the campaign."""
        raise NotImplementedError

    def apply(self, campaign: Campaign, rng: np.random.Generator) -> Campaign:
        """Draw what is open, and act."""
        return self.drawn(campaign, rng).act(campaign)

    def is_open(self, *names: str) -> bool:
        """Whether none of the settings is given."""
        return all(math.isnan(self.settings[name]) for name in names)

    def row(self, campaign: Campaign, setting: str) -> int:
        """Row of the position that a setting names."""
        found = np.flatnonzero(campaign.positions == self.settings[setting])
        if not len(found):
            raise InputError(
                f"gross error {self.name!r}: {setting}={self.settings[setting]:g} is no position "
                f"of {campaign.name}; they are {campaign.positions[0]} to {campaign.positions[-1]}"
            )
        return int(found[0])


_registry: RegistryWithSettings[GrossError] = RegistryWithSettings(GrossError.kind)
GrossErrorClass = TypeVar("GrossErrorClass", bound=type[GrossError])

gross_error_names = _registry.names


@cache
def get_gross_error(spec: str) -> GrossError:
    """Return a gross error by its name, with settings or not: ``row_order(first=3, second=4)``."""
    return _registry.get(spec)


def register(error: GrossErrorClass) -> GrossErrorClass:
    """Class decorator: enter a gross error into the registry under its name."""
    _registry.add(error.name, error())
    return error


def with_readings(campaign: Campaign, change: Callable[[Array], Array]) -> Campaign:
    """Change all that the sensor reads, (n, 3) columns, likewise."""
    columns: dict[str, Any] = {
        name: np.abs(change(values)) if is_sd else change(values)
        for name, is_sd in READINGS.items()
        if (values := getattr(campaign, name)) is not None
    }
    return replace(campaign, **columns)
