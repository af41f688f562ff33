"""Gross errors: units, axes, the order of rows, and bumped holds."""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations, product

import numpy as np

from accelstudy.basics.units import GON, STANDARD_GRAVITY
from accelstudy.campaign.session import Campaign
from studies.hidden.physics.conditions import Conditions
from studies.hidden.physics.geometry import GRAVITY, Array

Random = np.random.Generator
Changed = tuple[Campaign, dict[str, float]]

LEAST = 100.0  # noncentrality of a bumped hold, at least
FAR = 0.3 * GRAVITY  # m/s², least difference of the forces of exchanged rows, or nothing would show

# What a number in the file would be for one in its header's unit.
FORCE_UNITS = (1 / STANDARD_GRAVITY, 1e3 / STANDARD_GRAVITY, STANDARD_GRAVITY)
ANGLE_UNITS = (180 / np.pi * GON, GON)


def _with_axes(campaign: Campaign, change: Callable[[Array], Array]) -> Campaign:
    """Change all that has a value for each axis."""
    sd = None if campaign.sd is None else change(campaign.sd)
    return campaign.with_arrays(forces=change(campaign.forces), sd=sd)


def _axis_error(campaign: Campaign, rng: Random, *_: object) -> Changed:
    """Exchange channels, or turn their signs: one of the 47 ways that are wrong."""
    ways = [(o, s) for o in permutations(range(3)) for s in product((1.0, -1.0), repeat=3)]
    order, signs = ways[1 + int(rng.integers(len(ways) - 1))]
    exchanged = _with_axes(campaign, lambda values: values[:, order])
    shown = [sign * (axis + 1) for axis, sign in zip(order, signs, strict=True)]
    forces = np.array(signs) * exchanged.forces
    return exchanged.with_arrays(forces=forces), dict(zip("xyz", shown, strict=True))


def _unit_error(campaign: Campaign, rng: Random, *_: object) -> Changed:
    """Write the forces, or the angles, in another unit than the header says."""
    if campaign.angles is not None and rng.random() < 0.5:
        factor = float(rng.choice(ANGLE_UNITS))
        yaw = None if campaign.yaw is None else campaign.yaw * factor
        return campaign.with_arrays(angles=campaign.angles * factor, yaw=yaw), {"angle": factor}
    factor = float(rng.choice(FORCE_UNITS))
    return _with_axes(campaign, lambda values: values * factor), {"force": factor}


def _row_order(campaign: Campaign, rng: Random, *_: object) -> Changed:
    """Exchange the readings of two holds, of three in a ring, or reverse the order of some."""
    steps = np.zeros((1, 3))
    while np.any(np.linalg.norm(steps, axis=1) <= FAR):
        order = np.arange(campaign.n_positions)
        if rng.random() < 0.3:
            length = int(rng.integers(3, 7))
            start = int(rng.integers(len(order) - length + 1))
            rows = np.arange(start, start + length)
            order[rows] = rows[::-1]
        else:
            rows = rng.choice(len(order), int(rng.integers(2, 4)), replace=False)
            order[rows] = np.roll(rows, 1)
        moved = np.flatnonzero(order != np.arange(len(order)))
        steps = campaign.forces[order[moved]] - campaign.forces[moved]
    settings = {f"row_{row + 1}": float(order[row] + 1) for row in moved}
    return _with_axes(campaign, lambda values: values[order]), settings


def _outlier_position(
    campaign: Campaign, rng: Random, sigma: float, conditions: Conditions
) -> Changed:
    """Bump one hold, by much more than what could be detected."""
    size = sigma * float(np.exp(rng.uniform(np.log(15.0), np.log(150.0))))
    while True:
        row, direction = int(rng.integers(campaign.n_positions)), rng.standard_normal(3)
        change = np.zeros((1, campaign.n_positions, 3))
        change[0, row] = size * direction / np.linalg.norm(direction)
        lam = float(np.sum(conditions.left(conditions.changed(change)) ** 2))
        if lam > LEAST:
            error = dict(zip("xyz", change[0, row].tolist(), strict=True))
            settings = {"position": row + 1.0, **error, "lam": lam}
            return campaign.with_arrays(forces=campaign.forces + change[0]), settings


GROSS: dict[str, Callable[[Campaign, Random, float, Conditions], Changed]] = {
    "axis_error": _axis_error,
    "unit_error": _unit_error,
    "row_order": _row_order,
    "outlier_position": _outlier_position,
}
"""Name in the catalogue -> what it does; sigma is that of a position mean, m/s²."""


def visible_gross(design: str, approach: str) -> tuple[str, ...]:
    """Names of the gross errors that an approach can see; the norm shows neither axes nor order."""
    blind = () if approach == "robot" else ("axis_error", "row_order")
    return tuple(name for name in GROSS if name not in blind)
