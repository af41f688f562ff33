"""What is to be calibrated, what is known of it before, and what each position tells of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.adjustment import whitened_jacobian
from accelstudy.adjustment.equations import equations_of
from accelstudy.adjustment.gauss_helmert import whitened_design
from accelstudy.adjustment.observations import AngleErrors
from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON, STANDARD_GRAVITY
from accelstudy.design.estimability import estimability
from accelstudy.effects import HoldConditions
from accelstudy.leveling.angles import angles_of
from accelstudy.leveling.error import ATTITUDES, MAX_TILT_GON, TiltError, cap_forces, tilt_error
from accelstudy.positions.points import evenly_spread
from accelstudy.positions.scheme import Scheme
from accelstudy.sensors.models import compose, composition_name
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.hold_plan import HoldPlan, check_needs_no_plan
from accelstudy.simulation.sessions import Noise, session

Array = NDArray[np.float64]

SPHERE = 300
"""Attitudes that stand for the whole sphere."""
LOOKING_BACK = ("step_x", "step_y", "step_z", "order")


@dataclass(frozen=True)
class Task:
    """A calibration whose positions are to be chosen.

    All matrices are of scaled parameters. The unit of a parameter is the standard deviation that
    one position gives it, on average over all attitudes, if all others are known. So no number
    depends on a choice of units, and a criterion weighs all parameters by what positions can tell.

    Attributes
    ----------
    model : SensorModel, that is estimated
    approach : Approach
    noise : Noise
    gravity : float, m/s²
    tilt_range : float, rad, up to which the calibrated sensor is used
    prior_sigmas : mapping of parameter to the sd of its known value, SI (a factory calibration)
    measured : (k, 3) array of unit vectors, directions of positions measured before
    neglected : mapping of effect to the sd of its parameters, SI; effects that the sensor has and
        the model lacks, for criteria that take them into account

    Raises
    ------
    InputError
        If the model needs more than positions, or a prior sigma belongs to no parameter.
    """

    model: SensorModel
    approach: Approach
    noise: Noise = field(default_factory=Noise)
    gravity: float = STANDARD_GRAVITY
    tilt_range: float = MAX_TILT_GON * GON
    prior_sigmas: Mapping[str, float] = field(default_factory=dict)
    measured: Array | None = None
    neglected: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_needs_no_plan(self.extended)
        if back := [c for c in self.extended.hold_columns if c in LOOKING_BACK]:
            raise InputError(
                f"the model {self.extended.name!r} depends on the order of the positions "
                f"({back[0]}), which a set of attitudes does not have; leave that effect out"
            )
        for name in self.prior_sigmas:
            if name not in self.model.parameter_names:
                raise InputError(
                    f"prior: the model {self.model.name!r} has no parameter {name!r}; it has "
                    + ", ".join(self.model.parameter_names)
                )

    @cached_property
    def extended(self) -> SensorModel:
        """The model with the neglected effects."""
        if not self.neglected:
            return self.model
        specs = tuple(effect.spec for effect in self.model.effects)
        return extended_model(self.model, [e for e in self.neglected if e not in specs])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters, gravity last if it is observed."""
        observed = ("g",) if self.noise.sigma_gravity > 0 else ()
        return (*self.extended.parameter_names, *observed)

    @cached_property
    def estimated(self) -> NDArray[np.bool_]:
        """Which of all parameters are estimated, (u,)."""
        of_model = self.model.parameter_names
        return np.array([name in of_model or name == "g" for name in self.names])

    @cached_property
    def scale(self) -> Array:
        """Root of the information of one position on each parameter, mean over the sphere, (u,)."""
        rows = self._rows(evenly_spread(SPHERE))
        size = np.sqrt(np.mean(np.sum(rows**2, axis=1), axis=0))
        return np.where(size > 1e-12 * size.max(), size, 1.0)

    def _rows(self, directions: Array) -> Array:
        hold = HoldPlan().hold(len(directions)) if self.extended.hold_columns else None
        return position_rows(
            self.extended, self.approach, self.noise, directions, None, self.gravity, hold
        )

    def informations(self, directions: ArrayLike) -> Array:
        """Scaled information of each of k positions, (k, u, u)."""
        directions = np.asarray(directions, dtype=float)
        return information(self._rows(directions) / self.scale)

    @cached_property
    def prior(self) -> Array:
        """Scaled information before the first position, (u, u)."""
        weights = np.zeros(len(self.names))
        for name, sigma in self.prior_sigmas.items():
            weights[self.names.index(name)] = sigma**-2
        if self.noise.sigma_gravity > 0:
            weights[-1] = self.noise.sigma_gravity**-2
        information_before = np.diag(weights / self.scale**2)
        if self.measured is not None:
            information_before = information_before + self.informations(self.measured).sum(axis=0)
        return information_before

    def normal(self, directions: ArrayLike) -> Array:
        """Scaled normal matrix of positions and of what was known before, (u, u)."""
        return self.prior + self.informations(directions).sum(axis=0)

    @cached_property
    def tilt(self) -> TiltError:
        """Tilt error of a calibration as a function of errors of all parameters."""
        model, f_b = self.extended, cap_forces(self.tilt_range, ATTITUDES, self.gravity)
        ideal = np.zeros(model.n_parameters)
        hold = HoldPlan().use(f_b, 1)
        return tilt_error(model, ideal, model, ideal, f_b, self.gravity, hold)

    @cached_property
    def tilt_weights(self) -> Array:
        """Quadratic forms of scaled errors: mean squares of roll and of pitch, (2, u, u), rad²."""
        u, m = len(self.names), self.extended.n_parameters
        weights = np.zeros((2, u, u))
        weights[:, :m, :m] = self.tilt.quadratic / np.outer(self.scale[:m], self.scale[:m])
        return weights

    @cached_property
    def neglected_variance(self) -> Array:
        """Scaled mean squares of the parameters that are neglected, (u − estimated,)."""
        sizes = [
            self.neglected[e.spec]
            for e in self.extended.effects
            if e.spec in self.neglected
            for _ in e.parameters
        ]
        return (np.array(sizes) * self.scale[~self.estimated]) ** 2

    def covariance(self, directions: ArrayLike) -> Array:
        """Scaled covariance matrix of the estimated parameters, of linear theory."""
        keep = np.ix_(self.estimated, self.estimated)
        return np.asarray(np.linalg.inv(self.normal(directions)[keep]))

    def rms_tilt(self, directions: ArrayLike) -> Array:
        """Expected rms of roll and of pitch, rad, (2,), without the noise of the leveled reading.

        Neglected effects contribute as a scatter of their given size.
        """
        kept, left = self.estimated, ~self.estimated
        normal = self.normal(directions)
        covariance = np.linalg.inv(normal[np.ix_(kept, kept)])
        whole = np.zeros((len(normal), len(normal)))
        whole[np.ix_(kept, kept)] = covariance
        if left.any():
            shift = np.zeros((len(normal), left.sum()))
            shift[kept] = covariance @ normal[np.ix_(kept, left)]
            shift[left] = -np.eye(left.sum())
            whole += (shift * self.neglected_variance) @ shift.T
        return np.sqrt(np.einsum("auw,uw->a", self.tilt_weights, whole))

    def missing(self, directions: Array) -> str:
        """Why positions do not determine the model; empty if they do."""
        keep = np.ix_(self.estimated, self.estimated)
        if np.linalg.cond(self.normal(directions)[keep]) < 1e13:
            return ""
        scheme = Scheme("allowed", "allowed", directions, "generated", "")
        hold = HoldPlan().hold(len(directions))
        determined = estimability(
            scheme, self.model, self.approach, self.noise, None, self.gravity, hold
        )
        return determined.reason or "they hardly determine the model"


