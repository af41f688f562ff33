"""Gross errors that make all else meaningless: unit, axes, and order of the rows.

They are recognised by trying what would mend them. A real sensor fits its robot within some
hundredths of g before any calibration; a wrong unit, a swapped axis or exchanged rows do not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from accelstudy.approaches import Approach
from accelstudy.campaign.format import Campaign
from accelstudy.errors import InputError
from accelstudy.leveling import specific_force
from accelstudy.units import GON, STANDARD_GRAVITY, to_si

Array = NDArray[np.float64]

USUAL_MISFIT = 0.15
"""Share of gravity by which a sensor may miss its robot before calibration."""
CLEARLY = 4.0
"""How many times better an explanation must fit."""
EXCHANGED = 1000
"""Rows that may belong elsewhere, at most; where more do not fit, it is not their order."""
ENOUGH = 8
"""Positions from which on an affine calibration says something of the others."""
FORCE_UNITS = {
    "the forces are in g": STANDARD_GRAVITY,
    "the forces are in mg": 1e-3 * STANDARD_GRAVITY,
    "the forces are in m/s^2, not in g": 1 / STANDARD_GRAVITY,
}
ANGLE_UNITS = {
    "the robot's angles are in degrees": float(to_si(1.0, "deg", "rad")) / GON,
    "the robot's angles are in radians": 1 / GON,
}


@dataclass(frozen=True)
class Recognised:
    """A gross error that was recognised.

    Attributes
    ----------
    name : str, "unit_error", "axis_error" or "row_order"
    reason : str, what is wrong, in words
    mended : Campaign, as it would have been right
    conversion : (3, 3) array, turns forces as they were read into mended ones, where it is not I
    """

    name: str
    reason: str
    mended: Campaign
    conversion: Array | None = None


def recognise(campaign: Campaign, approach: Approach) -> Recognised | None:
    """Recognise a wrong unit, swapped axes or exchanged rows; None if all looks right.

    Raises
    ------
    InputError
        If the forces are nowhere near gravity and no unit explains it.
    """
    found = _recognised(campaign, approach)
    if found is None and not _near_gravity(campaign):
        raise InputError(
            f"{campaign.name}: fx, fy, fz: their norm is about {_norm(campaign):.3g} m/s^2, "
            f"nowhere near gravity, {campaign.gravity:g} m/s^2, in no unit; correct the columns"
        )
    return found


def _recognised(campaign: Campaign, approach: Approach) -> Recognised | None:
    if not approach.uses_angles or campaign.angles is None:
        return _by_norm(campaign)
    if _misfit(campaign) >= USUAL_MISFIT:
        tried = [_axes(campaign)]
        scaled = _by_norm(campaign)
        if scaled is not None:
            tried.append(scaled)
        best = min(tried, key=lambda one: _misfit(one.mended))
        if CLEARLY * _misfit(best.mended) < _misfit(campaign):
            return best
    return _by_angles(campaign) or _rows(campaign)


def _misfit(campaign: Campaign) -> float:
    """Rms difference between forces and the robot's attitude, in g."""
    difference = campaign.forces - _expected(campaign)
    return float(np.sqrt(np.mean(np.sum(difference**2, axis=1))) / campaign.gravity)


def _expected(campaign: Campaign) -> Array:
    assert campaign.angles is not None
    roll, pitch = campaign.angles.T
    return np.column_stack(specific_force(roll, pitch, campaign.gravity))


def _norm(campaign: Campaign) -> float:
    return float(np.median(np.linalg.norm(campaign.forces, axis=1)))


def _near_gravity(campaign: Campaign) -> bool:
    """Whether forces are as large as gravity but for what a bad sensor does."""
    return 0.5 < _norm(campaign) / campaign.gravity < 2


def _by_norm(campaign: Campaign) -> Recognised | None:
    """Recognise a unit of the forces by their norm."""
    if _near_gravity(campaign):
        return None
    for reason, factor in FORCE_UNITS.items():
        if 0.8 < _norm(campaign) * factor / campaign.gravity < 1.25:
            sd = None if campaign.sd is None else campaign.sd * factor
            mended = replace(campaign, forces=campaign.forces * factor, sd=sd)
            return Recognised("unit_error", reason, mended, factor * np.eye(3))
    return None


