"""What a scheme can determine: rank, condition and linear theory, before any simulation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from accelstudy.adjustment.observations import Known
from accelstudy.approaches import Approach
from accelstudy.basics.arrays import Array
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.design.information import Information, position_rows, prior_rows, rank_of
from accelstudy.effects import HoldConditions
from accelstudy.leveling.angles import angles_of
from accelstudy.positions.points import evenly_spread
from accelstudy.positions.scheme import Scheme
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.hold_plan import HoldPlan
from accelstudy.simulation.sessions import Noise

ABOVE_NOISE = 3.0
"""How far a combination of parameters must show above what the noise of readings makes of it. Where
positions do not determine it, it shows by noise alone, at about 1 whatever the noise is."""
SUFFICIENT_POSITIONS = 60
"""Positions that determine whatever an approach can determine at all."""
EVERYTHING_VARIES = HoldPlan(60.0, (0.0, 40.0), "random", (0.0, 1.0), "random")


@dataclass(frozen=True)
class Estimability:
    """What one scheme determines of one model with one approach, by linear theory.

    Attributes
    ----------
    parameter_names : tuple of str
    rank : int, of the design matrix
    condition : float, of the design matrix with columns of unit length; inf if singular
    redundancy : int, r = conditions − unknowns
    not_estimable : tuple of str, parameters that the scheme cannot determine
    reason : str, why; empty if all is estimable
    cofactors : (u, u) array, Q_xx of linear theory; NaN if not estimable
    """

    parameter_names: tuple[str, ...]
    rank: int
    condition: float
    redundancy: int
    not_estimable: tuple[str, ...]
    reason: str
    cofactors: Array

    @property
    def estimable(self) -> bool:
        """Whether every parameter is determined."""
        return not self.not_estimable

    @property
    def sigma(self) -> Array:
        """Standard deviations of linear theory, (u,), SI."""
        return np.sqrt(np.diag(self.cofactors))


def estimability(
    scheme: Scheme,
    model: SensorModel,
    approach: Approach,
    noise: Noise | None = None,
    gravity: float = STANDARD_GRAVITY,
    hold: HoldConditions | None = None,
    known: Known | None = None,
    forces: Array | None = None,
    blur: float = 0.0,
    gain: float = 1.0,
) -> Estimability:
    """Work out what a scheme determines, before any simulation.

    It is that at the ideal sensor (all parameters zero): what is singular there is near-singular
    for every real sensor, whose standard deviations differ by about its scale error.

    Noise gives any readings full rank. So by readings a combination of parameters counts as
    determined only if it shows by `ABOVE_NOISE` times what the noise adds to the design matrix.
    Without a `blur` the positions are exact, as in a study, whose simulation shows what noise does.

    Parameters
    ----------
    scheme : Scheme
    model : SensorModel
    approach : Approach
    noise : Noise, optional
    gravity : float, m/s²
    hold : HoldConditions, optional
        What a session knows of its positions beyond their directions (temperature, time, …).
    known : mapping, optional, what is known of parameters a priori, as in `Observations`
    forces : (n, 3) array, m/s², optional
        Noisy readings in place of the directions, corrected up to a linear map: their lengths
        count, as unit vectors would have the sensor's errors in their directions.
    blur : float, m/s², noise of readings by which they are judged
    gain : float, of the sensor: the noise of corrected `forces` is the blur over it
    """
    noise = noise or Noise()
    names = (*model.parameter_names, "g") if noise.sigma_gravity > 0 else model.parameter_names
    directions = scheme.directions if forces is None else -forces / gravity
    before = prior_rows(model, noise, known)
    # The noise of a reading turns no robot, whose roll changes at once beside the pole.
    angles = angles_of(-gravity * directions)

    def design(directions: Array) -> Array:
        rows = position_rows(model, approach, noise, directions, gravity, hold, angles=angles)
        return np.concatenate([rows.reshape(-1, len(names)), before])

    a = design(directions)
    rank, condition, free = exact = rank_of(a)
    if blur and not free.any():
        shifts = blur / (gain * gravity) * np.eye(3)
        changes = np.concatenate([design(directions + shift) - a for shift in shifts])
        rank, condition, free = rank_of(a, ABOVE_NOISE * changes)
    not_estimable = tuple(name for name, is_free in zip(names, free, strict=True) if is_free)
    reason, cofactors = "", np.full((len(names), len(names)), np.nan)
    if not_estimable:
        blind = is_blind(model, approach, noise, gravity)
        reason = (
            f"rank {rank} of {len(names)}: {', '.join(not_estimable)} cannot be told apart by "
            + (f"the {approach.name} approach in any scheme" if blind else "these positions")
            + (f" with a noise of {1e3 * blur:.2g} mm/s²" if rank < exact[0] else "")
        )
    else:
        cofactors = Information.of(a).covariance
    redundancy = len(a) - len(names)
    return Estimability(names, rank, condition, redundancy, not_estimable, reason, cofactors)


def is_blind(model: SensorModel, approach: Approach, noise: Noise, gravity: float) -> bool:
    """Whether an approach cannot determine a model in any scheme, whatever the conditions are."""
    directions = evenly_spread(SUFFICIENT_POSITIONS)
    hold = EVERYTHING_VARIES.hold(SUFFICIENT_POSITIONS)
    rows = position_rows(model, approach, noise, directions, gravity, hold)
    return not Information.of(rows, prior_rows(model, noise)).determined
