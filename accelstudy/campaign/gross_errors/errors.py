"""Gross errors: the data of a campaign are not what its file says.

A gross error is no effect of the sensor or of the rig. To add one, write a class under `register`,
and a function in `recognition.py` that undoes it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache
from itertools import permutations, product
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.registry import RegistryWithSettings, Setting, WithSettings
from accelstudy.basics.units import ROBOT_UNITS, UNITS
from accelstudy.campaign.session import Campaign

Array = NDArray[np.float64]

SIGNED_PERMUTATIONS = tuple(
    tuple(sign * axis for sign, axis in zip(signs, axes, strict=True))
    for axes in permutations((1, 2, 3))
    for signs in product((1, -1), repeat=3)
)
"""What the channels x, y, z show: axis 1, 2 or 3 with a sign; the first is the right one."""
SIZE = 0.1
"""m/s², size of an error of a position whose direction is drawn."""
MIN_DIFFERENCE = 1.0
"""m/s², smallest difference between the forces of two positions that are drawn to be exchanged."""


class GrossError(WithSettings):
    """One gross error; subclasses say what it does to a campaign, and draw settings left open.

    A setting whose default is NaN is open: if it is not given it is drawn for the campaign.

    Attributes
    ----------
    equation : str, what it does, for people
    """

    kind = "gross error"
    family = "gross error"
    equation: ClassVar[str]

    def draw(self, campaign: Campaign, rng: np.random.Generator) -> Self:
        """Return the same error with every open setting drawn for a campaign."""
        raise NotImplementedError

    def act(self, campaign: Campaign) -> Campaign:
        """Return the campaign with the error; no setting may be open."""
        raise NotImplementedError

    def apply(self, campaign: Campaign, rng: np.random.Generator) -> Campaign:
        """Draw the open settings, and act."""
        return self.draw(campaign, rng).act(campaign)

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


@register
class AxisError(GrossError):
    """One of the 48 signed permutations of the axes.

    The settings say what each channel shows: 1, 2 and 3 are the axes x, y and z, and a minus is a
    wrong sign; ``axis_error(x=2, y=1, z=3)`` exchanges x and y. One of the 47 that are wrong is
    drawn if none is given.
    """

    name = "axis_error"
    takes = tuple(Setting(axis, "1", math.nan) for axis in "xyz")
    equation = "f → P f, P one of 48 signed permutations"

    def draw(self, campaign: Campaign, rng: np.random.Generator) -> Self:
        """Draw one of the 47."""
        if not self.is_open(*"xyz"):
            return self
        wrong = SIGNED_PERMUTATIONS[1:]
        return type(self)(**dict(zip("xyz", wrong[rng.integers(len(wrong))], strict=True)))

    def act(self, campaign: Campaign) -> Campaign:
        """Permute the channels, and turn their signs."""
        shown = tuple(self.settings[axis] for axis in "xyz")
        if shown not in SIGNED_PERMUTATIONS:
            raise InputError(
                f"gross error {self.name!r}: x, y, z must be 1, 2, 3 in some order, each with a "
                f"sign, such as x=2, y=-1, z=3, not {self.spec}"
            )
        return permute_axes(campaign, matrix_of(shown))


@register
class OutlierPosition(GrossError):
    """The mean of one position is wrong by a vector e.

    The position is drawn if it is not given. If no component of e is given, its direction is drawn
    and its size is `SIZE`; if some are given, the others are zero.
    """

    name = "outlier_position"
    takes = (
        Setting("position", "1", math.nan),
        *(Setting(axis, "m/s^2", math.nan) for axis in "xyz"),
    )
    equation = "f + e in one position"

    def draw(self, campaign: Campaign, rng: np.random.Generator) -> Self:
        """Draw the position, and the direction of e."""
        position = self.settings["position"]
        if self.is_open("position"):
            position = float(rng.choice(campaign.positions))
        if self.is_open(*"xyz"):
            direction = rng.standard_normal(3)
            e = SIZE * direction / np.linalg.norm(direction)
        else:
            e = np.nan_to_num([self.settings[axis] for axis in "xyz"])
        return type(self)(position=position, **dict(zip("xyz", e.tolist(), strict=True)))

    def act(self, campaign: Campaign) -> Campaign:
        """Add e."""
        forces = campaign.forces.copy()
        forces[self.row(campaign, "position")] += [self.settings[axis] for axis in "xyz"]
        return replace(campaign, forces=forces)


@register
class RowOrder(GrossError):
    """The readings of the sensor in two positions are exchanged; all other columns stay.

    Both positions are drawn if neither is given.
    """

    name = "row_order"
    takes = (Setting("first", "1", math.nan), Setting("second", "1", math.nan))
    equation = "f_j ↔ f_k"

    def draw(self, campaign: Campaign, rng: np.random.Generator) -> Self:
        """Draw two positions in different attitudes."""
        if not self.is_open("first", "second"):
            if self.is_open("first") or self.is_open("second"):
                raise InputError(f"gross error {self.name!r}: give first and second, or neither")
            return self
        for first in rng.permutation(campaign.n_positions):
            distance = np.linalg.norm(campaign.forces - campaign.forces[first], axis=1)
            others = np.flatnonzero(distance > MIN_DIFFERENCE)
            if len(others):
                low, high = sorted(campaign.positions[[first, rng.choice(others)]].tolist())
                return type(self)(first=low, second=high)
        raise InputError(f"gross error {self.name!r}: all positions are in the same attitude")

    def act(self, campaign: Campaign) -> Campaign:
        """Exchange the rows of what the sensor reads."""
        rows = [self.row(campaign, "first"), self.row(campaign, "second")]
        order = np.arange(campaign.n_positions)
        order[rows] = rows[::-1]
        return reorder_rows(campaign, order)


@register
class UnitError(GrossError):
    """The numbers of the forces, or of the robot's angles, are wrong by a factor.

    One of the usual mistakes is drawn if no factor is given: forces in g in a column of m/s²
    (1/9.80665), degrees (0.9) or radians (π/200) in a column of gon.
    """

    name = "unit_error"
    takes = (Setting("force", "1", math.nan, above=0), Setting("angle", "1", math.nan, above=0))
    equation = "f → factor · f, or (φ, θ) → factor · (φ, θ)"

    def draw(self, campaign: Campaign, rng: np.random.Generator) -> Self:
        """Draw one of the usual mistakes."""
        if not self.is_open("force", "angle"):
            return self
        possible = [{"force": 1 / UNITS["m/s^2"]["g"]}]
        if campaign.angles is not None:
            possible += [
                {"angle": 1 / factor} for factor in other_units(ROBOT_UNITS, "rad", "gon").values()
            ]
        return type(self)(**possible[rng.integers(len(possible))])

    def act(self, campaign: Campaign) -> Campaign:
        """Multiply by the factors that are given."""
        if not self.is_open("angle"):
            if campaign.angles is None:
                raise InputError(f"gross error {self.name!r}: angle: {campaign.name} has no angles")
            campaign = angles_times(campaign, self.settings["angle"])
        if not self.is_open("force"):
            campaign = with_readings(campaign, lambda values: self.settings["force"] * values)
        return campaign


# --- What errors do, and what undoes them ---------------------------------------------------------


def with_readings(campaign: Campaign, change: Callable[[Array], Array]) -> Campaign:
    """Apply a change to all columns of what the sensor reads, (n, 3) each; sds have no sign."""
    sd = None if campaign.sd is None else np.abs(change(campaign.sd))
    return replace(campaign, forces=change(campaign.forces), sd=sd)


def matrix_of(shown: Sequence[float]) -> Array:
    """P of what the channels show: f → P f."""
    matrix = np.zeros((3, 3))
    matrix[range(3), np.abs(shown).astype(int) - 1] = np.sign(shown)
    return matrix


def permute_axes(campaign: Campaign, matrix: Array) -> Campaign:
    """Return the campaign with f → P f; columns are reordered, not summed, so no digit changes."""
    axes = np.argmax(np.abs(matrix), axis=1)
    return with_readings(campaign, lambda values: matrix[range(3), axes] * values[:, axes])


def reorder_rows(campaign: Campaign, order: NDArray[np.int_]) -> Campaign:
    """Return the campaign with the readings in another order."""
    n_samples = None if campaign.n_samples is None else campaign.n_samples[order]
    return replace(with_readings(campaign, lambda values: values[order]), n_samples=n_samples)


def angles_times(campaign: Campaign, factor: float) -> Campaign:
    """Return the campaign with the robot's angles multiplied by a factor."""
    columns: dict[str, Any] = {"angles": campaign.angles, "yaw": campaign.yaw}
    return replace(campaign, **{key: factor * v for key, v in columns.items() if v is not None})


def other_units(units: Iterable[str], quantity: str, stated: str) -> dict[str, float]:
    """Units that could be meant, each with the factor that mends numbers stated in `stated`."""
    sizes = UNITS[quantity]
    return {unit: sizes[unit] / sizes[stated] for unit in units if unit != stated}
