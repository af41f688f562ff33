"""Axis error: channels are swapped, or have the wrong sign."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import permutations, product
from typing import Self

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.basics.registry import Setting
from accelstudy.campaign.gross_errors.base import (
    EVERYWHERE,
    Array,
    GrossError,
    Mending,
    register,
    with_readings,
)
from accelstudy.campaign.gross_errors.real_sensor import RealSensor, attitude_forces
from accelstudy.campaign.session import Campaign
from accelstudy.sensors.conversion import Conversion

SIGNED_PERMUTATIONS = tuple(
    tuple(sign * axis for sign, axis in zip(signs, axes, strict=True))
    for axes in permutations((1, 2, 3))
    for signs in product((1, -1), repeat=3)
)
"""What the channels x, y, z show: axis 1, 2 or 3 with a sign; the first is the right one."""
NEAR = 2.0
"""Axes are tried if their distance from the ideal sensor is at most this many times the smallest
distance of any axes."""


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
    rank = EVERYWHERE

    def drawn(self, campaign: Campaign, rng: np.random.Generator) -> Self:
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
        return _turned(campaign, _matrix(shown))

    def mendings(self, campaign: Campaign, sensor: RealSensor) -> Iterator[Mending]:
        """Undo each of the 47 that are likely; without a robot none of them shows."""
        if sensor.expected is None:
            return
        ideal = attitude_forces(campaign)
        # An ideal sensor with any bias is near enough to compare all quickly.
        tried, misses = [], []
        for axes in SIGNED_PERMUTATIONS:
            for mended, reason, matrix in _undone(campaign, _matrix(axes).T):
                error = mended.forces - ideal
                bias = np.median(error, axis=0)
                distance = np.linalg.norm(error - bias, axis=1)
                misses.append(float(np.mean(np.minimum(distance, campaign.gravity))))
                tried.append((_changes(axes), float(np.linalg.norm(bias)), reason, mended, matrix))
        near = [one for one, miss in zip(tried, misses, strict=True) if miss < NEAR * min(misses)]
        for _, _, reason, mended, matrix in sorted(near, key=lambda one: one[:2]):
            if reason:
                yield Mending(reason, mended, matrix)
        assert campaign.angles is not None
        exchanged = replace(campaign, angles=campaign.angles[:, ::-1].copy())
        yield Mending("roll and pitch of the robot are exchanged", exchanged)


def _matrix(shown: Sequence[float]) -> Array:
    """P of what the channels show: f → P f."""
    matrix = np.zeros((3, 3))
    matrix[range(3), np.abs(shown).astype(int) - 1] = np.sign(shown)
    return matrix


def _turned(campaign: Campaign, matrix: Array) -> Campaign:
    """Return the campaign with f → P f; columns are reordered, not summed, so no digit changes."""
    axes = np.argmax(np.abs(matrix), axis=1)
    return with_readings(campaign, lambda values: matrix[range(3), axes] * values[:, axes])


def _undone(campaign: Campaign, matrix: Array) -> Iterator[tuple[Campaign, str, Array]]:
    """Undo an exchange of axes, and one of columns of counts, before nominal scales and offsets.

    Yields the mended campaign, what was wrong, and the matrix that turns forces as they were read.
    """
    reason = _reason(matrix) if np.any(matrix != np.eye(3)) else ""
    yield _turned(campaign, matrix), reason, matrix
    if (nominal := campaign.nominal) is None or not reason:
        return
    # Counts P r, read with S and o, were r: S (r − o) = S P S⁻¹ · S (P⁻¹ r − P⁻¹ o).
    scaled = matrix * nominal.scale[:, None] / nominal.scale
    offset = np.abs(matrix).T @ nominal.offset
    if np.allclose(scaled, matrix) and np.array_equal(offset, nominal.offset):
        return
    moved = campaign.forces + (nominal.offset - offset) * nominal.scale
    read = replace(campaign, forces=moved, nominal=Conversion(nominal.scale, offset))
    yield _turned(read, scaled), f"{reason}, in the counts, before `scale` and `offset`", scaled


def _changes(shown: Sequence[float]) -> tuple[int, int]:
    """Number of channels that show another axis, and of those with the wrong sign."""
    return (
        sum(abs(axis) != i for i, axis in enumerate(shown, 1)),
        sum(axis < 0 for axis in shown),
    )


def _reason(matrix: Array) -> str:
    """Say which axes are wrong, from the matrix that mends them."""
    axes, signs = np.argmax(np.abs(matrix), axis=1), matrix.sum(axis=1)
    words = ", ".join(
        f"{axis} is read as {'−' if sign < 0 else ''}{'xyz'[other]}"
        for axis, other, sign in zip("xyz", axes, signs, strict=True)
        if sign < 0 or axis != "xyz"[other]
    )
    wrong = "have the wrong sign" if (axes == range(3)).all() else "are swapped"
    return f"axes {wrong}: {words}"
