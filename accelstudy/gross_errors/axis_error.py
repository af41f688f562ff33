"""Axis error: channels are swapped, or have the wrong sign."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import permutations, product
from typing import Self

import numpy as np

from accelstudy.campaign.format import Campaign
from accelstudy.errors import InputError
from accelstudy.gross_errors.base import GrossError, register
from accelstudy.registry import Hyper

SIGNED_PERMUTATIONS = tuple(
    tuple(sign * axis for sign, axis in zip(signs, axes, strict=True))
    for axes in permutations((1, 2, 3))
    for signs in product((1, -1), repeat=3)
)
"""What the channels x, y, z show: axis 1, 2 or 3 with a sign; the first is the right one."""


@register
class AxisError(GrossError):
    """One of the 48 signed permutations of the axes.

    The settings say what each channel shows: 1, 2 and 3 are the axes x, y and z, and a minus is a
    wrong sign; ``axis_error(x=2, y=1, z=3)`` exchanges x and y. One of the 47 that are wrong is
    drawn if none is given.
    """

    name = "axis_error"
    hypers = tuple(Hyper(axis, "1", math.nan) for axis in "xyz")
    equation = "f → P f, P one of 48 signed permutations"

    def drawn(self, campaign: Campaign, rng: np.random.Generator) -> Self:
        """Draw one of the 47."""
        if not self.is_open(*"xyz"):
            return self
        wrong = SIGNED_PERMUTATIONS[1:]
        return type(self)(**dict(zip("xyz", wrong[rng.integers(len(wrong))], strict=True)))

    def act(self, campaign: Campaign) -> Campaign:
        """Permute the channels, and turn their signs."""
        shown = tuple(self.shape[axis] for axis in "xyz")
        if shown not in SIGNED_PERMUTATIONS:
            raise InputError(
                f"gross error {self.name!r}: x, y, z must be 1, 2, 3 in some order, each with a "
                f"sign, such as x=2, y=-1, z=3, not {self.spec}"
            )
        axes = np.abs(shown).astype(int) - 1
        return replace(
            campaign,
            forces=np.sign(shown) * campaign.forces[:, axes],
            sd=None if campaign.sd is None else campaign.sd[:, axes],
        )
