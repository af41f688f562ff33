"""What each effect leaves in the misclosures of a design: its shapes, and which are the same."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.hidden.physics.forward.designs import session
from accelstudy.hidden.physics.forward.effects import EFFECTS, Effect
from accelstudy.hidden.physics.forward.measuring import Cause, Sensor, observe
from accelstudy.hidden.physics.forward.session import Session
from accelstudy.hidden.physics.seen.conditions import Conditions

Array = NDArray[np.float64]

VISIBLE = 3e-3
"""Share of an effect that must be left, or it cannot be seen."""
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

    effect: Effect
    settings: Mapping[str, float]
    directions: Array
    basis: Array

    @property
    def dim(self) -> int:
        """Number of dimensions in which it can be seen."""
        return self.basis.shape[1]


@dataclass(frozen=True)
class Atlas:
    """All shapes that a design can see by one approach.

    Attributes
    ----------
    session : Session
    conditions : Conditions, of an ideal sensor
    """

    session: Session
    conditions: Conditions

    def shape(self, effect: Effect, settings: Mapping[str, float]) -> Shape | None:
        """Shape of an effect with any settings; None if it cannot be seen."""
        steps = effect.typical * np.eye(effect.k)
        cause = Cause(effect, dict(settings), np.concatenate([steps, -steps]))
        output, reading = observe(self.session, self.conditions.sensor, (cause,))
        change = self.conditions.seen(output, reading)
        left = (change[: effect.k] - change[effect.k :]) / 2
        raw_force = output[: effect.k] - output[effect.k :]
        raw_angle = reading[: effect.k] - reading[effect.k :]
        size = np.sqrt(
            np.sum((raw_force / self.session.sigma) ** 2)
            + np.sum((raw_angle * 9.8 / self.session.sigma) ** 2)
        ) / (2 * np.sqrt(effect.k))
        u, values, vt = np.linalg.svd(left.T, full_matrices=False)
        rank = int(np.sum(values > VISIBLE * size))
        return Shape(effect, settings, vt[:rank].T, u[:, :rank]) if rank else None

    @cached_property
    def shapes(self) -> tuple[Shape, ...]:
        """Shapes of all effects, in settings that cover all their values."""
        found = (
            self.shape(effect, settings)
            for effect in EFFECTS.values()
            if effect.shows(self.session)
            for settings in effect.grid(self.session)
        )
        return tuple(shape for shape in found if shape is not None)

    @cached_property
    def visible(self) -> tuple[str, ...]:
        """Names of the effects that can be seen."""
        return tuple(dict.fromkeys(shape.effect.name for shape in self.shapes))

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


@cache
def atlas(design: str, approach: str) -> Atlas:
    """The atlas of a design by an approach."""
    own = session(design)
    return Atlas(own, Conditions.of(own, approach, Sensor()))


def visible_effects(design: str, approach: str) -> tuple[str, ...]:
    """Names of the effects that a design can see by an approach."""
    return atlas(design, approach).visible


def invisible_effects(design: str, approach: str) -> tuple[str, ...]:
    """Names of the effects that a design has, but cannot see."""
    own = atlas(design, approach)
    return tuple(
        name
        for name, effect in EFFECTS.items()
        if effect.shows(own.session) and name not in own.visible
    )
