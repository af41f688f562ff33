"""Unit error: numbers are in another unit than the file says."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Self

import numpy as np

from accelstudy.campaign.format import Campaign
from accelstudy.errors import InputError
from accelstudy.gross_errors.base import Array, GrossError, register
from accelstudy.registry import Hyper
from accelstudy.units import GON, STANDARD_GRAVITY, to_si

USUAL = (
    {"force": 1 / STANDARD_GRAVITY},
    {"angle": float(GON / to_si(1, "deg", "rad"))},
    {"angle": GON},
)
"""Forces in g in a column of m/s², and degrees or radians in one of gon."""


@register
class UnitError(GrossError):
    """The numbers of the forces, or of the robot's angles, are wrong by a factor.

    One of the usual mistakes is drawn if no factor is given: forces in g in a column of m/s²
    (1/9.80665), degrees (0.9) or radians (π/200) in a column of gon.
    """

    name = "unit_error"
    hypers = (Hyper("force", "1", math.nan, above=0), Hyper("angle", "1", math.nan, above=0))
    equation = "f → factor · f, or (φ, θ) → factor · (φ, θ)"

    def drawn(self, campaign: Campaign, rng: np.random.Generator) -> Self:
        """Draw one of the usual mistakes."""
        if not self.is_open("force", "angle"):
            return self
        possible = [case for case in USUAL if "force" in case or campaign.angles is not None]
        return type(self)(**possible[rng.integers(len(possible))])

    def act(self, campaign: Campaign) -> Campaign:
        """Multiply by the factors; one that is not given is 1."""
        force, angle = np.nan_to_num([self.shape["force"], self.shape["angle"]], nan=1.0).tolist()
        if angle != 1 and campaign.angles is None:
            raise InputError(f"gross error {self.name!r}: angle: {campaign.name} has no angles")

        def times(values: Array | None, factor: float) -> Array | None:
            return None if values is None else factor * values

        return replace(
            campaign,
            forces=force * campaign.forces,
            sd=times(campaign.sd, force),
            angles=times(campaign.angles, angle),
            yaw=times(campaign.yaw, angle),
        )