def extended_model(model: SensorModel, effects: list[str]) -> SensorModel:
    """Return a model with further effects, each traced once."""
    extended = SensorModel.of("extended", (*(e.spec for e in model.effects), *effects))
    name = composition_name(extended.effects)
    return compose(name, tuple(effect.spec for effect in extended.effects))


def position_rows(
    model: SensorModel,
    approach: Approach,
    noise: Noise,
    directions: ArrayLike,
    parameters: Array | None = None,
    gravity: float = STANDARD_GRAVITY,
    hold: HoldConditions | None = None,
    errors: AngleErrors | None = None,
) -> Array:
    """Rows of the design matrix that each position contributes, at unit weight.

    The normal matrix of any choice of positions is the sum of RᵀR over their rows R. Where
    effects depend on the position before, the order of the directions is that of the session.

    Parameters
    ----------
    model : SensorModel
    approach : Approach
    noise : Noise
        With `sigma_gravity` > 0 gravity is the last parameter. Its observation belongs to no
        position, so its weight 1/σ² is not in the rows.
    directions : (k, 3) array of unit vectors, gravity in the body frame
    parameters : (u,) array, SI, optional; the ideal sensor by default
    gravity : float, m/s²
    hold : HoldConditions, optional
        What else is known of the k positions.
    errors : function of angles (k, 2), optional
        `sigma_angle` and `common` of `Observations`; errors that all angles share are parameters.

    Returns
    -------
    (k, c, u') array, with the c conditions of the approach

    Raises
    ------
    InputError
        If the model needs what `hold` does not tell.
    """
    directions = np.asarray(directions, dtype=float)
    if parameters is None and errors is None and not model.hold_columns:
        return _ideal_rows(model, approach, noise, directions, gravity)
    at = np.zeros(model.n_parameters) if parameters is None else np.asarray(parameters, float)
    ideal = session(model, at, directions, gravity, hold)
    observed = ideal.observations(noise)
    if errors is not None:
        sigma_angle, common = errors(ideal.angles)
        observed = replace(observed, sigma_angle=sigma_angle, common=common)
    rows = whitened_jacobian(model, approach, observed, at)
    k, c = len(directions), approach.n_conditions
    return np.ascontiguousarray(rows[: c * k].reshape(c, k, -1).swapaxes(0, 1))


def _ideal_rows(
    model: SensorModel, approach: Approach, noise: Noise, directions: Array, gravity: float
) -> Array:
    """Rows of the ideal sensor: its output is the force, so that nothing is iterated.

    A search for positions takes most of its time for them.
    """
    force = -gravity * directions
    observed, variance = force, np.full(force.shape, noise.sigma_force**2)
    if approach.uses_angles:
        angles = angles_of(force)
        observed = np.concatenate([force, angles], axis=1)
        of_angles = np.full(angles.shape, noise.sigma_angle**2)
        variance = np.concatenate([variance, of_angles], axis=1)
    equations = equations_of(model.trace, approach, noise.sigma_gravity > 0)
    x = np.zeros((equations.n_parameters, 1))
    if equations.estimates_gravity:
        x[-1] = gravity + noise.gravity_error
    conditions = equations.at(model.settings, gravity + noise.gravity_error, None)
    at = conditions.linearise(x, observed.T[:, None], force.T[:, None])
    rows = whitened_design(at, variance.T)[:, :, 0]
    return np.ascontiguousarray(rows.transpose(2, 0, 1))


def information(rows: Array) -> Array:
    """Normal matrices RᵀR, (k, u, u), of the rows (k, c, u) of k positions."""
    return np.einsum("kcu,kcw->kuw", rows, rows)
