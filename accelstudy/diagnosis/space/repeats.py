"""Positions of one attitude: their differences are noise alone, whatever the model lacks."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.hypotheses import Spaces, even
from accelstudy.diagnosis.space.residuals import Residuals

Array = NDArray[np.float64]


def lack_of_fit(residuals: Residuals, forces: Array) -> LackOfFit | None:
    """Return what repeated positions have in common; None if no attitude was measured twice.

    Nor is there any where the model absorbs all of it, or the repeats leave no redundancy.

    Parameters
    ----------
    residuals : Residuals
    forces : (n, 3) array, specific forces of the positions
    """
    labels = clusters(forces)
    if len(np.unique(labels)) == len(forces):
        return None
    same = LackOfFit.of(residuals, labels)
    return same if 0 < same.dims[0] < residuals.redundancy else None


@dataclass(frozen=True)
class LackOfFit(Spaces):
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
    shares : tuple of one array (l,), as in `Shapes`
    """

    order: NDArray[np.int_]
    starts: NDArray[np.int_]
    weights: Array
    absorbed: Array
    shares: tuple[Array, ...]

    @classmethod
    def of(cls, residuals: Residuals, labels: NDArray[np.int_]) -> LackOfFit:
        """Of residuals whose positions have labels (n,), the same for the same attitude."""
        order = np.argsort(labels, kind="stable")
        starts = np.flatnonzero(np.diff(labels[order], prepend=-1))
        whitening = residuals.whitening[order]
        normal = np.add.reduceat(whitening @ np.swapaxes(whitening, 1, 2), starts, axis=0)
        inverse = np.linalg.inv(np.linalg.cholesky(normal))
        counts = np.diff(np.append(starts, len(labels)))
        weights = np.repeat(inverse, counts, axis=0) @ whitening
        same = cls(order, starts, weights, np.empty((0, 0)), ())
        left, values, _ = np.linalg.svd(same._means(residuals.absorbed.T).T, full_matrices=False)
        absorbed = left[:, values > RULES.absorbed]
        shares = (even(absorbed.shape[0] - absorbed.shape[1]),)
        return replace(same, absorbed=absorbed, shares=shares)

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


def clusters(forces: NDArray[np.float64]) -> NDArray[np.int_]:
    """Label positions by attitude; positions with the same label repeat each other."""
    unit = forces / np.linalg.norm(forces, axis=1, keepdims=True)
    labels = -np.ones(len(unit), dtype=int)
    # Only positions alike in one coordinate need to be compared.
    order = np.argsort(unit[:, 0], kind="stable")
    x = unit[order, 0]
    first = np.searchsorted(x, unit[:, 0] - RULES.same_attitude)
    last = np.searchsorted(x, unit[:, 0] + RULES.same_attitude, side="right")
    for i in range(len(unit)):
        if labels[i] < 0:
            near = order[first[i] : last[i]]
            near = near[labels[near] < 0]
            labels[near[np.linalg.norm(unit[near] - unit[i], axis=1) < RULES.same_attitude]] = i
    return labels
