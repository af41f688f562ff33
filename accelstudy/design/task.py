"""What is to be calibrated, what is known of it before, and what each position tells of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from accelstudy.approaches import Approach
from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.levels import MAX_TILT_GON
from accelstudy.basics.units import GON
from accelstudy.design.estimability import estimability
from accelstudy.design.information import Information, position_rows, prior_rows
from accelstudy.leveling.error import error_in_use
from accelstudy.positions.points import evenly_spread
from accelstudy.positions.scheme import Scheme
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.hold_plan import HoldPlan, check_needs_no_plan
from accelstudy.simulation.sessions import Noise

SPHERE = 300
"""Attitudes that stand for the whole sphere."""
LOOKING_BACK = ("step_x", "step_y", "step_z", "order")


@dataclass(frozen=True)
class Task:
    """A calibration whose positions are to be chosen.

    Normal matrices are of scaled parameters. The unit of a parameter is the standard deviation that
    one position gives it, on average over all attitudes, if all others are known. So no number
    depends on a choice of units, and a criterion weighs all parameters by what positions can tell.

    Attributes
    ----------
    model : SensorModel, that is estimated
    approach : Approach
    noise : Noise
    tilt_range : float, rad, up to which the calibrated sensor is used
    measured : (k, 3) array of unit vectors, directions of positions measured before

    Raises
    ------
    InputError
        If the model needs more than positions.
    """

    model: SensorModel
    approach: Approach
    noise: Noise = field(default_factory=Noise)
    tilt_range: float = MAX_TILT_GON * GON
    measured: Array = field(default_factory=lambda: np.zeros((0, 3)))

    def __post_init__(self) -> None:
        check_needs_no_plan(self.model)
        if back := [c for c in self.model.hold_columns if c in LOOKING_BACK]:
            raise InputError(
                f"the model {self.model.name!r} depends on the order of the positions "
                f"({back[0]}), which a set of attitudes does not have; leave that effect out"
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters, gravity last if it is observed."""
        observed = ("g",) if self.noise.sigma_gravity > 0 else ()
        return (*self.model.parameter_names, *observed)

    @cached_property
    def scale(self) -> Array:
        """Root of the information of one position on each parameter, mean over the sphere, (u,)."""
        size = np.sqrt(np.mean(np.sum(self.rows(evenly_spread(SPHERE)) ** 2, axis=1), axis=0))
        return np.where(size > 1e-12 * size.max(), size, 1.0)

    def rows(self, directions: ArrayLike) -> Array:
        """Rows of the design matrix of k positions at unit weight, (k, c, u), SI."""
        directions = np.asarray(directions, dtype=float)
        hold = HoldPlan().hold(len(directions)) if self.model.hold_columns else None
        return position_rows(self.model, self.approach, self.noise, directions, hold=hold)

    def informations(self, directions: ArrayLike) -> Array:
        """Scaled information of each of k positions, (k, u, u)."""
        rows = self.rows(directions) / self.scale
        return np.einsum("kcu,kcw->kuw", rows, rows)

    @cached_property
    def _before(self) -> Information:
        """What is known before the first position, SI."""
        measured = self.rows(self.measured) if len(self.measured) else ()
        return Information.of(prior_rows(self.model, self.noise), *measured)

    @cached_property
    def prior(self) -> Array:
        """Scaled information before the first position, (u, u)."""
        return self._before.normal / np.outer(self.scale, self.scale)

    def normal(self, directions: ArrayLike) -> Array:
        """Scaled normal matrix of positions and of what was known before, (u, u)."""
        return self.prior + self.informations(directions).sum(axis=0)

    def information(self, directions: ArrayLike) -> Information:
        """What positions, and what was known before, tell of all parameters, SI."""
        return Information.of(self._before.rows, self.rows(directions))

    @cached_property
    def tilt_weights(self) -> Array:
        """Quadratic forms of scaled errors: mean squares of roll and of pitch, (2, u, u), rad²."""
        estimated = self.model.n_parameters
        weights = np.zeros((2, len(self.names), len(self.names)))
        error = error_in_use(self.model, max_tilt=self.tilt_range)
        weights[:, :estimated, :estimated] = error.quadratic
        return weights / np.outer(self.scale, self.scale)

    def missing(self, directions: Array) -> str:
        """Why readings in positions do not determine the model; empty if they do."""
        measured = np.concatenate([self.measured, directions])
        return estimability(
            Scheme("allowed", "allowed", measured, "generated", ""),
            self.model,
            self.approach,
            self.noise,
            hold=HoldPlan().hold(len(measured)),
            blur=self.noise.sigma_force,
        ).reason
