"""What a gross error is, and the registry of gross errors.

A gross error is no effect of the sensor or of the rig: the data are not what the file says.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.registry import RegistryWithSettings, WithSettings
from accelstudy.campaign.gross_errors.real_sensor import RealSensor
from accelstudy.campaign.session import Campaign

Array = NDArray[np.float64]

EVERYWHERE = 0
SINGLE = (1, 2)
"""Ranks of errors in all positions alike, and of errors in single positions. Exchanged rows are
looked for first: a row that was not exchanged may still be wrong by itself."""
READINGS = {"forces": False, "sd": True}
"""Columns of what the sensor reads, and whether they are sds, which have no sign."""


@dataclass(frozen=True)
class Mending:
    """What would undo a gross error.

    Attributes
    ----------
    reason : str, what is wrong, in words
    campaign : Campaign, mended
    matrix : (3, 3) array, turns forces as they were read into mended ones; None if it is I
    changed : (n,) bool array, which positions change; None if all do
    left_out : tuple of int, positions that cannot be mended
    """

    reason: str
    campaign: Campaign
    matrix: Array | None = None
    changed: NDArray[np.bool_] | None = None
    left_out: tuple[int, ...] = ()


class GrossError(WithSettings):
    """One gross error; subclasses say what it does to a campaign, and draw settings left open.

    A setting whose default is NaN is open: if it is not given it is drawn for the campaign.

    Attributes
    ----------
    equation : str, what it does, for people
    rank : int, when it is looked for: errors in all positions alike come first, together
    """

    kind = "gross error"
    family = "gross error"
    equation: ClassVar[str]
    rank: ClassVar[int]

    def drawn(self, campaign: Campaign, rng: np.random.Generator) -> Self:
        """Return the same error with every open setting drawn for a campaign."""
        raise NotImplementedError

    def act(self, campaign: Campaign) -> Campaign:
        """Return the campaign with the error; no setting may be open."""
        raise NotImplementedError

    def mendings(self, campaign: Campaign, sensor: RealSensor) -> Iterator[Mending]:
        """Ways to undo the error, the simplest first; `sensor` was fitted to most positions."""
        raise NotImplementedError

    def apply(self, campaign: Campaign, rng: np.random.Generator) -> Campaign:
        """Draw the open settings, and act."""
        return self.drawn(campaign, rng).act(campaign)

    def is_open(self, *names: str) -> bool:
        """Whether none of these settings is given."""
        return all(math.isnan(self.settings[name]) for name in names)

    def row(self, campaign: Campaign, setting: str) -> int:
        """Row of the position that a setting gives."""
        rows = np.flatnonzero(campaign.positions == self.settings[setting])
        if not len(rows):
            raise InputError(
                f"gross error {self.name!r}: {setting}={self.settings[setting]:g} is no position "
                f"of {campaign.name}; they are {campaign.positions[0]} to {campaign.positions[-1]}"
            )
        return int(rows[0])


_registry: RegistryWithSettings[GrossError] = RegistryWithSettings(GrossError.kind)
get_gross_error = cache(_registry.get)
gross_error_names = _registry.names
register = _registry.register


def with_readings(campaign: Campaign, change: Callable[[Array], Array]) -> Campaign:
    """Apply a change to all columns of what the sensor reads, (n, 3) each."""
    columns: dict[str, Any] = {
        name: np.abs(change(values)) if is_sd else change(values)
        for name, is_sd in READINGS.items()
        if (values := getattr(campaign, name)) is not None
    }
    return replace(campaign, **columns)