def _axes(campaign: Campaign) -> Recognised:
    """Try the 48 signed permutations of the axes; return the best."""
    correlation = _expected(campaign).T @ campaign.forces
    best, order, signs = -np.inf, (0, 1, 2), (1.0, 1.0, 1.0)
    for x, y, z in permutations(range(3)):
        for a, b, c in product((1.0, -1.0), repeat=3):
            value = a * correlation[0, x] + b * correlation[1, y] + c * correlation[2, z]
            if value > best:
                best, order, signs = value, (x, y, z), (a, b, c)
    words = ", ".join(
        f"{axis} is read as {'−' if s < 0 else ''}{'xyz'[o]}"
        for axis, o, s in zip("xyz", order, signs, strict=True)
        if (axis, s) != ("xyz"[o], 1.0)
    )
    wrong = "have the wrong sign" if order == (0, 1, 2) else "are swapped"
    columns = list(order)
    sd = None if campaign.sd is None else campaign.sd[:, columns]
    mended = replace(campaign, forces=campaign.forces[:, columns] * np.array(signs), sd=sd)
    conversion = np.zeros((3, 3))
    conversion[range(3), columns] = signs
    return Recognised("axis_error", f"axes {wrong}: {words}", mended, conversion)


def _by_angles(campaign: Campaign) -> Recognised | None:
    """Recognise a unit of the angles by how well any affine sensor could fit them."""
    if campaign.angles is None or campaign.n_positions < ENOUGH:
        return None
    for reason, factor in ANGLE_UNITS.items():
        yaw = None if campaign.yaw is None else campaign.yaw * factor
        mended = replace(campaign, angles=campaign.angles * factor, yaw=yaw)
        if CLEARLY * _affine_misfit(mended) < _affine_misfit(campaign):
            return Recognised("unit_error", reason, mended)
    return None


def _affine_misfit(campaign: Campaign) -> float:
    """Rms difference that remains after an affine calibration, m/s²."""
    design = np.column_stack([campaign.forces, np.ones(campaign.n_positions)])
    expected = _expected(campaign)
    solution = np.linalg.lstsq(design, expected, rcond=None)[0]
    return float(np.sqrt(np.mean((design @ solution - expected) ** 2)))


def _rows(campaign: Campaign) -> Recognised | None:
    """Recognise rows whose forces belong to other rows, after a robust affine calibration."""
    expected = _expected(campaign)
    forces = campaign.forces
    design = np.column_stack([forces, np.ones(len(forces))])
    if len(forces) < ENOUGH:
        return None
    weights = np.ones(len(forces))
    for _ in range(50):  # least absolute deviations: a few wrong rows do not matter
        root = np.sqrt(weights)[:, None]
        solution = np.linalg.lstsq(root * design, root * expected, rcond=None)[0]
        distance = np.linalg.norm(design @ solution - expected, axis=1)
        weights = 1 / np.maximum(distance, 1e-4 * campaign.gravity)
    # Repeated attitudes could be exchanged at will, so an exchange has to gain something.
    usual = np.median(distance)
    wrong = np.flatnonzero(distance > CLEARLY * usual)
    if not 1 < len(wrong) <= EXCHANGED:
        return None
    fitted = (design @ solution)[wrong]
    cost = np.linalg.norm(fitted[:, None] - expected[wrong][None], axis=2)
    total = cost**2 + np.where(np.eye(len(wrong), dtype=bool), 0.0, (CLEARLY * usual) ** 2)
    rows = np.arange(len(wrong))
    if np.array_equal(np.argmin(total, axis=1), rows):
        return None
    from scipy.optimize import linear_sum_assignment  # slow to import, and seldom needed

    found = linear_sum_assignment(total)[1]
    moved = np.flatnonzero(found != rows)
    if not len(moved):
        return None
    before, after = cost[moved, moved], cost[moved, found[moved]]
    clear = (before > CLEARLY * after) & (before > 20 * usual) & (before > 0.01 * campaign.gravity)
    if not np.all(clear):
        return None
    belongs = np.arange(len(forces))
    belongs[wrong] = wrong[found]
    order = np.empty(len(forces), dtype=int)
    order[belongs] = np.arange(len(forces))
    mended = replace(
        campaign,
        forces=forces[order],
        sd=None if campaign.sd is None else campaign.sd[order],
        n_samples=None if campaign.n_samples is None else campaign.n_samples[order],
    )
    positions = ", ".join(str(p) for p in campaign.positions[wrong[moved]])
    return Recognised("row_order", f"the forces of positions {positions} are exchanged", mended)
