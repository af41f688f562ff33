"""Learned: a smooth function of a coordinate, for what has no name in the catalogue."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, ClassVar

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.registry import Setting
from accelstudy.effects.base import Effect, Parameter, get_effect, unlisted
from accelstudy.effects.components import AXES, Number, Vector, multiply
from accelstudy.effects.smooth import (
    EDGE,
    MIN_LENGTHS,
    ORDERS,
    frequencies,
    harmonics,
    sines,
    spectrum,
)

LEARNED = "learned"
MIN_VARIANCE_SHARE = 5e-3
"""Share of the largest prior variance below which a function is left out."""

UNITS = {
    "force": "m/s^2", "previous": "m/s^2", "vibration": "m/s^2", "temperature": "degC",
    "temperature rate": "K/s", "time": "s", "order": "1",
}  # fmt: skip
"""Coordinates that have a range, with their units: the force of the same axis, that of the position
before, and so on; `order` counts the holds where no time is known."""
ANGLES = ("angle", "yaw")
"""Coordinates that are angles: those of which the robot reads roll and pitch, and the yaw."""
WAVES = {"time wave": "time", "order wave": "order"}
"""Periodic functions of a coordinate, with a period of their own."""
ROBOT = ("roll", "pitch")
TARGETS = {
    "bias": (AXES, "m/s^2"),
    "scale": (AXES, "1"),
    "square": (AXES, "s^2/m"),
    "nonorthogonality": (("yz", "zy", "zx"), "rad"),
    "mounting": (AXES, "rad"),
    "reading": (ROBOT, "rad"),
    "tilt": (("a", "b"), "rad"),
}
"""What depends on the coordinate, with its components and their unit."""
OF_EACH = ("force", "previous")
"""Coordinates of which each axis has its own."""


class LearnedFunction(Effect):
    """Smooth function h of a coordinate, with zero mean over its range; constant beyond it.

    It is a Gaussian process, h(c) = Σ_j w_j φ_j(c), w_j ~ N(0, σ² S_j); see
    `accelstudy.effects.smooth`. Its settings are the range of the coordinate, the length scale, in
    halves of that range or, of an angle, in rad, and σ, the amplitude. The w_j are its parameters.
    Each axis, or angle, has a function of its own.
    """

    name = LEARNED
    informed = True
    coordinate: ClassVar[str] = "temperature"
    target: ClassVar[str] = "bias"
    count: ClassVar[int] = 0
    edge: ClassVar[float] = EDGE

    def __init__(self, **settings: float) -> None:
        super().__init__(**settings)
        low, high = self.settings.get("low", -1.0), self.settings.get("high", 1.0)
        if not low < high:
            raise InputError(f"effect 'learned': low={low:g} must be below high={high:g}")

    @classmethod
    def variant(cls, words: dict[str, str], settings: dict[str, float]) -> type[LearnedFunction]:
        """Return the kind with some coordinate and target, and as many functions as it needs."""
        coordinate = words.get("coordinate", cls.coordinate)
        target = words.get("target", cls.target)
        return learned_kind(
            coordinate, target, *_needed(coordinate, settings.get("length", LENGTH))
        )

    @property
    def words(self) -> Mapping[str, str]:
        """Coordinate and target in the words of the spec."""
        return {"coordinate": self.coordinate, "target": self.target}

    @property
    def equation(self) -> str:
        """Formula of the learned function, for people."""
        of = "h_i(c), c the " + self.coordinate
        times = {"scale": " f_i", "square": " f_i²", "nonorthogonality": " f_j", "mounting": " × f"}
        return of.replace(",", times.get(self.target, "") + ",", 1)

    @property
    def deviations(self) -> Array:
        """Standard deviations of the parameters a priori, (k,), SI."""
        each = self.settings["amplitude"] * np.sqrt(self._spectrum())
        return np.tile(each, len(self.parameters) // len(each))

    def _spectrum(self) -> Array:
        """Prior variances of the weights of one function with the standard deviation 1."""
        if self.coordinate in WAVES:
            return np.ones(2)
        length = self.settings["length"]
        if self.coordinate in ANGLES:
            shares = spectrum(ORDERS[: self.count], length)
            return np.tile(shares / shares.sum(), 2)
        each = spectrum(frequencies(self.edge)[: self.count], length)
        return np.sqrt(2 * np.pi) * length / self.edge * each

    def function(self, values: Array, parameters: Array, covariance: Array) -> tuple[Array, Array]:
        """Evaluate h on a grid of its coordinate.

        Parameters
        ----------
        values : (k,) array, SI
        parameters, covariance : (u,) and (u, u) arrays, of its parameters

        Returns
        -------
        h, sigma : (k, c) arrays, SI, of each component of its target
        """
        phi = np.stack([np.broadcast_to(v, values.shape) for v in self._functions(values, np)], 1)
        count = len(parameters) // phi.shape[1]
        blocks = covariance.reshape(count, phi.shape[1], count, phi.shape[1])
        h = phi @ parameters.reshape(count, -1).T
        squares = [np.einsum("kj,jl,kl->k", phi, blocks[i, :, i], phi) for i in range(count)]
        return h, np.sqrt(np.stack(squares, axis=1))

    def _functions(self, c: Number, xp: Any) -> list[Number]:
        """φ_j of a coordinate."""
        if self.coordinate in WAVES:
            return harmonics(c * (2 * np.pi) / self.settings["period"], xp, 1)
        if self.coordinate in ANGLES:
            return harmonics(c, xp, self.count)
        low, high = self.settings["low"], self.settings["high"]
        scaled = (2 * c - low - high) / (high - low)
        # Between −1 and 1: beyond its range a function keeps its value.
        scaled = (xp.abs(scaled + 1) - xp.abs(scaled - 1)) / 2
        omega = frequencies(self.edge)
        # That of the even sines is zero.
        means = np.where(np.arange(len(omega)) % 2, 0.0, np.sin(omega * self.edge))
        means *= np.sin(omega) / omega
        all_of_them = zip(sines(scaled, xp, self.count, self.edge), means.tolist(), strict=False)
        return [sine - mean if mean else sine for sine, mean in all_of_them]

    def _of(self, c: Number, p: Sequence[Number], xp: Any) -> Number:
        """Evaluate h at a coordinate with given weights."""
        return sum(w * phi for w, phi in zip(p, self._functions(c, xp), strict=True))

    def _parts(self, p: Sequence[Number]) -> list[Sequence[Number]]:
        """Weights of each function."""
        size = 2 if self.coordinate in WAVES else self.count * (1 + (self.coordinate in ANGLES))
        return [p[i : i + size] for i in range(0, len(p), size)]

    def output(self, f, p, g, hold, xp):
        """Return what h of each component of the target adds."""
        if self.target == "reading":
            return super().output(f, p, g, hold, xp)
        parts, arguments = self._parts(p), self.arguments(f, (), hold)
        h = [self._of(c, part, xp) for c, part in zip(arguments, parts, strict=False)]
        if self.coordinate == "previous":
            # Where nothing moved, or the position before is not known, it adds nothing.
            step = xp.abs(hold.step_x) + xp.abs(hold.step_y) + xp.abs(hold.step_z)
            h = [xp.sign(step) * h_i for h_i in h]
        return added_by(self.target, h, f, g, hold, xp)

    def arguments(self, f: Sequence[Number], angles: Sequence[Number], hold: Any) -> list[Number]:
        """Coordinate of each component of the target."""
        if self.coordinate == "angle":
            return list(angles)
        if self.coordinate == "force":
            return list(f)
        if self.coordinate == "previous":
            return [a - b for a, b in zip(f, (hold.step_x, hold.step_y, hold.step_z), strict=True)]
        return [self._column(hold)] * len(TARGETS[self.target][0])

    def _column(self, hold: Any) -> Number:
        """Coordinate of a hold."""
        if self.coordinate == "temperature rate":
            tau = self.settings["tau"]
            return (hold.temperature - hold.lagged(tau)) / tau
        return getattr(hold, WAVES.get(self.coordinate, self.coordinate))

    def reading(self, angles, p, hold, xp):
        """Return h of either angle, or of what both have in common."""
        if self.target != "reading":
            return super().reading(angles, p, hold, xp)
        arguments = self.arguments((), angles, hold)
        return tuple(self._of(c, w, xp) for c, w in zip(arguments, self._parts(p), strict=True))


def added_by(target: str, h: Sequence[Number], f: Vector, g: Number, hold: Any, xp: Any) -> Vector:
    """Return what values h of the components of a target add to the output of the sensor."""
    if target == "tilt":
        return get_effect("base_tilt").output(f, tuple(h), g, hold, xp)
    if target == "mounting":
        return get_effect("mounting_rotation").output(f, tuple(h), g, hold, xp)
    if target == "nonorthogonality":
        return multiply(get_effect("nonorthogonality").axes(tuple(h), xp), f)
    power = {"bias": 0, "scale": 1, "square": 2}[target]
    return tuple(h_i * f_i**power for h_i, f_i in zip(h, f, strict=True))


LENGTH = 0.6
"""Length scale by default."""


def _needed(coordinate: str, length: float) -> tuple[int, float]:
    """Number of sines, or of harmonics, that a length scale needs, and where sines vanish."""
    if coordinate in WAVES:
        return 1, EDGE
    edge = max(EDGE, float(f"{MIN_LENGTHS * length:.3g}"))
    omega = ORDERS if coordinate in ANGLES else frequencies(edge)
    density = spectrum(omega, length)
    return int(np.count_nonzero(density >= MIN_VARIANCE_SHARE * density[0])), edge


@cache
def learned_kind(coordinate: str, target: str, count: int, edge: float) -> type[LearnedFunction]:
    """Kind of a coordinate, a target, and a number of functions, which vanish at an edge.

    Raises
    ------
    InputError
        If nothing of the kind can be.
    """
    known = (*UNITS, *ANGLES, *WAVES)
    for word, name, words in (("coordinate", coordinate, known), ("target", target, TARGETS)):
        if name not in words:
            raise InputError(f"effect 'learned': {word}={name} is none of {', '.join(words)}")
    of_axes, of_robot = coordinate in OF_EACH, target in ("reading", "tilt")
    if (coordinate == "angle" and target != "reading") or (of_axes and of_robot):
        raise InputError(f"effect 'learned': no {target} can depend on the {coordinate}")
    components, unit = TARGETS[target]
    size = 2 * count if coordinate in (*ANGLES, *WAVES) else count
    content = {
        "__doc__": LearnedFunction.__doc__,
        "coordinate": coordinate,
        "target": target,
        "count": count,
        "edge": edge,
        "takes": _takes(coordinate, unit),
        "part": "rig" if target in ("reading", "tilt") else "sensor",
        "parameters": tuple(
            Parameter(f"h_{i}_{j}", unit, f"$h_{{{i},{j}}}$")
            for i in components
            for j in range(1, size + 1)
        ),
    }
    return type("LearnedFunction", (LearnedFunction,), content)


def _takes(coordinate: str, unit: str) -> tuple[Setting, ...]:
    """Settings of a kind."""
    amplitude = Setting("amplitude", unit, 1.0, above=0)
    length = Setting("length", "1", LENGTH, above=0)
    if coordinate in WAVES:
        return (Setting("period", UNITS[WAVES[coordinate]], 1.0, above=0), amplitude)
    if coordinate in ANGLES:
        return (length, amplitude)
    of = UNITS[coordinate]
    lag = (Setting("tau", "s", 1.0, above=0),) if coordinate == "temperature rate" else ()
    return (Setting("low", of, -1.0), Setting("high", of, 1.0), *lag, length, amplitude)


unlisted(
    learned_kind(
        LearnedFunction.coordinate,
        LearnedFunction.target,
        *_needed(LearnedFunction.coordinate, LENGTH),
    )
)
