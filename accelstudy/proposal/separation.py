"""What further positions add to the separation of two fitted explanations.

The predictions of two explanations for a new position differ by d. If one of them is right, the
other is fitted to the new position as well, and then misses it by less than d. Its sum of squares
grows by

    dᵀ (I + G C Gᵀ)⁻¹ d,

with the predictions in units of their noise, their derivatives G by the parameters of the wrong
explanation, and its cofactors C so far. The noncentrality of the test of one against the other
grows by the same amount, so the size from which they can be told apart (MIB) falls. Either may be
the right one, so the mean of both counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Columns = tuple[Array, Array]
"""Derivatives of the predictions of either explanation by its p parameters, each (..., c, p)."""


@dataclass(frozen=True, eq=False)
class Explained:
    """An explanation, fitted to the positions so far.

    Attributes
    ----------
    values : (p,) array, its parameters
    cofactors : (p, p) array
    """

    values: Array
    cofactors: Array

    def growth(self, columns: Array, seen: Array) -> Array:
        """How much the sum of squares grows, (k,), if candidates (k, c, p) show `seen` (k, c)."""
        missed = seen - columns @ self.values
        noise = np.eye(columns.shape[1]) + columns @ self.cofactors @ columns.swapaxes(1, 2)
        return np.asarray(
            np.einsum("kc,kc->k", missed, np.linalg.solve(noise, missed[..., None])[..., 0])
        )

    def after(self, columns: Array, seen: Array) -> Explained:
        """Fit a position (c, p) that shows `seen` (c,), too."""
        cross = columns @ self.cofactors
        weight = np.linalg.solve(np.eye(len(columns)) + cross @ columns.T, cross).T
        values = self.values + weight @ (seen - columns @ self.values)
        return Explained(values, self.cofactors - weight @ cross)


@dataclass(frozen=True, eq=False)
class Separation:
    """Two explanations, each in the role of the right one and of the wrong one.

    Attributes
    ----------
    right : (p,) arrays, parameters by which either predicts
    wrong : Explained, either one, fitted to the positions taken so far
    """

    right: tuple[Array, Array]
    wrong: tuple[Explained, Explained]

    @classmethod
    def of(cls, first: Explained, second: Explained) -> Separation:
        """Begin with two explanations of the same positions."""
        return cls((first.values, second.values), (first, second))

    def gains(self, columns: Columns) -> Array:
        """What each of k candidates would add to the separation, (k,)."""
        seen = [c @ values for c, values in zip(columns, self.right, strict=True)]
        first, second = self.wrong
        return (second.growth(columns[1], seen[0]) + first.growth(columns[0], seen[1])) / 2

    def taking(self, columns: Columns) -> Separation:
        """Return the separation after one more position."""
        seen = [c @ values for c, values in zip(columns, self.right, strict=True)]
        first, second = self.wrong
        after = first.after(columns[0], seen[1]), second.after(columns[1], seen[0])
        return Separation(self.right, after)
