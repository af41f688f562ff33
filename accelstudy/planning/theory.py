"""Linear theory of the errors that a calibration leaves, for all models of a plan at once.

One model has every effect that matters. What a scheme tells of its parameters is computed once; a
calibration with fewer effects estimates some of them, and neglects others.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainc, gammaincinv

from accelstudy.approaches import get_approach
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.campaign.reference import ReferenceSensor
from accelstudy.design.information import Information, position_rows
from accelstudy.effects import HoldConditions
from accelstudy.leveling.error import ATTITUDES, cap_forces, tilt_error
from accelstudy.sensors.models import get_model
from accelstudy.simulation.hold_plan import HoldPlan
from accelstudy.simulation.sessions import Noise

Array = NDArray[np.float64]

OF_SENSOR = (
    "bias",
    "scale",
    "nonorthogonality",
    "cross_axis_misalignment",
    "quadratic_scale",
    "cubic_scale",
    "mounting_rotation",
)
OF_RIG = ("base_tilt", "encoder_scale", "encoder_offset", "gravity_error")
"""Effects of the sensor and of the rig that a plan considers."""
NOISE = "noise"
STEPS = 17
"""Errors at which the share of calibrations below is computed, to interpolate between."""


@dataclass(frozen=True)
class Expected:
    """Errors that calibrations leave on average, by linear theory.

    Attributes
    ----------
    form : (2, s, s) array, rad², mean squares over attitudes of the errors of roll and of pitch, as
        quadratic forms of s independent standard normal variables
    causes : tuple of str, of these variables: `NOISE`, or a neglected effect
    redundancy, conditions : int
    """

    form: Array
    causes: tuple[str, ...]
    redundancy: int
    conditions: int

    def with_noise(self, factor: float) -> Expected:
        """The same with the noise of all observations multiplied by a factor."""
        factors = np.array([factor if cause == NOISE else 1.0 for cause in self.causes])
        return replace(self, form=self.form * np.outer(factors, factors))

    @cached_property
    def squares(self) -> dict[str, Array]:
        """Mean square of the errors of roll and of pitch, (2,), rad², by each cause."""
        each = np.maximum(np.diagonal(self.form, axis1=1, axis2=2), 0.0)  # rounding of zero
        causes = np.array(self.causes)
        return {c: each[:, causes == c].sum(axis=1) for c in dict.fromkeys(self.causes)}

    @property
    def rms(self) -> Array:
        """Rms over attitudes, calibrations and sensors, (2,), rad."""
        return np.sqrt(np.trace(self.form, axis1=1, axis2=2))

    @cached_property
    def _spread(self) -> tuple[Array, Array]:
        """Mean squares of roll and of pitch, and the degrees of freedom of χ² that are alike.

        A mean square is a weighted sum of χ² variables, approximated by a scaled χ² of the same
        mean and variance.
        """
        form, mean = self.form, self.rms**2
        return mean, mean**2 / np.sum(form**2, axis=(1, 2))

    def quantile(self, probability: float) -> Array:
        """Error of each angle by itself that this share of the calibrations stays below, (2,)."""
        mean, freedom = self._spread
        return np.sqrt(2 * mean / freedom * gammaincinv(freedom / 2, probability))

    def of_both(self, probability: float) -> float:
        """Error that roll and pitch both stay below in this share of the calibrations, rad.

        The mean squares of the two angles are taken to be independent: their correlation is 0.1 at
        most, up to tilts of 80 gon.
        """
        mean, freedom = self._spread
        ends = [self.quantile(p).max() for p in (probability, (1 + probability) / 2)]
        squares = np.linspace(ends[0] ** 2, ends[1] ** 2, STEPS)[:, None]
        both = gammainc(freedom / 2, freedom / 2 * squares / mean).prod(axis=1)
        return float(np.sqrt(np.interp(probability, both, squares[:, 0])))


class Theory:
    """Linear theory up to a tilt range, rad."""

    def __init__(self, tilt_range: float) -> None:
        self.model = get_model("+".join((*OF_SENSOR, *OF_RIG)))
        ideal, forces = np.zeros(self.model.n_parameters), cap_forces(tilt_range, ATTITUDES)
        hold = HoldPlan().use(forces, 1)
        error = tilt_error(self.model, ideal, self.model, ideal, forces, hold=hold)
        self.quadratic = error.quadratic
        names = list(self.model.parameter_names)
        self.columns = {
            effect.name: [names.index(parameter.name) for parameter in effect.parameters]
            for effect in self.model.effects
        }

    def information(
        self,
        directions: Array,
        approach: str,
        noise: Noise,
        reference: ReferenceSensor | None = None,
    ) -> Information:
        """What positions tell of the parameters of every effect.

        Errors of a reference, 0 ± 1 and common to all positions, are unknown beside them.
        """
        hold, errors = HoldConditions(yaw=np.zeros(len(directions))), None
        if reference is not None:
            errors = partial(reference.errors, gravity=STANDARD_GRAVITY)
        rows = position_rows(
            self.model, get_approach(approach), noise, directions, hold=hold, errors=errors
        )
        shared = rows.shape[-1] - self.model.n_parameters
        rows = np.roll(rows, shared, axis=-1)  # errors of the reference come first
        return Information.of(rows, np.eye(shared, rows.shape[-1])).beside(shared)

    def expected(
        self, information: Information, effects: Iterable[str], sizes: Mapping[str, float]
    ) -> Expected | None:
        """Errors that calibrations leave.

        Parameters
        ----------
        information : Information, of positions
        effects : str, that are estimated
        sizes : mapping of effect to the sd of its parameters over sensors, SI; those that are not
            estimated are neglected

        Returns
        -------
        Expected, or None if the positions do not determine the effects
        """
        estimated = [i for effect in effects for i in self.columns[effect]]
        neglected = {
            i: (effect, size)
            for effect, size in sizes.items()
            for i in self.columns[effect]
            if size and i not in estimated
        }
        errors = information.errors(estimated, [*neglected], [s for _, s in neglected.values()])
        if errors is None:
            return None
        causes = (*[NOISE] * len(estimated), *(effect for effect, _ in neglected.values()))
        redundancy = information.conditions - len(estimated)
        form = errors.T @ self.quadratic @ errors
        return Expected(form, causes, redundancy, information.conditions)


@cache
def theory_of(tilt_range: float) -> Theory:
    """Theory up to a tilt range, rad; computed once."""
    return Theory(tilt_range)
