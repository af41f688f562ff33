"""What a calibration can see of a session, and the shapes that effects leave in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from studies.hidden.physics.designs import Session
from studies.hidden.physics.geometry import GRAVITY, Array, level_force
from studies.hidden.physics.kinds import EFFECTS, Cause, Kind
from studies.hidden.physics.measuring import Sensor, observe

STEP = 1e-5
"""rad, of numerical derivatives by the angles."""
TRIANGLE = tuple((i, j) for i in range(3) for j in range(i, 3))


class Conditions:
    """Misclosures of a session, without any effect, that is calibrated by the true sensor.

    Attributes
    ----------
    session : Session; sensor : Sensor
    robot : bool, whether the readings of the encoders are used; else the norm of gravity is
    directions : (n, 3) array, unit vectors along the specific force
    absorbed : (m, 9) array, orthonormal, what the nine parameters of a calibration absorb
    """

    def __init__(self, session: Session, approach: str, sensor: Sensor) -> None:
        self.session, self.sensor, self.robot = session, sensor, approach == "robot"
        output, joints = (part[0] for part in observe(session, sensor, ()))
        correction = sensor.correction
        self.directions = (output - sensor.bias) @ correction.T / GRAVITY
        noise = session.sigma**2 * correction @ correction.T
        if self.robot:
            turned = np.stack([STEP * np.eye(2), -STEP * np.eye(2)])
            ahead, back = level_force(joints[:, None, :] + turned[:, None])
            by_angles = (ahead - back) / (2 * STEP)
            angles = session.sigma_angle**2 * np.swapaxes(by_angles, 1, 2) @ by_angles
            self._root = np.linalg.inv(np.linalg.cholesky(noise + angles))
        else:
            variance = np.sum((self.directions @ noise) * self.directions, axis=1)
            self._root = 1 / np.sqrt(variance)[:, None, None]
        # A calibrated force is an upper triangular matrix times the output less its bias.
        columns = np.zeros((len(output), 3, 9))
        for column, (i, j) in enumerate(TRIANGLE):
            columns[:, i, column] = output[:, j] - sensor.bias[j]
        columns[:, :, 6:] = correction
        self.absorbed = np.linalg.qr(self._white(columns.transpose(2, 0, 1)).T)[0]

    def absorb(self, basis: Array) -> None:
        """Let a calibration absorb what lies in a basis (m, d), too."""
        self.absorbed = np.linalg.qr(np.concatenate([self.absorbed, basis], axis=1))[0]

    def misclosures(self, output: Array, reading: Array) -> Array:
        """Misclosures (B, m) of unit weight of outputs (B, n, 3) and readings (B, n, 2)."""
        calibrated = (output - self.sensor.bias) @ self.sensor.correction.T
        if self.robot:
            return self._white(calibrated - level_force(reading))
        norms = np.sqrt(np.sum(calibrated**2, axis=-1)) - GRAVITY
        return np.asarray(norms * self._root[:, 0, 0])

    def changed(self, forces: Array) -> Array:
        """Misclosures (B, m) that small changes (B, n, 3) of the outputs make."""
        return self._white(forces @ self.sensor.correction.T)

    def seen(self, output: Array, reading: Array) -> Array:
        """Misclosures (B, m) less what the parameters absorb."""
        return self.left(self.misclosures(output, reading))

    def left(self, misclosures: Array) -> Array:
        """What the parameters leave of misclosures (B, m)."""
        return np.asarray(misclosures - (misclosures @ self.absorbed) @ self.absorbed.T)

    def _white(self, forces: Array) -> Array:
        """Conditions (B, m) of unit weight of changes of forces (B, n, 3)."""
        if not self.robot:
            return np.asarray(np.sum(forces * self.directions, axis=-1) * self._root[:, 0, 0])
        white = np.matmul(self._root, forces[..., None])[..., 0]
        return np.asarray(white.reshape(len(forces), -1))


VISIBLE = 3e-3
"""Share of an effect that must be left, or it cannot be seen."""
ROUNDING = 1e-12
"""Share of the readings themselves up to which an effect is only their rounding."""
ALIKE = 0.9999
"""Canonical cosine from which on two effects are the same."""


@dataclass(frozen=True)
class Shape:
    """What an effect with its settings leaves in the misclosures of an ideal sensor.

    Attributes
    ----------
    effect : Effect
    settings : mapping of str to float
    directions : (k, d) array, orthonormal combinations of its parameters that can be seen
    basis : (m, d) array, orthonormal
    """

    effect: Kind
    settings: Mapping[str, float]
    directions: Array
    basis: Array

    @classmethod
    def of(
        cls, effect: Kind, settings: Mapping[str, float], left: Array, size: float
    ) -> Shape | None:
        """Shape of what each parameter leaves (k, m); None if that is too little of its size."""
        u, values, vt = np.linalg.svd(left.T, full_matrices=False)
        rank = int(np.sum(values > VISIBLE * size))
        return cls(effect, settings, vt[:rank].T, u[:, :rank]) if rank else None

    def drawn(self, rng: np.random.Generator) -> Array:
        """Parameters (k,) at random, without what cannot be seen and so has no size."""
        parameters = rng.standard_normal(self.effect.k)
        if self.effect.target == "clipping":  # which only takes away
            parameters = abs(parameters)
        return np.asarray(self.directions @ (self.directions.T @ parameters))

    @property
    def dim(self) -> int:
        """Number of dimensions in which it can be seen."""
        return self.basis.shape[1]


@dataclass(frozen=True)
class Atlas:
    """All shapes that a design can see by one approach.

    Attributes
    ----------
    conditions : Conditions, of an ideal sensor
    """

    conditions: Conditions

    @property
    def session(self) -> Session:
        """The session."""
        return self.conditions.session

    def shape(self, effect: Kind, settings: Mapping[str, float]) -> Shape | None:
        """Shape of an effect with any settings; None if it cannot be seen."""
        k, sigma = effect.k, self.session.sigma
        steps = effect.typical * np.eye(k)
        cause = Cause(effect, dict(settings), np.concatenate([steps, -steps]))
        output, reading = observe(self.session, self.conditions.sensor, (cause,))
        seen = self.conditions.seen(output, reading)
        left, force, angle = ((each[:k] - each[k:]) / 2 for each in (seen, output, reading))
        size = float(
            np.hypot(np.linalg.norm(force), GRAVITY * np.linalg.norm(angle)) / sigma / np.sqrt(k)
        )
        readings = float(np.linalg.norm(self.conditions.directions)) * GRAVITY / sigma
        if size < ROUNDING * readings:  # else what is left would be a matter of the processor
            return None
        return Shape.of(effect, settings, left, size)

    @cached_property
    def shapes(self) -> tuple[Shape, ...]:
        """Shapes of all effects, in settings that cover all their values."""
        candidates = (
            self.shape(effect, settings)
            for effect in EFFECTS.values()
            if effect.shows(self.session)
            for settings in effect.grid(self.session)
        )
        return tuple(shape for shape in candidates if shape is not None)

    @cached_property
    def visible(self) -> tuple[str, ...]:
        """Names of the effects that can be seen."""
        return tuple(dict.fromkeys(shape.effect.name for shape in self.shapes))

    @property
    def invisible(self) -> tuple[str, ...]:
        """Names of the effects that the session has, but that cannot be seen."""
        had = (name for name, effect in EFFECTS.items() if effect.shows(self.session))
        return tuple(name for name in had if name not in self.visible)

    @cached_property
    def together(self) -> Array:
        """Bases of all shapes side by side, (m, k)."""
        return np.concatenate([shape.basis for shape in self.shapes], axis=1)

    @cached_property
    def starts(self) -> NDArray[np.int_]:
        """First column of each shape in `together`."""
        return np.cumsum([0, *(shape.dim for shape in self.shapes)])[:-1]

    @cached_property
    def dims(self) -> NDArray[np.int_]:
        """Dimensions of all shapes."""
        return np.array([shape.dim for shape in self.shapes])

    def parts(self, z: Array) -> Array:
        """Squares of what misclosures (..., m) have in each shape, (..., s)."""
        return np.asarray(np.add.reduceat((z @ self.together) ** 2, self.starts, axis=-1))

    def cosines(self) -> dict[tuple[str, str], float]:
        """Largest canonical cosine of any shapes of every two effects that can be seen."""
        largest: dict[tuple[str, str], float] = {}
        for one, other in combinations(self.shapes, 2):
            pair = one.effect.name, other.effect.name
            cosine = float(np.linalg.svd(one.basis.T @ other.basis, compute_uv=False)[0])
            largest[pair] = max(cosine, largest.get(pair, 0.0))
        return largest

    def same_as(self, shape: Shape) -> tuple[str, ...]:
        """Names of the effects with a shape that cannot be told from the given one."""
        squares = np.add.reduceat(np.sum((shape.basis.T @ self.together) ** 2, axis=0), self.starts)
        # The squares of d cosines, each at most 1, have a sum of almost d.
        near = (self.dims == shape.dim) & (squares > shape.dim - 1 + ALIKE**2)
        names = {shape.effect.name}
        for i in np.flatnonzero(near):
            cosines = np.linalg.svd(shape.basis.T @ self.shapes[i].basis, compute_uv=False)
            if cosines[-1] > ALIKE:
                names.add(self.shapes[i].effect.name)
        return tuple(name for name in EFFECTS if name in names)
