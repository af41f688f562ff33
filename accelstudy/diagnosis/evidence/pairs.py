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
"""Two spaces are tried together only if the second keeps this share beside the first."""
POSITIONS = 100
"""Bumped positions that are tried in pairs, at most."""
ROWS = 4096
"""Conditions that are looked at at once."""


@dataclass(frozen=True)
class Pair:
    """Two candidates in their best shapes, and the log density of the residuals with both."""

    best: tuple[Hypothesis, Hypothesis]
    log_density: float


def all_pairs(
    candidates: Mapping[str, Shapes], residuals: Residuals, evidence: Evidence
) -> list[Pair]:
    """Evidence for all pairs of candidates, over all shapes of both.

    Of the positions that may be bumped, the `POSITIONS` are tried that explain most by themselves;
    pairs with others count as pairs without any evidence.

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
    gram, seen = _products(tried, z)
    one, other = np.triu_indices(len(tried), 1)
    # Shapes of one effect are alternatives, but two positions may both be bumped.
    apart = (number[one] != number[other]) | (number[one] == order.get(OUTLIER, -1))
    apart &= dims[one] + dims[other] < r
    one, other = one[apart], other[apart]
    parts, kept = [], []
    for some in np.array_split(np.arange(len(one)), len(one) // ROWS + 1):
        part, independent = _parts_of_both(gram, seen, one[some], other[some])
        parts.append(part)
        kept.append(independent)
    part, independent = np.concatenate(parts), np.concatenate(kept)
    one, other, part = one[independent], other[independent], part[independent]
    logs = evidence.of_spaces(part, dims[one] + dims[other], float(z @ z))
    weighted = logs + np.log(weights[one]) + np.log(weights[other])
    keys = number[one] * len(order) + number[other]
    sequence = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[sequence], prepend=-1))
    if not len(starts):
        return []
    totals = np.logaddexp.reduceat(weighted[sequence], starts)
    pairs = []
    for k, total in enumerate(totals):
        alike = sequence[starts[k] : starts[k + 1] if k + 1 < len(starts) else None]
        best = alike[np.argmax(logs[alike])]
        twice = np.log(2.0) if number[one[best]] == number[other[best]] else 0.0
        pairs.append(Pair((tried[one[best]], tried[other[best]]), float(total + twice)))
    return pairs


def _parts_of_both(
    gram: Array, seen: Array, one: NDArray[np.int_], other: NDArray[np.int_]
) -> tuple[Array, NDArray[np.bool_]]:
    """Squares of what residuals have in the space of two spaces, and whether these are two."""
    cross = gram[one, :, other, :]
    left = np.eye(seen.shape[1]) - np.swapaxes(cross, 1, 2) @ cross
    values, vectors = np.linalg.eigh(left)
    # Padding has eigenvalue 1 and no share in the residuals.
    rest = seen[other] - np.einsum("jab,ja->jb", cross, seen[one])
    along = np.einsum("jab,ja->jb", vectors, rest) ** 2
    part = np.sum(seen[one] ** 2, axis=1)
    part += np.sum(along / np.maximum(values, COLLINEAR), axis=1)
    return part, values[:, 0] > COLLINEAR


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


def _products(hypotheses: Sequence[Hypothesis], z: Array) -> tuple[Array, Array]:
    """Products of all bases, (h, w, h, w), and of each with residuals, (h, w); padded by zeros."""
    width = max((h.dim for h in hypotheses), default=1)
    gram = np.zeros((len(hypotheses) * width,) * 2)
    seen = np.zeros(len(gram))
    # Some conditions after the other: all bases side by side would need the memory once more.
    for rows in np.array_split(np.arange(len(z)), len(z) // ROWS + 1):
        part = np.zeros((len(rows), len(hypotheses), width))
        for k, h in enumerate(hypotheses):
            part[:, k, : h.dim] = h.basis[rows[0] : rows[-1] + 1]
        flat = part.reshape(len(rows), -1)
        gram += flat.T @ flat
        seen += z[rows] @ flat
    return gram.reshape(len(hypotheses), width, -1, width), seen.reshape(-1, width)
