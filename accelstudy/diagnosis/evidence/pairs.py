"""Exhaustive search over pairs of hypotheses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.evidence.naming import log_evidence, mean_evidence
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
    """Two candidates with their best shapes, and the evidence for both at once."""

    names: tuple[str, str]
    best: tuple[Hypothesis, Hypothesis]
    log_evidence: float


def best_pairs(candidates: Mapping[str, Shapes], residuals: Residuals) -> list[Pair]:
    """Evidence for all pairs of candidates, over all shapes of both; strongest first.

    Of the positions that may be bumped, the `POSITIONS` are tried that explain most by themselves;
    pairs with others count as pairs without any evidence.

    Parameters
    ----------
    candidates : mapping of name to shapes
    residuals : Residuals
    """
    z, r = residuals.z, residuals.redundancy
    hypotheses, standing = _tried(candidates, z)
    names = [h.name for h in hypotheses]
    order = {name: i for i, name in enumerate(dict.fromkeys(names))}
    number = np.array([order[name] for name in names])
    dims = np.array([h.dim for h in hypotheses])
    gram, seen = _products(hypotheses, z)
    alone, total = np.sum(seen**2, axis=1), float(z @ z)

    tried: list[tuple[Array, ...]] = []
    for i in range(len(dims) - 1):
        others = np.arange(i + 1, len(dims))
        # Shapes of one effect are alternatives, but two positions may both be bumped.
        others = others[(number[others] != number[i]) | (names[i] == OUTLIER)]
        others = others[dims[i] + dims[others] < r]
        cross = np.moveaxis(gram[i][:, others], 1, 0)
        left = np.eye(seen.shape[1]) - np.einsum("jab,jac->jbc", cross, cross)
        values, vectors = np.linalg.eigh(left)
        # Padding has eigenvalue 1 and no share in the residuals.
        rest = seen[others] - np.einsum("jab,a->jb", cross, seen[i])
        along = np.einsum("jab,ja->jb", vectors, rest) ** 2
        part = alone[i] + np.sum(along / np.maximum(values, COLLINEAR), axis=1)
        apart = values[:, 0] > COLLINEAR
        others, part = others[apart], part[apart]
        log = log_evidence(np.minimum(part / total, 1.0), dims[i] + dims[others], r)
        tried.append((np.full(len(others), i), others, log))
    if not tried:
        return []
    one, other, logs = (np.concatenate(column) for column in zip(*tried, strict=True))
    keys = number[one] * len(order) + number[other]
    pairs = []
    for key in np.unique(keys):
        alike = np.flatnonzero(keys == key)
        best = alike[np.argmax(logs[alike])]
        first, second = sorted((one[best], other[best]), key=lambda k: -alone[k])
        both = (hypotheses[first], hypotheses[second])
        # The mean is over all positions, those included that were not tried.
        untried = sum(h.name == OUTLIER for h in both) * np.log(standing)
        mean = mean_evidence(logs[alike]) - float(untried)
        pairs.append(Pair((both[0].name, both[1].name), both, mean))
    return sorted(pairs, key=lambda pair: -pair.log_evidence)


def _tried(candidates: Mapping[str, Shapes], z: Array) -> tuple[list[Hypothesis], float]:
    """Shapes of which pairs are made, and how many bumped positions stand for one that is tried."""
    hypotheses, standing = [], 1.0
    for name, shapes in candidates.items():
        places = np.arange(len(shapes))
        if name == OUTLIER and len(places) > POSITIONS:
            places = np.sort(np.argsort(-shapes.parts(z), kind="stable")[:POSITIONS])
            standing = len(shapes) / POSITIONS
        hypotheses += [shapes[int(k)] for k in places]
    return hypotheses, standing


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
