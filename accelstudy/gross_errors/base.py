"""What a gross error is, and the registry of gross errors.

A gross error is not an effect of the sensor or of the rig: the data is not what it says it is.
"""

from __future__ import annotations

import math
from functools import cache
from typing import ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from accelstudy.campaign.format import Campaign
from accelstudy.errors import InputError
from accelstudy.registry import Shaped, ShapedRegistry

Array = NDArray[np.float64]


class GrossError(Shaped):
    """One gross error; subclasses say what it does to a campaign, and draw what is left open.

    A setting whose default is NaN is open: it is drawn for the campaign at hand.

    Attributes
    ----------
    equation : str, what it does, for people
    """

    kind = "gross error"
    family = "gross error"
    equation: ClassVar[str]

    def drawn(self, campaign: Campaign, rng: np.random.Generator) -> Self:
        """Return the same error with all that was open drawn for a campaign."""
        raise NotImplementedError

    def act(self, campaign: Campaign) -> Campaign:
        """Return the campaign with the error; nothing is open any more."""
        raise NotImplementedError

    def apply(self, campaign: Campaign, rng: np.random.Generator) -> Campaign:
        """Draw what is open, and act."""
        return self.drawn(campaign, rng).act(campaign)

    def is_open(self, *names: str) -> bool:
        """Whether none of the settings is given."""
        return all(math.isnan(self.shape[name]) for name in names)

    def row(self, campaign: Campaign, setting: str) -> int:
        """Row of the position that a setting names."""
        found = np.flatnonzero(campaign.positions == self.shape[setting])
        if not len(found):
            raise InputError(
                f"gross error {self.name!r}: {setting}={self.shape[setting]:g} is no position of "
                f"{campaign.name}; they are {campaign.positions[0]} to {campaign.positions[-1]}"
            )
        return int(found[0])


_registry: ShapedRegistry[GrossError] = ShapedRegistry(GrossError.kind)
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
