"""Constraints on the attitudes of a design, singly and in pairs.

A constraint has margins, which are not negative where it is met. They filter a grid of attitudes,
and keep positions within the constraints while they are moved.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.units import attitude_unit, to_attitude
from accelstudy.design.optimal.spaces import attitudes

Array = NDArray[np.float64]

TOLERANCE = 1e-7
"""rad, by which rounding may break a constraint."""


class Constraint(ABC):
    """A constraint on single attitudes.

    Attributes
    ----------
    text : str, for people
    """

    text: str

    @abstractmethod
    def margins(self, directions: Array) -> Array:
        """Distances of directions (n, 3) from breaking it, (n, m), rad; negative where they do."""


@dataclass(frozen=True)
class RollRange(Constraint):
    """Roll between two angles, rad."""

    least: float
    most: float

    @property
    def text(self) -> str:  # type: ignore[override]
        """Ends of the range."""
        return f"roll from {_shown(self.least)} to {_shown(self.most)}"

    def margins(self, directions: Array) -> Array:
        """Angles to both ends."""
        roll = attitudes(directions)[:, 0]
        return np.stack([roll - self.least, self.most - roll], axis=-1)


@dataclass(frozen=True)
class PitchRange(Constraint):
    """Pitch between two angles, rad."""

    least: float
    most: float

    @property
    def text(self) -> str:  # type: ignore[override]
        """Ends of the range."""
        return f"pitch from {_shown(self.least)} to {_shown(self.most)}"

    def margins(self, directions: Array) -> Array:
        """Angles to both ends."""
        pitch = attitudes(directions)[:, 1]
        return np.stack([pitch - self.least, self.most - pitch], axis=-1)


@dataclass(frozen=True)
class OffPole(Constraint):
    """Least angle, rad, between the x axis and the vertical, where roll is undefined."""

    angle: float

    @property
    def text(self) -> str:  # type: ignore[override]
        """Least distance."""
        return f"at least {_shown(self.angle)} from the roll pole"

    def margins(self, directions: Array) -> Array:
        """Angle to the nearer pole, beyond the least one."""
        x, y, z = directions.T
        return (np.arctan2(np.hypot(y, z), np.abs(x)) - self.angle)[:, None]


@dataclass(frozen=True)
class LeastAngle:
    """Least angle, rad, between any two positions."""

    angle: float

    @property
    def text(self) -> str:
        """The angle."""
        return f"at least {_shown(self.angle)} between positions"

    def apart(self, directions: Array, others: Array) -> NDArray[np.bool_]:
        """Which of k directions are far enough from which of the others, (k, j)."""
        return np.asarray(directions @ others.T <= np.cos(self.angle - TOLERANCE))


@dataclass(frozen=True)
class Constraints:
    """Constraints that must all be met.

    Attributes
    ----------
    single : of attitudes
    pair : LeastAngle or None
    """

    single: tuple[Constraint, ...] = ()
    pair: LeastAngle | None = None

    @property
    def texts(self) -> list[str]:
        """All of them, for people."""
        return [c.text for c in (*self.single, self.pair) if c is not None]

    def margins(self, directions: Array) -> Array:
        """Margins of all constraints of single attitudes, (n, m)."""
        found: Sequence[Array] = [c.margins(directions) for c in self.single]
        return np.concatenate([np.zeros((len(directions), 0)), *found], axis=1)

    def keep(self, directions: Array) -> Array:
        """Return those of directions (k, 3) that are allowed."""
        return directions[np.all(self.margins(directions) >= -TOLERANCE, axis=1)]

    def kept(self, directions: Array) -> bool:
        """Whether a set of positions meets all constraints."""
        if np.any(self.margins(directions) < -TOLERANCE):
            return False
        if self.pair is None or len(directions) < 2:
            return True
        near = ~self.pair.apart(directions, directions)
        np.fill_diagonal(near, False)
        return not near.any()


def _shown(angle: float) -> str:
    return f"{float(to_attitude(angle)):.6g} {attitude_unit()}"
