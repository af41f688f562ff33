"""What is to be calibrated, what is known of it before, and what each position tells of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON, STANDARD_GRAVITY
from accelstudy.design.estimability import estimability
from accelstudy.design.information import Information, position_rows
from accelstudy.leveling.error import ATTITUDES, MAX_TILT_GON, TiltError, cap_forces, tilt_error
from accelstudy.positions.points import evenly_spread
from accelstudy.positions.scheme import Scheme
from accelstudy.sensors.models import compose, composition_name
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.hold_plan import HoldPlan, check_needs_no_plan
from accelstudy.simulation.sessions import Noise

Array = NDArray[np.float64]

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
        size = np.sqrt(np.mean(np.sum(self._rows(evenly_spread(SPHERE)) ** 2, axis=1), axis=0))
        return np.where(size > 1e-12 * size.max(), size, 1.0)

    def _rows(self, directions: Array) -> Array:
        hold = HoldPlan().hold(len(directions)) if self.extended.hold_columns else None
        return position_rows(
            self.extended, self.approach, self.noise, directions, self.gravity, hold
        )

    def informations(self, directions: ArrayLike) -> Array:
        """Scaled information of each of k positions, (k, u, u)."""
        rows = self._rows(np.asarray(directions, dtype=float)) / self.scale
        return np.einsum("kcu,kcw->kuw", rows, rows)

    @cached_property
    def _before(self) -> Array:
        """Rows of what is known before the first position, (m, u), SI."""
        sigmas = dict(self.prior_sigmas)
        if self.noise.sigma_gravity > 0:
            sigmas["g"] = self.noise.sigma_gravity
        known = np.diag([1 / sigmas.get(name, np.inf) for name in self.names])
        if self.measured is None:
            return known
        rows = self._rows(self.measured)
        return np.concatenate([known, rows.reshape(-1, len(self.names))])

    @cached_property
    def prior(self) -> Array:
        """Scaled information before the first position, (u, u)."""
        scaled = self._before / self.scale
        return np.asarray(scaled.T @ scaled)

    def normal(self, directions: ArrayLike) -> Array:
        """Scaled normal matrix of positions and of what was known before, (u, u)."""
        return self.prior + self.informations(directions).sum(axis=0)

    def information(self, directions: ArrayLike) -> Information:
        """What positions, and what was known before, tell of all parameters, SI."""
        return Information.of(self._before, self._rows(np.asarray(directions, dtype=float)))

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

    def places(self, effect: str) -> NDArray[np.int_]:
        """Places of the parameters of an effect among all parameters."""
        owner = [e.spec for e in self.extended.effects for _ in e.parameters]
        return np.flatnonzero([spec == effect for spec in owner])

    @cached_property
    def neglected_sigmas(self) -> Array:
        """Scaled standard deviations of the parameters that are neglected, (u − estimated,)."""
        sizes = np.zeros(len(self.names))
        for effect, size in self.neglected.items():
            sizes[self.places(effect)] = size
        return np.asarray((sizes * self.scale)[~self.estimated])

    def rms_tilt(self, directions: ArrayLike) -> Array:
        """Expected rms of roll and of pitch, rad, (2,), without the noise of the leveled reading.

        Neglected effects contribute as a scatter of their given size. Infinite where the positions
        do not determine the model.
        """
        neglected = {effect: (self.places(effect), size) for effect, size in self.neglected.items()}
        estimated = np.flatnonzero(self.estimated)
        tilt = self.information(directions).tilt(self.tilt, estimated, neglected)
        return np.full(2, np.inf) if tilt is None else tilt.rms

    def missing(self, directions: Array) -> str:
        """Why readings in positions do not determine the model; empty if they do."""
        measured = directions
        if self.measured is not None:
            measured = np.concatenate([self.measured, directions])
        return estimability(
            Scheme("allowed", "allowed", measured, "generated", ""),
            self.model,
            self.approach,
            self.noise,
            gravity=self.gravity,
            hold=HoldPlan().hold(len(measured)),
            known={name: (0.0, sigma) for name, sigma in self.prior_sigmas.items()},
            blur=self.noise.sigma_force,
        ).reason


def extended_model(model: SensorModel, effects: list[str]) -> SensorModel:
    """Return a model with further effects, each traced once."""
    extended = SensorModel.of("extended", (*(e.spec for e in model.effects), *effects))
    name = composition_name(extended.effects)
    return compose(name, tuple(effect.spec for effect in extended.effects))
