"""Spaces of residuals in which something that is missing from a model would lie.

Two things count of a space: its dimension, and the size of the part of the residuals that lies in
it. Many spaces of one kind are evaluated together. No matrix of all conditions by all conditions is
formed, so the effort grows with the number of positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.space.residuals import Residuals

Array = NDArray[np.float64]

ABSORBED = 1e-2
"""A direction counts as absorbed by the model if less than this share of it is left."""
VISIBLE = 3e-3
"""An effect is invisible where the model absorbs all but this share of its signature."""


class Spaces(Protocol):
    """Some spaces of residuals."""

    @property
    def dims(self) -> NDArray[np.int_]:
        """Their dimensions, (s,)."""

    def parts(self, errors: Array) -> Array:
        """Squares of what residuals (..., m) have in each of them, (..., s)."""


@dataclass(frozen=True)
class Bases:
    """Spaces given by orthonormal bases in the residual space.

    Attributes
    ----------
    together : (m, Σ l) array, one basis beside the other
    dims : (s,) int array, l
    """

    together: Array
    dims: NDArray[np.int_]

    @classmethod
    def beside_each_other(cls, bases: Sequence[Array]) -> Bases:
        """Gather bases (m, l)."""
        dims = np.array([basis.shape[1] for basis in bases])
        return cls(np.concatenate(bases, axis=1), dims)

    def split(self) -> list[Array]:
        """Each of the bases, (m, l)."""
        return np.split(self.together, self.ends[1:-1], axis=1)

    def parts(self, errors: Array) -> Array:
        """Squares of what residuals (..., m) have in each of them, (..., s)."""
        return np.add.reduceat((errors @ self.together) ** 2, self.ends[:-1], axis=-1)

    @cached_property
    def ends(self) -> NDArray[np.int_]:
        """Where the bases begin and the last one ends, (s + 1,)."""
        return np.concatenate([[0], np.cumsum(self.dims)])


@dataclass(frozen=True)
class LackOfFit:
    """All that positions of one attitude have in common: everything but their differences.

    A change of conditions by t that is the same in all positions of an attitude is L_iᵀ t at unit
    weight (but for what varies between them). Of these directions, orthonormal within each
    attitude, those are left that the model does not absorb.

    Attributes
    ----------
    order : (n,) int array, positions sorted by attitude
    starts : (a,) int array, where each attitude begins there
    weights : (n, c, c) array, W_i with Σ W_i e_i the coordinates (c,) of an attitude, sorted
    absorbed : (a c + k, l) array, orthonormal basis of what the model absorbs, in coordinates
    """

    order: NDArray[np.int_]
    starts: NDArray[np.int_]
    weights: Array
    absorbed: Array

    @classmethod
    def of(cls, residuals: Residuals, labels: NDArray[np.int_]) -> LackOfFit:
        """Of residuals whose positions have labels (n,), the same for the same attitude."""
        order = np.argsort(labels, kind="stable")
        starts = np.flatnonzero(np.diff(labels[order], prepend=-1))
        whitening = residuals.whitening[order]
        normal = np.add.reduceat(whitening @ np.swapaxes(whitening, 1, 2), starts, axis=0)
        inverse = np.linalg.inv(np.linalg.cholesky(normal))
        counts = np.diff(np.append(starts, len(labels)))
        same = cls(order, starts, np.repeat(inverse, counts, axis=0) @ whitening, np.empty((0, 0)))
        left, values, _ = np.linalg.svd(same._means(residuals.absorbed.T).T, full_matrices=False)
        return cls(order, starts, same.weights, left[:, values > ABSORBED])

    @property
    def dims(self) -> NDArray[np.int_]:
        """Its dimension, (1,)."""
        rows, absorbed = self.absorbed.shape
        return np.array([rows - absorbed])

    def parts(self, errors: Array) -> Array:
        """Squares of what residuals (..., m) have in it, (..., 1)."""
        same = self._means(errors)
        part = np.sum(same**2, axis=-1) - np.sum((same @ self.absorbed) ** 2, axis=-1)
        return np.maximum(part, 0.0)[..., None]

    def _means(self, errors: Array) -> Array:
        """Coordinates of residuals (..., m): of each attitude, and of observed gravity."""
        n, c = self.weights.shape[:2]
        blocks = errors[..., : n * c].reshape(*errors.shape[:-1], n, c)[..., self.order, :]
        weighted = np.einsum("ncd,...nd->...nc", self.weights, blocks)
        sums = np.add.reduceat(weighted, self.starts, axis=-2)
        return np.concatenate([sums.reshape(*errors.shape[:-1], -1), errors[..., n * c :]], axis=-1)


@dataclass(frozen=True)
class Repeats:
    """Differences between positions of one attitude: what lack of fit leaves of the residuals."""

    lack_of_fit: LackOfFit
    redundancy: int

    @property
    def dims(self) -> NDArray[np.int_]:
        """Its dimension, (1,)."""
        return self.redundancy - self.lack_of_fit.dims

    def parts(self, errors: Array) -> Array:
        """Squares of what residuals (..., m) have in it, (..., 1)."""
        total = np.sum(errors**2, axis=-1, keepdims=True)
        return np.maximum(total - self.lack_of_fit.parts(errors), 0.0)


def span(columns: Array, sizes: Array | None, tolerance: float) -> tuple[Array, Array]:
    """What columns (m, k) span: l combinations of them, (k, l), and a basis, (m, l); see `spans`.

    Parameters
    ----------
    columns : (m, k) array
    sizes : (k,) array, or None
    tolerance : float
    """
    each = None if sizes is None else sizes[None]
    directions, basis, (rank,) = spans(columns[None], each, tolerance)
    return directions[0, :, :rank], basis[0, :, :rank]


def spans(
    columns: Array, sizes: Array | None, tolerance: float
) -> tuple[Array, Array, NDArray[np.int_]]:
    """What each of several sets of columns (s, m, k) spans.

    Parameters
    ----------
    columns : (s, m, k) array
    sizes : (s, k) array beside which the columns are seen; their own norms if None
    tolerance : float, share of them below which a direction counts as nothing

    Returns
    -------
    directions : (s, k, l) array, combinations of the columns, l the smaller of m and k
    basis : (s, m, l) array, orthonormal, of their spaces
    rank : (s,) int array; what is beyond it is zero
    """
    norms = np.linalg.norm(columns, axis=1) if sizes is None else sizes
    scale = np.where(norms > 0, norms, 1.0)
    left, values, right = np.linalg.svd(columns / scale[:, None], full_matrices=False)
    seen = values > tolerance
    directions = np.swapaxes(right, 1, 2) / scale[..., None] * seen[:, None]
    return directions, left * seen[:, None], np.count_nonzero(seen, axis=1)
