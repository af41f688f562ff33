"""Linear theory of the errors that a calibration leaves, for all models of a plan at once.

One model has every effect that matters. Its design rows for a scheme are computed once; a
calibration with fewer effects estimates some of its columns, A, and neglects others, N. With the
noise n and the parameters p of the neglected effects, the estimates are wrong by

    δx = (AᵀA)⁻¹Aᵀ (n + N p),        and the neglected parameters by −p.

So the mean square of the tilt error is tr(Q C), with the covariance C of both together and the
quadratic form Q of `accelstudy.leveling.error`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainc, gammaincinv

from accelstudy.approaches import get_approach
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.campaign.reference import ReferenceSensor
from accelstudy.design.estimability import SINGULAR
from accelstudy.design.task import position_rows
from accelstudy.effects import HoldConditions, get_effect
from accelstudy.leveling.error import ATTITUDES, cap_forces, tilt_error
from accelstudy.sensors.models import get_model
from accelstudy.sensors.sensor import SensorModel
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
STEPS = 17
"""Errors at which the share of calibrations below is computed, to interpolate between."""


@dataclass(frozen=True)
class Expected:
    """Errors that calibrations leave on average, by linear theory.

    Attributes
    ----------
    noise : (2,) array, rad², mean square error of roll and of pitch that noise leaves
    neglected : dict of effect to (2,) array, rad², mean square error that neglecting it adds
    quadratic : (2, u, u) array, rad² per SI², quadratic form of the errors of all parameters
    scatter : (u, s) array, errors of all parameters per unit of s independent normal variables;
        the first of these variables are those of the noise
    of_noise : int, number of variables of the noise
    redundancy, conditions : int
    """

    noise: Array
    neglected: dict[str, Array]
    quadratic: Array
    scatter: Array
    of_noise: int
    redundancy: int
    conditions: int

    def with_noise(self, factor: float) -> Expected:
        """The same with the noise of all observations multiplied by a factor."""
        scatter = self.scatter.copy()
        scatter[:, : self.of_noise] *= factor
        return replace(self, noise=self.noise * factor**2, scatter=scatter)

    @property
    def rms(self) -> Array:
        """Rms over attitudes, calibrations and sensors, (2,), rad."""
        return np.sqrt(self.noise + sum(self.neglected.values(), np.zeros(2)))

    @cached_property
    def _spread(self) -> tuple[Array, Array]:
        """Mean squares of roll and of pitch, and the degrees of freedom of χ² that are alike.

        A mean square is a weighted sum of χ² variables, approximated by a scaled χ² of the same
        mean and variance.
        """
        form = self.scatter.T @ self.quadratic @ self.scatter
        mean = np.trace(form, axis1=1, axis2=2)
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
        carried = get_model("+".join(OF_SENSOR))
        zeros = np.zeros(carried.n_parameters)
        forces = cap_forces(tilt_range, ATTITUDES)
        error = tilt_error(carried, zeros, carried, zeros, forces)
        u, k = self.model.n_parameters, carried.n_parameters
        self.quadratic = np.zeros((2, u, u))
        self.quadratic[:, :k, :k] = error.quadratic
        names = list(self.model.parameter_names)
        self.columns = {
            effect: [names.index(p.name) for p in get_effect(effect).parameters]
            for effect in (*OF_SENSOR, *OF_RIG)
        }

    def of_model(self, model: SensorModel) -> list[int]:
        """Columns of what a model estimates."""
        return [i for effect in model.effects for i in self.columns[effect.name]]

    def rows(
        self,
        directions: Array,
        approach: str,
        noise: Noise,
        reference: ReferenceSensor | None = None,
    ) -> Array:
        """Whitened rows of the model with every effect, (conditions, u).

        Errors c of a reference, 0 ± 1 and common to all positions, add C c to the noise, so its
        covariance is I + C Cᵀ. With the singular value decomposition C = U S Vᵀ, the rows are
        scaled by its inverse root, I − U (I − (I + S²)^(−1/2)) Uᵀ.
        """
        hold, errors = HoldConditions(yaw=np.zeros(len(directions))), None
        if reference is not None:
            errors = partial(reference.errors, gravity=STANDARD_GRAVITY)
        rows = position_rows(
            self.model, get_approach(approach), noise, directions, hold=hold, errors=errors
        )
        rows = rows.reshape(-1, rows.shape[-1])
        u = self.model.n_parameters
        left, size, _ = np.linalg.svd(rows[:, u:], full_matrices=False)
        less = 1 - 1 / np.sqrt(1 + size**2)
        return np.asarray(rows[:, :u] - (left * less) @ (left.T @ rows[:, :u]))

    def expected(
        self, rows: Array, model: SensorModel, sizes: Mapping[str, float]
    ) -> Expected | None:
        """Errors that calibrations with a model leave.

        Parameters
        ----------
        rows : (n, u) array, of `rows`
        model : SensorModel, that is estimated
        sizes : mapping of effect to the sd of its parameters over sensors, SI; an effect that the
            model lacks is neglected

        Returns
        -------
        Expected, or None if the positions do not determine the model
        """
        estimated = self.of_model(model)
        solved = _solved(rows[:, estimated])
        if solved is None:
            return None
        cofactors, solve = solved
        quadratic = self.quadratic[:, estimated][:, :, estimated]
        noise = np.einsum("auw,uw->a", quadratic, cofactors)
        scatter = [np.zeros((self.model.n_parameters, len(estimated)))]
        scatter[0][estimated] = np.linalg.cholesky(cofactors)
        neglected: dict[str, Array] = {}
        for effect, size in sizes.items():
            columns = self.columns[effect]
            if size == 0 or set(columns) <= set(estimated):
                continue
            response = self.response(rows, estimated, solve, columns) * size
            neglected[effect] = np.einsum("uj,auw,wj->a", response, self.quadratic, response)
            scatter.append(response)
        return Expected(
            noise,
            neglected,
            self.quadratic,
            np.hstack(scatter),
            len(estimated),
            len(rows) - len(estimated),
            len(rows),
        )

    def response(
        self, rows: Array, estimated: Sequence[int], solve: Array, columns: Sequence[int]
    ) -> Array:
        """Errors of all parameters per unit of the neglected parameters, (u, j)."""
        error = np.zeros((self.model.n_parameters, len(columns)))
        error[list(estimated)] = solve @ rows[:, list(columns)]
        error[list(columns), range(len(columns))] = -1.0
        return error

    def neglecting(self, rows: Array, model: SensorModel, effect: str) -> Array:
        """Rms of the tilt error that a neglected effect of unit size leaves, (2,), rad per SI."""
        estimated = self.of_model(model)
        solved = _solved(rows[:, estimated])
        assert solved is not None
        columns = self.columns[effect]
        response = self.response(rows, estimated, solved[1], columns)
        square = np.einsum("uj,auw,wj->a", response, self.quadratic, response)
        return np.sqrt(np.maximum(square, 0.0))


@cache
def theory_of(tilt_range: float) -> Theory:
    """Theory up to a tilt range, rad; computed once."""
    return Theory(tilt_range)


def _solved(design: Array) -> tuple[Array, Array] | None:
    """Cofactors (AᵀA)⁻¹ and the solution (AᵀA)⁻¹Aᵀ of a design; None if it is singular."""
    if len(design) < design.shape[1]:
        return None
    length = np.linalg.norm(design, axis=0)
    if not np.all(length > SINGULAR * length.max()):
        return None
    left, values, right = np.linalg.svd(design / length, full_matrices=False)
    if values[-1] <= SINGULAR * values[0]:
        return None
    solve = (right.T / values) @ left.T / length[:, None]
    return solve @ solve.T, solve
