"""Evidence for all pairs of hypotheses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.evidence.field import shape_weights
from accelstudy.diagnosis.evidence.size import Evidence
from accelstudy.diagnosis.space.hypotheses import OUTLIER, Hypothesis, Shapes
from accelstudy.diagnosis.space.residuals import Residuals

Array = NDArray[np.float64]

COLLINEAR = 0.05
"""Two spaces are tried together only if this share of the second is left beside the first."""
POSITIONS = 100
"""Bumped positions that are tried in pairs, at most."""
ROWS = 4096
"""Conditions in one block of work."""


@dataclass(frozen=True)
class Pair:
    """Two candidates in their best shapes, and the log density of the residuals with both."""

    best: tuple[Hypothesis, Hypothesis]
    log_density: float


def all_pairs(
    candidates: Mapping[str, Shapes], residuals: Residuals, evidence: Evidence
) -> list[Pair]:
    """Evidence for all pairs of candidates, over all shapes of both.

    Of the bumped positions only the `POSITIONS` that explain most by themselves are tried; pairs
    with the others count as pairs without any evidence.

    Parameters
    ----------
    candidates : mapping of name to shapes
    residuals : Residuals
    evidence : Evidence
    """
    z, r = residuals.z, residuals.redundancy
    tried, weights = _tried(candidates, z)
    if len(tried) < 2:
        return []
    names = [h.name for h in tried]
    order = {name: i for i, name in enumerate(dict.fromkeys(names))}
    number = np.array([order[name] for name in names])
    dims = np.array([h.dim for h in tried])
    products = _Products.of(tried, z)
    one, other = np.triu_indices(len(tried), 1)
    # Shapes of one effect are alternatives, but two positions may both be bumped.
    apart = (number[one] != number[other]) | (number[one] == order.get(OUTLIER, -1))
    apart &= dims[one] + dims[other] < r
    one, other = one[apart], other[apart]
    part, independent = np.zeros(len(one)), np.zeros(len(one), dtype=bool)
    # The smaller space is taken beside the larger one, which is less to compute.
    large = np.where(dims[one] < dims[other], other, one)
    small = one + other - large
    sizes = dims[large] * r + dims[small]
    for size in np.unique(sizes):
        alike = np.flatnonzero(sizes == size)
        for some in np.array_split(alike, len(alike) // ROWS + 1):
            part[some], independent[some] = products.of_both(large[some], small[some])
    if not independent.any():
        return []
    one, other, part = one[independent], other[independent], part[independent]
    logs = evidence.of_spaces(part, dims[one] + dims[other], float(z @ z))
    weighted = logs + np.log(weights[one]) + np.log(weights[other])
    keys = number[one] * len(order) + number[other]
    sequence = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[sequence], prepend=-1))
    totals = np.logaddexp.reduceat(weighted[sequence], starts)
    pairs = []
    for k, total in enumerate(totals):
        alike = sequence[starts[k] : starts[k + 1] if k + 1 < len(starts) else None]
        best = alike[np.argmax(logs[alike])]
        twice = np.log(2.0) if number[one[best]] == number[other[best]] else 0.0
        pairs.append(Pair((tried[one[best]], tried[other[best]]), float(total + twice)))
    return pairs


def _tried(candidates: Mapping[str, Shapes], z: Array) -> tuple[list[Hypothesis], Array]:
    """Shapes of which pairs are made, and the prior probability of each in its candidate."""
    tried: list[Hypothesis] = []
    weights: list[Array] = []
    for name, shapes in candidates.items():
        places = np.arange(len(shapes))
        if name == OUTLIER and len(places) > POSITIONS:
            places = np.sort(np.argsort(-shapes.parts(z), kind="stable")[:POSITIONS])
        tried += [shapes[int(k)] for k in places]
        weights.append(shape_weights(shapes)[places])
    return tried, np.concatenate(weights) if weights else np.zeros(0)


@dataclass(frozen=True)
class _Products:
    """Products of the columns of the bases of hypotheses.

    Attributes
    ----------
    gram : (Σ l, Σ l) array, of each with each
    seen : (Σ l,) array, of each with residuals
    starts, dims : (h,) int arrays, where the columns of each hypothesis begin, and their number l
    """

    gram: Array
    seen: Array
    starts: NDArray[np.int_]
    dims: NDArray[np.int_]

    @classmethod
    def of(cls, hypotheses: Sequence[Hypothesis], z: Array) -> _Products:
        """Multiply the bases of hypotheses (m, l) with each other and with residuals z (m,)."""
        dims = np.array([h.dim for h in hypotheses])
        starts = np.cumsum(dims) - dims
        gram = np.zeros((dims.sum(),) * 2)
        seen = np.zeros(len(gram))
        # In blocks of conditions: all bases together would need twice the memory.
        for rows in np.array_split(np.arange(len(z)), len(z) // ROWS + 1):
            part = np.concatenate([h.basis[rows[0] : rows[-1] + 1] for h in hypotheses], axis=1)
            gram += part.T @ part
            seen += z[rows] @ part
        return cls(gram, seen, starts, dims)

    def of_both(
        self, large: NDArray[np.int_], small: NDArray[np.int_]
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Squares of what residuals have in two spaces together, and whether these are two.

        (j,) each. All large ones have one dimension, and all small ones.
        """
        a, b = (
            self.starts[places][:, None] + np.arange(self.dims[places[0]])
            for places in (large, small)
        )
        cross = self.gram[a[:, :, None], b[:, None, :]]
        left = np.eye(b.shape[1]) - np.swapaxes(cross, 1, 2) @ cross
        if b.shape[1] == 1:
            values, vectors = left[:, 0], np.ones_like(left)
        else:
            values, vectors = np.linalg.eigh(left)
        rest = self.seen[b] - np.einsum("jab,ja->jb", cross, self.seen[a])
        along = np.einsum("jab,ja->jb", vectors, rest) ** 2
        part = np.sum(self.seen[a] ** 2, axis=1)
        part += np.sum(along / np.maximum(values, COLLINEAR), axis=1)
        return part, values[:, 0] > COLLINEAR
