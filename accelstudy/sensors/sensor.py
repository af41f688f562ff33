"""Sensor models: compositions of effects, evaluated forwards and backwards.

    f_a = T⁻¹ f_b,   T = I + Σ axes(p),
    f_o = f_a + Σ output(f_a, p),
    f_s = f_o + Σ output(f_o, p) of the effects that act last.

With the effects bias, scale and non-orthogonality this is f_s = S T⁻¹ f_b + b (Thalmann & Neuner
2018, eq. 5). The way back solves f_s for f_a by Newton's method, so that an effect
needs no inverse of its own, and has f_b = T f_a in closed form.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import islice

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.effects import Effect, HoldConditions, Parameter, get_effect
from accelstudy.sensors.trace import HOLD, SensorTrace, trace_of
from accelstudy.symbolic.tracing import TracedFunction


@dataclass(frozen=True)
class SensorModel:
    """A named composition of effects.

    Parameters
    ----------
    name : str
    effects : tuple of Effect
        No two of them share a parameter name.
    """

    name: str
    effects: tuple[Effect, ...]

    def __post_init__(self) -> None:
        names = [parameter.name for parameter in self.parameters]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            of = f"model {self.name!r}: " if self.name else ""
            raise InputError(f"{of}parameters {', '.join(twice)} occur in two effects")

    @classmethod
    def of(cls, name: str, effects: Iterable[str]) -> SensorModel:
        """Compose a model of registered effects by their names."""
        return cls(name, tuple(get_effect(effect) for effect in effects))

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters, effect after effect."""
        return tuple(p for effect in self.effects for p in effect.parameters)

    @property
    def n_parameters(self) -> int:
        """Number of parameters u."""
        return len(self.parameters)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of all parameters."""
        return tuple(p.name for p in self.parameters)

    @property
    def effect_names(self) -> tuple[str, ...]:
        """Names of its effects."""
        return tuple(effect.name for effect in self.effects)

    @property
    def parts(self) -> Iterator[tuple[Effect, slice]]:
        """Each effect, and where its parameters stand in a vector (u,)."""
        first = 0
        for effect in self.effects:
            yield effect, slice(first, first := first + len(effect.parameters))

    @property
    def stays(self) -> NDArray[np.bool_]:
        """Whether each parameter, (u,), belongs to the sensor and not to the rig."""
        return np.array([e.part == "sensor" for e in self.effects for _ in e.parameters], bool)

    @cached_property
    def prior_weights(self) -> Array:
        """Weights (u,) of the parameters, observed as zero a priori; 0 if nothing is known."""
        return np.concatenate([np.zeros(0), *(effect.deviations**-2 for effect in self.effects)])

    def vector(self, values: Mapping[str, float]) -> Array:
        """Parameter vector (u,) in SI from a mapping; parameters that it does not name are zero."""
        return np.array([values.get(name, 0.0) for name in self.parameter_names], dtype=float)

    @cached_property
    def settings(self) -> Array:
        """Settings of all effects, (s,), effect after effect."""
        return np.array(
            [v for effect in self.effects for v in effect.settings.values()], dtype=float
        )

    @property
    def trace(self) -> SensorTrace:
        """The functions generated from the model."""
        return trace_of(tuple(type(effect) for effect in self.effects))

    @cached_property
    def hold_columns(self) -> tuple[str, ...]:
        """Columns of `HoldConditions` on which the output or the robot's reading depends."""
        used = self.trace.conditions
        names = {name for name in HoldConditions.columns() if HOLD + name in used}
        for tau, name in self.trace.lags(self.settings):
            if name in used:
                names |= {"temperature", "time"} if tau > 0 else {"temperature"}
        return tuple(name for name in HoldConditions.columns() if name in names)

    @cached_property
    def needs(self) -> tuple[tuple[str, str], ...]:
        """Effects that need more than the force, each with a column of `HoldConditions`."""
        if not self.hold_columns:
            return ()
        alone = (SensorModel("", (effect,)) for effect in self.effects)
        return tuple((one.effects[0].name, column) for one in alone for column in one.hold_columns)

    @property
    def without_rig(self) -> SensorModel:
        """The model without the effects of the rig, which stay with it."""
        return SensorModel(self.name, tuple(e for e in self.effects if e.part == "sensor"))

    def affine(self, parameters: ArrayLike) -> tuple[Array, Array] | None:
        """K (3, 3) and b (3,) of f_b = K (f_s − b); None if the model is not affine.

        Effects of the rig are left out: they are no part of the sensor.

        Parameters
        ----------
        parameters : (u,) array, SI
        """
        if not_affine(self):
            return None
        probes = STANDARD_GRAVITY * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
        corrected = self.without_rig.correct(probes, np.asarray(parameters)[self.stays])
        if not np.isfinite(corrected).all():
            return None
        matrix = ((corrected[1:4] - corrected[4:]) / (2 * STANDARD_GRAVITY)).T
        return matrix, -np.linalg.solve(matrix, corrected[0])

    def sense(
        self,
        f_b: ArrayLike,
        parameters: ArrayLike,
        g: ArrayLike = STANDARD_GRAVITY,
        hold: HoldConditions | None = None,
    ) -> Array:
        """Output of the sensor for a specific force in the body frame (forward, no noise).

        Parameters
        ----------
        f_b : (..., n, 3) array, m/s²
        parameters : (..., u) array, SI
        g : float or (...) array, local gravity, m/s²
        hold : HoldConditions, optional
            What else is known of the n positions; only effects that depend on it need it.

        Returns
        -------
        f_s : (..., n, 3) array, m/s²
        """
        return self._evaluate(self.trace.sense, f_b, parameters, g, hold)[..., 0]

    def correct(
        self,
        f_s: ArrayLike,
        parameters: ArrayLike,
        g: ArrayLike = STANDARD_GRAVITY,
        hold: HoldConditions | None = None,
    ) -> Array:
        """Specific force in the body frame for a sensor output: the inverse of `sense`.

        Parameters and result as in `sense`, with f_s and f_b exchanged. Where the Newton iteration
        does not converge (effects as large as the signal) the result is NaN.
        """
        f_a = self.sensitive_force(f_s, parameters, g, hold)
        return self._evaluate(self.trace.body, f_a, parameters, g, hold)[..., 0]

    def correction_jacobian(
        self,
        f_s: ArrayLike,
        parameters: ArrayLike,
        g: ArrayLike = STANDARD_GRAVITY,
        hold: HoldConditions | None = None,
    ) -> Array:
        """Derivative of `correct` with respect to the parameters, (..., n, 3, u)."""
        f_a = self.sensitive_force(f_s, parameters, g, hold)
        return self._evaluate(self.trace.body_jacobian, f_a, parameters, g, hold)

    def output_jacobian(
        self,
        f_s: ArrayLike,
        parameters: ArrayLike,
        g: ArrayLike = STANDARD_GRAVITY,
        hold: HoldConditions | None = None,
    ) -> Array:
        """Derivative of `correct` with respect to the sensor's output, (..., n, 3, 3)."""
        f_a = self.sensitive_force(f_s, parameters, g, hold)
        return self._evaluate(self.trace.output_jacobian, f_a, parameters, g, hold)

    def sensitive_force(
        self,
        f_s: ArrayLike,
        parameters: ArrayLike,
        g: ArrayLike = STANDARD_GRAVITY,
        hold: HoldConditions | None = None,
    ) -> Array:
        """Specific force in the sensitive axes, f_a, for a sensor output; else as `correct`."""
        step, f_a = np.zeros_like(f_s, dtype=float), np.asarray(f_s, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for f_a, step in islice(self.newton(f_s, parameters, g, hold), 25):  # noqa: B007
                if not np.any(np.abs(step) > 1e-14 * STANDARD_GRAVITY):
                    break
        return np.where(np.abs(step) <= 1e-12 * STANDARD_GRAVITY, f_a, np.nan)

    def newton(
        self,
        f_s: ArrayLike,
        parameters: ArrayLike,
        g: ArrayLike = STANDARD_GRAVITY,
        hold: HoldConditions | None = None,
    ) -> Iterator[tuple[Array, Array]]:
        """Yield f_a and the step to it, one step of Newton's method after the other, without end.

        Parameters as in `correct`.
        """
        f_s = np.asarray(f_s, dtype=float)
        batch = np.broadcast_shapes(f_s.shape[:-2], np.shape(parameters)[:-1])
        f_a = np.broadcast_to(f_s, batch + f_s.shape[-2:])
        while True:
            step = self._evaluate(self.trace.newton_step, f_a, parameters, g, hold, f_s)[..., 0]
            f_a = f_a + step
            yield f_a, step

    def slope_of_last(
        self, f_a: Array, parameters: ArrayLike, hold: HoldConditions | None
    ) -> Array:
        """Derivative of the output, by what the effects before the last ones leave, (..., n, 3, 3).

        Parameters (u,) as in `sense`, with the force f_a (..., n, 3) in the sensitive axes.
        """
        return self._evaluate(self.trace.by_last, f_a, parameters, STANDARD_GRAVITY, hold)

    def axes_matrix(self, parameters: ArrayLike) -> Array:
        """Return T, (3, 3), which turns forces in the sensitive axes into the body frame."""
        body = self._evaluate(self.trace.body, np.eye(3), parameters, STANDARD_GRAVITY, None)
        return body[..., 0].T

    def reading_errors(
        self, angles: ArrayLike, parameters: ArrayLike, hold: HoldConditions | None = None
    ) -> Array:
        """Return what the effects add to a robot's reading of roll and pitch.

        Effects are functions of what the robot reads, as in the adjustment, so the reading r of an
        attitude a is the solution of r = a + e(r).

        Parameters
        ----------
        angles : (n, 2) array, rad, roll and pitch of the attitude
        parameters : (u,) array, SI
        hold : HoldConditions, optional

        Returns
        -------
        (n, 2) array, rad
        """
        angles = np.asarray(angles, dtype=float)
        errors = np.zeros_like(angles)
        if self.trace.reading.is_zero:
            return errors
        for _ in range(10):  # each iteration gains as many digits as a relative error has zeros
            before, errors = errors, self.errors_of_reading(angles + errors, parameters, hold)
            if np.array_equal(before, errors):
                break
        return errors

    def errors_of_reading(
        self,
        reading: Array,
        parameters: ArrayLike,
        hold: HoldConditions | None = None,
    ) -> Array:
        """Return the errors (..., n, 2) of a reading (..., n, 2); see `reading_errors`."""
        padded = np.concatenate([reading, np.zeros_like(reading[..., :1])], axis=-1)
        errors = self._evaluate(self.trace.reading, padded, parameters, STANDARD_GRAVITY, hold)
        return errors[..., 0]

    def _evaluate(
        self,
        function: TracedFunction,
        force: ArrayLike,
        parameters: ArrayLike,
        g: ArrayLike,
        hold: HoldConditions | None,
        output: ArrayLike | None = None,
    ) -> Array:
        """Call a function of the trace, components last; returns (..., n, rows, columns)."""
        force = _components(force)
        output = force if output is None else _components(output)
        x, g = _components(parameters), np.asarray(g, dtype=float)
        result = self.trace.evaluate(function, force, output, x, self.settings, g, hold)
        return result.transpose(*range(2, result.ndim), 0, 1)


def _components(vectors: ArrayLike) -> Array:
    """Turn the last axis into the first, as `np.moveaxis` does in many times the time."""
    array = np.asarray(vectors, dtype=float)
    return array.transpose(-1, *range(array.ndim - 1))


def not_affine(model: SensorModel) -> tuple[str, ...]:
    """Names of the effects that no matrix can hold.

    Their output is not linear in the force, or depends on more than the force. Effects of the rig
    do not count.
    """
    return tuple(
        effect.name
        for effect in model.effects
        if effect.part == "sensor" and not trace_of((type(effect),)).affine
    )
