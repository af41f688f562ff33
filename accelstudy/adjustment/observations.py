"""What was observed in a calibration."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.arrays import Array
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.effects import HoldConditions

AngleErrors = Callable[[Array], tuple[Array, Array]]
Known = Mapping[str, tuple[float, float]]
"""What is known of parameters a priori: mean and sigma, SI, by the name of the parameter."""


@dataclass(frozen=True)
class Observations:
    """What was observed in n positions, R times.

    Parameters
    ----------
    forces : (R, n, 3) array, m/s², sensor output f_s
    sigma_force : float or (n, 3) array, m/s²
    sigma_dof : float, degrees of freedom of the square of `sigma_force`; infinite where it is known
    angles : (R, n, 2) array, rad, roll and pitch of the robot; None without a robot
    sigma_angle : float or (n, 2) array, rad
    gravity : float or (R,) array, m/s²; one number where it is held fixed
    sigma_gravity : float, m/s²; 0 holds gravity fixed
    hold : HoldConditions, of the positions
    initial : (u,) array, SI, initial values of the model's parameters; an ideal sensor if None
    known : mapping of str to (mean, sigma), SI, what is known a priori of parameters, in place of
        what effects say of them
    common : (n, 2, k) array, rad, errors of the angles that all positions share: derivatives by k
        unknown numbers that are 0 ± 1; None if the errors of the positions are independent
    angle_errors : function of angles (k, 2), rad, optional: `sigma_angle` and `common` in other
        attitudes; the adjustment does not use it
    """

    forces: Array
    sigma_force: ArrayLike
    angles: Array | None = None
    sigma_angle: ArrayLike = 0.0
    gravity: ArrayLike = STANDARD_GRAVITY
    sigma_gravity: float = 0.0
    hold: HoldConditions | None = None
    initial: Array | None = None
    known: Known = field(default_factory=dict)
    common: Array | None = None
    angle_errors: AngleErrors | None = None
    sigma_dof: float = math.inf

    def take(self, positions: NDArray[np.int_]) -> Observations:
        """Return the sessions with some of their positions."""

        def at_positions(values: ArrayLike) -> ArrayLike:
            return np.asarray(values)[positions] if np.ndim(values) == 2 else values

        return replace(
            self,
            forces=self.forces[:, positions],
            angles=None if self.angles is None else self.angles[:, positions],
            sigma_force=at_positions(self.sigma_force),
            sigma_angle=at_positions(self.sigma_angle),
            common=None if self.common is None else self.common[positions],
            hold=None if self.hold is None else self.hold.take(positions),
        )

    def sessions(self, chosen: slice) -> Observations:
        """Return some of the sessions."""
        angles, gravity = self.angles, np.asarray(self.gravity)
        return replace(
            self,
            forces=self.forces[chosen],
            angles=None if angles is None else angles[chosen],
            gravity=gravity[chosen] if gravity.ndim else gravity,
        )

    @staticmethod
    def concatenate(parts: Sequence[Observations]) -> Observations:
        """Join sessions of one set-up, each with its gravity."""

        def joined(name: str) -> Array:
            return np.concatenate([getattr(part, name) for part in parts])

        angles = None if parts[0].angles is None else joined("angles")
        return replace(parts[0], forces=joined("forces"), angles=angles, gravity=joined("gravity"))

    def first(self, replicates: int) -> Observations:
        """Return the first `replicates` sessions; all if there are fewer."""
        return self.sessions(slice(replicates))
